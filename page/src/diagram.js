// The stabilization diagram: poles of every order over the mode indicator, with a click to take or refuse.
// It is drawn in layers, of which a change draws its own alone: curves and axes, lines of modes, poles, the pole under the pointer.
import { axis, decibels, fitted, uPlot, wheelZoom } from "./chart.js";
import { colour, dodge, fill, h, hertz, number, rgb, soon } from "./dom.js";
import { makePixels, packed, stamped } from "./pixels.js";

/** The mark of a kind in a legend, in its ink. @param {any} kind  as modalscope.interfaces.plot.web.poles describes it */
export const keyOf = (kind) => h(`i.key.${kind.mark}`, { style: `color: var(--ink-${kind.ink})` });

/** Number of the kind of poles that are stable in all. */
const STABLE = 4;

/** How near the pointer must be, in pixels; poles listed under it; how near a mode's line is the mode. */
const NEAR = 16;
const LISTED = 5;
const SAME = 7;

/** From the lowest to the highest of several bands. @param {number[][]} bands @returns {[number, number]} */
export const ends = (bands) => [Math.min(...bands.map((b) => b[0])), Math.max(...bands.map((b) => b[1]))];

/**
 * @typedef {{frequency: ArrayLike<number>, damping: ArrayLike<number>, order: ArrayLike<number>, kind: ArrayLike<number>,
 *   std?: ArrayLike<number>, damping_std?: ArrayLike<number>}} Poles
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
  let letters = false;
  let linear = false;
  let harmonics = false;
  let pointer = NaN;
  let level = "mode indicator";
  let always = false; // linear whatever was chosen
  let hover = -1;
  let curves = { lines: /** @type {ArrayLike<number>} */ ([0, 1]), levels: /** @type {any[]} */ ([]) };
  let chart = /** @type {any} */ (null);
  // poles of each kind, and how many orders there are
  let table = /** @type {any[]} */ ([]);
  let kinds = /** @type {number[][]} */ ([]);
  let rows = 1;
  const layers = ["marks", "poles", "ring"].map(() => h("canvas.layer", { "aria-hidden": "true" }));
  const [markLayer, poleLayer, ringLayer] = layers;
  const sheet = makePixels(poleLayer);

  const options = () => ({
    width: Math.max(holder.clientWidth, 60),
    height: Math.max(holder.clientHeight, 60),
    padding: [30, 4, 0, 0],
    legend: { show: false },
    cursor: { drag: { x: true, y: false, dist: 4 }, points: { show: false }, focus: { prox: 1e6 } },
    scales: {
      x: { time: false, range: (_, min, max) => (min === max || min === null ? band : [min, max]) },
      y: { range: () => [0, top * 1.04 + 1] },
      c: { range: (_, min, max) => (min === null ? [0, 1] : [min - (max - min) * 0.03, max + (max - min) * 0.04]) },
    },
    axes: [
      axis({ label: "frequency [Hz]", size: 24 }),
      axis({ scale: "y", label: "model order (states)", size: 30, grid: { show: false }, space: 26 }),
      axis({ scale: "c", side: 1, size: 32, grid: { show: false }, label: linear || always ? level : level.includes("[") ? level.replace("[", "[dB re ") : `${level} [dB]` }),
    ],
    series: [
      {},
      { scale: "y", show: true, points: { show: false } },
      ...curves.levels.map((_, i) => ({ scale: "c", stroke: () => colour(`curve-${Math.min(i + 1, 3)}`), width: i ? 1 : 1.5, points: { show: false } })),
    ],
    hooks: { draw: [drawMarks, drawPoles, drawRing], setScale: [() => (hover = -1)] },
  });

  function build() {
    const zoom = chart && chart.scales.x.min > band[0] + 1e-9 ? { min: chart.scales.x.min, max: chart.scales.x.max } : null;
    chart?.destroy();
    const empty = new Array(curves.lines.length).fill(null);
    if (empty.length) empty[0] = 0;
    const levels = curves.levels.map((level) => (linear || always ? level : Array.from(level, decibels)));
    chart = new uPlot(/** @type {any} */ (options()), /** @type {any} */ ([curves.lines, empty, ...levels]), holder);
    chart.over.before(...layers);
    chart.setScale("x", zoom && zoom.max <= band[1] * 1.001 ? zoom : { min: band[0], max: band[1] });
    listen(chart);
  }

  const paint = Object.fromEntries(Object.entries({ marks: drawMarks, poles: drawPoles, ring: drawRing }).map(([name, draw]) => [name, soon(() => chart && draw(chart))]));

  /** Put a layer where the chart is, or where its poles are, and return its size in pixels and what a pixel of the page is. @param {any} u @param {HTMLCanvasElement} layer @param {boolean} [inside] */
  function placed(u, layer, inside = true) {
    const ratio = uPlot.pxRatio;
    const box = inside ? { left: u.bbox.left, top: u.bbox.top, width: u.bbox.width, height: u.bbox.height } : { left: 0, top: 0, width: u.width * ratio, height: u.height * ratio };
    for (const [side, value] of Object.entries(box)) layer.style[side] = `${value / ratio}px`;
    return { width: Math.round(box.width), height: Math.round(box.height), ratio };
  }

  /** The same, wiped and ready to be drawn on. @param {any} u @param {HTMLCanvasElement} layer @param {boolean} [inside] */
  function wiped(u, layer, inside) {
    const { width, height, ratio } = placed(u, layer, inside);
    [layer.width, layer.height] = [width, height];
    return { ctx: layer.getContext("2d"), ratio };
  }

  /** How large a mark is, in pixels of the screen. @param {any} u @param {number} ratio */
  const sizeOf = (u, ratio) => Math.min(3.6, Math.max(1.7, (0.42 * u.bbox.height) / ratio / rows)) * ratio;

  /** @param {any} u */
  function drawPoles(u) {
    const { width, height, ratio } = placed(u, poleLayer);
    sheet.begin(width, height);
    const { min, max } = u.scales.x;
    const kx = width / (max - min);
    const ky = height / u.scales.y.max;
    const size = sizeOf(u, ratio);
    kinds.forEach((members, kind) => {
      const stamp = letters ? letterOf(table[kind], ratio) : markOf(table[kind], size * (kind === STABLE ? 1 : 0.8), ratio);
      const [red, green, blue] = rgb(`ink-${table[kind].ink}`);
      const ink = packed(red, green, blue);
      for (const i of members) {
        const f = poles.frequency[i];
        if (poles.order[i] <= shownTop && f >= min && f <= max) sheet.dot(stamp, (f - min) * kx, height - poles.order[i] * ky, ink);
      }
    });
    sheet.end();
  }

  /** Lines of modes with their numbers, and ticks of what was left out. @param {any} u */
  function drawMarks(u) {
    const { ctx, ratio } = wiped(u, markLayer, false);
    const { bbox } = u;
    ctx.font = `600 ${11 * ratio}px system-ui, sans-serif`;
    ctx.textAlign = "center";
    ctx.textBaseline = "alphabetic";
    const named = /** @type {[number, string][]} */ ([]);
    modes.forEach((mode, i) => {
      const x = u.valToPos(mode.frequency, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) return;
      const interval = mode.frequency_interval;
      ctx.globalAlpha = i === chosen ? 0.24 : 0.1;
      ctx.fillStyle = colour("mode");
      if (interval?.[0]) {
        const [a, b] = interval.map((/** @type {number} */ f) => Math.min(Math.max(u.valToPos(f, "x", true), bbox.left), bbox.left + bbox.width));
        ctx.fillRect(a, bbox.top, b - a, bbox.height);
      }
      ctx.globalAlpha = i === chosen ? 1 : 0.75;
      ctx.strokeStyle = ctx.fillStyle = colour("mode");
      ctx.lineWidth = (i === chosen ? 1.8 : 1) * ratio;
      ctx.setLineDash(mode.shown?.grade === "preliminary" ? [2 * ratio, 3 * ratio] : i === chosen ? [] : [6 * ratio, 4 * ratio]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.setLineDash([]);
      named.push([x, String(i + 1)]);
    });
    drawNumbers(ctx, named, bbox, ratio);
    ctx.globalAlpha = 0.9;
    ctx.fillStyle = colour("muted");
    for (const candidate of leftOut) {
      const x = u.valToPos(candidate.frequency_hz, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(x - 3.5 * ratio, bbox.top);
      ctx.lineTo(x + 3.5 * ratio, bbox.top);
      ctx.lineTo(x, bbox.top + 5.5 * ratio);
      ctx.fill();
    }
  }

  /** The numbers of modes over their lines, apart from each other, with a stroke to where each belongs. @param {any} ctx @param {[number, string][]} named @param {any} bbox @param {number} ratio */
  function drawNumbers(ctx, named, bbox, ratio) {
    const places = dodge(named.map(([x]) => x), 17 * ratio);
    ctx.globalAlpha = 1;
    ctx.strokeStyle = ctx.fillStyle = colour("mode");
    ctx.lineWidth = ratio;
    ctx.beginPath();
    named.forEach(([x, words], k) => {
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(places[k], bbox.top - 9 * ratio);
      ctx.fillText(words, places[k], bbox.top - 12 * ratio);
    });
    ctx.stroke();
  }

  /** A ring about the pole under the pointer, with its interval. @param {any} u */
  function drawRing(u) {
    const { ctx, ratio } = wiped(u, ringLayer);
    if (harmonics && pointer > 0) drawHarmonics(u, ctx, ratio);
    if (hover < 0) return;
    const x = u.valToPos(poles.frequency[hover], "x", true) - u.bbox.left;
    const y = u.valToPos(poles.order[hover], "y", true) - u.bbox.top;
    const half = poles.std?.[hover];
    ctx.strokeStyle = colour("ink");
    ctx.lineWidth = 1.6 * ratio;
    if (half > 0) {
      const wide = (1.96 * half * u.bbox.width) / (u.scales.x.max - u.scales.x.min);
      ctx.beginPath();
      ctx.moveTo(x - wide, y);
      ctx.lineTo(x + wide, y);
      ctx.stroke();
    }
    ctx.beginPath();
    ctx.arc(x, y, sizeOf(u, ratio) + 3.5 * ratio, 0, 7);
    ctx.stroke();
  }

  /** Lines at the multiples of the frequency under the pointer, with their numbers. @param {any} u @param {any} ctx @param {number} ratio */
  function drawHarmonics(u, ctx, ratio) {
    ctx.strokeStyle = ctx.fillStyle = colour("accent");
    ctx.font = `${10 * ratio}px system-ui, sans-serif`;
    ctx.lineWidth = ratio;
    ctx.setLineDash([2 * ratio, 3 * ratio]);
    for (let k = 1; k <= 40 && k * pointer <= u.scales.x.max; k++) {
      const x = u.valToPos(k * pointer, "x", true) - u.bbox.left;
      if (x < 0) continue;
      ctx.beginPath();
      ctx.moveTo(x, 0);
      ctx.lineTo(x, u.bbox.height);
      ctx.stroke();
      ctx.fillText(`${k} x ${hertz(pointer, band[1])}`.slice(0, k === 1 ? 40 : String(k).length), x + 3 * ratio, u.bbox.height - 5 * ratio);
    }
    ctx.setLineDash([]);
  }

  /** Poles under the pointer, the nearest first. @param {any} u @param {number} x @param {number} y */
  function under(u, x, y) {
    const { min, max } = u.scales.x;
    const kx = u.over.clientWidth / (max - min);
    const ky = u.over.clientHeight / u.scales.y.max;
    const found = [];
    for (let i = 0; i < poles.frequency.length; i++) {
      if (poles.kind[i] >= table.length || poles.order[i] > shownTop) continue;
      const dx = (poles.frequency[i] - min) * kx - x;
      if (dx > NEAR || dx < -NEAR) continue;
      const dy = u.over.clientHeight - poles.order[i] * ky - y;
      const far = dx * dx + dy * dy;
      if (far < NEAR * NEAR) found.push([far - (poles.kind[i] === STABLE ? 9 : 0), i]);
    }
    return found.sort((a, b) => a[0] - b[0]).slice(0, LISTED).map((pair) => pair[1]);
  }

  /** The mode whose line is where a pole is. @param {any} u @param {number} pole */
  function modeAt(u, pole) {
    const x = u.valToPos(poles.frequency[pole], "x");
    let best = -1;
    let near = SAME;
    modes.forEach((mode, i) => {
      const far = Math.abs(u.valToPos(mode.frequency, "x") - x);
      if (far < near) [best, near] = [i, far];
    });
    return best;
  }

  /** @param {any} u @param {number[]} found */
  function show(u, found) {
    hover = found[0] ?? -1;
    paint.ring();
    tip.hidden = hover < 0;
    if (hover < 0) return;
    const mode = modeAt(u, hover);
    const rows = found.map((i, k) =>
      h(`div.row${k ? "" : ".first"}`, {}, keyOf(table[poles.kind[i]]), h("span", {}, `${hertz(poles.frequency[i], band[1])} Hz`), h("span", {}, `${number(100 * poles.damping[i], 3)} %`), h("span.muted", {}, `order ${poles.order[i]}, ${table[poles.kind[i]].words}`)),
    );
    const does = acts.take ? h("div.does", {}, mode >= 0 ? `click: refuse mode ${mode + 1}` : "click: take") : null;
    fill(tip, rows, does);
    const left = u.over.offsetLeft + u.valToPos(poles.frequency[hover], "x");
    const high = u.over.offsetTop + u.valToPos(poles.order[hover], "y");
    const over = left > place.clientWidth * 0.55;
    tip.style.left = over ? "" : `${left + 14}px`;
    tip.style.right = over ? `${place.clientWidth - left + 14}px` : "";
    tip.style.top = `${Math.max(4, Math.min(high - 12, place.clientHeight - tip.offsetHeight - 8))}px`;
  }

  /** @param {any} u @param {number} pole */
  function act(u, pole) {
    if (pole < 0) return;
    const mode = modeAt(u, pole);
    if (mode >= 0) acts.refuse?.(mode);
    else acts.take?.(pole);
  }

  /** @param {any} u */
  function listen(u) {
    let down = [0, 0];
    u.over.addEventListener("mousedown", (/** @type {MouseEvent} */ e) => (down = [e.clientX, e.clientY]));
    u.over.addEventListener("mousemove", (/** @type {MouseEvent} */ e) => {
      pointer = u.posToVal(e.offsetX, "x");
      show(u, under(u, e.offsetX, e.offsetY));
    });
    u.over.addEventListener("mouseleave", () => show(u, []));
    u.over.addEventListener("click", (/** @type {MouseEvent} */ e) => {
      if (Math.hypot(e.clientX - down[0], e.clientY - down[1]) > 4) return;
      const found = under(u, e.offsetX, e.offsetY);
      if (found.length) act(u, found[0]);
      else {
        const x = u.valToPos(modes[0]?.frequency ?? 0, "x");
        const near = modes.map((m, i) => [Math.abs(u.valToPos(m.frequency, "x") - e.offsetX), i]).sort((a, b) => a[0] - b[0])[0];
        if (near && near[0] < SAME && x !== undefined) acts.select?.(near[1]);
      }
    });
    u.over.addEventListener("dblclick", () => whole());
    wheelZoom(u, () => band);
  }

  holder.addEventListener("keydown", (event) => {
    if (!chart || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (step) {
      event.preventDefault();
      event.stopPropagation();
      show(chart, [neighbour(step[0], step[1])].filter((i) => i >= 0));
    } else if (event.key === "Enter" && hover >= 0) {
      event.preventDefault();
      act(chart, hover);
    } else if (event.key === "Home") whole();
  });
  holder.addEventListener("blur", () => chart && show(chart, []));

  /** The next pole in a direction: along an order, or at the next one. @param {number} right @param {number} up */
  function neighbour(right, up) {
    const stable = [...poles.kind.length ? Array(poles.kind.length).keys() : []].filter((i) => poles.kind[i] <= STABLE && poles.frequency[i] >= chart.scales.x.min && poles.frequency[i] <= chart.scales.x.max);
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

  function whole() {
    chart?.setScale("x", { min: band[0], max: band[1] });
  }

  const resize = fitted(holder, () => chart);
  return {
    /** @param {{lines: ArrayLike<number>, levels: any[]}} given @param {[number, number]} limits @param {string} [name] @param {boolean} [onlyLinear] */
    setCurves(given, limits, name = "mode indicator", onlyLinear = false) {
      level = name;
      always = onlyLinear;
      const [low, high] = limits;
      let a = 0;
      let b = given.lines.length;
      while (a < b && given.lines[a] < low) a++;
      while (b > a && given.lines[b - 1] > high) b--;
      const cut = (/** @type {any} */ values) => values.slice(a, b);
      curves = b - a > 1 ? { lines: Array.from(cut(given.lines)), levels: given.levels.map(cut) } : { lines: [low, high], levels: [] };
      band = limits;
      build();
      resize();
    },
    /** @param {Poles} given @param {number} highest */
    setPoles(given, highest) {
      poles = given;
      hover = -1;
      kinds = table.map(() => []);
      for (let i = 0; i < given.frequency.length; i++) kinds[given.kind[i]]?.push(i);
      rows = Math.max(new Set(Array.from(given.order)).size, 1);
      if (highest !== top) {
        top = highest;
        chart?.setScale("y", { min: 0, max: top * 1.04 + 1 });
      }
      paint.poles();
      paint.ring();
    },
    /** @param {any[]} given  letter, words, mark and ink of each kind of poles, by its number */
    setKinds(given) {
      table = given;
    },
    /** @param {{modes: any[], leftOut: any[], chosen: number}} given */
    setModes(given) {
      ({ modes, leftOut, chosen } = given);
      paint.marks();
    },
    setOrder(/** @type {number} */ order) {
      shownTop = order;
      paint.poles();
    },
    toggleLetters() {
      letters = !letters;
      paint.poles();
      return letters;
    },
    toggleHarmonics() {
      harmonics = !harmonics;
      paint.ring();
      return harmonics;
    },
    toggleLinear() {
      linear = !linear;
      if (chart) build();
      return linear;
    },
    whole,
    /** Where a pole is on the screen. @param {number} i */
    at: (i) => {
      const box = chart.over.getBoundingClientRect();
      return [box.left + chart.valToPos(poles.frequency[i], "x"), box.top + chart.valToPos(poles.order[i], "y")];
    },
    get poles() {
      return poles;
    },
  };
}

/** Marks and letters that were drawn once. */
const stamps = new Map();
/** @param {string} name @param {number} size @param {(ctx: CanvasRenderingContext2D, middle: number) => void} draw */
function kept(name, size, draw) {
  if (!stamps.has(name)) stamps.set(name, stamped(size, draw));
  return stamps.get(name);
}

/** @param {any} kind @param {number} r @param {number} ratio */
const markOf = (kind, r, ratio) =>
  kept(`${kind.mark} ${r} ${ratio}`, 2 * (r + 2 * ratio), (ctx, middle) => {
    ctx.beginPath();
    mark(ctx, kind.mark, middle, middle, r);
    ctx.lineWidth = ratio * 1.15;
    if (kind.mark === "dot") ctx.fill();
    else ctx.stroke();
  });

/** @param {any} kind @param {number} ratio */
const letterOf = (kind, ratio) =>
  kept(`${kind.letter} ${ratio}`, 14 * ratio, (ctx, middle) => {
    ctx.font = `${kind.letter === "s" ? 600 : 400} ${10 * ratio}px ui-monospace, monospace`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    ctx.fillText(kind.letter, middle, middle);
  });

/** @param {any} ctx @param {string} name @param {number} x @param {number} y @param {number} r */
export function mark(ctx, name, x, y, r) {
  if (name === "cross") {
    const a = r * 0.72;
    ctx.moveTo(x - a, y - a);
    ctx.lineTo(x + a, y + a);
    ctx.moveTo(x + a, y - a);
    ctx.lineTo(x - a, y + a);
  } else if (name === "diamond") {
    ctx.moveTo(x, y - r);
    ctx.lineTo(x + r, y);
    ctx.lineTo(x, y + r);
    ctx.lineTo(x - r, y);
    ctx.closePath();
  } else if (name === "triangle") {
    ctx.moveTo(x, y - r);
    ctx.lineTo(x + r, y + r);
    ctx.lineTo(x - r, y + r);
    ctx.closePath();
  } else if (name === "square") ctx.rect(x - r, y - r, r * 2, r * 2);
  else if (name === "bar" || name === "stick") {
    const [a, b] = name === "bar" ? [2 * r, 0] : [0, 2 * r];
    ctx.moveTo(x - a, y - b);
    ctx.lineTo(x + a, y + b);
  } else {
    ctx.moveTo(x + r, y);
    ctx.arc(x, y, r, 0, 7);
  }
}
