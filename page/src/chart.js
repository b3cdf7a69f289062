// What all curves share: uPlot with the colours of the theme, sized to its place.
import uPlot from "uplot";
import { colour, onTheme } from "./dom.js";

export { uPlot };

/** An axis in the colours of the theme. @param {any} given */
export function axis(given) {
  return {
    stroke: () => colour("muted"),
    font: "11px system-ui, sans-serif",
    labelFont: "11px system-ui, sans-serif",
    labelSize: 15,
    size: 40,
    gap: 3,
    labelGap: 0,
    grid: { stroke: () => colour("grid"), width: 1 },
    ticks: { stroke: () => colour("line"), width: 1, size: 4 },
    values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => ticks.map((v) => (v === null ? "" : String(Number(v.toPrecision(6))))),
    ...given,
  };
}

/** Keep a chart as large as its place. @param {HTMLElement} place @param {() => any} chart */
export function fitted(place, chart) {
  const resize = () => {
    const u = chart();
    const { clientWidth: width, clientHeight: height } = place;
    if (u && width > 20 && height > 20 && (u.width !== width || u.height !== height)) u.setSize({ width, height });
  };
  new ResizeObserver(resize).observe(place);
  onTheme(() => chart()?.redraw(false));
  return resize;
}

/** Zoom by the wheel about the pointer, as far as the data go. @param {any} u @param {() => [number, number]} whole */
export function wheelZoom(u, whole) {
  u.over.addEventListener(
    "wheel",
    (/** @type {WheelEvent} */ event) => {
      event.preventDefault();
      const [low, high] = whole();
      const at = u.posToVal(event.offsetX, "x");
      const factor = event.deltaY < 0 ? 0.8 : 1.25;
      const { min, max } = u.scales.x;
      u.setScale("x", { min: Math.max(low, at - (at - min) * factor), max: Math.min(high, at + (max - at) * factor) });
    },
    { passive: false },
  );
}

/** Decibels of what is positive. @param {number} value */
export const decibels = (value) => (value > 0 ? 20 * Math.log10(value) : null);
