// One channel, measured and rebuilt: magnitude, phase, real, imaginary, or one over the other.
import { axis, decibels, fitted, uPlot, wheelZoom } from "./chart.js";
import { colour, fill, h, number } from "./dom.js";

const FORMS = {
  dB: { label: "magnitude [dB]", of: (/** @type {number} */ x, /** @type {number} */ y) => decibels(Math.hypot(x, y)) },
  linear: { label: "magnitude", of: Math.hypot },
  phase: { label: "phase [°]", of: (/** @type {number} */ x, /** @type {number} */ y) => (Math.atan2(y, x) * 180) / Math.PI },
  real: { label: "real", of: (/** @type {number} */ x) => x },
  imaginary: { label: "imaginary", of: (/** @type {number} */ _, /** @type {number} */ y) => y },
  Nyquist: { label: "imaginary", of: null },
};

/**
 * @param {HTMLElement} place
 * @param {(output: number, column: number) => Promise<any>} ask
 */
export function makeResponse(place, ask) {
  const outputs = h("select", { "aria-label": "Output", onchange: load });
  const inputs = h("select", { "aria-label": "Input", onchange: load });
  const forms = h("select", { "aria-label": "Representation", onchange: () => draw() }, Object.keys(FORMS).map((name) => h("option", {}, name)));
  const fit = h("span.muted.fit");
  const holder = h("div.plot");
  place.append(h("div.bar", {}, outputs, inputs, forms, fit), holder);
  let data = /** @type {any} */ (null);
  let chart = /** @type {any} */ (null);
  let asked = 0;
  outputs.hidden = inputs.hidden = true;

  async function load() {
    if (!outputs.options.length) return;
    const mine = ++asked;
    try {
      const found = await ask(outputs.selectedIndex, Math.max(inputs.selectedIndex, 0));
      if (mine !== asked || !found) return;
      data = found;
      draw();
    } catch {
      fit.textContent = "";
    }
  }

  function draw() {
    if (!data) return;
    const form = FORMS[forms.value];
    chart?.destroy();
    fill(holder);
    fit.textContent = data.fit === null ? "" : `unexplained: ${number(100 * data.fit, 3)} %`;
    const sides = ["measured", "rebuilt"].map((side) => [data[`${side}_real`], data[`${side}_imag`]]);
    const nyquist = form.of === null;
    const values = nyquist ? [] : sides.map(([x, y]) => Array.from(x, (v, i) => (Number.isFinite(v) ? form.of(v, y[i]) : null)));
    const looks = [{ stroke: () => colour("measured"), width: 1.3 }, { stroke: () => colour("mode"), width: 1.5, dash: [5, 3] }];
    const common = { width: Math.max(holder.clientWidth, 60), height: Math.max(holder.clientHeight, 60), legend: { show: false }, padding: [8, 14, 0, 0] };
    if (nyquist) {
      const box = limits(sides);
      const path = (/** @type {any} */ u, /** @type {number} */ s) => trace(u, u.data[s][0], u.data[s][1]);
      chart = new uPlot(
        /** @type {any} */ ({
          ...common,
          mode: 2,
          scales: { x: { time: false, range: () => box[0] }, y: { range: () => box[1] } },
          axes: [axis({ label: "real", size: 24 }), axis({ label: "imaginary", size: 50 })],
          series: [null, ...looks.map((look) => ({ ...look, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }], paths: path, points: { show: false } }))],
          cursor: { points: { show: false } },
        }),
        /** @type {any} */ ([null, ...sides]),
        holder,
      );
      return;
    }
    chart = new uPlot(
      /** @type {any} */ ({
        ...common,
        cursor: { drag: { x: true, y: false, dist: 4 }, points: { size: 5 } },
        scales: { x: { time: false } },
        axes: [axis({ label: "frequency [Hz]", size: 24 }), axis({ label: form.label, size: 44 })],
        series: [{}, ...looks.map((look) => ({ ...look, points: { show: false } }))],
      }),
      /** @type {any} */ ([data.lines, ...values]),
      holder,
    );
    wheelZoom(chart, () => [data.lines[0], data.lines[data.lines.length - 1]]);
  }

  fitted(holder, () => chart);
  return {
    /** @param {string[]} outs @param {string[]} ins */
    setChannels(outs, ins) {
      const same = outs.length === outputs.options.length && ins.length === inputs.options.length;
      if (!same) {
        fill(outputs, outs.map((name) => h("option", {}, name)));
        fill(inputs, ins.map((name) => h("option", {}, name)));
      }
      outputs.hidden = !outs.length;
      inputs.hidden = ins.length < 2;
      load();
    },
    next(/** @type {number} */ step) {
      outputs.selectedIndex = (outputs.selectedIndex + step + outputs.options.length) % outputs.options.length;
      load();
    },
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
