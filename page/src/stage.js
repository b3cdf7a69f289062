// Where the structure stands, and the eyes on it: points, lines and faces that move, seen from far away.
import { h, rgb } from "./dom.js";
import { makePixels, packed, stamped, toneAt, tones } from "./pixels.js";

/** Directions that the structure is looked at from: towards the eye, and up. */
const VIEWS = {
  "3D": [[0.62, -0.66, 0.46], [0, 0, 1]],
  top: [[0, 0, 1], [0, 1, 0]],
  front: [[0, -1, 0], [0, 0, 1]],
  side: [[1, 0, 0], [0, 0, 1]],
};
const ALL = "all four";

export const VIEW_NAMES = [...Object.keys(VIEWS), ALL];

/** How much of a face is seen through it; how faint what was not measured is. */
const THIN = 0.5;
const FAINT = 0.45;

/** Pixels a structure is drawn in at most, so that a screen of many of them is no slower. */
const MOST = 2e6;

/** @typedef {number[][]} Turn  three rows: to the right, up, towards the eye */

/** @param {number[]} a @param {number[]} b */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @param {number[]} a */
const unit = (a) => a.map((v) => v / Math.hypot(...a));
/** @param {Turn} a @param {Turn} b @returns {Turn} */
const product = (a, b) => a.map((row) => [0, 1, 2].map((k) => row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k]));

/** @param {string} name @returns {Turn} */
function turnTo(name) {
  const [towards, up] = VIEWS[name];
  const back = unit(towards);
  const right = unit(cross(up, back));
  return [right, cross(back, right), back];
}

/** About the structure's own vertical, then about the screen's horizontal: the vertical stays upright. @param {Turn} turn @param {number} dx @param {number} dy */
function dragged(turn, dx, dy) {
  const [a, b] = [dx * 0.008, dy * 0.008];
  const about = [[Math.cos(a), -Math.sin(a), 0], [Math.sin(a), Math.cos(a), 0], [0, 0, 1]];
  return product([[1, 0, 0], [0, Math.cos(b), -Math.sin(b)], [0, Math.sin(b), Math.cos(b)]], product(turn, about));
}

