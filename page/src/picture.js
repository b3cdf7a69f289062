// Paints a described picture on a canvas: the same lines, marks, areas and words that reports and Matplotlib show (interfaces/plot/picture.py).
// A picture may be enlarged along its horizontal axis, and may have what follows the pointer on a canvas above it.
import { drawnOf, share, ticksOf } from "./axes.js";
import { colour, dodge, h, onTheme, rgb, soon } from "./dom.js";
import { makePixels, packed, stamped } from "./pixels.js";

/** Pixels of a character, a line of text, a name above the axes with its distance to the next, and between panels. */
const [CHARACTER, LINE, NAME, GAP] = [6.2, 15, 13, 12];
const FONT = "11px system-ui, sans-serif";

/** Pixels between ticks along the axes and up them; of a move that is no click; marks from which they are set pixel by pixel. */
const [ACROSS, UPWARD, MOVED, MANY] = [76, 30, 4, 300];

/** @param {any} axis */
const longest = (axis) => Math.max(0, ...axis.ticks.map((/** @type {any} */ t) => t[1].length));
/** @param {any} p */
const leftOf = (p) => (p.bare ? 8 : 10 + CHARACTER * longest(p.y) + (p.y.label ? LINE : 0));
/** @param {any} p */
const rightOf = (p) => (p.behind ? 12 + CHARACTER * longest(p.behind.axis) + LINE : p.bare ? 8 : 8 + (CHARACTER * longest(p.x)) / 2);
/** Names above the axes stand upright, or lie flat. @param {any} p */
const namesHigh = (p) => (!p.marked.length ? 0 : 12 + (p.flat ? LINE - 4 : 5.6 * Math.max(...p.marked.map((/** @type {any} */ m) => m[1].length))));
/** @param {any} p */
const aboveOf = (p) => 6 + (p.title || p.aside ? LINE : 0) + namesHigh(p);
/** @param {any} x */
const ticksHigh = (x) => (x.upright ? 8 + CHARACTER * longest(x) : longest(x) ? LINE + 4 : 4);
/** @param {any} p @param {boolean} last */
const belowOf = (p, last) => (p.bare || !(last || p.labelled) ? GAP : ticksHigh(p.x) + (p.x.label ? LINE + 3 : 2));

/** The colour between two inks for a tone from -1 to 1. @param {number} tone */
const toned = (tone) => `color-mix(in srgb, ${colour(tone > 0 ? "ink-vermillion" : "ink-blue")} ${Math.min(100, Math.abs(tone) * 100)}%, ${colour("ink-middle")})`;
const ink = (/** @type {string} */ name) => colour(`ink-${name}`);

/** What a panel has where it is not said. */
const PLAIN = { title: "", aside: "", share: 1, marked: [], grid: true, x: {}, y: {} };

/**
 * A picture in a place, painted again when the place or the theme changes.
 * @param {HTMLElement} place
 * @param {{whole?: () => [number, number], over?: (ctx: CanvasRenderingContext2D, box: any) => void, move?: (x: number, y: number, box: any) => void, leave?: () => void, click?: (x: number, y: number, box: any) => void}} acts
 *   `whole`: the ends of the axis that is enlarged by dragging and by the wheel; `over`: draws above the picture
 */
