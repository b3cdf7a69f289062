// What opens above the page: findings and notes, comparison, geometry, keys.
import { fill, h, icon, ICONS, number } from "./dom.js";
import { makePicture } from "./picture.js";
import { faultInWords, inWords, remediesOf } from "./remedies.js";
import { makeSketch } from "./sketch.js";

/** @param {string} title @param {any} inside @param {string} [kind] */
export function dialog(title, inside, kind = "") {
  const close = h("button.small.quiet", { "aria-label": "Close", title: "Close (Esc)", onclick: () => element.close() }, icon(ICONS.close));
  const body = h("div.body", {}, inside);
  const element = h(`dialog${kind && `.${kind}`}`, { "aria-label": title }, h("header", {}, h("h2", {}, title), close), body);
  element.addEventListener("close", () => element.remove());
  element.addEventListener("click", (/** @type {MouseEvent} */ e) => e.target === element && element.close());
  (document.querySelector(".ms") ?? document.body).append(element);
  element.showModal();
  return { element, body };
}

/** @param {any} parts  asked, found, change */
export function errorBox(parts) {
  const change = inWords(parts.change ?? "");
  const end = !change || /[.!?:]$/.test(change) ? "" : remediesOf(parts.change).length ? ":" : ".";
  return h("div.error", { role: "alert" }, h("b", {}, cap(faultInWords(faultOf(parts)))), h("span", {}, ` ${change}${end}`));
}

/** The fault of an error, without its remedy. @param {any} parts */
function faultOf({ asked = "", found, text }) {
  if (!found) return text ?? "the request failed.";
  const subject = asked.replace(/,? (was|were) asked$/, "");
  return subject === asked ? `${asked}, but ${found}.` : `${subject}: ${found}.`;
}

/** A warning where its colour says what it is. @param {string} text */
export const plainly = (text) => cap(text.replace(/^WARNING: /, ""));

/** @param {string} text */
const cap = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** What the pictures of the data show. */
const MEASURED = {
  points: "Measured and driven points",
  coherence: "Coherence of all channels over frequency",
  driving: "Driving points: where a force acts, it gives energy to the structure",
  reciprocity: "Two responses that are equal for a linear structure, of the pair that differs most",
};

/**
 * What was measured beside what is to be said of it.
 * @param {any} found  the result, as far as there is one
 * @param {(remedy: any) => void} cure  does what a remedy says
 * @returns {(names: string[], ask: (name: string) => Promise<any>, error?: any) => void}  draws the pictures
 */
export function showData(found, cure) {
  const { findings = [], warnings = [], notes = [], computing = [], taken = [] } = found;
  const does = (/** @type {any} */ remedy) => h("button.small", { onclick: () => (cure(remedy), shown.element.close()) }, remedy.words);
  const listed = findings.map((/** @type {any} */ f) =>
    h("li", {}, h("b", {}, `${f.kind}: ${f.channels.join(", ")}`), h("p", {}, `${cap(f.reason)}. ${inWords(f.change)}`), (/leave|exclude|drop/i.test(f.change) ? f.channels : []).map((/** @type {string} */ c) => does({ words: `exclude ${c}`, exclude: [c] }))),
  );
  const items = (/** @type {string[]} */ texts) => texts.map((text) => h("li", {}, `${inWords(text)} `, remediesOf(text).map(does)));
  const pictures = h("div.pictures", {}, h("p.muted.waiting", { role: "status" }, "drawing what was measured…"));
  const shown = dialog("Data", [
    pictures,
    h("h3", {}, "Findings"),
    listed.length ? h("ul.findings", {}, listed) : h("p", {}, found.findings ? "No data problem found." : "The data are examined with the analysis."),
    notes.length + warnings.length ? h("h3", {}, "Notes") : null,
    h("ul.notes", {}, items([...warnings.map(plainly), ...taken, ...notes])),
    computing.length ? h("details", {}, h("summary", {}, "How it was computed"), h("ul.notes", {}, items(computing))) : null,
  ], "wide");
  return (names, ask, error) => {
    const none = h("p.muted", {}, "No force was measured and no geometry is known: there is nothing to draw of these data but their channels.");
    fill(pictures, error ? errorBox(error) : names.length ? names.map((name) => pictured(name, MEASURED[name], ask, names.length === 1 ? "wide" : "")) : none);
  };
}

/** The head of a table; columns of numbers stand together in a list. @param {...(string | string[])} columns */
function heads(...columns) {
  const cell = (/** @type {string} */ kind) => (/** @type {string} */ name) => h(kind, { scope: "col" }, name);
  return h("thead", {}, h("tr", {}, columns.flatMap((c) => (Array.isArray(c) ? c.map(cell("th.num")) : cell("th")(c)))));
}

