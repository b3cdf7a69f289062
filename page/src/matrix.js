// The AutoMAC of the modes.
import { colour, h, onTheme, soon } from "./dom.js";

/** @param {HTMLElement} place @param {(mode: number) => void} select */
export function makeMatrix(place, select) {
  const canvas = h("canvas", { role: "img", "aria-label": "AutoMAC of the modes" });
  const words = h("div.muted.matrix-words");
  const holder = h("div.plot", {}, canvas);
  const key = h("div.matrix-key", { "aria-hidden": "true" }, "0", h("i"), "1");
  place.append(holder, key, words);
  let values = /** @type {ArrayLike<number>} */ ([]);
  let count = 0;
  let across = 0;
  let chosen = -1;
  let geometry = { left: 0, top: 0, cell: 1 };

  const paint = soon(() => {
    const ratio = devicePixelRatio || 1;
    const { clientWidth: w, clientHeight: high } = holder;
    if (!w || !high) return;
    [canvas.width, canvas.height] = [w * ratio, high * ratio];
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    if (!count) return;
    const cell = Math.min((w - 26) / across, (high - 22) / count);
    const left = (w - cell * across - 18) / 2 + 18;
    const top = 2;
    geometry = { left, top, cell };
    ctx.font = `${Math.min(11, Math.max(8, cell * 0.4))}px system-ui, sans-serif`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    const ink = colour("ink");
    for (let i = 0; i < count; i++)
      for (let j = 0; j < across; j++) {
        const v = values[i * across + j];
        ctx.globalAlpha = 0.05 + 0.95 * v;
        ctx.fillStyle = colour("matrix");
        ctx.fillRect(left + j * cell + 0.5, top + i * cell + 0.5, cell - 1, cell - 1);
        ctx.globalAlpha = 1;
        if (cell > 18) {
          ctx.fillStyle = v > 0.55 ? colour("on-matrix") : ink;
          ctx.fillText(v > 0.995 ? "1" : v.toFixed(2).replace(/^0/, ""), left + (j + 0.5) * cell, top + (i + 0.5) * cell);
        }
      }
    for (let i = 0; i < count; i++) {
      if (cell < 11 && i % Math.ceil(11 / cell)) continue;
      ctx.fillStyle = i === chosen ? colour("mode") : colour("muted");
      ctx.fillText(String(i + 1), left - 9, top + (i + 0.5) * cell);
    }
    for (let j = 0; j < across; j++) {
      if (cell < 11 && j % Math.ceil(11 / cell)) continue;
      ctx.fillStyle = j === chosen && across === count ? colour("mode") : colour("muted");
      ctx.fillText(String(j + 1), left + (j + 0.5) * cell, top + count * cell + 9);
    }
  });

  const find = (/** @type {MouseEvent} */ event) => [event.offsetY - geometry.top, event.offsetX - geometry.left].map((v) => Math.floor(v / geometry.cell));
  canvas.addEventListener("mousemove", (event) => {
    if (!count) return;
    const [i, j] = find(event);
    const inside = i >= 0 && j >= 0 && i < count && j < across;
    words.textContent = inside ? `modes ${i + 1} and ${j + 1}: ${values[i * across + j].toFixed(3)}` : "";
  });
  canvas.addEventListener("mouseleave", () => count && (words.textContent = ""));
  canvas.addEventListener("click", (event) => {
    const [i] = find(event);
    if (i >= 0 && i < count) select(i);
  });
  new ResizeObserver(paint).observe(holder);
  onTheme(paint);
  return {
    /** @param {ArrayLike<number>} mac @param {number} modes @param {number} outputs @param {number} [columns]  those of another file */
    set(mac, modes, outputs, columns = modes) {
      [values, count, across] = [mac, outputs > 1 ? modes : 0, columns];
      key.hidden = !count;
      words.textContent = modes && outputs === 1 ? "One output: shapes cannot be compared." : "";
      paint();
    },
    choose(/** @type {number} */ mode) {
      chosen = mode;
      paint();
    },
  };
}
