// Channels, measured and rebuilt: magnitude, phase, real, imaginary, coherence, or one part over the other.
import { axisOf, cut, decibels } from "./axes.js";
import { colour, fill, h, icon, ICONS, number } from "./dom.js";
import { peaksOf } from "./peaks.js";
import { makePicture } from "./picture.js";

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
const BEHIND = ["blue", "green", "purple", "amber", "middle"];

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
  const message = h("div.muted.one-output");
  const listed = h("div.menu.fits", { hidden: true });
  place.append(h("div.bar", {}, h("h2", {}, "Responses"), outputs, inputs, forms, pin, marks, clear, h("div.holder", {}, fit, listed)), key, message, holder);
  let data = /** @type {any} */ (null);
  let kept = /** @type {any[]} */ ([]);
  let fits = /** @type {number[][] | undefined} */ (undefined);
  let whole = /** @type {number | undefined} */ (undefined);
  let shown = /** @type {any[]} */ ([]);
  let readings = /** @type {any[]} */ ([]);
  let [asked, at] = [0, -1];
  let marked = false;
  const where = h("span.reading");
  const picture = makePicture(holder, { whole: () => ends(), over, move: (x, _, box) => data && read(nearest(box.value(x))), leave: () => read(-1) });
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
    picture.again();
  }

  /** The line under the pointer, and marks at the peaks of the measured curve with their frequency and value, the most prominent first, as far as there is room. @param {CanvasRenderingContext2D} ctx @param {any} box */
  function over(ctx, box) {
    if (!shown || forms.value === "Nyquist") return;
    ctx.strokeStyle = colour("muted");
    ctx.lineWidth = 0.8;
    if (at >= 0) {
      ctx.beginPath();
      ctx.moveTo(box.across(data.lines[at]), box.top);
      ctx.lineTo(box.across(data.lines[at]), box.foot);
      ctx.stroke();
    }
    if (!marked || marks.disabled) return;
    ctx.fillStyle = ctx.strokeStyle = colour("ink");
    ctx.textAlign = "center";
    const levels = Array.from(data.measured_real, (v, i) => decibels(Math.hypot(v, data.measured_imag[i])));
    const taken = /** @type {number[][]} */ ([]);
    for (const i of peaksOf(levels, nearest(box.x.low), nearest(box.x.high))) {
      const [x, y] = [box.across(data.lines[i]), box.upward(shown[0][i])];
      const words = [`${number(data.lines[i], 5)} Hz`, forms.value === "dB" ? `${shown[0][i].toFixed(1)} dB` : number(shown[0][i], 3)];
      const wide = Math.max(...words.map((text) => ctx.measureText(text).width)) / 2;
      const middle = Math.min(Math.max(x, box.left + wide), box.left + box.width - wide);
      const base = Math.max(y - 8, box.top + 22);
      if (taken.some((t) => Math.abs(t[0] - middle) < t[1] + wide + 4 && Math.abs(t[2] - base) < 24)) continue;
      taken.push([middle, wide, base]);
      ctx.beginPath();
      ctx.arc(x, y, 3, 0, 7);
      ctx.stroke();
      words.forEach((text, k) => ctx.fillText(text, middle, base - (1 - k) * 11));
    }
  }

  /** The index of the line nearest to a frequency. @param {number} f */
  function nearest(f) {
    let [a, b] = [0, data.lines.length - 1];
    while (b - a > 1) data.lines[(a + b) >> 1] < f ? (a = (a + b) >> 1) : (b = (a + b) >> 1);
    return f - data.lines[a] < data.lines[b] - f ? a : b;
  }

  /** Say the values under the pointer. @param {number} line  its index, -1 for none */
  function read(line) {
    at = line;
    const unit = FORMS[forms.value].unit ?? data?.unit ?? "";
    where.textContent = at < 0 ? "" : `${number(data.lines[at], 6)} Hz`;
    readings.forEach((reading, i) => (reading.textContent = at < 0 || !Number.isFinite(shown[i]?.[at]) ? "" : ` ${number(shown[i][at], 4)}${unit ? ` ${unit}` : ""}`));
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
    if (forms.value === "coherence") return side === "measured" ? d.coherence : null;
    const [x, y] = [d[`${side}_real`], d[`${side}_imag`]];
    return Float64Array.from(x, (v, i) => FORMS[forms.value].of(v, y[i]));
  }

  function draw() {
    if (!data) return;
    const form = FORMS[forms.value];
    const behind = kept.filter((d) => d !== data && d.lines.length === data.lines.length);
    clear.hidden = !kept.length;
    const share = (data.all ? whole : fits?.[outputs.selectedIndex - 1]?.[Math.max(inputs.selectedIndex, 0)]) ?? null;
    fit.textContent = share === null ? "" : `unexplained ${number(100 * share, 3)} %, worst first ▾`;
    fit.disabled = !fits;
    marks.disabled = !["dB", "linear"].includes(forms.value);
    const unit = form.unit ?? data.unit ?? "";
    const label = data.all && form.label.startsWith("magnitude") ? form.label.replace("magnitude", "sum |H|") : form.label;
    const words = forms.value === "dB" && data.unit ? label.replace("[dB]", `[dB re ${data.unit}]`) : form.unit === undefined && unit ? `${label} [${unit}]` : label;
    const drawn = /** @type {any[][]} */ ([[data, "measured", "ink", `measured ${nameOf(data)}`], ...(forms.value === "coherence" ? [] : [[data, "rebuilt", "vermillion", "rebuilt"]]), ...behind.map((d, k) => [d, "measured", BEHIND[k], nameOf(d)])]);
    readings = drawn.map(() => h("span.reading"));
    fill(key, drawn.map(([, , ink, text], i) => h("span", {}, h("i.stroke", { style: `background: var(--ink-${ink})` }), text, readings[i])), where);
    const none = forms.value === "coherence" && !data.coherence;
    fill(message, none ? "The coherence of these data is not known." : "");
    holder.hidden = none;
    shown = none ? [] : drawn.map(([d, side]) => (forms.value === "Nyquist" ? d[`${side}_imag`] : valuesOf(d, side)));
    const order = [...drawn.keys()].sort((i, j) => Number(drawn[i][1] === "rebuilt") - Number(drawn[j][1] === "rebuilt") || j - i);
    const looks = order.map((k) => ({ kind: "Line", ink: drawn[k][2], width: drawn[k][1] === "rebuilt" ? 1.5 : 1.2, dashed: drawn[k][1] === "rebuilt", y: shown[k] }));
    const panelOf = (/** @type {any} */ x, /** @type {any} */ y, /** @type {any[]} */ items) => ({ words: `Responses: ${words} over frequency`, panels: [{ x, y, items }] });
    if (forms.value === "Nyquist") {
      const real = drawn.map(([d, side]) => d[`${side}_real`]);
      picture.set(() => panelOf(axisOf(unit ? `real [${unit}]` : "real", real), axisOf(words, shown), looks.map((look, k) => ({ ...look, x: real[order[k]] }))));
    } else if (!none)
      picture.set((/** @type {[number, number] | null} */ view) => {
        const [low, high] = view ?? ends();
        const seen = view ? cut(data.lines, shown, view).levels : shown;
        return panelOf({ label: "frequency [Hz]", low, high }, forms.value === "coherence" ? { label: words, low: 0, high: 1.02 } : axisOf(words, seen), looks.map((look) => ({ ...look, x: data.lines })));
      });
    read(-1);
  }

  /** The first and the last line. @returns {[number, number]} */
  const ends = () => [data?.lines[0] ?? 0, data?.lines[data.lines.length - 1] ?? 1];

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
