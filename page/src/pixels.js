// Marks, lines and triangles set pixel by pixel: ten thousand of each take a few milliseconds with a graphics card or without,
// where as many strokes of a canvas take seconds. Positions are in pixels of the canvas; colours are packed as `packed` gives them.

/**
 * A mark drawn once, as how much of each pixel about its middle it covers.
 * @typedef {{dx: Int16Array, dy: Int16Array, cover: Uint8Array}} Stamp
 */

/** Eight bits a part, as words of ImageData hold them. @param {number} red @param {number} green @param {number} blue */
export const packed = (red, green, blue) => (blue << 16) | (green << 8) | red;

/** Tones from one colour over another to a third, each as [red, green, blue]; the middle is left quickly. @param {number[]} below @param {number[]} middle @param {number[]} above */
export function tones(below, middle, above) {
  return Uint32Array.from({ length: 257 }, (_, i) => {
    const share = Math.sqrt(Math.abs(i - 128) / 128);
    const to = i < 128 ? below : above;
    const [red, green, blue] = middle.map((m, k) => Math.round(m + (to[k] - m) * share));
    return packed(red, green, blue);
  });
}

/** The index of a tone. @param {number} value  -1 to 1 */
export const toneAt = (value) => 128 + 128 * Math.max(-1, Math.min(1, value));

/** What `draw` leaves on a small canvas, about its middle. @param {number} size @param {(ctx: CanvasRenderingContext2D, middle: number) => void} draw @returns {Stamp} */
export function stamped(size, draw) {
  const wide = 2 * Math.ceil(size / 2) + 1;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = wide;
  const ctx = canvas.getContext("2d", { willReadFrequently: true });
  draw(ctx, wide / 2);
  const { data } = ctx.getImageData(0, 0, wide, wide);
  const covered = [...Array(wide * wide).keys()].filter((i) => data[4 * i + 3]);
  const half = (wide - 1) / 2;
  return {
    dx: Int16Array.from(covered, (i) => (i % wide) - half),
    dy: Int16Array.from(covered, (i) => Math.floor(i / wide) - half),
    cover: Uint8Array.from(covered, (i) => data[4 * i + 3]),
  };
}

/** @param {HTMLCanvasElement} canvas */
export function makePixels(canvas) {
  const ctx = canvas.getContext("2d", { willReadFrequently: true });
  let image = /** @type {ImageData} */ (null);
  let words = new Uint32Array(0);
  let [wide, high] = [0, 0];

  /** One colour over what is there. @param {number} at @param {number} colour @param {number} cover  0 to 255 */
  function blend(at, colour, cover) {
    const under = words[at];
    const below = under >>> 24;
    if (cover === 255 || below === 0) {
      words[at] = (cover << 24) | colour;
      return;
    }
    const all = cover + (below * (255 - cover)) / 255;
    const share = cover / all;
    const red = (under & 255) + ((colour & 255) - (under & 255)) * share;
    const green = ((under >>> 8) & 255) + (((colour >>> 8) & 255) - ((under >>> 8) & 255)) * share;
    const blue = ((under >>> 16) & 255) + (((colour >>> 16) & 255) - ((under >>> 16) & 255)) * share;
    words[at] = (all << 24) | (blue << 16) | (green << 8) | red;
  }

  return {
    /** An empty sheet of so many pixels. @param {number} w @param {number} h */
    begin(w, h) {
      [wide, high] = [Math.max(1, Math.round(w)), Math.max(1, Math.round(h))];
      if (image?.width !== wide || image.height !== high) {
        [canvas.width, canvas.height] = [wide, high];
        image = ctx.createImageData(wide, high);
        words = new Uint32Array(image.data.buffer);
      } else words.fill(0);
    },

    end() {
      ctx.putImageData(image, 0, 0);
      return canvas;
    },

    /** @param {Stamp} stamp @param {number} x @param {number} y @param {number} colour */
    dot({ dx, dy, cover }, x, y, colour) {
      const [a, b] = [Math.round(x - 0.5), Math.round(y - 0.5)];
      for (let i = 0; i < cover.length; i++) {
        const [px, py] = [a + dx[i], b + dy[i]];
        if (px >= 0 && px < wide && py >= 0 && py < high) blend(py * wide + px, colour, cover[i]);
      }
    },

    /** A line with smooth sides, whose tone runs from one end to the other. @param {number} x0 @param {number} y0 @param {number} x1 @param {number} y1 @param {number} width @param {number} tone0 @param {number} tone1 @param {Uint32Array} table @param {number} strength  0 to 1 */
    line(x0, y0, x1, y1, width, tone0, tone1, table, strength) {
      const steep = Math.abs(y1 - y0) > Math.abs(x1 - x0);
      if (steep) [x0, y0, x1, y1] = [y0, x0, y1, x1];
      if (x0 > x1) [x0, y0, tone0, x1, y1, tone1] = [x1, y1, tone1, x0, y0, tone0];
      const run = x1 - x0 || 1;
      const slope = (y1 - y0) / run;
      const half = (width / 2) * Math.sqrt(1 + slope * slope);
      const [along, across] = steep ? [high, wide] : [wide, high];
      const last = Math.min(along - 1, Math.floor(x1));
      for (let p = Math.max(0, Math.floor(x0)); p <= last; p++) {
        const far = Math.max(0, Math.min(run, p + 0.5 - x0));
        const middle = y0 + slope * far;
        const colour = table[Math.round(tone0 + ((tone1 - tone0) * far) / run)];
        const [low, top] = [middle - half, middle + half];
        for (let q = Math.max(0, Math.floor(low)); q < Math.min(across, top); q++) {
          const covered = Math.min(q + 1, top) - Math.max(q, low);
          blend(steep ? p * wide + q : q * wide + p, colour, Math.round(255 * covered * strength));
        }
      }
    },

    /** A triangle whose tone runs between its corners, each [x, y, tone]; neighbours share no pixel. @param {number[]} a @param {number[]} b @param {number[]} c @param {Uint32Array} table @param {number} strength */
    triangle(a, b, c, table, strength) {
      const corners = [a, b, c].sort((p, q) => p[1] - q[1]);
      const [top, middle, bottom] = corners;
      const cover = Math.round(255 * strength);
      const on = (/** @type {number[]} */ p, /** @type {number[]} */ q, /** @type {number} */ y) => {
        const share = q[1] === p[1] ? 0 : (y - p[1]) / (q[1] - p[1]);
        return [p[0] + (q[0] - p[0]) * share, p[2] + (q[2] - p[2]) * share];
      };
      for (let row = Math.max(0, Math.ceil(top[1] - 0.5)); row < Math.min(high, bottom[1] - 0.5); row++) {
        const y = row + 0.5;
        let [left, right] = [on(top, bottom, y), y < middle[1] ? on(top, middle, y) : on(middle, bottom, y)];
        if (left[0] > right[0]) [left, right] = [right, left];
        const rise = (right[1] - left[1]) / (right[0] - left[0] || 1);
        for (let x = Math.max(0, Math.ceil(left[0] - 0.5)); x < Math.min(wide, right[0] - 0.5); x++) blend(row * wide + x, table[Math.round(left[1] + rise * (x + 0.5 - left[0]))], cover);
      }
    },
  };
}