export function makePicture(place, acts = {}) {
  const canvas = h("canvas.picture", { role: "img" });
  const above = h("canvas.picture.over", { "aria-hidden": "true" });
  place.append(canvas, acts.over || acts.whole ? above : "");
  const sheet = makePixels(h("canvas"));
  let described = /** @type {any} */ (null);
  let view = /** @type {[number, number] | null} */ (null);
  let box = /** @type {any} */ (null);
  let dragged = /** @type {[number, number] | null} */ (null);
  const told = { words: /** @type {string[]} */ ([]), marks: 0, took: 0 };

  /** A context of so many pixels of the page. @param {HTMLCanvasElement} on @param {number} w @param {number} high */
  function ready(on, w, high) {
    const ratio = devicePixelRatio || 1;
    [on.width, on.height] = [Math.round(w * ratio), Math.round(high * ratio)];
    const ctx = on.getContext("2d");
    ctx.scale(ratio, ratio);
    ctx.lineCap = ctx.lineJoin = "round";
    ctx.font = FONT;
    return ctx;
  }

  const paint = soon(() => {
    const [w, high] = [place.clientWidth, place.clientHeight];
    if (!described || !w || !high) return;
    const begun = performance.now();
    const blob = typeof described === "function" ? described(view) : described;
    canvas.setAttribute("aria-label", blob.words);
    const ctx = ready(canvas, w, high);
    [told.words, told.marks] = [[], 0];
    /** The numbers of a name among the arrays, or those that were given. @param {any} v */
    const of = (v) => (typeof v === "string" ? blob[v] : v);
    const panels = blob.panels.map((/** @type {any} */ given) => {
      const p = { ...PLAIN, ...given };
      const x = view && acts.whole ? { ...p.x, low: view[0], high: view[1] } : p.x;
      const upright = (/** @type {any} */ axis) => ({ ...axis, ticks: ticksOf(axis, (0.7 * high * p.share) / UPWARD) });
      return { ...p, x: { ...x, ticks: ticksOf(x, w / ACROSS) }, y: upright(p.y), behind: p.behind && { ...p.behind, axis: upright(p.behind.axis) } };
    });

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
      ctx.fillStyle = ctx.strokeStyle = style;
      drawMark(ctx, item, x, y, 1);
    }

    let top = 6 + key(w);
    /** @param {number} wide */
    function key(wide) {
      let [x, row] = [8, 0];
      for (const item of blob.key ?? []) {
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
      return blob.key?.length ? LINE * (row + 1) : 0;
    }

    const [left, right] = [Math.max(...panels.map(leftOf)), Math.max(...panels.map(rightOf))];
    const room = panels.map((/** @type {any} */ p, /** @type {number} */ i) => [aboveOf(p), belowOf(p, i === panels.length - 1)]);
    const free = high - top - room.reduce((/** @type {number} */ sum, /** @type {number[]} */ r) => sum + r[0] + r[1], 0);
    const shares = panels.reduce((/** @type {number} */ sum, /** @type {any} */ p) => sum + p.share, 0);
    panels.forEach((/** @type {any} */ p, /** @type {number} */ i) => {
      const tall = Math.max((free * p.share) / shares, 20);
      panel(p, { left, top: top + room[i][0], width: w - left - right, height: tall }, room[i][1] > GAP);
      top += room[i][0] + tall + room[i][1];
    });
    told.took = performance.now() - begun;
    again();

    /** @param {any} p @param {any} own  left, top, width and height @param {boolean} named */
    function panel(p, own, named) {
      const head = [own.left, own.left + own.width, own.top - aboveOf(p) + LINE - 6];
      if (p.equal) {
        const [wide, tall] = [Math.abs(p.x.high - p.x.low) || 1, Math.abs(p.y.high - p.y.low) || 1];
        const scale = Math.min(own.width / wide, own.height / tall);
        if (p.bare || p.middle) own.left += (own.width - scale * wide) / 2;
        if (p.bare) own.top += (own.height - scale * tall) / 2;
        [own.width, own.height] = [scale * wide, scale * tall];
      }
      const across = (/** @type {number} */ v) => own.left + own.width * share(p.x, v);
      const upward = (/** @type {number} */ v, axis = p.y) => own.top + own.height * (1 - share(axis, v));
      const foot = own.top + own.height;
      const inside = (/** @type {number} */ v) => share(p.x, v) >= -1e-9 && share(p.x, v) <= 1 + 1e-9;
      box = { ...own, foot, across, upward, inside, x: p.x, y: p.y, value: (/** @type {number} */ px) => p.x.low + ((px - own.left) / own.width) * (p.x.high - p.x.low), height_of: (/** @type {number} */ px) => p.y.high - ((px - own.top) / own.height) * (p.y.high - p.y.low) };
      if (p.behind) {
        clipped(() => [...p.behind.items].reverse().forEach((item) => line(item, p.behind.axis)));
        for (const [v, words] of p.behind.axis.ticks) text(words, own.left + own.width + 5, upward(v, p.behind.axis), "muted", "left");
        text(p.behind.axis.label, own.left + own.width + rightOf(p) - 10, own.top + own.height / 2, "muted", "center", Math.PI / 2);
      }
      if (!p.bare) {
        for (const [v, words, name] of p.y.ticks) {
          if (p.grid) stroke(ink("grid"), 0.8, false, () => (ctx.moveTo(own.left, upward(v)), ctx.lineTo(own.left + own.width, upward(v))));
          text(words, own.left - 5, upward(v), name ?? "muted", "right");
        }
        if (p.y.label) text(p.y.label, own.left - leftOf(p) + 8, own.top + own.height / 2, "muted", "center", -Math.PI / 2);
        for (const [v, words, name] of p.x.ticks) {
          if (p.grid && !p.named) stroke(ink("grid"), 0.8, false, () => (ctx.moveTo(across(v), own.top), ctx.lineTo(across(v), foot)));
          if (named) text(words, across(v), foot + (p.x.upright ? 7 : LINE - 4), name ?? "muted", p.x.upright ? "right" : "center", p.x.upright ? -Math.PI / 2 : 0);
        }
        if (named && p.x.label) text(p.x.label, own.left + own.width / 2, foot + ticksHigh(p.x) + LINE - 6, "muted");
      }
      if (p.title) text(p.title, head[0], head[2], "ink", "left", 0, "600 ");
      if (p.aside && CHARACTER * (p.title.length + p.aside.length + 3) < head[1] - head[0]) text(p.aside, head[1], head[2], "muted", "right");
      marked(p.marked.filter((/** @type {any} */ m) => inside(m[0])));
      const many = p.items.reduce((/** @type {number} */ sum, /** @type {any} */ item) => sum + (item.kind === "Marks" && !item.tones ? of(item.x).length : 0), 0) > MANY;
      if (many) sheet.begin(canvas.width, canvas.height);
      clipped(() => {
        for (const item of p.items) ({ Line: line, Marks: marks, Areas: areas, Words: words })[item.kind](item);
        if (many) ctx.drawImage(sheet.end(), 0, 0, w, high);
      });

      /** @param {() => void} draw */
      function clipped(draw) {
        ctx.save();
        ctx.beginPath();
        ctx.rect(own.left - 4, own.top - 4, own.width + 8, own.height + 8);
        if (!p.bare) ctx.clip();
        draw();
        ctx.restore();
      }

      /** A line at each place that is marked, and its name above the axes, apart from its neighbours. @param {any[]} listed  place, name and look of each */
      function marked(listed) {
        const places = dodge(listed.map((m) => across(m[0])), p.flat ? 17 : NAME);
        listed.forEach(([v, words, look = {}], i) => {
          stroke(ink("vermillion"), look.width ?? 1.1, !look.full, () => (ctx.moveTo(across(v), foot), ctx.lineTo(across(v), own.top)));
          stroke(ink("vermillion"), 0.9, false, () => (ctx.moveTo(across(v), own.top), ctx.lineTo(places[i], own.top - 7)));
          if (p.flat) text(words, places[i], own.top - 14, "vermillion", "center", 0, "600 ");
          else text(words, places[i], own.top - 10, "vermillion", "left", -Math.PI / 2);
        });
      }

      /** @param {any} item @param {any} [axis] */
      function line(item, axis) {
        const [x, y] = [of(item.x), of(item.y)];
        if (item.tones) {
          const tones = of(item.tones);
          for (let i = 0; i + 1 < x.length; i++)
            if (Number.isFinite(x[i]) && Number.isFinite(x[i + 1])) stroke(toned((tones[i] + tones[i + 1]) / 2), item.width, false, () => (ctx.moveTo(across(x[i]), upward(y[i])), ctx.lineTo(across(x[i + 1]), upward(y[i + 1]))));
          return;
        }
        const drawn = x.length > 4 * own.width ? drawnOf(x, y, p.x, Math.ceil(own.width)) : x.keys();
        stroke(ink(item.ink), item.width ?? 1, item.dashed, () => {
          let pen = false;
          for (const i of drawn) {
            const known = y[i] !== null && Number.isFinite(x[i]) && Number.isFinite(y[i]);
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
        const [x, y, tones] = [of(item.x), of(item.y), item.tones && of(item.tones)];
        const ratio = canvas.width / w;
        const [cover, style] = many && !tones ? [stampOf(item, ratio), packed(.../** @type {[number, number, number]} */ (rgb(`ink-${item.ink}`)))] : [null, 0];
        for (let i = 0; i < x.length; i++) {
          const [a, b] = [share(p.x, x[i]), share(p.y, y[i])];
          if (!(a >= 0 && a <= 1 && b >= 0 && b <= 1)) continue;
          told.marks += 1;
          const [px, py] = [own.left + own.width * a, own.top + own.height * (1 - b)];
          if (cover) sheet.dot(cover, px * ratio, py * ratio, style);
          else stamp(item, px, py, tones ? toned(tones[i]) : undefined);
        }
      }

      /** @param {any} item */
      function areas(item) {
        const [count, corners] = blob.shapes?.[item.corners] ?? [item.corners.length / 8, 4];
        const [at, strength, tones] = [of(item.corners), of(item.strength), item.tones && of(item.tones)];
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
        const align = /** @type {CanvasTextAlign} */ ({ left: "left", middle: "center", right: "right" }[item.side ?? "middle"]);
        item.texts.forEach((/** @type {string} */ one, /** @type {number} */ i) => text(one, across(of(item.x)[i]), upward(of(item.y)[i]), item.ink, item.turned ? "right" : align, item.turned ? -Math.PI / 2 : 0));
      }
    }
  });

  /** What is above the picture, which follows the pointer. */
  const again = soon(() => {
    if (!box || !above.parentNode) return;
    const ctx = ready(above, place.clientWidth, place.clientHeight);
    acts.over?.(ctx, box);
    if (!dragged || !acts.whole) return;
    ctx.fillStyle = colour("accent");
    ctx.globalAlpha = 0.16;
    ctx.fillRect(Math.min(...dragged), box.top, Math.abs(dragged[1] - dragged[0]), box.height);
  });

  /** Show a part of the horizontal axis; all of it where there is none. @param {[number, number] | null} [part] */
  function zoom(part = null) {
    const [low, high] = acts.whole?.() ?? [0, 1];
    view = part && part[1] - part[0] < (high - low) * 0.999 ? [Math.max(low, part[0]), Math.min(high, part[1])] : null;
    paint();
  }

  let down = /** @type {[number, number] | null} */ (null);
  const ofClick = (/** @type {MouseEvent} */ e) => box && acts.click?.(e.offsetX, e.offsetY, box);
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    down = [e.offsetX, e.offsetY];
  });
  canvas.addEventListener("pointermove", (e) => {
    if (!box) return;
    dragged = down && e.buttons && Math.abs(e.offsetX - down[0]) > MOVED ? [down[0], e.offsetX] : null;
    acts.move?.(e.offsetX, e.offsetY, box);
    again();
  });
  canvas.addEventListener("pointerup", (e) => {
    const part = dragged;
    if (part && acts.whole) zoom(/** @type {[number, number]} */ (part.map((px) => Math.min(box.x.high, Math.max(box.x.low, box.value(px)))).sort((a, b) => a - b)));
    else if (down && Math.hypot(e.offsetX - down[0], e.offsetY - down[1]) <= MOVED) ofClick(e);
    [down, dragged] = [null, null];
    again();
  });
  canvas.addEventListener("pointerleave", () => {
    dragged = null;
    acts.leave?.();
    again();
  });
  if (acts.whole) {
    canvas.addEventListener("dblclick", () => zoom());
    canvas.addEventListener("wheel", (e) => {
      if (!box) return;
      e.preventDefault();
      const [at, factor] = [box.value(e.offsetX), e.deltaY < 0 ? 0.8 : 1.25];
      zoom([at - (at - box.x.low) * factor, at + (box.x.high - at) * factor]);
    }, { passive: false });
  }

  new ResizeObserver(paint).observe(place);
  onTheme(paint);
  return {
    /** @param {any} given  a blob of interfaces/plot/web/blob.py, or a function of the part that is shown which gives the like of it */
    set(given) {
      described = given;
      paint();
    },
    paint,
    again,
    zoom,
    told,
    canvas,
    get box() {
      return box;
    },
    get view() {
      return view;
    },
  };
}

/** A mark in the colours that are set, full or its outline; a letter where it has one. @param {any} ctx @param {any} item @param {number} x @param {number} y @param {number} ratio */
function drawMark(ctx, item, x, y, ratio) {
  if (item.letters) {
    ctx.font = `${item.mark === "dot" ? 600 : 400} ${10 * ratio}px ui-monospace, monospace`;
    [ctx.textAlign, ctx.textBaseline] = ["center", "middle"];
    ctx.fillText(item.letter, x, y);
    return;
  }
  ctx.beginPath();
  trace(ctx, item.mark, x, y, 2.6 * ratio * Math.sqrt(item.size ?? 1));
  ctx.lineWidth = 1.2 * ratio;
  if (item.hollow || ["cross", "bar", "stick"].includes(item.mark)) ctx.stroke();
  else ctx.fill();
}

/** Marks and letters that were drawn once. */
const stamps = new Map();
/** @param {any} item @param {number} ratio */
function stampOf(item, ratio) {
  const name = [item.letters ? item.letter : item.mark, item.size, item.hollow, ratio].join(" ");
  if (!stamps.has(name)) stamps.set(name, stamped((item.letters ? 14 : 6 + 8 * Math.sqrt(item.size ?? 1)) * ratio, (ctx, middle) => drawMark(ctx, item, middle, middle, ratio)));
  return stamps.get(name);
}

/** @param {any} ctx @param {string} name @param {number} x @param {number} y @param {number} r */
function trace(ctx, name, x, y, r) {
  if (name === "cross") {
    const a = r * 0.72;
    ctx.moveTo(x - a, y - a);
    ctx.lineTo(x + a, y + a);
    ctx.moveTo(x + a, y - a);
    ctx.lineTo(x - a, y + a);
  } else if (name === "diamond") {
    ctx.moveTo(x, y - r);
    ctx.lineTo(x + r, y);
    ctx.lineTo(x, y + r);
    ctx.lineTo(x - r, y);
    ctx.closePath();
  } else if (name === "triangle") {
    ctx.moveTo(x, y - r);
    ctx.lineTo(x + r, y + r);
    ctx.lineTo(x - r, y + r);
    ctx.closePath();
  } else if (name === "square") ctx.rect(x - r, y - r, r * 2, r * 2);
  else if (name === "bar" || name === "stick") {
    const [a, b] = name === "bar" ? [2 * r, 0] : [0, 2 * r];
    ctx.moveTo(x - a, y - b);
    ctx.lineTo(x + a, y + b);
  } else {
    ctx.moveTo(x + r, y);
    ctx.arc(x, y, r, 0, 7);
  }
}
