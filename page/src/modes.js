// The table of modes, with intervals, reasons and what was left out.
import { plainly } from "./dialogs.js";
import { fill, h, icon, ICONS, number } from "./dom.js";

/** Types of modes that a name is chosen from, or begins with. */
const TYPES = ["first bending", "second bending", "third bending", "first torsion", "second torsion", "axial", "local", "rigid body"];

/** A name is a type and a remark: "first bending; wing tips". @param {string} name */
function parted(name) {
  const [type, ...remark] = name.split("; ");
  return [type, remark.join("; ")];
}

/** From the surest on. */
const GRADES = ["good", "look", "doubtful", "preliminary"];

/**
 * @param {HTMLElement} place
 * @param {{select: (mode: number) => void, refuse?: (mode: number) => void, take?: (frequency: number) => void, rename?: (mode: number, name: string) => void}} acts
 */
export function makeModes(place, acts) {
  const body = h("tbody");
  let order = /** @type {{by: ((mode: any, i: number) => number) | null, up: boolean}} */ ({ by: null, up: true });

  /** A head of the table, which sorts it; a second click turns the order round. @param {string} words @param {(mode: any, i: number) => number} by @param {string} [kind] @param {string} [title] */
  function head(words, by, kind = "", title = "") {
    const sort = () => {
      order = { by, up: order.by === by ? !order.up : true };
      for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
      cell.setAttribute("aria-sort", order.up ? "ascending" : "descending");
      rows();
    };
    const cell = h(`th${kind && `.${kind}`}`, { scope: "col", title }, h("button.link.head", { onclick: sort }, words), kind && words !== "MPC" ? h("small", {}, "± 95 %") : null);
    return cell;
  }
  const table = h(
    "table.modes",
    {},
    h("thead", {}, h("tr", {}, head("#", (m, i) => i), head("f [Hz]", (m) => m.frequency, "num"), head("damping [%]", (m) => m.damping, "num"), head("grade", (m) => GRADES.indexOf(m.shown.grade)), head("MPC", (m) => Number(m.shown.mpc), "num", "Modal phase collinearity: 1 when all points move in phase or in opposition"), acts.refuse ? h("th", { scope: "col" }, h("span.hidden", {}, "do")) : null)),
    body,
  );
  const why = h("div.why", { "aria-live": "polite" });
  const left = h("div.left");
  const heading = h("h2", {}, "Modes");
  const types = h("datalist", { id: "mode-types" }, TYPES.map((name) => h("option", {}, name)));
  place.append(types, heading, h("div.scroll.table", { tabIndex: 0, role: "region", "aria-label": "Modes" }, table), why, left);
  let modes = /** @type {any[]} */ ([]);
  let chosen = -1;

  /** All rows in the order that was asked. */
  function rows() {
    const listed = modes.map((mode, i) => [mode, i]);
    const { by, up } = order;
    if (by) listed.sort(([a, i], [b, j]) => (up ? 1 : -1) * (by(a, i) - by(b, j)));
    fill(body, listed.map(([mode, i]) => row(mode, i)));
  }
  const rowOf = (/** @type {number} */ i) => /** @type {any} */ (body.querySelector(`[data-mode="${i}"]`));

  /** @param {any} mode @param {number} i */
  function row(mode, i) {
    const { frequency, frequency_half, damping, damping_half, grade, mpc, reason } = mode.shown;
    const [type, remark] = parted(mode.name ?? "");
    const told = [type && h("em", {}, type), remark, grade !== "good" && reason].filter(Boolean); // what is good needs no reason beside it
    const aside = told.length > 0;
    const half = (/** @type {string} */ text) => h("small", {}, text && text !== "-" ? `± ${text}` : "");
    const cells = [
      h("td", {}, h("button.link", { "aria-label": `mode ${i + 1}`, onclick: () => acts.select(i) }, i + 1), aside ? h("span.reason", { title: `${mode.name ?? ""} ${reason}` }, told.flatMap((part, k) => (k ? [" · ", part] : [part]))) : null),
      h("td.num", {}, h("b", {}, frequency), half(frequency_half)),
      h("td.num", {}, damping, half(damping_half)),
      h("td", { title: reason }, h(`span.grade.${grade}`, {}, grade)),
      h("td.num", {}, mpc),
    ];
    if (acts.refuse)
      cells.push(
        h(
          "td.do",
          {},
          h("button.small.quiet", { title: "Name it (n)", "aria-label": `name mode ${i + 1}`, onclick: (/** @type {Event} */ e) => (e.stopPropagation(), rename(i)) }, icon(ICONS.pencil)),
          h("button.small.quiet", { title: "Refuse it (x)", "aria-label": `refuse mode ${i + 1}`, onclick: (/** @type {Event} */ e) => (e.stopPropagation(), acts.refuse(i)) }, icon(ICONS.close)),
        ),
      );
    return h(`tr${i === chosen ? ".chosen" : ""}${aside ? ".reasoned" : ""}${mode.shown.grade === "preliminary" ? ".pending" : ""}`, { "data-mode": i, onclick: () => acts.select(i) }, cells);
  }

  function rename(/** @type {number} */ i) {
    const cell = rowOf(i).children[1];
    const [type, remark] = parted(modes[i].name ?? "");
    const field = h("input.name", { value: type, "aria-label": `type of mode ${i + 1}`, placeholder: "type or name", list: "mode-types" });
    const note = h("input.name", { value: remark, "aria-label": `remark on mode ${i + 1}`, placeholder: "remark" });
    const both = h("div.naming", {}, field, note);
    let done = false;
    const end = (/** @type {boolean} */ keep) => {
      if (done) return;
      done = true;
      both.remove();
      if (keep) acts.rename?.(i, [field.value.trim(), note.value.trim()].join("; ").replace(/; $/, ""));
    };
    both.addEventListener("keydown", (/** @type {KeyboardEvent} */ e) => {
      e.stopPropagation();
      if (e.key === "Enter") end(true);
      if (e.key === "Escape") end(false);
    });
    both.addEventListener("focusout", (/** @type {FocusEvent} */ e) => both.contains(/** @type {Node} */ (e.relatedTarget)) || end(true));
    both.addEventListener("click", (/** @type {Event} */ e) => e.stopPropagation());
    cell.append(both);
    field.focus();
  }

  function explain() {
    const mode = modes[chosen];
    if (!mode) return fill(why);
    const told = Object.entries(mode.indicators ?? {}).map(([name, value]) => `${name.replace(/_/g, " ")} ${number(value, 3)}`);
    if (mode.gain !== undefined && mode.gain !== null) told.unshift(`significance ${number(mode.gain, 3)}`);
    const before = mode.frequency_before ? `before refinement ${number(mode.frequency_before, 6)} Hz, ${number(100 * mode.damping_before, 3)} %` : "";
    const { grade, reason } = mode.shown;
    return fill(why, h("p", {}, h("b", {}, mode.name ? `Mode ${chosen + 1}, ${mode.name}: ` : `Mode ${chosen + 1}: `), h(`span.grade.${grade}`, {}, grade), `, ${reason}. `), h("p", {}, mode.text ?? ""), h("p.muted", {}, [before, ...told].filter(Boolean).join(" · ")));
  }

  return {
    /** @param {{modes: any[], leftOut: any[], refused: number[], chosen: number, unexplained?: string[], warnings?: string[]}} given */
    set(given) {
      ({ modes, chosen } = given);
      fill(heading, "Modes", modes.length ? h("span.count", {}, modes.length) : null);
      rows();
      explain();
      const refused = given.refused.map((f) => h("li", {}, h("b.struck", {}, `${number(f, 6)} Hz`), " refused by hand ", acts.take ? h("button.small", { onclick: () => acts.take(f) }, "restore") : null));
      const out = given.leftOut.map((c) =>
        h("li", {}, h("div", {}, h("b", {}, `${number(c.frequency_hz, 5)} Hz`), h("span.muted", {}, ` ${number(100 * c.damping_ratio, 3)} %`), acts.take ? h("button.small", { "aria-label": `take the candidate at ${number(c.frequency_hz, 5)} Hz`, onclick: () => acts.take(c.frequency_hz) }, icon(ICONS.plus), "take") : null), h("p.muted", {}, c.reason)),
      );
      fill(
        left,
        (given.warnings ?? []).map((words) => h("p.explained.loud", {}, plainly(words))),
        (given.unexplained ?? []).map((words) => h("p.explained", {}, words)),
        refused.length ? h("ul", {}, refused) : null,
        out.length ? h("details", { open: /** @type {any} */ (left.querySelector("details"))?.open ?? true }, h("summary", {}, `Candidates left out (${out.length})`), h("ul", {}, out)) : null,
      );
    },
    choose(/** @type {number} */ mode) {
      rowOf(chosen)?.classList.remove("chosen");
      chosen = mode;
      rowOf(chosen)?.classList.add("chosen");
      rowOf(chosen)?.scrollIntoView({ block: "nearest" });
      explain();
    },
    rename,
  };
}