/** A described picture with its caption, asked for and painted where it stands. @param {string} name @param {string} words @param {(name: string) => Promise<any>} ask @param {string} [kind] */
export function pictured(name, words, ask, kind = "") {
  const place = h("div.picture-box");
  const picture = makePicture(place);
  ask(name).then(picture.set, (error) => place.replaceWith(errorBox(error.parts ?? { text: String(error.message ?? error) })));
  return h(`figure${kind && `.${kind}`}`, {}, place, h("figcaption", {}, words));
}

/** @param {any} found @param {(name: string) => Promise<any>} ask  for a picture */
export function showComparison(found, ask) {
  const [columns, ...listed] = found.rows;
  const graded = columns.indexOf("grade");
  const counts = ["good", "look", "doubtful"].map((word) => [word, listed.filter((/** @type {any} */ r) => r[graded] === word).length]).filter(([, n]) => n);
  const rows = listed.map((/** @type {any} */ r) => h("tr", {}, r.map((/** @type {string} */ cell, /** @type {number} */ k) => (k === graded ? h("td", {}, h(`span.grade.${cell}`, {}, cell)) : h(k < graded ? "td.num" : k === r.length - 1 ? "td.words" : "td", {}, cell)))));
  const methods = found.methods.map((/** @type {any} */ m) => h("tr", {}, h("td", {}, m.label), h("td.num", {}, m.modes ?? "–"), h("td.num", {}, m.fit === null ? "–" : number(100 * m.fit, 3)), h("td.words", {}, m.failure)));
  const picture = (/** @type {string} */ name, /** @type {string} */ words) => (found.pictures.includes(name) ? pictured(name, words, ask) : null);
  dialog(
    "All methods on these data",
    [
      found.verdict.split("\n").map((/** @type {string} */ line) => h("p", {}, line)),
      counts.length ? h("p.counts", {}, counts.map(([word, n]) => h(`span.grade.${word}`, {}, `${n} ${word}`))) : null,
      h("div.scroll", {}, h("table", {}, heads(columns.slice(0, graded), ...columns.slice(graded)), h("tbody", {}, rows))),
      h("div.pictures", {}, picture("map", "Map of methods by the distance of their poles"), picture("deviations", "Deviation of each method from the consensus")),
      h("div.scroll", {}, h("table", {}, heads("method", ["modes", "unexplained [%]"], "remark"), h("tbody", {}, methods))),
      Object.entries(found.causes).map(([name, cure]) => h("p", {}, h("b", {}, `${cap(name)}: `), String(cure))),
    ],
    "wide",
  );
}

/**
 * What to measure next, for what is asked of the modes: an answer a line each.
 * @param {(ask: string) => Promise<string[]>} ask
 */
export function showNext(ask) {
  const wish = h("input.name", { value: "damping 5 %", spellcheck: false, "aria-label": "What is asked of the modes", title: "damping 5 %, f 0.1 %, shapes 0.98, or several with commas", onkeydown: (/** @type {KeyboardEvent} */ e) => e.key === "Enter" && answer() });
  const lines = h("div.next", { role: "status" });
  dialog("What to measure next", [h("div.bar", {}, h("label", {}, "asked of the modes ", wish), h("button.small.primary", { onclick: answer }, "answer")), lines], "wide");
  answer();
  async function answer() {
    fill(lines, h("p.muted", {}, "weighing places…"));
    try {
      const told = await ask(wish.value);
      const steps = told.map((line) => /^(\d+)\. (.*): (.*)\.$/.exec(line)).filter(Boolean);
      const others = (/** @type {boolean} */ before) => told.filter((line) => !/^\d+\. /.test(line) && /^(Asked|All|Now)/.test(line) === before).map((line) => h("p", {}, line));
      const rows = steps.map(([, rank, place, reached]) => h("tr", {}, h("td.num", {}, rank), h("td", {}, place), h("td", {}, reached)));
      fill(lines, others(true), rows.length ? h("div.scroll", {}, h("table", {}, heads(["#"], "measure", "then at worst"), h("tbody", {}, rows))) : null, others(false));
    } catch (error) {
      fill(lines, errorBox(error.parts ?? { text: String(error.message ?? error) }));
    }
  }
}

/**
 * The points and lines of the structure: as tables, and lines by clicks on two points of a sketch.
 * @param {any} found  the result @param {(files: File[]) => void} give
 * @param {{exact: boolean, set: (exact: boolean) => void} | null} matching  of a geometry that is there
 */
