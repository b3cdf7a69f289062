// Channels, measured and rebuilt: magnitude, phase, real, imaginary, coherence, or one part over the other.
import { axis, decibels, fitted, uPlot, wheelZoom } from "./chart.js";
import { colour, fill, h, icon, ICONS, number } from "./dom.js";
import { peaksOf } from "./peaks.js";

/** The first choice of outputs: all channels together, as the sum of their magnitudes, which has neither phase nor parts. */
const ALL = "all (sum)";
const OF_ALL = ["dB", "linear", "coherence"];

const FORMS = {
  dB: { label: "magnitude [dB]", unit: "dB", of: (/** @type {number} */ x, /** @type {number} */ y) => decibels(Math.hypot(x, y)) },
  linear: { label: "magnitude", of: Math.hypot },
  phase: { label: "phase [°]", unit: "°", of: (/** @type {number} */ x, /** @type {number} */ y) => (Math.atan2(y, x) * 180) / Math.PI },
  real: { label: "real", of: (/** @type {number} */ x) => x },
  imaginary: { label: "imaginary", of: (/** @type {number} */ _, /** @type {number} */ y) => y },
  Nyquist: { label: "imaginary", of: null },
  coherence: { label: "coherence", unit: "", of: null },
};

/** Most channels over one another, and the colours of those behind the first. */
const MOST = 6;
const BEHIND = ["ink-blue", "ink-green", "ink-purple", "ink-amber", "curve-1"];

/** Channels that the list of what is unexplained names at most. */
const LISTED = 200;

/**
 * @param {HTMLElement} place
 * @param {(output: number, column: number) => Promise<any>} ask
 */
