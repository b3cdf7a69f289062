// The stabilization diagram: poles of every order over the mode indicator, with a click to take or refuse.
import { axisOf, cut, decibels } from "./axes.js";
import { rowsOf } from "./blob.js";
import { colour, fill, h, hertz, number } from "./dom.js";
import { makePicture } from "./picture.js";

/** The mark of a kind in a legend, in its ink. @param {any} kind  as modalscope.interfaces.plot.web.poles describes it */
export const keyOf = (kind) => h(`i.key.${kind.mark}`, { style: `color: var(--ink-${kind.ink})` });

/** Number of the kind of poles that are stable in all. */
const STABLE = 4;

/** How near the pointer must be, in pixels; poles listed under it; how near a mode's line is the mode. */
const NEAR = 16;
const LISTED = 5;
const SAME = 7;

/** Multiples of a frequency that are drawn at most. */
const HARMONICS = 40;

/** Inks of the curves behind the poles, from the first on. */
const BEHIND = ["muted", "middle", "pale", "grid"];

/** From the lowest to the highest of several bands. @param {number[][]} bands @returns {[number, number]} */
export const ends = (bands) => [Math.min(...bands.map((b) => b[0])), Math.max(...bands.map((b) => b[1]))];

/**
 * @typedef {{frequency: ArrayLike<number>, damping: ArrayLike<number>, order: ArrayLike<number>, kind: ArrayLike<number>, std?: ArrayLike<number>}} Poles
 */

/**
 * @param {HTMLElement} place
 * @param {{take?: (pole: number) => void, refuse?: (mode: number) => void, select?: (mode: number) => void}} acts
 */