/** @param {HTMLElement} holder @param {any} first  the blob of modes @param {() => void} again  called when it is turned by hand */
export function makeStage(holder, first, again) {
  const canvas = h("canvas", { "aria-hidden": "true" });
  holder.append(canvas);
  const sheet = makePixels(canvas);
  const count = first.nodes.length;
  let data = first;
  let [mode, zoom, turn, all] = [0, 1, turnTo("3D"), false];
  let ratio = 1;
  // on the screen: where each node is, where it rests, and the tone of its motion
  const [x, y, restX, restY, tone] = [0, 0, 0, 0, 0].map(() => new Float32Array(count));
  let hues = new Uint32Array(257);
  let rest = new Uint32Array(257);

  let from = /** @type {number[] | null} */ (null);
  canvas.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
    from = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointerup", () => (from = null));
  canvas.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
    if (!from) return;
    turn = dragged(turn, event.clientX - from[0], event.clientY - from[1]);
    from = [event.clientX, event.clientY];
    again();
  });
  canvas.addEventListener(
    "wheel",
    (/** @type {WheelEvent} */ event) => {
      event.preventDefault();
      zoom = Math.min(12, Math.max(0.3, zoom * (event.deltaY < 0 ? 1.1 : 0.9)));
      again();
    },
    { passive: false },
  );

  /** Half of the height that shows all of the structure, with room to move. @param {Turn} eye @param {number} aspect */
  function reach(eye, aspect) {
    let half = 0.12;
    const every = Math.max(1, Math.floor(count / 400));
    for (let i = 0; i < count; i += every) {
      const [across, upward] = eye.map((row) => row[0] * data.rest[3 * i] + row[1] * data.rest[3 * i + 1] + row[2] * data.rest[3 * i + 2]);
      half = Math.max(half, Math.abs(upward), Math.abs(across) / aspect);
    }
    return half * 1.06 + 0.08;
  }

  /** Where everything is on a part of the screen. @param {Turn} eye @param {number[]} part  left, top, width, height @param {number} c @param {number} s @param {number} amplitude */
  function project([right, up], [left, top, wide, high], c, s, amplitude, scale) {
    const [re, im, still] = [data.moved_real, data.moved_imag, data.rest];
    const [a, b] = [amplitude * c, -amplitude * s];
    const [midX, midY] = [left + wide / 2, top + high / 2];
    for (let i = 0, at = 3 * count * mode, j = 0; i < count; i++, at += 3, j += 3) {
      restX[i] = midX + scale * (right[0] * still[j] + right[1] * still[j + 1] + right[2] * still[j + 2]);
      restY[i] = midY - scale * (up[0] * still[j] + up[1] * still[j + 1] + up[2] * still[j + 2]);
      const [dx, dy, dz] = [a * re[at] + b * im[at], a * re[at + 1] + b * im[at + 1], a * re[at + 2] + b * im[at + 2]];
      x[i] = restX[i] + scale * (right[0] * dx + right[1] * dy + right[2] * dz);
      y[i] = restY[i] - scale * (up[0] * dx + up[1] * dy + up[2] * dz);
      tone[i] = toneAt(data.signed_real[mode * count + i] * c - data.signed_imag[mode * count + i] * s);
    }
  }

  /** @param {boolean} outline @param {number} size  of a point */
  function paint(outline, size) {
    const { lines, faces, measured } = data;
    const seen = (/** @type {number} */ i) => FAINT + (1 - FAINT) * measured[i];
    if (outline) for (let k = 0; k < lines.length; k += 2) sheet.line(restX[lines[k]], restY[lines[k]], restX[lines[k + 1]], restY[lines[k + 1]], ratio, 0, 0, rest, 0.6);
    for (let k = 0; k < faces.length; k += 3) {
      const [a, b, c] = [faces[k], faces[k + 1], faces[k + 2]];
      sheet.triangle([x[a], y[a], tone[a]], [x[b], y[b], tone[b]], [x[c], y[c], tone[c]], hues, (THIN * (seen(a) + seen(b) + seen(c))) / 3);
    }
    for (let k = 0; k < lines.length; k += 2) {
      const [a, b] = [lines[k], lines[k + 1]];
      sheet.line(x[a], y[a], x[b], y[b], 1.6 * ratio, tone[a], tone[b], hues, (seen(a) + seen(b)) / 2);
    }
    const marks = [0, 1].map((known) => disc(size * (0.55 + 0.45 * known), known ? 1 : FAINT));
    for (let i = 0; i < count; i++) sheet.dot(marks[measured[i] ? 1 : 0], x[i], y[i], hues[Math.round(tone[i])]);
  }

  const stage = {
    paint() {
      hues = tones(rgb("below"), rgb("middle"), rgb("above"));
      const [red, green, blue] = rgb("rest");
      rest = new Uint32Array(257).fill(packed(red, green, blue));
    },
    /** @param {any} given */
    data(given) {
      data = given;
    },
    /** @param {number} chosen */
    choose(chosen) {
      mode = chosen;
    },
    /** @param {string} name */
    look(name) {
      all = name === ALL;
      turn = turnTo(name in VIEWS ? name : "3D");
      zoom = 1;
    },
    /** @param {number} c @param {number} s @param {number} amplitude @param {boolean} outline */
    draw(c, s, amplitude, outline) {
      const { clientWidth, clientHeight } = holder;
      if (!clientWidth || !clientHeight) return;
      ratio = Math.min(devicePixelRatio || 1, Math.sqrt(MOST / (clientWidth * clientHeight)));
      const [w, high] = [clientWidth * ratio, clientHeight * ratio];
      sheet.begin(w, high);
      const size = Math.max(3, Math.min(9, (1.1 * Math.min(clientWidth, clientHeight)) / Math.sqrt(count) / 3)) * ratio;
      const eyes = all ? Object.keys(VIEWS).map(turnTo) : [turn];
      eyes.forEach((eye, i) => {
        const part = all ? [(i % 2) * (w / 2), i < 2 ? 0 : high / 2, w / 2, high / 2] : [0, 0, w, high];
        project(eye, part, c, s, amplitude, (zoom * part[3]) / (2 * reach(eye, part[2] / part[3])));
        paint(outline, size);
      });
      sheet.end();
    },
    end() {
      canvas.remove();
    },
  };
  stage.paint();
  return stage;
}

const discs = new Map();
/** @param {number} size @param {number} strength */
function disc(size, strength) {
  const name = `${size} ${strength}`;
  if (!discs.has(name))
    discs.set(
      name,
      stamped(size + 1, (ctx, middle) => {
        ctx.globalAlpha = strength;
        ctx.beginPath();
        ctx.arc(middle, middle, size / 2, 0, 7);
        ctx.fill();
      }),
    );
  return discs.get(name);
}
