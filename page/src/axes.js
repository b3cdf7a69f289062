// Axes of described pictures: where values lie between their ends, and which of them have names.

/** Least decades of a logarithmic axis, and powers of ten that alone have ticks. */
const [DECADES, POWERS] = [0.8, 3];

const RAISED = /** @type {Record<string, string>} */ ({ "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" });

/** Where a value lies between the ends of an axis. @param {any} axis @param {number} v */
export const share = ({ low, high, log }, v) => (log ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low || 1));

/** The axis that shows all finite values with some room. @param {string} label @param {ArrayLike<number>[]} sides @param {any} [given] */
export function axisOf(label, sides, given = {}) {
  let [low, high] = [Infinity, -Infinity];
  for (const side of sides)
    for (let i = 0; i < side.length; i++) {
      const v = side[i];
      if (v === null || !Number.isFinite(v) || (given.log && v <= 0)) continue;
      if (v < low) low = v;
      if (v > high) high = v;
    }
  if (low > high) [low, high] = given.log ? [0.1, 1] : [0, 1];
  if (given.log) {
    const room = 10 ** (Math.max(Math.log10(high / low), 0.1) * 0.05);
    return { label, ...given, low: low / room, high: high * room };
  }
  const room = (high - low || Math.abs(high) || 1) * 0.05;
  return { label, ...given, low: low - room, high: high + room };
}

/** Decibels of what is positive. @param {number} value */
export const decibels = (value) => (value > 0 ? 20 * Math.log10(value) : NaN);

/** The part of curves between two frequencies. @param {ArrayLike<number>} lines @param {any[]} levels @param {[number, number]} limits */
export function cut(lines, levels, [low, high]) {
  let [a, b] = [0, lines.length];
  while (a < b && lines[a] < low) a++;
  while (b > a && lines[b - 1] > high) b--;
  return { lines: /** @type {any} */ (lines).slice(a, b), levels: levels.map((level) => level.slice(a, b)) };
}

/** Values and words of about so many ticks. @param {any} axis @param {number} most @returns {[number, string][]} */
export function ticksOf({ low, high, log, ticks }, most) {
  if (ticks) return ticks;
  if (log && Math.log10(high / low) >= DECADES) return decades(low, high, most);
  const rough = (high - low) / Math.max(most, 1) || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((s) => s * power).find((s) => s >= rough * (1 - 1e-9)) ?? power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.max(Math.floor(high / step + 1e-9) - first + 1, 0) }, (_, k) => [(first + k) * step, ((first + k) * step + 0).toFixed(digits)]);
}

/** @param {number} low @param {number} high @param {number} most @returns {[number, string][]} */
function decades(low, high, most) {
  const [first, last] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
  if (last - first < POWERS) {
    const values = Array.from({ length: last - first + 2 }, (_, k) => [1, 2, 5].map((s) => s * 10 ** (first - 1 + k))).flat();
    return values.filter((v) => v >= low && v <= high).map((v) => [v, String(Number(v.toPrecision(6)))]);
  }
  const every = Math.ceil((last - first + 1) / Math.max(most, 1));
  return Array.from({ length: Math.floor((last - first) / every) + 1 }, (_, k) => [10 ** (first + k * every), `10${String(first + k * every).replace(/./g, (c) => RAISED[c])}`]);
}

/** Indices of a line's points that are drawn: of many in one column of pixels the lowest and the highest, so that no peak is lost. @param {ArrayLike<number>} x @param {ArrayLike<number>} y @param {any} axis @param {number} columns @returns {ArrayLike<number>} */
export function drawnOf(x, y, { low, high }, columns) {
  const kept = [];
  let [column, a, b] = [NaN, -1, -1];
  const flush = () => {
    if (a >= 0) kept.push(Math.min(a, b));
    if (a !== b) kept.push(Math.max(a, b));
    [column, a, b] = [NaN, -1, -1];
  };
  for (let i = 0; i < x.length; i++) {
    if (x[i + 1] < low || x[i - 1] > high) continue;
    if (!Number.isFinite(y[i])) {
      flush();
      kept.push(i);
      continue;
    }
    const own = Math.floor(((x[i] - low) / (high - low)) * columns);
    if (own !== column) {
      flush();
      [column, a, b] = [own, i, i];
    }
    if (y[i] < y[a]) a = i;
    if (y[i] > y[b]) b = i;
  }
  flush();
  return kept;
}
