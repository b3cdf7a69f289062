// The page on a local server: the document is the state; every action makes a new one.
import "./style.css";
import * as api from "./api.js";
import { rowsOf } from "./blob.js";
import { bench } from "./bench.js";
import { ends, keyOf, makeDiagram } from "./diagram.js";
import { dialog, editGeometry, editHead, errorBox, showComparison, showData, showKeys, showNext, showScript } from "./dialogs.js";
import { fill, h, icon, ICONS, number, paintAgain } from "./dom.js";
import { makeMatrix } from "./matrix.js";
import { makeModes } from "./modes.js";
import { makeOverview } from "./overview.js";
import { remediesOf } from "./remedies.js";
import { makeResponse } from "./response.js";
import { makeSettings } from "./settings.js";
import { makeShape } from "./shape.js";
import { makeWelcome } from "./welcome.js";

const KEYS = [
  ["↑ ↓", "previous / next mode (k, j)"],
  ["x", "refuse the mode"],
  ["n", "type and remark of the mode"],
  ["a", "return to the automatic selection"],
  ["space", "shape: play or pause"],
  ["1 2 3 4 5", "shape: 3D, top, front, side, all four"],
  ["[ ]", "response: previous / next output"],
  ["m", "response: mark the peaks"],
  ["z", "diagram: full range"],
  ["l", "diagram: letters or marks"],
  ["i", "diagram: indicator in dB or linear"],
  ["p", "diagram: select poles by arrow keys, Enter takes or refuses"],
  ["Ctrl+Z Ctrl+Y", "undo, redo"],
  ["s", "save the document"],
  ["e", "export"],
  ["r", "report"],
  ["c", "compare all methods"],
  ["f", "data: points, coherence, driving points, findings"],
  ["w", "what to measure next"],
  ["h", "diagram: multiples of the frequency under the pointer"],
  ["Esc", "stop the computation"],
  ["d", "light or dark"],
  ["?", "show the keys"],
];

const WORDS = {
  idle: "", waiting: "starting", reading: "reading", examining: "looking at what was read", factoring: "preparing the data matrix", sweeping: "orders", selecting: "selecting modes",
  refining: "refining values", done: "", failed: "", stopped: "stopped; all choices are kept",
};

/** What each pane shows, and the stage from which it is there: it says what it waits for until then. */
const PANES = { diagram: "poles", modes: "modes", shape: "modes", response: "settled", matrix: "modes" };

/** Tools that need a result. */
const OF_RESULTS = ["export", "report", "script", "compare", "next"];

/** Bytes as people read them. @param {number} bytes */
const size = (bytes) => (bytes >= 1e6 ? `${number(bytes / 1e6, 3)} MB` : `${Math.max(1, Math.round(bytes / 1e3))} kB`);

const root = /** @type {HTMLElement} */ (document.getElementById("page"));
root.className = "ms";
history.replaceState(null, "", location.pathname + location.search.replace(/[?&]token=[^&]*/, "").replace(/^&/, "?") + location.hash);
const theme = localStorage.getItem("theme");
if (theme) document.documentElement.dataset.theme = theme;