export function makeResponse(place, ask) {
  const outputs = h("select", { "aria-label": "Output", onchange: load });
  const inputs = h("select", { "aria-label": "Input", onchange: load });
  const forms = h("select", { "aria-label": "Representation", onchange: () => draw() }, Object.keys(FORMS).map((name) => h("option", {}, name)));
  const pin = h("button.small", { title: "Keep this channel behind the next ones", onclick: keep }, icon(ICONS.plus), "overlay");
  const marks = h("button.small", { title: "Mark the peaks of the measured curve with frequency and value (m)", "aria-pressed": "false", onclick: mark }, "peaks");
  const clear = h("button.small.quiet", { title: "Remove the channels behind", "aria-label": "Remove overlays", hidden: true, onclick: () => { kept = []; draw(); } }, icon(ICONS.close));
  const fit = h("button.small.quiet.fit", { title: "List what is unexplained of every channel", onclick: list });
  const key = h("div.curve-key");
  const holder = h("div.plot");
  const listed = h("div.menu.fits", { hidden: true });
  place.append(h("div.bar", {}, h("h2", {}, "Responses"), outputs, inputs, forms, pin, marks, clear, h("div.holder", {}, fit, listed)), key, holder);
  let data = /** @type {any} */ (null);
  let kept = /** @type {any[]} */ ([]);
  let fits = /** @type {number[][] | undefined} */ (undefined);
  let whole = /** @type {number | undefined} */ (undefined);
  let chart = /** @type {any} */ (null);
  let asked = 0;
  let marked = false;
  outputs.hidden = inputs.hidden = true;

  async function load() {
    if (!outputs.options.length) return;
    const mine = ++asked;
    try {
      const found = await ask(outputs.selectedIndex - 1, Math.max(inputs.selectedIndex, 0));
      if (mine !== asked || !found) return;
      data = found;
      inputs.hidden = data.all || inputs.options.length < 2;
      for (const option of forms.options) option.disabled = Boolean(data.all) && !OF_ALL.includes(option.text);
      if (forms.selectedOptions[0].disabled) forms.value = "dB";
      draw();
    } catch {
      fit.textContent = "";
    }
  }

  function mark() {
    marked = !marked;
    marks.setAttribute("aria-pressed", String(marked));
    chart?.redraw(false);
  }

  /** Marks at the peaks of the measured curve that is seen, with their frequency and value, the most prominent first, as far as there is room. @param {any} u */
  function drawPeaks(u) {
    if (!marked || !["dB", "linear"].includes(forms.value)) return;
    const { ctx, bbox } = u;
    const ratio = uPlot.pxRatio;
    const [first, last] = [u.valToIdx(u.scales.x.min), u.valToIdx(u.scales.x.max)];
    const levels = Array.from(data.measured_real, (v, i) => decibels(Math.hypot(v, data.measured_imag[i])));
    ctx.save();
    ctx.fillStyle = ctx.strokeStyle = colour("ink");
    ctx.font = `${10.5 * ratio}px system-ui, sans-serif`;
    ctx.textAlign = "center";
    ctx.setLineDash([]);
    const taken = [];
    for (const i of peaksOf(levels, first, last)) {
      const [x, y] = [u.valToPos(u.data[0][i], "x", true), u.valToPos(u.data[1][i], "y", true)];
      const words = [`${number(u.data[0][i], 5)} Hz`, forms.value === "dB" ? `${u.data[1][i].toFixed(1)} dB` : number(u.data[1][i], 3)];
      const wide = Math.max(...words.map((text) => ctx.measureText(text).width)) / 2;
      const above = y - 30 * ratio > bbox.top;
      const beside = x + 2 * wide + 8 * ratio < bbox.left + bbox.width ? x + wide + 8 * ratio : x - wide - 8 * ratio;
      const middle = above ? Math.min(Math.max(x, bbox.left + wide), bbox.left + bbox.width - wide) : beside;
      const base = above ? y - 8 * ratio : Math.max(y + 8 * ratio, bbox.top + 22 * ratio);
      const box = [middle - wide, middle + wide, base - 22 * ratio, base];
      if (taken.some((t) => box[0] < t[1] + 4 * ratio && box[1] > t[0] - 4 * ratio && box[2] < t[3] && box[3] > t[2])) continue;
      taken.push(box);
      ctx.beginPath();
      ctx.arc(x, y, 3 * ratio, 0, 7);
      ctx.stroke();
      words.forEach((text, k) => ctx.fillText(text, middle, base - (1 - k) * 11 * ratio));
    }
    ctx.restore();
  }

  function keep() {
    if (!data || kept.includes(data)) return;
    kept = [data, ...kept].slice(0, MOST - 1);
    next(1);
  }

  const nameOf = (/** @type {any} */ d) => (d.all ? "sum of all" : inputs.options.length > 1 ? `${d.output} / ${d.input}` : d.output) ?? "";

  /** Channels by what is unexplained of them; a click shows one. */
  function list() {
    listed.hidden = !listed.hidden;
    if (listed.hidden || !fits) return;
    const all = fits.flatMap((row, o) => row.map((value, c) => ({ o, c, value }))).filter(({ value }) => Number.isFinite(value));
    all.sort((a, b) => b.value - a.value);
    const show = (/** @type {number} */ o, /** @type {number} */ c) => {
      [outputs.selectedIndex, inputs.selectedIndex] = [o + 1, c];
      listed.hidden = true;
      load();
    };
    const words = (/** @type {number} */ o, /** @type {number} */ c) => [outputs.options[o + 1].text, inputs.options.length > 1 ? ` / ${inputs.options[c].text}` : ""].join("");
    fill(listed, all.slice(0, LISTED).map(({ o, c, value }) => h("button", { onclick: () => show(o, c) }, h("b", {}, `${number(100 * value, 3)} %`), h("span", {}, words(o, c)))));
  }

  /** What a curve is made of, by form. @param {any} d @param {string} side */
  function valuesOf(d, side) {
    const form = FORMS[forms.value];
    if (forms.value === "coherence") return side === "measured" && d.coherence ? Array.from(d.coherence, (v) => (Number.isFinite(v) ? v : null)) : null;
    const [x, y] = [d[`${side}_real`], d[`${side}_imag`]];
    return Array.from(x, (v, i) => (Number.isFinite(v) ? form.of(v, y[i]) : null));
  }

  function draw() {
    if (!data) return;
    const form = FORMS[forms.value];
    chart?.destroy();
    fill(holder);
    const behind = kept.filter((d) => d !== data && d.lines.length === data.lines.length);
    clear.hidden = !kept.length;
    const share = (data.all ? whole : fits?.[outputs.selectedIndex - 1]?.[Math.max(inputs.selectedIndex, 0)]) ?? data.fit;
    fit.textContent = share === null ? "" : `unexplained ${number(100 * share, 3)} %, worst first ▾`;
    fit.disabled = !fits;
    marks.disabled = !["dB", "linear"].includes(forms.value);
    const unit = form.unit ?? data.unit ?? "";
    const label = data.all && form.label.startsWith("magnitude") ? form.label.replace("magnitude", "sum |H|") : form.label;
    const words = forms.value === "dB" && data.unit ? label.replace("[dB]", `[dB re ${data.unit}]`) : form.unit === undefined && unit ? `${label} [${unit}]` : label;
    const entries = [["measured", `measured ${nameOf(data)}`], ...(forms.value === "coherence" ? [] : [["mode", "rebuilt"]]), ...behind.map((d, k) => [BEHIND[k], nameOf(d)])];
    const readings = entries.map(() => h("span.reading"));
    const where = h("span.reading");
    fill(key, entries.map(([c, text], i) => h("span", {}, h("i.stroke", { style: `background: var(--${c})` }), text, readings[i])), where);
    const common = { width: Math.max(holder.clientWidth, 60), height: Math.max(holder.clientHeight, 60), legend: { show: false }, padding: [8, 24, 0, 0] };
    const looks = [{ stroke: () => colour("measured"), width: 1.3 }, { stroke: () => colour("mode"), width: 1.5, dash: [5, 3] }];
    const behindLooks = behind.map((_, k) => ({ stroke: () => colour(BEHIND[k]), width: 1.1 }));
    if (forms.value === "Nyquist") {
      const sides = [...["measured", "rebuilt"].map((side) => [data[`${side}_real`], data[`${side}_imag`]]), ...behind.map((d) => [d.measured_real, d.measured_imag])];
      const box = limits(sides);
      const path = (/** @type {any} */ u, /** @type {number} */ s) => trace(u, u.data[s][0], u.data[s][1]);
      chart = new uPlot(
        /** @type {any} */ ({
          ...common,
          mode: 2,
          scales: { x: { time: false, range: () => box[0] }, y: { range: () => box[1] } },
          axes: [axis({ label: unit ? `real [${unit}]` : "real", size: 24 }), axis({ label: words, size: 50 })],
          series: [null, ...[...looks, ...behindLooks].map((look) => ({ ...look, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }], paths: path, points: { show: false } }))],
          cursor: { points: { show: false } },
        }),
        /** @type {any} */ ([null, ...sides]),
        holder,
      );
      return;
    }
    const curves = [valuesOf(data, "measured"), ...(forms.value === "coherence" ? [] : [valuesOf(data, "rebuilt")]), ...behind.map((d) => valuesOf(d, "measured"))];
    if (!curves[0]) {
      fill(holder, h("div.muted.one-output", {}, "The coherence of these data is not known."));
      chart = null;
      return;
    }
    const drawn = curves.map((values, i) => ({ values: values ?? [], look: i === 0 ? looks[0] : i < entries.length - behind.length ? looks[1] : behindLooks[i - (entries.length - behind.length)] }));
    const read = (/** @type {any} */ u) => {
      const at = u.cursor.idx;
      where.textContent = at === null || at === undefined ? "" : `${number(data.lines[at], 6)} Hz`;
      drawn.forEach(({ values }, i) => (readings[i].textContent = at === null || at === undefined || values[at] === null ? "" : ` ${number(values[at], 4)}${unit ? ` ${unit}` : ""}`));
    };
    chart = new uPlot(
      /** @type {any} */ ({
        ...common,
        cursor: { drag: { x: true, y: false, dist: 4 }, points: { size: 5 } },
        scales: { x: { time: false }, ...(forms.value === "coherence" ? { y: { range: () => [0, 1.02] } } : {}) },
        axes: [axis({ label: "frequency [Hz]", size: 24 }), axis({ label: words, size: 44 })],
        series: [{}, ...drawn.map(({ look }) => ({ ...look, points: { show: false } }))],
        hooks: { setCursor: [read], draw: [drawPeaks] },
      }),
      /** @type {any} */ ([data.lines, ...drawn.map(({ values }) => values)]),
      holder,
    );
    wheelZoom(chart, () => [data.lines[0], data.lines[data.lines.length - 1]]);
  }

  fitted(holder, () => chart);
  /** @param {number} step */
  function next(step) {
    outputs.selectedIndex = (outputs.selectedIndex + step + outputs.options.length) % outputs.options.length;
    load();
  }
  return {
    /** @param {string[]} outs @param {string[]} ins @param {number[][]} [unexplained]  of each output and input @param {number} [of]  of all together */
    setChannels(outs, ins, unexplained, of) {
      const names = (/** @type {any} */ select) => Array.from(select.options, (o) => o.text).join("\n");
      if (names(outputs) !== [ALL, ...outs].join("\n") || names(inputs) !== ins.join("\n")) {
        fill(outputs, [ALL, ...outs].map((name) => h("option", {}, name)));
        fill(inputs, ins.map((name) => h("option", {}, name)));
      }
      kept = [];
      fits = unexplained;
      whole = of;
      outputs.hidden = !outs.length;
      inputs.hidden = ins.length < 2;
      pin.hidden = outs.length * ins.length < 2;
      load();
    },
    next,
    mark,
  };
}

/** @param {any[][]} sides */
function limits(sides) {
  return [0, 1].map((part) => {
    let [low, high] = [Infinity, -Infinity];
    for (const side of sides) for (const v of side[part]) if (Number.isFinite(v)) [low, high] = [Math.min(low, v), Math.max(high, v)];
    const room = (high - low || 1) * 0.05;
    return /** @type {[number, number]} */ ([low - room, high + room]);
  });
}

/** @param {any} u @param {ArrayLike<number>} x @param {ArrayLike<number>} y */
function trace(u, x, y) {
  const stroke = new Path2D();
  let pen = false;
  for (let i = 0; i < x.length; i++) {
    if (!Number.isFinite(x[i])) {
      pen = false;
      continue;
    }
    const [a, b] = [u.valToPos(x[i], "x", true), u.valToPos(y[i], "y", true)];
    if (pen) stroke.lineTo(a, b);
    else stroke.moveTo(a, b);
    pen = true;
  }
  return { stroke, fill: null, clip: null, flags: 1 };
}
