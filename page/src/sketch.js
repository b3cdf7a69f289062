// A sketch of the points of a structure in the plane where they spread most; a click on two points joins them, or takes their line away.
import { colour, h } from "./dom.js";

/** How near a click must be to a point, in pixels. */
const NEAR = 14;

/** Rows of a table by its signs. @param {string} text */
const rowsOf = (text) => text.split("\n").map((row) => row.split(/[,;\t]/).map((cell) => cell.trim())).filter((row) => row.some(Boolean));

/** Nodes with their coordinates, of a table with a head. @param {string} text @returns {Map<string, number[]>} */
export function nodesOf(text) {
  const [head = [], ...rows] = rowsOf(text);
  const at = ["node", "x", "y", "z"].map((name) => head.map((cell) => cell.toLowerCase()).indexOf(name));
  const found = new Map();
  for (const row of rows) {
    const xyz = at.slice(1).map((k) => (k < 0 ? 0 : Number(row[k])));
    if (row[at[0]] && xyz.every(Number.isFinite)) found.set(row[at[0]], xyz);
  }
  return found;
}

/** @param {HTMLTextAreaElement} points @param {HTMLTextAreaElement} lines @param {HTMLButtonElement} undo */
export function makeSketch(points, lines, undo) {
  const canvas = h("canvas.sketch", { role: "img", "aria-label": "Sketch of points and lines" });
  const words = h("span.muted", {}, "click two points to join or part them");
  let places = /** @type {Map<string, number[]>} */ (new Map());
  let first = "";
  const before = /** @type {string[]} */ ([]);

  function draw() {
    const nodes = nodesOf(points.value);
    const ratio = devicePixelRatio || 1;
    const { clientWidth: w, clientHeight: high } = canvas;
    if (!w || !high) return;
    [canvas.width, canvas.height] = [w * ratio, high * ratio];
    const ctx = canvas.getContext("2d");
    ctx.scale(ratio, ratio);
    const all = [...nodes.values()];
    const low = [0, 1, 2].map((k) => Math.min(...all.map((p) => p[k])));
    const span = [0, 1, 2].map((k) => Math.max(...all.map((p) => p[k])) - low[k]);
    const [u, v] = [0, 1, 2].sort((a, b) => span[b] - span[a] || a - b).slice(0, 2).sort();
    const fits = [span[u] && (w - 40) / span[u], span[v] && (high - 40) / span[v]].filter(Boolean);
    const scale = fits.length ? Math.min(...fits) : 1;
    const middle = [u, v].map((k) => low[k] + span[k] / 2);
    places = new Map([...nodes].map(([name, p]) => [name, [w / 2 + scale * (p[u] - middle[0]), high / 2 - scale * (p[v] - middle[1])]]));
    ctx.strokeStyle = colour("muted");
    for (const row of rowsOf(lines.value)) {
      const ends = row.filter(Boolean).map((name) => places.get(name));
      if (ends.length < 2 || ends.some((end) => !end)) continue;
      ctx.beginPath();
      ends.forEach((end, k) => (k ? ctx.lineTo(end[0], end[1]) : ctx.moveTo(end[0], end[1])));
      if (ends.length > 2) ctx.closePath();
      ctx.stroke();
    }
    ctx.font = "10.5px system-ui, sans-serif";
    ctx.textAlign = "center";
    for (const [name, [x, y]] of places) {
      ctx.fillStyle = colour(name === first ? "mode" : "accent");
      ctx.beginPath();
      ctx.arc(x, y, name === first ? 5.5 : 4, 0, 7);
      ctx.fill();
      ctx.fillStyle = colour("ink");
      if (places.size <= 60) ctx.fillText(name, x, y - 8);
    }
    undo.disabled = !before.length;
  }

  /** Join two nodes, or take the line between them away. @param {string} a @param {string} b */
  function toggle(a, b) {
    before.push(lines.value);
    const rows = lines.value.split("\n").filter((row) => row.trim());
    const kept = rows.filter((row) => {
      const ends = rowsOf(row)[0] ?? [];
      return !(ends.length === 2 && ends.includes(a) && ends.includes(b));
    });
    lines.value = (kept.length < rows.length ? kept : [...rows, `${a},${b}`]).join("\n");
  }

  canvas.addEventListener("click", (event) => {
    let [best, near] = ["", NEAR];
    for (const [name, [x, y]] of places) {
      const far = Math.hypot(event.offsetX - x, event.offsetY - y);
      if (far < near) [best, near] = [name, far];
    }
    if (first && best && best !== first) toggle(first, best);
    first = first || !best ? "" : best;
    draw();
  });
  new ResizeObserver(draw).observe(canvas);
  return {
    canvas,
    words,
    draw,
    undo() {
      lines.value = before.pop() ?? lines.value;
      draw();
    },
  };
}