/** Everything that is on the screen of one document. @param {any} begin @param {any} state */
function makeWork(begin, state) {
  let now = state;
  let found = /** @type {any} */ (null);
  let poles = /** @type {any} */ (null);
  let live = /** @type {any} */ (null);
  let overview = /** @type {any} */ (null);
  let chosen = 0;
  const number_ = { overview: 0, poles: 0, modes: 0 };

  const button = (/** @type {string} */ label, /** @type {string} */ key, /** @type {string} */ path, /** @type {() => void} */ does) =>
    h("button.tool", { onclick: does, title: `${label} (${key})`, "aria-label": label }, icon(path), h("span.label", {}, label));
  const undo = button("undo", "Ctrl+Z", ICONS.undo, () => act("undo"));
  const redo = button("redo", "Ctrl+Y", ICONS.redo, () => act("redo"));
  const reporting = button("report", "r", ICONS.report, () => save("html"));
  const comparing = button("compare", "c", ICONS.compare, compare);
  const planning = button("next", "w", ICONS.next, plan);
  const findings = h("button.chip", { title: "Data, findings and notes (f)", onclick: data });
  const formats = h("div.menu", { hidden: true, role: "menu" });
  const exporting = button("export", "e", ICONS.export, () => menu());
  const header = h(
    "header.top",
    {},
    h("button.logo", { onclick: leave, title: "Open another file", "aria-label": "modalscope: open another file" }, logo(), h("span", {}, "modalscope")),
    h("h1", {}, state.name), findings, h("span.space"),
    button("data", "f", ICONS.points, data), undo, redo, button("save", "s", ICONS.save, () => save("analysis.json")), h("div.holder", {}, exporting, formats), reporting,
    button("script", "", ICONS.script, () => found?.script && showScript(found.script)), comparing, planning,
    button("theme", "d", ICONS.theme, switchTheme), button("keys", "?", ICONS.help, () => showKeys(KEYS)),
  );
  const told = h("div.told", { "aria-live": "assertive" });
  const places = Object.fromEntries(["settings", "diagram", "strip", "modes", "shape", "response", "matrix"].map((name) => [name, h(`section.panel.${name}`, { "aria-label": name })]));
  const bar = h("div.progress-bar");
  const stage = h("span");
  const stop = h("button.small", { onclick: () => cancel(), hidden: true, title: "Stop (Esc)" }, "stop");
  const status = h("div.status", { role: "status" }, h("div.progress", {}, bar), stage, stop);
  const legend = h("div.legend");
  fill(root, header, told, h("main.work", {}, h("div.side", {}, places.settings, status), h("div.middle", {}, places.diagram, places.strip), places.modes, places.shape, places.response, places.matrix));

  const act = async (/** @type {string} */ action, given = {}) => {
    try {
      const answer = await api.act(now.key, action, given, now.edition);
      answered(answer);
    } catch (error) {
      complain(error);
      if (error.status === 409) refresh();
    }
  };
  const settings = makeSettings(places.settings, { set: (fields) => act("set", fields), order: (order) => diagram.setOrder(order), automatic: () => act("automatic"), read: (options) => act("reading", options) }, begin.methods);
  const box = h("div.diagram-box");
  const behindPoles = h("select", { "aria-label": "Curves behind the poles", hidden: true, onchange: () => poles && curvesOf(poles) });
  places.diagram.append(h("div.bar", {}, h("h2", {}, "Stabilization"), legend, h("span.space"), h("button.small", { onclick: () => diagram.toggleLetters(), title: "Letters or marks (l)" }, "ofdvs"), behindPoles, h("button.small", { onclick: () => diagram.toggleLinear(), title: "Indicator in dB or linear (i)" }, "dB"), h("button.small", { onclick: () => diagram.whole(), title: "Full range (z)", "aria-label": "full range" }, icon(ICONS.whole))), box);
  const diagram = makeDiagram(box, { take: (i) => take(diagram.poles.frequency[i]), refuse, select });
  const strip = makeOverview(places.strip, (band) => act("set", { bands: band ? [band.map((f) => Number(f.toPrecision(6)))] : [] }));
  const modes = makeModes(places.modes, { select, refuse, take, rename: (i, name) => act("name", { frequency: shown()[i].frequency, name }) });
  const shape = makeShape(places.shape, { geometry: () => found && editGeometry(found, geometry, matching()), line: () => found && geometry(pointsOnALine(found.points)) });
  const response = makeResponse(places.response, async (output, column) => (found ? api.channel(now.key, output, column) : null));
  const macTitle = h("h2", {}, "AutoMAC");
  const other = h("input", { type: "file", hidden: true, "aria-label": "A file of modes", onchange: () => against(other.files[0]) });
  const versus = h("button.small", { title: "MAC with the modes of another file", onclick: () => (macTitle.textContent === "AutoMAC" ? other.click() : autoMac()) }, "with file…");
  places.matrix.prepend(h("div.bar", {}, macTitle, h("span.space"), versus, other));
  const matrix = makeMatrix(places.matrix, select);

  /** Modes as they are shown: those found, without what was refused since, with what was taken since. */
  function shown() {
    const same = (/** @type {number} */ a, /** @type {number} */ b) => Math.abs(a - b) <= 0.01 * b;
    const listed = (found?.modes ?? []).filter((/** @type {any} */ m) => !now.document.refused.some((/** @type {number} */ f) => same(m.frequency, f)) || stageName() === "done");
    const more = now.document.taken.filter((/** @type {number} */ f) => !listed.some((/** @type {any} */ m) => same(m.frequency, f)) && stageName() !== "done").map(pendingMode);
    return [...listed, ...more].sort((a, b) => a.frequency - b.frequency);
  }

  /** The nearest pole's own values, until there are better ones. @param {number} f */
  function pendingMode(f) {
    const source = diagram.poles;
    let best = -1;
    for (let i = 0; i < source.frequency.length; i++) if (best < 0 || Math.abs(source.frequency[i] - f) < Math.abs(source.frequency[best] - f)) best = i;
    const damping = best < 0 ? NaN : source.damping[best];
    const shown = { frequency: number(f, 6), damping: number(100 * damping, 3), grade: "preliminary", mpc: "", reason: "value of the pole, refinement pending" };
    return { frequency: f, damping, shown };
  }
  const stageName = () => now.stage.stage;

  function drawModes() {
    const listed = shown();
    chosen = Math.max(0, Math.min(chosen, listed.length - 1));
    const leftOut = (found?.left_out ?? []).filter((/** @type {any} */ c) => !now.document.taken.some((/** @type {number} */ f) => Math.abs(f - c.frequency_hz) <= 0.002 * f));
    modes.set({ modes: listed, leftOut, refused: now.document.refused, chosen, unexplained: found?.unexplained, warnings: found?.warnings });
    diagram.setModes({ modes: listed, leftOut, chosen });
    return listed;
  }

  function select(/** @type {number} */ i) {
    chosen = i;
    modes.choose(i);
    matrix.choose(i);
    const listed = shown();
    diagram.setModes({ modes: listed, leftOut: found?.left_out ?? [], chosen });
    const mode = listed[i];
    const own = (found?.modes ?? []).indexOf(mode);
    if (own >= 0) shape.choose(own);
    caption(mode, i);
  }

  /** @param {any} mode @param {number} i */
  function caption(mode, i) {
    if (mode) shape.caption(h("b", {}, `Mode ${i + 1}`, mode.name ? ` ${mode.name.split("; ")[0]}` : ""), ` ${mode.shown.frequency} Hz, ${mode.shown.damping} %`, found?.over === "inputs" ? ", over the points that were driven" : "");
    else shape.caption(found ? "no mode" : "");
  }

  function take(/** @type {number} */ frequency) {
    now = { ...now, document: { ...now.document, taken: [...now.document.taken, frequency], refused: now.document.refused.filter((/** @type {number} */ f) => Math.abs(f - frequency) > 1e-6 * f) }, stage: { stage: "waiting" } };
    drawModes();
    api.act(now.key, "take", { frequency }, now.edition).then(answered, wrong);
  }
  function refuse(/** @type {number} */ i) {
    const mode = shown()[i];
    if (!mode) return;
    const near = now.document.taken.find((/** @type {number} */ f) => Math.abs(f - mode.frequency) <= 0.01 * f);
    const frequency = near ?? mode.frequency;
    if (near === undefined) now = { ...now, document: { ...now.document, refused: [...now.document.refused, frequency] }, stage: { stage: "waiting" } };
    drawModes();
    api.act(now.key, "refuse", { frequency }, now.edition).then(answered, wrong);
  }
  const wrong = (/** @type {any} */ error) => {
    complain(error);
    refresh();
  };

  /** What an action is answered; events may have told it before, and more since. @param {any} given */
  const answered = (given) => {
    if (given.edition > now.edition) setState(given);
  };

  /** @param {any} given */
  function setState(given) {
    now = given;
    fill(told, given.failed ? failure(given.failed) : null);
    undo.disabled = !given.undo;
    redo.disabled = !given.redo;
    settings.set(given.document);
    strip.setBand(given.document.bands[0] ?? null);
    setStage(given.stage);
    for (const [name, count] of Object.entries(given.blobs)) fetchBlob(name, Number(count));
    drawModes();
  }

  /** Do what a button of a remedy says. @param {any} r */
  const cure = (r) => (r.read ? act("remedy", { options: r.read }) : act("set", r.set ?? { exclude: [...now.document.exclude, ...r.exclude] }));

  /** @param {any} parts */
  function failure(parts) {
    const box_ = errorBox(parts);
    const byHand = now.document.taken.length + now.document.refused.length;
    const field = settings.concerned(parts);
    const remedies = remediesOf(parts.change ?? "");
    if (!found && !remedies.length) setTimeout(() => field?.show());
    const offers = remedies.map((r) => h("button.small.primary", { onclick: () => cure(r) }, r.words));
    if (/geometr|points/i.test(parts.found ?? "")) offers.push(h("button.small.primary", { onclick: leave }, "drop the measurement with it"));
    box_.append(h("span.does", {}, offers, field && !remedies.length ? h("button.small.primary", { onclick: field.show }, field.words) : null, byHand ? h("button.small", { onclick: () => act("automatic") }, "automatic selection") : null, now.undo ? h("button.small", { onclick: () => act("undo") }, "undo") : null, h("button.small", { onclick: () => act("again") }, "again"), h("button.small", { onclick: leave }, "another file")));
    return box_;
  }

  /** @param {any} given */
  function setStage(given) {
    now.stage = given;
    const busy = !["idle", "done", "failed", "stopped"].includes(given.stage);
    if (given.stage !== saidOf) [saidOf, since] = [given.stage, Date.now()];
    say();
    status.classList.toggle("busy", busy);
    const unknown = !given.total || given.done >= given.total;
    status.classList.toggle("unknown", busy && unknown);
    bar.style.width = unknown ? "" : `${(100 * given.done) / given.total}%`;
    stop.hidden = !busy;
    root.dataset.stage = given.stage;
  }

  let saidOf = "";
  let since = Date.now();

  /** Say what is done and what is left, on the bar and in every pane that waits. */
  function say() {
    const { stage: name, done, total } = now.stage;
    const busy = !["idle", "done", "failed", "stopped"].includes(name);
    const bytes = now.document.files.reduce((/** @type {number} */ sum, /** @type {any} */ f) => sum + (f.size ?? 0), 0);
    const seconds = Math.floor((Date.now() - since) / 1000);
    const words = name === "sweeping" ? `orders ${done} of ${total}` : name === "reading" && bytes ? (total && done >= total ? `${size(bytes)} read, recognizing channels` : `reading ${size(bytes)}${total ? `, ${number(Math.round(done / 1e5) / 10, 3)} of ${number(total / 1e6, 3)}` : ""}`) : WORDS[name] ?? name;
    stage.textContent = words && busy && seconds > 2 && name !== "sweeping" ? `${words}, ${seconds} s` : words;
    const there = { poles: Boolean(poles || live), modes: Boolean(found), settled: Boolean(found?.columns) };
    for (const [pane, what] of Object.entries(PANES)) {
      places[pane].classList.toggle("waits", busy && !there[what]);
      places[pane].dataset.waits = what !== "poles" && ["sweeping", "factoring"].includes(name) ? `${stage.textContent}; then the modes` : stage.textContent;
    }
    // behind an error there are no empty cards: what was found before stays
    root.classList.toggle("without", ["failed", "stopped"].includes(name) && !found);
    for (const tool of header.querySelectorAll("button.tool")) if (OF_RESULTS.includes(tool.textContent)) tool.disabled = !found || (tool === planning && !found.plans);
  }
  setInterval(() => root.dataset.stage === now.stage.stage && !["idle", "done", "failed", "stopped"].includes(now.stage.stage) && say(), 1000);

  /** Blobs that are on their way: what is drawn lags behind the stage until there is none. */
  let pending = 0;

  async function fetchBlob(/** @type {string} */ name, /** @type {number} */ count) {
    if (!(name in number_) || count <= number_[name]) return;
    number_[name] = count;
    pending += 1;
    try {
      const blob = await api.blob(now.key, name);
      if (count === number_[name]) ({ overview: setOverview, poles: setPoles, modes: setFound })[name](blob);
    } catch (error) {
      complain(error);
    } finally {
      pending -= 1;
    }
  }

  /** @param {any} blob */
  function setOverview(blob) {
    overview = blob;
    diagram.setKinds(blob.kinds);
    fill(legend, [...blob.kinds].reverse().map((/** @type {any} */ kind) => h("span", {}, keyOf(kind), kind.words)));
    settings.setData(blob.summary);
    if (!found) sayFindings(blob);
    strip.setData(blob);
    strip.setBand(now.document.bands[0] ?? null);
    if (!poles && blob.span) behind();
  }

  /** What stands behind the poles while a sweep runs. */
  function behind() {
    if (!overview?.span) return;
    const band = now.document.bands[0] ?? overview.span;
    diagram.setCurves({ lines: overview.lines, levels: rowsOf(overview, "curves") }, band);
  }

  /** Draw the indicator that was chosen behind the poles, the first of those there are by default. @param {any} blob */
  function curvesOf(blob) {
    const listed = blob.indicators;
    const before = behindPoles.value;
    fill(behindPoles, listed.map((/** @type {any} */ each) => h("option", { value: each.name }, each.words)));
    const shown_ = listed.find((/** @type {any} */ each) => each.name === before) ?? listed[0];
    behindPoles.value = shown_.name;
    behindPoles.hidden = false;
    diagram.setBlob(blob, now.document.bands.length === 1 ? now.document.bands[0] : ends(blob.bands), shown_);
  }

  /** @param {any} blob */
  function setPoles(blob) {
    poles = blob;
    live = null;
    curvesOf(blob);
    settings.setTop(Math.max(...blob.orders, 2));
    settings.setUsed(now.document.method ? "" : `automatic: ${blob.label}`);
    drawModes();
  }

  /** @param {any} cut */
  function addCut(cut) {
    if (cut.again || !live) {
      if (!live) behind();
      live = { frequency: [], damping: [], order: [], kind: [] };
      poles = null;
    }
    for (let i = 0; i < cut.frequency.length; i++) {
      live.frequency.push(cut.frequency[i]);
      live.damping.push(cut.damping[i]);
      live.order.push(cut.order);
      live.kind.push(cut.kind[i]);
    }
    const highest = Math.max(cut.order, Math.round((cut.order / cut.done) * cut.total));
    diagram.setPoles(live, highest);
    settings.setTop(highest);
  }

  /** @param {any} blob */
  function setFound(blob) {
    const before = found;
    found = blob.early && before ? { ...before, ...blob, settled: false } : blob;
    const listed = drawModes();
    if (!blob.early) sayFindings(found);
    say();
    planning.title = blob.plans ? "next (w)" : "What to measure next: asked of responses to forces, in one band";
    settings.setChannels(found.outputs);
    shape.set(found, Math.max(0, found.modes.indexOf(listed[chosen])));
    caption(listed[chosen], chosen);
    autoMac();
    matrix.choose(chosen);
    if (!blob.early && found.columns) response.setChannels(found.outputs, found.columns, found.fits, found.fit);
  }

  function sayFindings(/** @type {any} */ of) {
    const bad = (of.findings ?? []).length + (of.warnings ?? []).length;
    findings.classList.toggle("bad", bad > 0);
    fill(findings, bad ? `${bad} finding${bad > 1 ? "s" : ""}` : "no problem found");
  }

  function autoMac() {
    macTitle.textContent = "AutoMAC";
    versus.textContent = "with file…";
    if (found) matrix.set(found.mac, found.modes.length, found.points.length);
  }

  /** @param {File | undefined} file  of modes */
  async function against(file) {
    if (!file) return;
    try {
      const answer = await api.against(now.key, await api.upload(file, () => {}));
      macTitle.textContent = `MAC against ${answer.name}`;
      versus.textContent = "AutoMAC";
      matrix.set(answer.mac.flat(), found.modes.length, found.outputs.length, answer.frequencies.length);
    } catch (error) {
      complain(error);
    } finally {
      other.value = "";
    }
  }

  async function refresh() {
    try {
      setState(await api.look(now.key));
    } catch (error) {
      complain(error);
    }
  }

  /** @param {any} error */
  function complain(error) {
    fill(told, errorBox(error.parts ?? { text: String(error.message ?? error) }), h("button.small.quiet", { "aria-label": "Close", onclick: () => fill(told) }, icon(ICONS.close)));
  }

  async function save(/** @type {string} */ suffix) {
    formats.hidden = true;
    stage.textContent = "writing the file";
    status.classList.add("busy", "unknown");
    try {
      const { name, data } = await api.exported(now.key, suffix, Math.max(0, (found?.modes ?? []).indexOf(shown()[chosen])));
      const link = h("a", { href: URL.createObjectURL(data), download: name });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    } catch (error) {
      complain(error);
    } finally {
      setStage(now.stage);
    }
  }

  function menu() {
    formats.hidden = !formats.hidden;
    if (formats.hidden) return;
    fill(formats, Object.entries(begin.formats).map(([suffix, words]) => h("button", { role: "menuitem", disabled: suffix in begin.missing, onclick: () => save(suffix.slice(1)) }, h("b", {}, suffix), h("span.muted", {}, begin.missing[suffix] ?? String(words)))), h("button", { role: "menuitem", onclick: () => (menu(), editHead(now.document.remarks, (remarks) => act("set", { remarks }))) }, h("b", {}, "report header…"), h("span.muted", {}, "project, structure, operator, date, sensors, conclusion")));
    formats.querySelector("button")?.focus();
  }

  /** What was measured, and what is to be said of it: before there are modes, too. */
  async function data() {
    const shown_ = showData({ findings: overview?.findings, ...found }, cure);
    try {
      shown_(await api.measured(now.key), (name) => api.picture(now.key, name));
    } catch (error) {
      shown_([], () => Promise.reject(error), error.parts ?? { text: String(error.message ?? error) });
    }
  }

  async function compare() {
    const wait = dialog("All methods on these data", [h("p", { role: "status" }, "Running all methods…"), h("div.progress", {}, h("div.progress-bar")), h("footer", {}, h("button", { onclick: () => api.cancel(now.key) }, "stop"))]);
    asked = (/** @type {any} */ m) => (/** @type {HTMLElement} */ (wait.body.querySelector(".progress-bar")).style.width = `${(100 * m.done) / m.total}%`);
    try {
      const answer = await api.compare(now.key);
      wait.element.close();
      showComparison(answer, (name) => api.picture(now.key, name));
    } catch (error) {
      wait.element.close();
      complain(error);
    }
  }
  let asked = (/** @type {any} */ _) => {};

  function plan() {
    showNext((ask) => api.planned(now.key, ask));
  }

  /** @param {File[]} files */
  async function geometry(files) {
    try {
      const names = [];
      for (const file of files) names.push(await api.upload(file, () => {}));
      await act("geometry", { files: names });
    } catch (error) {
      complain(error);
    }
  }

  /** Whether channels are placed by names alone, where there is a geometry. */
  function matching() {
    const reading = now.document.files[0]?.reading ?? {};
    return reading.geometry ? { exact: Boolean(reading.exact_nodes), set: (/** @type {boolean} */ exact) => act("exact_nodes", { exact }) } : null;
  }

  async function cancel() {
    await api.cancel(now.key).catch(complain);
  }

  function leave() {
    location.hash = "";
  }

  // what is dropped on an open document is the geometry of its points
  root.ondragover = (event) => event.preventDefault();
  root.ondrop = (event) => {
    event.preventDefault();
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length) geometry(files);
  };
  const end = api.events(
    now.key,
    (message) => {
      if (message.type === "document") {
        if (message.edition >= now.edition) setState(message);
      } else if (message.type === "stage") {
        if (message.stage === "factoring") live = null;
        setStage(message);
        if (["done", "stopped"].includes(message.stage)) drawModes();
      } else if (message.type === "cut") {
        setStage({ stage: "sweeping", done: message.done, total: message.total });
        addCut(message);
      } else if (message.type === "blob") fetchBlob(message.name, message.number);
      else if (message.type === "failed") {
        setStage({ stage: "failed" });
        now.failed = message;
        fill(told, failure(message));
      } else if (message.type === "asked") asked(message);
      else if (message.type === "missed") refresh();
      else if (message.type === "closed") leave();
    },
    (alive) => root.classList.toggle("lost", !alive),
  );

  const step = (/** @type {number} */ by) => {
    const count = shown().length;
    if (count) select((chosen + by + count) % count);
  };
  const keys = {
    ArrowDown: () => step(1), ArrowUp: () => step(-1), j: () => step(1), k: () => step(-1), x: () => refuse(chosen), n: () => shown().length && modes.rename(chosen), a: () => act("automatic"),
    " ": () => shape.toggle(), "[": () => response.next(-1), "]": () => response.next(1), m: () => response.mark(), z: () => diagram.whole(), l: () => diagram.toggleLetters(), i: () => diagram.toggleLinear(),
    p: () => /** @type {HTMLElement} */ (places.diagram.querySelector(".plot")).focus(), s: () => save("analysis.json"), e: () => exporting.click(), r: () => reporting.click(), c: () => comparing.click(), w: () => planning.click(), f: data, h: () => diagram.toggleHarmonics(), Escape: () => (formats.hidden ? cancel() : (formats.hidden = true)), d: switchTheme, "?": () => showKeys(KEYS),
    ...Object.fromEntries(shape.views.map((name, i) => [String(i + 1), () => shape.see(name)])),
  };
  /** @param {KeyboardEvent} event */
  function onKey(event) {
    const target = /** @type {HTMLElement} */ (event.target);
    if (document.querySelector("dialog[open]")) return;
    if ((event.ctrlKey || event.metaKey) && "zy".includes(event.key.toLowerCase())) {
      if (target.matches("input[type=number], input.name, textarea")) return;
      event.preventDefault();
      act(event.key.toLowerCase() === "y" || event.shiftKey ? "redo" : "undo");
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches("input:not([type=checkbox]), select, textarea") || (target.matches("button, summary, input") && [" ", "Enter"].includes(event.key))) return;
    if (keys[event.key]) {
      event.preventDefault();
      keys[event.key]();
    }
  }
  document.addEventListener("keydown", onKey);
  const away = (/** @type {Event} */ e) => {
    if (!exporting.parentElement.contains(e.target)) formats.hidden = true;
  };
  document.addEventListener("click", away);

  if (state.blobs) for (const [name, count] of Object.entries(state.blobs)) fetchBlob(name, Number(count));
  setState(state);
  for (const cut of state.cuts ?? []) if (!state.blobs.poles || state.stage.stage === "sweeping") addCut(cut);
  globalThis.modalscope = { diagram, shape, get state() { return now; }, get pending() { return pending; }, get found() { return found; }, get shown() { return shown(); }, get poles() { return poles; }, setPoles, setFound, take };
  return () => {
    end();
    document.removeEventListener("keydown", onKey);
    document.removeEventListener("click", away);
  };
}

