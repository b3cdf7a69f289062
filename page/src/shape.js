// A mode shape, moving: on the geometry, or as bars where none is known.
import { fill, h, icon, ICONS, onTheme } from "./dom.js";
import { makePicture } from "./picture.js";
import { makeStage, VIEW_NAMES } from "./stage.js";

/** @param {HTMLElement} place @param {{geometry?: () => void, line?: () => void}} acts */
export function makeShape(place, acts = {}) {
  const holder = h("div.plot.shape", { tabIndex: 0, role: "img", "aria-label": "Animated mode shape" });
  const caption = h("div.caption");
  const playing = h("button.small", { title: "Play or pause (space)", "aria-label": "Play or pause", onclick: () => toggle() });
  const views = h("select", { "aria-label": "View", onchange: () => see(views.value) }, VIEW_NAMES.map((name) => h("option", {}, name)));
  const real = h("select", { "aria-label": "Complex or real", onchange: () => draw() }, h("option", {}, "complex"), h("option", {}, "real"));
  const amplitude = h("input", { type: "range", min: 0, max: 0.4, step: 0.005, value: 0.12, "aria-label": "Amplitude", title: "Amplitude" });
  const speed = h("input", { type: "range", min: 0.1, max: 2.5, step: 0.05, value: 0.8, "aria-label": "Speed", title: "Speed" });
  const outline = h("input", { type: "checkbox", checked: true, "aria-label": "Undeformed outline", onchange: () => draw() });
  const add = acts.geometry ? h("button.small", { onclick: acts.geometry, title: "Points and lines of the structure" }, "geometry…") : null;
  const offer = acts.line ? h("div.bar.offer", { hidden: true }, "No geometry: drop a table of points,", h("button.small", { onclick: acts.line, title: "Place the points side by side on a line, in the order of their numbers" }, "points on a line")) : null;
  const bar = h("div.bar", {}, h("h2", {}, "Shape"), playing, views, real, h("label.slide", { title: "Amplitude" }, "size", amplitude), h("label.slide", { title: "Speed" }, "speed", speed), h("label.check", { title: "Undeformed outline" }, outline, "outline"));
  place.append(bar, offer ?? "", holder, caption);
  let data = /** @type {any} */ (null);
  let chosen = -1;
  let run = !globalThis.matchMedia?.("(prefers-reduced-motion: reduce)").matches;
  let phase = 0;
  let last = 0;
  let frames = 0;
  let visible = true;
  let stage = /** @type {any} */ (null);
  const barsPlace = h("div.plot");
  const bars = makePicture(barsPlace);

  const ONE_OUTPUT = "One point was measured: a shape of one number says nothing. Measure more points, or give responses to several forces.";

  const loop = (/** @type {number} */ now) => {
    const step = Math.min((now - last) / 1000, 0.1);
    last = now;
    if (run && visible && chosen >= 0) {
      phase += step * Number(speed.value) * 2 * Math.PI;
      draw();
    }
    requestAnimationFrame(loop);
  };
  requestAnimationFrame(loop);
  new IntersectionObserver((seen) => (visible = seen[0].isIntersecting)).observe(holder);

  function draw() {
    frames++;
    if (chosen < 0 || !data) return;
    if (stage) stage.draw(Math.cos(phase), real.value === "real" ? 0 : Math.sin(phase), Number(amplitude.value), outline.checked);
    else bars.paint();
  }

  /** Bars of all channels at a phase of the motion, at rest behind them, with one standard deviation to either side. */
  function barsOf() {
    const count = data.points.length;
    const from = chosen * count;
    const [c, s] = [Math.cos(phase), real.value === "real" ? 0 : Math.sin(phase)];
    const part = (/** @type {string} */ name) => data[name]?.subarray(from, from + count);
    const still = part("shape_real");
    const now = run || phase ? still.map((/** @type {number} */ v, /** @type {number} */ i) => v * c - part("shape_imag")[i] * s) : still;
    const reach = 1.15 / Math.min(1, 0.35 + Number(amplitude.value) * 5);
    const boxes = (/** @type {number[]} */ heights) => Array.from(heights, (v, i) => [i - 0.36, 0, i - 0.36, v, i + 0.36, v, i + 0.36, 0]).flat();
    const spread = Array.from(part("shape_std") ?? [], (std, i) => (std ? [now[i] - std, now[i] + std, NaN] : [])).flat();
    const every = Math.ceil((34 * count) / Math.max(holder.clientWidth, 1));
    const ticks = data.points.map((/** @type {string} */ name, /** @type {number} */ i) => [i, name]).filter((/** @type {any} */ _, /** @type {number} */ i) => i % every === 0);
    const items = [
      { kind: "Areas", ink: "pale", corners: outline.checked ? boxes(still) : [], strength: [0.45] },
      { kind: "Areas", ink: "blue", corners: boxes(now), tones: now.map(Math.sign), strength: [1] },
      { kind: "Line", ink: "muted", x: [-0.6, count - 0.4], y: [0, 0] },
      { kind: "Line", ink: "ink", mark: "bar", x: spread.map((_, k) => Math.floor(k / 3)), y: spread },
    ];
    return { words: "Mode shape as bars, one per channel", panels: [{ x: { label: "", low: -0.6, high: count - 0.4, ticks }, y: { label: "", low: -reach, high: reach, ticks: [] }, items, named: true, grid: false }] };
  }

  function toggle(/** @type {boolean} */ on = !run) {
    run = on;
    fill(playing, icon(run ? ICONS.pause : ICONS.play));
    if (!run) draw();
  }

  /** @param {string} name */
  function see(name) {
    views.value = name;
    stage?.look(name);
    draw();
  }

  function choose(/** @type {number} */ mode) {
    chosen = mode;
    phase = 0;
    if (chosen < 0 || !data) return;
    stage?.choose(chosen);
    draw();
  }

  new ResizeObserver(draw).observe(holder);
  onTheme(() => {
    stage?.paint();
    draw();
  });
  toggle(run);
  return {
    /** @param {any} given  the blob of modes @param {number} mode */
    set(given, mode) {
      const same = stage && data?.nodes && given.nodes && data.nodes.length === given.nodes.length && given.rest?.every((/** @type {number} */ v, /** @type {number} */ i) => v === data.rest[i]);
      data = given;
      const solid = Boolean(data.nodes) && data.points.length > 1;
      if (offer) offer.hidden = Boolean(data.nodes) || data.points.length < 2;
      if (add) (offer && !offer.hidden ? offer : bar).append(add);
      views.hidden = !solid;
      if (!same) {
        stage?.end();
        stage = null;
        fill(holder);
        if (data.points.length === 1 && data.modes.length) fill(holder, h("div.muted.one-output", {}, ONE_OUTPUT));
        else if (solid) (stage = makeStage(holder, data, () => run || draw())).look(views.value);
        else {
          holder.append(barsPlace);
          bars.set(barsOf);
        }
      } else stage.data(data);
      choose(Math.min(mode, data.modes.length - 1));
    },
    choose,
    toggle: () => toggle(),
    see,
    caption: (/** @type {any} */ ...inside) => fill(caption, ...inside),
    views: VIEW_NAMES,
    get frames() {
      return frames;
    },
  };
}
