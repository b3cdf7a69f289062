// Peaks of a curve: local maxima that stand out of what lies between them and higher ones.

/** Least prominence of a peak: 6 dB, as of the peaks of spectra (modalscope.signals.preprocess.singular_spectra). */
const PROMINENCE = 6;

/** Peaks that are marked at most. */
const MOST = 24;

/**
 * Indices of the most prominent maxima, the first before the others.
 * @param {ArrayLike<number | null>} levels  dB @param {number} first @param {number} last  indices of what is shown
 */
export function peaksOf(levels, first, last) {
  const at = (/** @type {number} */ i) => levels[i] ?? -Infinity;
  const found = [];
  for (let i = Math.max(first, 1); i <= Math.min(last, levels.length - 2); i++) {
    if (!(at(i) > at(i - 1) && at(i) >= at(i + 1))) continue;
    const lowest = [-1, 1].map((step) => {
      let low = at(i);
      for (let k = i + step; k >= first && k <= last; k += step) {
        if (at(k) > at(i)) return low;
        low = Math.min(low, at(k));
      }
      return low;
    });
    const prominence = at(i) - Math.max(...lowest);
    if (prominence >= PROMINENCE) found.push({ i, prominence });
  }
  return found
    .sort((a, b) => b.prominence - a.prominence)
    .slice(0, MOST)
    .map(({ i }) => i);
}
