// Paints a described picture on a canvas: the same lines, marks, areas and words that reports and Matplotlib show (interfaces/plot/picture.py).
import { mark } from "./diagram.js";
import { colour, dodge, h, onTheme, soon } from "./dom.js";

/** Pixels of a character, a line of text, a name above the axes with its distance to the next, and between panels. */
const [CHARACTER, LINE, NAME, GAP] = [6.2, 15, 13, 12];
const FONT = "11px system-ui, sans-serif";

/** @param {any} axis */
const longest = (axis) => Math.max(0, ...axis.ticks.map((/** @type {any} */ t) => t[1].length));
/** @param {any} p */
const leftOf = (p) => (p.bare ? 8 : 10 + CHARACTER * longest(p.y) + (p.y.label ? LINE : 0));
/** @param {any} p */
const rightOf = (p) => (p.behind ? 12 + CHARACTER * longest(p.behind.axis) + LINE : p.bare ? 8 : 8 + (CHARACTER * longest(p.x)) / 2);
/** @param {any} p */
const aboveOf = (p) => 6 + (p.title || p.aside ? LINE : 0) + (p.marked.length ? 12 + 5.6 * Math.max(...p.marked.map((/** @type {any} */ m) => m[1].length)) : 0);
/** @param {any} x */
const ticksHigh = (x) => (x.upright ? 8 + CHARACTER * longest(x) : longest(x) ? LINE + 4 : 4);
/** @param {any} p @param {boolean} last */
const belowOf = (p, last) => (p.bare || !(last || p.labelled) ? GAP : ticksHigh(p.x) + (p.x.label ? LINE + 3 : 2));

/** Where a value lies between the ends of an axis. @param {any} axis @param {number} v */
const share = ({ low, high, log }, v) => (log ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low || 1));

/** The colour between two inks for a tone from -1 to 1. @param {number} tone */
const toned = (tone) => `color-mix(in srgb, ${colour(tone > 0 ? "ink-vermillion" : "ink-blue")} ${Math.min(100, Math.abs(tone) * 100)}%, ${colour("ink-middle")})`;