export function editGeometry(found, give, matching) {
  const nodes = [...new Set(/** @type {string[]} */ (found.points).map((label) => label.split(":")[0]))];
  const known = Boolean(found.table && found.nodes);
  const pairs = known ? Array.from({ length: found.lines.length / 2 }, (_, k) => `${found.nodes[found.lines[2 * k]]},${found.nodes[found.lines[2 * k + 1]]}`) : nodes.slice(1).map((n, i) => `${nodes[i]},${n}`);
  const points = h("textarea", { rows: 12, spellcheck: false, "aria-label": "Points: node,x,y,z", value: known ? found.table : ["node,x,y,z", ...nodes.map((n, i) => `${n},${i},0,0`)].join("\n"), oninput: () => sketch.draw() });
  const lines = h("textarea", { rows: 12, spellcheck: false, "aria-label": "Lines: pairs of nodes", value: pairs.join("\n"), oninput: () => sketch.draw() });
  const undo = h("button.small", { disabled: true, onclick: () => sketch.undo() }, icon(ICONS.undo), "undo");
  const sketch = makeSketch(points, lines, undo);
  const file = h("input", { type: "file", accept: ".csv,.txt,.uff,.unv,.msh,.vtk,.inp,.bdf,.stl,.obj", "aria-label": "A file of points, or a mesh" });
  const csv = (/** @type {string} */ name, /** @type {string} */ text) => new File([`${text.trim()}\n`], name, { type: "text/csv" });
  const exact = h("input", { type: "checkbox", checked: matching?.exact, onchange: () => (matching?.set(exact.checked), shown.element.close()) });
  const done = h("button.primary", { onclick: use }, "Apply");
  const shown = dialog(
    "Sensor positions",
    [
      h("p", {}, "One point per line: the node of a channel and its coordinates. Channels are named by node and direction, such as 3:+Z. Lines join two nodes: write them, or click two points."),
      h("div.editor", {}, h("label", {}, "Points", points), h("label", {}, "Lines", lines), h("div", {}, h("div.bar", {}, sketch.words, h("span.space"), undo), sketch.canvas)),
      h("p", {}, "Or from a file: a table node,x,y,z, a universal file, a mesh. ", file),
      matching ? h("p", {}, h("label.check", {}, exact, "Place no channel by its number alone (P3 at node 3)")) : null,
      h("footer", {}, done),
    ],
    "wide",
  );
  sketch.draw();
  function use() {
    const chosen = file.files?.[0];
    give(chosen ? [chosen] : [csv("points.csv", points.value), ...(lines.value.trim() ? [csv("lines.csv", lines.value)] : [])]);
    shown.element.close();
  }
}

/** Entries of the head of a report, and what is asked for them. */
const HEAD = { project: "", structure: "", operator: "", date: "", sensors: "a line each: channel, sensor, serial, sensitivity, calibrated", conclusion: "" };

/** The head of a report: fields, and what else is told, a line each. @param {string[]} remarks @param {(remarks: string[]) => void} set */
export function editHead(remarks, set) {
  const known = (/** @type {string} */ name) => remarks.find((line) => line.startsWith(`${name}: `))?.slice(name.length + 2) ?? "";
  const long = (/** @type {string} */ name, /** @type {string} */ value, /** @type {string} */ placeholder) => h("textarea", { rows: 3, name, value, placeholder, "aria-label": name });
  const fields = Object.entries(HEAD).map(([name, asked]) => (["sensors", "conclusion"].includes(name) ? long(name, known(name), asked) : h("input.name", { name, type: name === "date" ? "date" : "text", value: known(name), "aria-label": name })));
  const others = long("others", remarks.filter((line) => !Object.keys(HEAD).some((name) => line.startsWith(`${name}: `))).join("\n"), "a line each, such as customer: Bridge Office");
  const use = () => {
    const told = fields.filter((field) => field.value.trim()).map((field) => `${field.name}: ${field.value.trim()}`);
    set([...told, ...others.value.split("\n").map((/** @type {string} */ line) => line.trim()).filter(Boolean)]);
    shown.element.close();
  };
  const shown = dialog("Report header", [h("div.head-fields", {}, [...fields, others].map((field) => h("label", {}, field.name, field))), h("footer", {}, h("button.primary", { onclick: use }, "Apply"))]);
}

/** @param {string} script */
export function showScript(script) {
  const copy = h("button", { onclick: () => navigator.clipboard.writeText(script).then(() => fill(copy, "copied")) }, "copy");
  dialog("Script that repeats the analysis", [h("pre", { tabIndex: 0 }, script), h("footer", {}, copy)]);
}

/** @param {string[][]} keys */
export function showKeys(keys) {
  dialog("Keys", h("dl.keys", {}, keys.map(([key, words]) => [h("dt", {}, key.split(" ").map((k) => h("kbd", {}, k))), h("dd", {}, words)])));
}
