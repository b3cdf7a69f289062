// The strip over the full range: drag to select a band.
import { colour, h, hertz, onTheme, soon } from "./dom.js";

/**
 * @param {HTMLElement} place
 * @param {(band: [number, number] | null) => void} choose
 */
export function makeOverview(place, choose) {
  const canvas = h("canvas", { role: "img", "aria-label": "Mode indicator over the full range; drag to select a band" });
  const words = h("div.strip-words", { "aria-hidden": true });
  place.append(canvas, words);
  let lines = /** @type {ArrayLike<number>} */ ([]);
  let level = /** @type {ArrayLike<number>} */ ([]);
  let tops = new Float64Array(0);
  let span = [0, 1];
  let band = /** @type {[number, number] | null} */ (null);
  let drag = /** @type {any} */ (null);

  const paint = soon(() => {
    const ratio = devicePixelRatio || 1;
    const { clientWidth: w, clientHeight: hgt } = place;
    if (!w || !hgt) return;
    [canvas.width, canvas.height] = [w * ratio, hgt * ratio];
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    if (lines.length > 1) curve(ctx, w, hgt);
    const [a, b] = (band ?? span).map((f) => place_(f, w));
    ctx.fillStyle = colour("veil");
    ctx.fillRect(0, 0, a, hgt);
    ctx.fillRect(b, 0, w - b, hgt);
    ctx.strokeStyle = ctx.fillStyle = colour("accent");
    ctx.lineWidth = 1.5;
    ctx.strokeRect(a + 0.75, 0.75, Math.max(b - a - 1.5, 1), hgt - 1.5);
    for (const x of [a, b]) {
      ctx.beginPath();
      ctx.roundRect(x - 3, hgt / 2 - 9, 6, 18, 3);
      ctx.fill();
    }
    const shown = drag?.band ?? band;
    words.textContent = shown ? `${hertz(shown[0], span[1])} – ${hertz(shown[1], span[1])} Hz` : "Full range: drag to select a band";
  });

  /** @param {number} f @param {number} w */
  const place_ = (f, w) => ((f - span[0]) / (span[1] - span[0])) * w;

  /** The highest value of each column, which a drag looks up and does not seek again. @param {number} w */
  function highest(w) {
    const found = new Float64Array(w).fill(-Infinity);
    for (let i = 0; i < lines.length; i++) {
      const x = Math.min(w - 1, Math.max(0, Math.floor(place_(lines[i], w))));
      if (level[i] > found[x]) found[x] = level[i];
    }
    return found.map((v) => (v > 0 ? Math.log10(v) : -Infinity));
  }

  /** @param {CanvasRenderingContext2D} ctx @param {number} w @param {number} high */
  function curve(ctx, w, high) {
    if (tops.length !== Math.ceil(w)) tops = highest(Math.ceil(w));
    const known = tops.filter(Number.isFinite);
    const [low, top] = [Math.min(...known), Math.max(...known)];
    ctx.beginPath();
    ctx.moveTo(0, high);
    tops.forEach((v, x) => Number.isFinite(v) && ctx.lineTo(x, high - 4 - ((v - low) / (top - low || 1)) * (high - 10)));
    ctx.lineTo(w, high);
    ctx.closePath();
    ctx.fillStyle = colour("strip");
    ctx.fill();
    ctx.strokeStyle = colour("curve-1");
    ctx.lineWidth = 1;
    ctx.stroke();
  }

  /** @param {PointerEvent} event */
  const value = (event) => {
    const box = canvas.getBoundingClientRect();
    return Math.min(span[1], Math.max(span[0], span[0] + ((event.clientX - box.left) / box.width) * (span[1] - span[0])));
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (lines.length < 2) return;
    canvas.setPointerCapture(event.pointerId);
    const near = ((span[1] - span[0]) / canvas.clientWidth) * 8;
    const f = value(event);
    const [a, b] = band ?? span;
    const what = Math.abs(f - a) < near ? "low" : Math.abs(f - b) < near ? "high" : band && f > a && f < b ? "move" : "new";
    drag = { what, from: f, was: /** @type {[number, number]} */ ([a, b]), band: null };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!drag) {
      const near = ((span[1] - span[0]) / canvas.clientWidth) * 8;
      const f = value(event);
      canvas.style.cursor = (band ?? span).some((end) => Math.abs(end - f) < near) ? "ew-resize" : "crosshair";
      return;
    }
    const f = value(event);
    const [a, b] = drag.was;
    const ends = { low: [f, b], high: [a, f], new: [drag.from, f], move: [a + f - drag.from, b + f - drag.from] }[drag.what];
    ends.sort((/** @type {number} */ x, /** @type {number} */ y) => x - y);
    drag.band = [Math.max(span[0], ends[0]), Math.min(span[1], ends[1])];
    band = drag.band;
    paint();
  });
  canvas.addEventListener("pointerup", () => {
    const done = drag;
    drag = null;
    if (done?.band && done.band[1] - done.band[0] > (span[1] - span[0]) / 500) choose(done.band);
    else if (done) band = done.was[0] === span[0] && done.was[1] === span[1] ? null : done.was;
    paint();
  });
  canvas.addEventListener("dblclick", () => choose(null));
  new ResizeObserver(paint).observe(place);
  onTheme(paint);
  return {
    /** @param {any} overview  the blob */
    setData(overview) {
      lines = overview.lines;
      level = overview.curves.subarray(0, lines.length);
      span = overview.span ?? [0, 1];
      tops = new Float64Array(0);
      paint();
    },
    /** @param {[number, number] | null} given */
    setBand(given) {
      if (!drag) band = given;
      paint();
    },
    get span() {
      return span;
    },
  };
}