export function makeDiagram(place, acts = {}) {
  const tip = h("div.tip", { hidden: true, role: "tooltip" });
  const holder = h("div.plot", { tabIndex: 0, role: "application", "aria-label": "Stabilization diagram: arrow keys select poles, Enter takes or refuses" });
  place.append(holder, tip);
  /** @type {Poles} */
  let poles = { frequency: [], damping: [], order: [], kind: [] };
  let modes = /** @type {any[]} */ ([]);
  let leftOut = /** @type {any[]} */ ([]);
  let chosen = -1;
  let band = /** @type {[number, number]} */ ([0, 1]);
  let top = 10;
  let shownTop = Infinity;
  let [letters, linear, harmonics] = [false, false, false];
  let pointer = NaN;
  let level = "mode indicator";
  let always = false; // linear whatever was chosen
  let hover = -1;
  let curves = { lines: /** @type {ArrayLike<number>} */ ([]), levels: /** @type {any[]} */ ([]) };
  let [decibel, bare] = [/** @type {any[]} */ ([]), /** @type {any[]} */ ([])];
  let table = /** @type {any[]} */ ([]);
  let rows = 1;

  const picture = makePicture(holder, {
    whole: () => band,
    over,
    leave: () => show([]),
    move(x, y, box) {
      pointer = box.value(x);
      show(under(x, y, box));
    },
    click(x, y, box) {
      const found = under(x, y, box);
      if (found.length) return act(found[0]);
      const near = modes.map((m, i) => [Math.abs(box.across(m.frequency) - x), i]).sort((a, b) => a[0] - b[0])[0];
      if (near && near[0] < SAME) acts.select?.(near[1]);
    },
  });

  /** The picture of a part of the band: curves in the ends that they have there. @param {[number, number] | null} view */
  function described(view) {
    const [low, high] = view ?? band;
    const levels = linear || always ? bare : decibel;
    const label = linear || always ? level : level.includes("[") ? level.replace("[", "[dB re ") : `${level} [dB]`;
    const highest = top * 1.04 + 1;
    const spans = modes.flatMap(({ frequency_interval: interval }, i) => (interval?.[0] ? [{ kind: "Areas", ink: "vermillion", corners: [interval[0], 0, interval[0], highest, interval[1], highest, interval[1], 0], strength: [i === chosen ? 0.24 : 0.1] }] : []));
    return {
      words: "Stabilization diagram: poles of all orders over frequency",
      panels: [
        {
          x: { label: "frequency [Hz]", low, high },
          y: { label: "model order (states)", low: 0, high: highest },
          items: [...spans, ...marksOf(), { kind: "Marks", ink: "muted", mark: "stick", x: leftOut.map((c) => c.frequency_hz), y: leftOut.map(() => highest) }],
          flat: true,
          marked: modes.map((mode, i) => [mode.frequency, String(i + 1), { width: i === chosen ? 1.8 : 1, full: i === chosen && mode.shown?.grade !== "preliminary" }]),
          behind: levels.length ? { axis: axisOf(label, view ? cut(curves.lines, levels, view).levels : levels), items: levels.map((y, k) => ({ kind: "Line", x: curves.lines, y, ink: BEHIND[k], width: k ? 1 : 1.5 })) } : null,
        },
      ],
    };
  }

  /** Marks of all poles up to the order that is shown, by their kinds; those that are stable in all over the others. */
  function marksOf() {
    const size = Math.min(1.9, Math.max(0.42, ((0.42 * holder.clientHeight) / rows / 2.6) ** 2));
    const items = table.map((kind, k) => ({ kind: "Marks", x: /** @type {number[]} */ ([]), y: /** @type {number[]} */ ([]), ink: kind.ink, mark: kind.mark, letter: kind.letter, letters, size: k === STABLE ? size : 0.64 * size, hollow: !["dot", "cross"].includes(kind.mark) }));
    for (let i = 0; i < poles.frequency.length; i++) {
      if (poles.order[i] > shownTop) continue;
      items[poles.kind[i]]?.x.push(poles.frequency[i]);
      items[poles.kind[i]]?.y.push(poles.order[i]);
    }
    return items;
  }

  /** A ring about the pole under the pointer, with its interval, and the multiples of the frequency there. @param {CanvasRenderingContext2D} ctx @param {any} box */
  function over(ctx, box) {
    if (harmonics && pointer > 0) {
      ctx.strokeStyle = ctx.fillStyle = colour("accent");
      ctx.setLineDash([2, 3]);
      for (let k = 1; k <= HARMONICS && k * pointer <= box.x.high; k++) {
        if (!box.inside(k * pointer)) continue;
        const x = box.across(k * pointer);
        ctx.beginPath();
        ctx.moveTo(x, box.top);
        ctx.lineTo(x, box.foot);
        ctx.stroke();
        ctx.fillText(k === 1 ? `1 x ${hertz(pointer, band[1])}` : String(k), x + 3, box.foot - 5);
      }
      ctx.setLineDash([]);
    }
    if (hover < 0) return;
    const [x, y] = [box.across(poles.frequency[hover]), box.upward(poles.order[hover])];
    const wide = box.across(poles.frequency[hover] + 1.96 * (poles.std?.[hover] || 0)) - x;
    ctx.strokeStyle = colour("ink");
    ctx.lineWidth = 1.6;
    ctx.beginPath();
    ctx.moveTo(x - wide, y);
    ctx.lineTo(x + wide, y);
    ctx.stroke();
    ctx.beginPath();
    ctx.arc(x, y, 6.5, 0, 7);
    ctx.stroke();
  }

  /** Poles under the pointer, the nearest first. @param {number} x @param {number} y @param {any} box */
  function under(x, y, box) {
    const found = [];
    for (let i = 0; i < poles.frequency.length; i++) {
      if (poles.kind[i] >= table.length || poles.order[i] > shownTop) continue;
      const dx = box.across(poles.frequency[i]) - x;
      if (dx > NEAR || dx < -NEAR) continue;
      const far = dx * dx + (box.upward(poles.order[i]) - y) ** 2;
      if (far < NEAR * NEAR) found.push([far - (poles.kind[i] === STABLE ? 9 : 0), i]);
    }
    return found.sort((a, b) => a[0] - b[0]).slice(0, LISTED).map((pair) => pair[1]);
  }

  /** The mode whose line is where a pole is. @param {number} pole */
  function modeAt(pole) {
    const far = modes.map((mode) => Math.abs(picture.box.across(mode.frequency) - picture.box.across(poles.frequency[pole])));
    const best = far.indexOf(Math.min(...far));
    return far[best] < SAME ? best : -1;
  }

  /** @param {number[]} found */
  function show(found) {
    hover = found[0] ?? -1;
    picture.again();
    tip.hidden = hover < 0;
    if (hover < 0) return;
    const mode = modeAt(hover);
    const listed = found.map((i, k) =>
      h(`div.row${k ? "" : ".first"}`, {}, keyOf(table[poles.kind[i]]), h("span", {}, `${hertz(poles.frequency[i], band[1])} Hz`), h("span", {}, `${number(100 * poles.damping[i], 3)} %`), h("span.muted", {}, `order ${poles.order[i]}, ${table[poles.kind[i]].words}`)),
    );
    const does = acts.take ? h("div.does", {}, mode >= 0 ? `click: refuse mode ${mode + 1}` : "click: take") : null;
    fill(tip, listed, does);
    const [left, high] = [picture.box.across(poles.frequency[hover]), picture.box.upward(poles.order[hover])];
    const right = left > place.clientWidth * 0.55;
    tip.style.left = right ? "" : `${left + 14}px`;
    tip.style.right = right ? `${place.clientWidth - left + 14}px` : "";
    tip.style.top = `${Math.max(4, Math.min(high - 12, place.clientHeight - tip.offsetHeight - 8))}px`;
  }

  /** @param {number} pole */
  function act(pole) {
    const mode = modeAt(pole);
    if (mode >= 0) acts.refuse?.(mode);
    else acts.take?.(pole);
  }

  holder.addEventListener("keydown", (event) => {
    if (!picture.box || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (step) {
      event.preventDefault();
      event.stopPropagation();
      show([neighbour(step[0], step[1])].filter((i) => i >= 0));
    } else if (event.key === "Enter" && hover >= 0) {
      event.preventDefault();
      act(hover);
    } else if (event.key === "Home") picture.zoom();
  });
  holder.addEventListener("blur", () => show([]));

  /** The next pole in a direction: along an order, or at the next one. @param {number} right @param {number} up */
  function neighbour(right, up) {
    const stable = [...poles.kind.length ? Array(poles.kind.length).keys() : []].filter((i) => poles.kind[i] <= STABLE && picture.box.inside(poles.frequency[i]));
    if (hover < 0) return stable.find((i) => poles.kind[i] === STABLE) ?? stable[0] ?? -1;
    const [f, n] = [poles.frequency[hover], poles.order[hover]];
    if (right) {
      const row = stable.filter((i) => poles.order[i] === n && (poles.frequency[i] - f) * right > 0);
      return row.sort((a, b) => (poles.frequency[a] - poles.frequency[b]) * right)[0] ?? hover;
    }
    const orders = [...new Set(stable.map((i) => poles.order[i]))].filter((m) => (m - n) * up > 0).sort((a, b) => (a - b) * up);
    if (!orders.length) return hover;
    return stable.filter((i) => poles.order[i] === orders[0]).sort((a, b) => Math.abs(poles.frequency[a] - f) - Math.abs(poles.frequency[b] - f))[0];
  }

  return {
    /** @param {{lines: ArrayLike<number>, levels: any[]}} given @param {[number, number]} limits @param {string} [name] @param {boolean} [onlyLinear] */
    setCurves(given, limits, name = "mode indicator", onlyLinear = false) {
      [level, always] = [name, onlyLinear];
      curves = cut(given.lines, given.levels, limits);
      [bare, decibel] = [curves.levels, curves.levels.map((each) => Float64Array.from(each, decibels))];
      const kept = picture.view && picture.view[1] <= limits[1] * 1.001 && picture.view[0] >= limits[0] ? picture.view : null;
      band = limits;
      picture.zoom(kept);
      picture.set(described);
    },
    /** @param {Poles} given @param {number} highest */
    setPoles(given, highest) {
      poles = given;
      [hover, top] = [-1, highest];
      rows = Math.max(new Set(Array.from(given.order)).size, 1);
      picture.paint();
    },
    /** Poles, and one of the indicators behind them. @param {any} blob @param {[number, number]} limits @param {any} [shown]  the first by default */
    setBlob(blob, limits, shown = blob.indicators[0]) {
      this.setCurves({ lines: blob[`${shown.name}_lines`], levels: rowsOf(blob, `${shown.name}_curves`) }, limits, shown.level, shown.linear);
      this.setPoles(blob, Math.max(...blob.orders, 2));
    },
    /** @param {any[]} given  letter, words, mark and ink of each kind of poles, by its number */
    setKinds(given) {
      table = given;
    },
    /** @param {{modes: any[], leftOut: any[], chosen: number}} given */
    setModes(given) {
      ({ modes, leftOut, chosen } = given);
      picture.paint();
    },
    setOrder(/** @type {number} */ order) {
      shownTop = order;
      picture.paint();
    },
    toggleLetters() {
      letters = !letters;
      picture.paint();
    },
    toggleHarmonics() {
      harmonics = !harmonics;
      picture.again();
    },
    toggleLinear() {
      linear = !linear;
      picture.paint();
    },
    whole: () => picture.zoom(),
    /** Where a pole is on the screen. @param {number} i */
    at: (i) => {
      const { left, top: upper } = picture.canvas.getBoundingClientRect();
      return [left + picture.box.across(poles.frequency[i]), upper + picture.box.upward(poles.order[i])];
    },
    told: picture.told,
    get poles() {
      return poles;
    },
  };
}