function switchTheme() {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const is = document.documentElement.dataset.theme ?? (dark ? "dark" : "light");
  document.documentElement.dataset.theme = is === "dark" ? "light" : "dark";
  localStorage.setItem("theme", document.documentElement.dataset.theme);
  paintAgain();
}

/** Tables of points side by side, in the order of their numbers, and of the lines between neighbours. @param {string[]} labels  of channels */
function pointsOnALine(labels) {
  const nodes = [...new Set(labels.map((label) => label.split(":")[0]))].sort((a, b) => a.localeCompare(b, undefined, { numeric: true }));
  const points = ["node,x,y,z", ...nodes.map((node, i) => `${node},${i},0,0`)];
  const lines = nodes.slice(1).map((node, i) => `${nodes[i]},${node}`);
  return [new File([`${points.join("\n")}\n`], "points.csv"), new File([`${lines.join("\n")}\n`], "lines.csv")];
}

/** A decaying wave in a circle. */
function logo() {
  const mark = icon("M2 12h3c1.5 0 1.5-8 3.2-8s1.9 15 3.8 15 1.9-10 3.6-10 1.6 5 3 5H22");
  mark.setAttribute("class", "mark");
  return mark;
}

let end = () => {};
async function show() {
  end();
  end = () => {};
  root.classList.remove("lost");
  try {
    const begin = await api.start();
    const key = location.hash.slice(1);
    if (!key && begin.first.length && !sessionStorage.getItem("opened")) {
      sessionStorage.setItem("opened", "yes");
      location.hash = (await api.open(begin.first)).key;
      return;
    }
    if (new URLSearchParams(location.search).has("bench")) await bench(root, begin, makeWork);
    else if (key) end = makeWork(begin, await api.look(key));
    else makeWelcome(root, begin, { theme: switchTheme, logo });
  } catch (error) {
    fill(root, h("main.lost-page", {}, h("h1", {}, "modalscope"), errorBox(error.parts ?? { text: String(error.message ?? error) }), h("p", {}, h("a", { href: "#", onclick: () => show() }, "Back to the files"))));
  }
}
addEventListener("hashchange", show);
show();
