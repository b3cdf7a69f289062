// The strip over the full range: drag to select a band.
import { axisOf } from "./axes.js";
import { colour, h, hertz } from "./dom.js";
import { makePicture } from "./picture.js";

/** Pixels about an end of the band in which it is taken hold of; of the words; least part of the range that is a band. */
const [NEAR, WORDS, LEAST] = [8, 130, 1 / 500];

/**
 * @param {HTMLElement} place
 * @param {(band: [number, number] | null) => void} choose
 */
export function makeOverview(place, choose) {
  const words = h("div.strip-words", { "aria-hidden": true });
  let span = /** @type {[number, number]} */ ([0, 1]);
  let band = /** @type {[number, number] | null} */ (null);
  let drag = /** @type {any} */ (null);
  const picture = makePicture(place, {
    over(ctx, box) {
      const [a, b] = (band ?? span).map(box.across);
      ctx.fillStyle = colour("veil");
      ctx.fillRect(0, 0, a, place.clientHeight);
      ctx.fillRect(b, 0, place.clientWidth - b, place.clientHeight);
      ctx.strokeStyle = ctx.fillStyle = colour("accent");
      ctx.lineWidth = 1.5;
      ctx.strokeRect(a, 0.75, Math.max(b - a, 1), place.clientHeight - 1.5);
      for (const x of [a, b]) {
        ctx.beginPath();
        ctx.roundRect(x - 3, place.clientHeight / 2 - 9, 6, 18, 3);
        ctx.fill();
      }
      const wide = place.clientWidth; // the words cover no end of the band: inside, or on its wider side
      words.style.left = `${(b - a > WORDS ? a + b : a > wide - b ? a : b + wide) / 2}px`;
      words.textContent = band ? `${hertz(band[0], span[1])} – ${hertz(band[1], span[1])} Hz` : "Full range: drag to select a band";
    },
  });
  const canvas = picture.canvas;
  place.append(words);

  /** The frequency under the pointer, and what is there: an end of the band, the band, or nothing. @param {PointerEvent} event */
  function under(event) {
    const f = Math.min(span[1], Math.max(span[0], picture.box.value(event.offsetX)));
    const at = (band ?? span).map((end) => Math.abs(picture.box.across(end) - event.offsetX) < NEAR);
    return { f, what: at[0] ? "low" : at[1] ? "high" : band && f > band[0] && f < band[1] ? "move" : "new" };
  }

  canvas.addEventListener("pointerdown", (event) => {
    if (!picture.box) return;
    const { f, what } = under(event);
    drag = { what, from: f, was: band, band: null };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!picture.box) return;
    const { f, what } = under(event);
    if (!drag) {
      canvas.style.cursor = ["low", "high"].includes(what) ? "ew-resize" : "crosshair";
      return;
    }
    const [a, b] = drag.was ?? span;
    const ends = { low: [f, b], high: [a, f], new: [drag.from, f], move: [a + f - drag.from, b + f - drag.from] }[drag.what];
    ends.sort((/** @type {number} */ x, /** @type {number} */ y) => x - y);
    band = drag.band = /** @type {[number, number]} */ ([Math.max(span[0], ends[0]), Math.min(span[1], ends[1])]);
    picture.again();
  });
  canvas.addEventListener("pointerup", () => {
    const done = drag;
    drag = null;
    if (done?.band && done.band[1] - done.band[0] > (span[1] - span[0]) * LEAST) choose(done.band);
    else if (done) band = done.was;
    picture.again();
  });
  canvas.addEventListener("dblclick", () => choose(null));
  return {
    /** @param {any} overview  the blob */
    setData(overview) {
      span = overview.span ?? [0, 1];
      const level = overview.curves.subarray(0, overview.lines.length);
      picture.set({ words: "Mode indicator over the full range; drag to select a band", panels: [{ x: { low: span[0], high: span[1] }, y: axisOf("", [level], { log: true }), items: [{ kind: "Line", x: overview.lines, y: level, ink: "muted" }], bare: true }] });
    },
    /** @param {[number, number] | null} given */
    setBand(given) {
      if (!drag) band = given;
      picture.again();
    },
    get span() {
      return span;
    },
  };
}
