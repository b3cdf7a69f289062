// The AutoMAC of the modes, or their MAC with those of a file: a cell says its number, and a click chooses a mode.
import { h } from "./dom.js";
import { makePicture } from "./picture.js";

/** Shade from which numbers are white; pixels of a cell that holds its number, and of a digit of a name at the axes. */
const [DARK, NUMBERED, DIGIT] = [0.55, 21, 8];

/** @param {HTMLElement} place @param {(mode: number) => void} select */
export function makeMatrix(place, select) {
  const words = h("div.muted.matrix-words");
  const holder = h("div.plot");
  const key = h("div.matrix-key", { "aria-hidden": "true" }, "0", h("i"), "1");
  place.append(holder, key, words);
  let values = /** @type {ArrayLike<number>} */ ([]);
  let [count, across, chosen] = [0, 0, -1];
  const find = (/** @type {number} */ x, /** @type {number} */ y, /** @type {any} */ box) => [Math.round(box.height_of(y)), Math.round(box.value(x))];
  const picture = makePicture(holder, {
    move(x, y, box) {
      const [i, j] = find(x, y, box);
      words.textContent = count && i >= 0 && j >= 0 && i < count && j < across ? `modes ${i + 1} and ${j + 1}: ${values[i * across + j].toFixed(3)}` : "";
    },
    leave: () => count && (words.textContent = ""),
    click(x, y, box) {
      const [i] = find(x, y, box);
      if (i >= 0 && i < count) select(i);
    },
  });

  function described() {
    const cell = Math.min((holder.clientWidth - 30) / across, (holder.clientHeight - 30) / count);
    const cells = Array.from({ length: count * across }, (_, k) => [k % across, Math.floor(k / across), values[k]]);
    const axis = (/** @type {number} */ n, /** @type {boolean} */ down) => {
      const every = Math.ceil((DIGIT * String(n).length) / cell);
      const ticks = Array.from({ length: n }, (_, k) => [k, String(k + 1), k === chosen && across === count ? "vermillion" : "muted"]).filter((_, k) => k % every === 0);
      return { label: "", low: down ? n - 0.5 : -0.5, high: down ? -0.5 : n - 0.5, ticks };
    };
    const numbers = [true, false].map((dark) => {
      const own = cell > NUMBERED ? cells.filter(([, , v]) => v > DARK === dark) : [];
      return { kind: "Words", ink: dark ? "paper" : "ink", x: own.map((c) => c[0]), y: own.map((c) => c[1]), texts: own.map(([, , v]) => (v > 0.995 ? "1" : v.toFixed(2).replace(/^0/, ""))) };
    });
    const corners = cells.flatMap(([j, i]) => [j - 0.48, i - 0.48, j - 0.48, i + 0.48, j + 0.48, i + 0.48, j + 0.48, i - 0.48]);
    const shades = { kind: "Areas", ink: "blue", corners, strength: cells.map(([, , v]) => 0.05 + 0.95 * v) };
    return { words: "MAC of the modes", panels: [{ x: axis(across, false), y: axis(count, true), items: count ? [shades, ...numbers] : [], equal: true, middle: true, grid: false, bare: !count }] };
  }

  return {
    /** @param {ArrayLike<number>} mac @param {number} modes @param {number} outputs @param {number} [columns]  those of another file */
    set(mac, modes, outputs, columns = modes) {
      [values, count, across] = [mac, outputs > 1 ? modes : 0, columns];
      key.hidden = !count;
      words.textContent = modes && outputs === 1 ? "One output: shapes cannot be compared." : "";
      picture.set(described);
    },
    choose(/** @type {number} */ mode) {
      chosen = mode;
      picture.paint();
    },
  };
}
