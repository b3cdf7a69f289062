// Where the page begins: drop a file, choose one of the folder, or go on with a document.
import * as api from "./api.js";
import { errorBox } from "./dialogs.js";
import { fill, h, icon, ICONS } from "./dom.js";

/** @param {HTMLElement} root @param {any} begin @param {{theme: () => void, logo: () => any}} with_ */
export function makeWelcome(root, begin, with_) {
  const told = h("div.told", { "aria-live": "assertive" });
  const chooser = h("input", { type: "file", multiple: true, hidden: true, onchange: () => give([...chooser.files]) });
  const bar = h("div.progress-bar");
  const progress = h("div.progress", { hidden: true }, bar);
  const drop = h("button.drop", { onclick: () => chooser.click() }, icon(ICONS.export), h("b", {}, "Drop a measurement here"), h("span", {}, "or click to select files: responses, impulse responses, hammer, shaker or ambient records. Several files are runs or setups of one test; a table of points (node, x, y, z) or a mesh among them is its geometry."), h("small.muted", {}, ".uff .unv .csv .txt .xlsx .npz .npy .mat .h5 .wav .tdms …"));
  const over = (/** @type {boolean} */ on) => drop.classList.toggle("over", on);
  root.ondragover = (event) => {
    event.preventDefault();
    over(true);
  };
  root.ondragleave = () => over(false);
  root.ondrop = (event) => {
    event.preventDefault();
    over(false);
    give([...event.dataTransfer.files]);
  };

  /** @param {File[]} files */
  async function give(files) {
    if (!files.length) return;
    try {
      progress.hidden = false;
      const names = [];
      for (const file of files) {
        if (file.size > begin.upload) throw new api.Refused({ asked: `uploading ${file.name}:`, found: `it has more than ${begin.upload / 1e6} MB`, change: "Start the page in its folder and choose it there." }, 400);
        names.push(await api.upload(file, (share) => (bar.style.width = `${100 * share}%`)));
      }
      await open(names);
    } catch (error) {
      complain(error);
    } finally {
      progress.hidden = true;
    }
  }

  /** @param {string[]} names */
  async function open(names) {
    fill(told, h("p.error", { role: "status" }, `opening ${names.map((name) => name.split(/[/:]/).at(-1)).join(", ")}…`));
    try {
      location.hash = (await api.open(names)).key;
    } catch (error) {
      complain(error);
    }
  }

  /** @param {any} error */
  const complain = (error) => fill(told, errorBox(error.parts ?? { text: String(error.message ?? error) }));

  const size = (/** @type {number} */ bytes) => (bytes > 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : `${Math.max(1, Math.round(bytes / 1e3))} kB`);
  const date = (/** @type {number} */ seconds) => (seconds ? new Date(1000 * seconds).toISOString().slice(0, 10) : "");
  const file = (/** @type {any} */ f) => h("li", {}, h("button.row", { onclick: () => open([f.name]) }, icon(ICONS.report), h("b", { title: f.name }, f.name.split("/").at(-1)), h("span.muted", {}, size(f.size)), h("span.muted.date", {}, date(f.changed))));
  const kept = (/** @type {any} */ d) => {
    const row = h("li", {}, h("a.row", { href: `#${d.key}` }, icon(ICONS.points), h("b", {}, d.name), h("span.muted", {}, `${d.steps} step${d.steps > 1 ? "s" : ""}`), h("span.muted.date", {}, date(d.changed))), h("button.small.quiet", { "aria-label": `delete ${d.name}`, title: "Delete it", onclick: () => api.forget(d.key).then(() => row.remove(), complain) }, icon(ICONS.close)));
    return row;
  };
  /** Files of the folder itself, and its folders, folded. @param {any[]} files */
  const listing = (files) => {
    const folders = /** @type {Map<string, any[]>} */ (new Map());
    for (const f of files) {
      const folder = f.name.split("/").slice(0, -1).join("/");
      folders.set(folder, [...(folders.get(folder) ?? []), f]);
    }
    const inner = [...folders].filter(([name]) => name).map(([name, list]) => h("li", {}, h("details.folder", {}, h("summary", {}, h("b", {}, name), h("span.muted", {}, ` ${list.length} file${list.length > 1 ? "s" : ""}`)), h("ul", {}, list.map(file)))));
    return h("ul", {}, (folders.get("") ?? []).map(file), inner);
  };
  fill(
    root,
    h("header.top", {}, h("span.logo", {}, with_.logo(), h("span", {}, "modalscope")), h("span.space"), h("button.tool", { onclick: with_.theme, title: "Light or dark", "aria-label": "light or dark" }, icon(ICONS.theme))),
    told,
    h(
      "main.welcome",
      {},
      h("h1", {}, "From a measurement to modes you can defend"),
      drop, progress, chooser,
      h("p.example", {}, "Nothing at hand? ", h("button.small", { onclick: () => open(["example:beam_hammer"]) }, "open the example beam"), h("span.muted", {}, " a beam hit by a hammer at six points, measured by seven accelerometers")),
      h("div.columns", {}, h("section", {}, h("h2", {}, begin.folder ? `In ${begin.folder}` : "Files"), begin.files.length ? listing(begin.files) : h("p.muted", {}, begin.folder ? "no data files" : "Started in a folder, the page lists its files here.")), h("section", {}, h("h2", {}, "Recent documents"), begin.documents.length ? h("ul", {}, begin.documents.map(kept)) : h("p.muted", {}, "none"))),
      h("p.muted.version", {}, `modalscope ${begin.version}. Nothing leaves this machine.`),
    ),
  );
}
