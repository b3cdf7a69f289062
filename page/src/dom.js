// Elements made by name, and colours of the present theme. Text is set as text, never as markup.

/**
 * @param {string} tag  name, with classes behind dots: "button.primary"
 * @param {Record<string, any>} [given]  properties, `on...` handlers and attributes
 * @param {...(Node | string | number | null | undefined | false | any[])} inside
 * @returns {any}
 */
export function h(tag, given = {}, ...inside) {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name);
  if (classes.length) element.className = classes.join(" ");
  for (const [key, value] of Object.entries(given)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key in element && !key.includes("-") && key !== "list") element[key] = value;
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  append(element, inside);
  return element;
}

/** @param {Node} element @param {any[]} inside */
function append(element, inside) {
  for (const part of inside.flat(3)) if (part || part === 0) element.appendChild(part instanceof Node ? part : document.createTextNode(String(part)));
}

/** Put new children in the place of the old. @param {HTMLElement} element @param {...any} inside */
export function fill(element, ...inside) {
  element.textContent = "";
  append(element, inside);
  return element;
}

const NS = "http://www.w3.org/2000/svg";

/** A line drawing of 24 x 24. @param {string} path */
export function icon(path) {
  const svg = document.createElementNS(NS, "svg");
  for (const [k, v] of Object.entries({ viewBox: "0 0 24 24", width: "18", height: "18", fill: "none", stroke: "currentColor", "stroke-width": "1.8", "stroke-linecap": "round", "stroke-linejoin": "round", "aria-hidden": "true" })) svg.setAttribute(k, v);
  const line = document.createElementNS(NS, "path");
  line.setAttribute("d", path);
  svg.appendChild(line);
  return svg;
}

export const ICONS = {
  undo: "M9 14 4 9l5-5M4 9h10a6 6 0 0 1 0 12h-3",
  redo: "m15 14 5-5-5-5M20 9H10a6 6 0 0 0 0 12h3",
  save: "M5 3h11l3 3v15H5zM8 3v6h7V3M8 21v-7h8v7",
  export: "M12 3v12M7 10l5 5 5-5M4 19v2h16v-2",
  report: "M6 2h9l4 4v16H6zM9 12h7M9 16h7M9 8h3",
  compare: "M4 20V10M10 20V4M16 20v-8M22 20H2",
  theme: "M12 3a9 9 0 1 0 9 9 7 7 0 0 1-9-9z",
  help: "M9 9a3 3 0 1 1 4 2.8c-.7.3-1 .9-1 1.7M12 17h.01M12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20z",
  play: "M7 4v16l13-8z",
  pause: "M8 5v14M16 5v14",
  close: "M6 6l12 12M18 6 6 18",
  plus: "M12 5v14M5 12h14",
  pencil: "M4 20h4L19 9l-4-4L4 16z",
  script: "m8 8-4 4 4 4M16 8l4 4-4 4M13 5l-2 14",
  points: "M5 19 9 8l6 5 4-9M5 19h.01M9 8h.01M15 13h.01M19 4h.01",
  next: "M12 21s-6-6-6-11a6 6 0 1 1 12 0c0 5-6 11-6 11zM12 8v4M10 10h4",
  whole: "M3 12h18M8 7l-5 5 5 5M16 7l5 5-5 5",
  home: "M3 11 12 4l9 7M6 10v10h12V10",
};

/** Colours of the present theme, as they were asked for. */
const known = new Map();

/** The red, green and blue of a custom property of the style. @param {string} name  without the dashes @returns {number[]} */
export const rgb = (name) => (colour(name).match(/[\d.]+/g) ?? []).slice(0, 3).map(Number);

/** @param {string} name  a custom property of the style, without the dashes */
export function colour(name) {
  if (known.has(name)) return known.get(name);
  const probe = h("i", { hidden: true });
  probe.style.color = `var(--${name})`; // the property itself would still say what it is in light and in dark
  (document.querySelector(".ms") ?? document.body).append(probe);
  const found = getComputedStyle(probe).color;
  probe.remove();
  known.set(name, found);
  return found;
}

/** Listeners that draw again when the theme changes. */
const repaint = new Set();
/** @param {() => void} draw */
export function onTheme(draw) {
  repaint.add(draw);
}
export function paintAgain() {
  known.clear();
  for (const draw of repaint) draw();
}
globalThis.matchMedia?.("(prefers-color-scheme: dark)").addEventListener("change", () => setTimeout(paintAgain));

/** Draw once in the next frame however often it is asked. @param {() => void} draw */
export function soon(draw) {
  let waits = false;
  return () => {
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      draw();
    });
  };
}

/** A number as people read it. @param {number | null} value @param {number} [digits] */
export function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return String(Number(value.toPrecision(digits)));
}

/** A frequency with as many decimals as its highest neighbour's five digits need. @param {number} value @param {number} highest */
export function hertz(value, highest) {
  const decimals = Math.min(4, Math.max(0, 4 - Math.floor(Math.log10(Math.max(highest, 1e-9)))));
  return value.toFixed(decimals);
}

/** Move rising places as little as needed to lie `gap` apart: groups that touch share their mean. @param {number[]} places @param {number} gap */
export function dodge(places, gap) {
  const groups = /** @type {number[][]} */ ([]);
  places.forEach((place, i) => {
    groups.push([place - gap * i, 1]);
    while (groups.length > 1 && groups[groups.length - 2][0] > groups[groups.length - 1][0]) {
      const [b, a] = [groups.pop(), groups.pop()];
      groups.push([(a[0] * a[1] + b[0] * b[1]) / (a[1] + b[1]), a[1] + b[1]]);
    }
  });
  return groups.flatMap(([mean, count]) => Array(count).fill(mean)).map((v, i) => v + gap * i);
}