/** A picture in a place, painted again when the place or the theme changes. @param {HTMLElement} place */
export function makePicture(place) {
  const canvas = h("canvas.picture", { role: "img" });
  place.append(canvas);
  let blob = /** @type {any} */ (null);
  const told = { words: /** @type {string[]} */ ([]), marks: 0 };

  const paint = soon(() => {
    const [w, high] = [place.clientWidth, place.clientHeight];
    if (!blob || !w || !high) return;
    const ratio = devicePixelRatio || 1;
    [canvas.width, canvas.height] = [w * ratio, high * ratio];
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    ctx.lineCap = ctx.lineJoin = "round";
    [told.words, told.marks] = [[], 0];
    const ink = (/** @type {string} */ name) => colour(`ink-${name}`);

    /** @param {string} words @param {number} x @param {number} y @param {string} name @param {CanvasTextAlign} [align] @param {number} [turn] @param {string} [weight] */
    function text(words, x, y, name, align = "center", turn = 0, weight = "") {
      told.words.push(words);
      ctx.save();
      ctx.translate(x, y);
      ctx.rotate(turn);
      ctx.font = weight + FONT;
      ctx.fillStyle = ink(name);
      ctx.textAlign = align;
      ctx.textBaseline = "middle";
      ctx.fillText(words, 0, 0);
      ctx.restore();
    }

    /** @param {string} style @param {number} width @param {boolean} dashed @param {() => void} draw */
    function stroke(style, width, dashed, draw) {
      ctx.strokeStyle = style;
      ctx.lineWidth = width;
      ctx.setLineDash(dashed ? [5, 3.2] : []);
      ctx.beginPath();
      draw();
      ctx.stroke();
      ctx.setLineDash([]);
    }

    /** @param {any} item @param {number} x @param {number} y @param {string} [style] */
    function stamp(item, x, y, style = ink(item.ink)) {
      ctx.beginPath();
      mark(ctx, item.mark, x, y, 2.6 * Math.sqrt(item.size ?? 1));
      ctx.fillStyle = ctx.strokeStyle = style;
      ctx.lineWidth = 1.2;
      if (item.hollow || ["cross", "bar", "stick"].includes(item.mark)) ctx.stroke();
      else ctx.fill();
    }

    let top = 6 + key(w);
    /** @param {number} wide */
    function key(wide) {
      let [x, row] = [8, 0];
      for (const item of blob.key) {
        const long = 30 + CHARACTER * item.words.length;
        if (x > 8 && x + long > wide) [x, row] = [8, row + 1];
        const y = 12 + LINE * row;
        if (item.kind === "Areas") {
          ctx.globalAlpha = 0.4;
          ctx.fillStyle = ink(item.ink);
          ctx.fillRect(x, y - 4, 14, 8);
          ctx.globalAlpha = 1;
        } else if (item.kind === "Marks") stamp(item, x + 8, y);
        else stroke(ink(item.ink), 1.4, item.dashed, () => (ctx.moveTo(x, y), ctx.lineTo(x + 16, y)));
        text(item.words, x + 20, y, "muted", "left");
        x += long + 10;
      }
      return blob.key.length ? LINE * (row + 1) : 0;
    }

    const [left, right] = [Math.max(...blob.panels.map(leftOf)), Math.max(...blob.panels.map(rightOf))];
    const room = blob.panels.map((/** @type {any} */ p, /** @type {number} */ i) => [aboveOf(p), belowOf(p, i === blob.panels.length - 1)]);
    const free = high - top - room.reduce((/** @type {number} */ sum, /** @type {number[]} */ r) => sum + r[0] + r[1], 0);
    const shares = blob.panels.reduce((/** @type {number} */ sum, /** @type {any} */ p) => sum + p.share, 0);
    blob.panels.forEach((/** @type {any} */ p, /** @type {number} */ i) => {
      const tall = Math.max((free * p.share) / shares, 20);
      panel(p, { left, top: top + room[i][0], width: w - left - right, height: tall }, room[i][1] > GAP);
      top += room[i][0] + tall + room[i][1];
    });

    /** @param {any} p @param {{left: number, top: number, width: number, height: number}} box @param {boolean} named */
    function panel(p, box, named) {
      const head = [box.left, box.left + box.width, box.top - aboveOf(p) + LINE - 6];
      if (p.equal) {
        const [wide, tall] = [Math.abs(p.x.high - p.x.low) || 1, Math.abs(p.y.high - p.y.low) || 1];
        const scale = Math.min(box.width / wide, box.height / tall);
        if (p.bare) [box.left, box.top] = [box.left + (box.width - scale * wide) / 2, box.top + (box.height - scale * tall) / 2];
        [box.width, box.height] = [scale * wide, scale * tall];
      }
      const across = (/** @type {number} */ v) => box.left + box.width * share(p.x, v);
      const upward = (/** @type {number} */ v, axis = p.y) => box.top + box.height * (1 - share(axis, v));
      const foot = box.top + box.height;
      if (p.behind) {
        for (const item of [...p.behind.items].reverse()) line(item, p.behind.axis);
        for (const [v, words] of p.behind.axis.ticks) text(words, box.left + box.width + 5, upward(v, p.behind.axis), "muted", "left");
        text(p.behind.axis.label, box.left + box.width + rightOf(p) - 10, box.top + box.height / 2, "muted", "center", Math.PI / 2);
      }
      if (!p.bare) {
        for (const [v, words] of p.y.ticks) {
          if (p.grid) stroke(ink("grid"), 0.8, false, () => (ctx.moveTo(box.left, upward(v)), ctx.lineTo(box.left + box.width, upward(v))));
          text(words, box.left - 5, upward(v), "muted", "right");
        }
        if (p.y.label) text(p.y.label, box.left - leftOf(p) + 8, box.top + box.height / 2, "muted", "center", -Math.PI / 2);
        for (const [v, words] of p.x.ticks) {
          if (p.grid && !p.named) stroke(ink("grid"), 0.8, false, () => (ctx.moveTo(across(v), box.top), ctx.lineTo(across(v), foot)));
          if (named) text(words, across(v), foot + (p.x.upright ? 7 : LINE - 4), "muted", p.x.upright ? "right" : "center", p.x.upright ? -Math.PI / 2 : 0);
        }
        if (named && p.x.label) text(p.x.label, box.left + box.width / 2, foot + ticksHigh(p.x) + LINE - 6, "muted");
      }
      if (p.title) text(p.title, head[0], head[2], "ink", "left", 0, "600 ");
      if (p.aside && CHARACTER * (p.title.length + p.aside.length + 3) < head[1] - head[0]) text(p.aside, head[1], head[2], "muted", "right");
      const places = dodge(p.marked.map((/** @type {any} */ m) => across(m[0])), NAME);
      p.marked.forEach((/** @type {any} */ [v, words], /** @type {number} */ i) => {
        stroke(ink("vermillion"), 1.1, true, () => (ctx.moveTo(across(v), foot), ctx.lineTo(across(v), box.top)));
        stroke(ink("vermillion"), 0.9, false, () => (ctx.moveTo(across(v), box.top), ctx.lineTo(places[i], box.top - 7)));
        text(words, places[i], box.top - 10, "vermillion", "left", -Math.PI / 2);
      });
      ctx.save();
      ctx.beginPath();
      ctx.rect(box.left - 4, box.top - 4, box.width + 8, box.height + 8);
      if (!p.bare) ctx.clip();
      for (const item of p.items) ({ Line: line, Marks: marks, Areas: areas, Words: words })[item.kind](item);
      ctx.restore();

      /** @param {any} item @param {any} [axis] */
      function line(item, axis) {
        const [x, y] = [blob[item.x], blob[item.y]];
        if (item.tones) {
          const tones = blob[item.tones];
          for (let i = 0; i + 1 < x.length; i++)
            if (Number.isFinite(x[i]) && Number.isFinite(x[i + 1])) stroke(toned((tones[i] + tones[i + 1]) / 2), item.width, false, () => (ctx.moveTo(across(x[i]), upward(y[i])), ctx.lineTo(across(x[i + 1]), upward(y[i + 1]))));
          return;
        }
        stroke(ink(item.ink), item.width, item.dashed, () => {
          let pen = false;
          for (let i = 0; i < x.length; i++) {
            const known = Number.isFinite(x[i]) && Number.isFinite(y[i]);
            if (known) ctx[pen ? "lineTo" : "moveTo"](across(x[i]), upward(y[i], axis));
            pen = known;
          }
        });
        if (item.mark)
          for (let i = 0; i < x.length; i++) {
            if (!Number.isFinite(y[i])) continue;
            told.marks += 1;
            stamp(item, across(x[i]), upward(y[i], axis));
          }
      }

      /** @param {any} item */
      function marks(item) {
        const [x, y, tones] = [blob[item.x], blob[item.y], item.tones && blob[item.tones]];
        for (let i = 0; i < x.length; i++) {
          if (!Number.isFinite(y[i]) || share(p.x, x[i]) < 0 || share(p.x, x[i]) > 1 || share(p.y, y[i]) < 0 || share(p.y, y[i]) > 1) continue;
          told.marks += 1;
          stamp(item, across(x[i]), upward(y[i]), tones ? toned(tones[i]) : undefined);
        }
      }

      /** @param {any} item */
      function areas(item) {
        const [count, corners] = blob.shapes[item.corners];
        const [at, strength, tones] = [blob[item.corners], blob[item.strength], item.tones && blob[item.tones]];
        for (let k = 0; k < count; k++) {
          ctx.beginPath();
          for (let c = 0; c < corners; c++) ctx.lineTo(across(at[2 * (k * corners + c)]), upward(at[2 * (k * corners + c) + 1]));
          ctx.globalAlpha = strength.length === 1 ? strength[0] : strength[k];
          ctx.fillStyle = tones ? toned(tones[k]) : ink(item.ink);
          ctx.fill();
        }
        ctx.globalAlpha = 1;
      }

      /** @param {any} item */
      function words(item) {
        const align = /** @type {CanvasTextAlign} */ ({ left: "left", middle: "center", right: "right" }[item.side]);
        item.texts.forEach((/** @type {string} */ one, /** @type {number} */ i) => text(one, across(blob[item.x][i]), upward(blob[item.y][i]), item.ink, item.turned ? "right" : align, item.turned ? -Math.PI / 2 : 0));
      }
    }
  });

  new ResizeObserver(paint).observe(place);
  onTheme(paint);
  return {
    /** @param {any} given  a blob of interfaces/plot/web/blob.py */
    set(given) {
      blob = given;
      canvas.setAttribute("aria-label", given.words);
      paint();
    },
    told,
  };
}
