// Band, method, orders and channels: what the document says of how poles are found.
import { fill, h, number } from "./dom.js";

/**
 * @param {HTMLElement} place
 * @param {{set: (fields: any) => void, order: (order: number) => void, automatic: () => void, read: (options: any) => void}} acts
 * @param {any[]} methods
 */
export function makeSettings(place, acts, methods) {
  const low = h("input", { type: "number", step: "any", min: 0, "aria-label": "Lowest frequency, Hz", placeholder: "from", onchange: band });
  const high = h("input", { type: "number", step: "any", min: 0, "aria-label": "Highest frequency, Hz", placeholder: "to", onchange: band });
  const known = new Map(methods.map((m) => [`${m.name}|${m.domain}`, m]));
  const method = h("select", { "aria-label": "Method", onchange: () => acts.set(split(method.value)) }, h("option", { value: "|" }, "automatic"), groups(known));
  const [first, last, step] = ["first", "last", "step"].map((name) => h("input", { type: "number", min: 1, max: 2000, placeholder: name, "aria-label": `Orders: ${name}`, onchange: orders }));
  const refine = h("input", { type: "checkbox", onchange: () => acts.set({ refine: refine.checked }) });
  const slider = h("input", { type: "range", min: 2, max: 80, value: 80, "aria-label": "Highest displayed order", oninput: () => slide() });
  const shown = h("output");
  const channels = h("div.channels");
  const box = h("details", {}, h("summary", {}, "Channels"), channels);
  const columns = h("input.name", { "aria-label": "Roles of the columns of a table", placeholder: "in=2,out=3-7", title: "Columns of a table, counted from 1: time=1,in=2,out=3-7; a free decay is time=1,decay=2-5", onchange: read });
  const rate = h("input", { type: "number", step: "any", min: 0, "aria-label": "Sampling rate, Hz", placeholder: "rate", onchange: read });
  const rows = h("input.name", { "aria-label": "Rows of a table to read", placeholder: "202-", title: "Rows of a table, counted from 1: 202-4000, or 202- for all from row 202", onchange: read });
  const reading = h("details", {}, h("summary", {}, "Reading options"), h("div.pair", {}, "columns", columns), h("div.pair", {}, "rows", rows), h("div.pair", {}, "samples", rate, h("span.muted", {}, "Hz")));
  const expert = h("input.name", { "aria-label": "Options of the method", placeholder: "block_rows=40; row_shifts=[0,1,3]", title: "Name=value, parted by semicolons, as in Python: block_rows, block_columns, form, row_shifts, row_subsets, row_weights, row_compression, weighting, references, source ...; each method says which it has", onchange: () => acts.set({ options: options(expert.value) }) });
  const data = h("p.muted.data");
  const used = h("p.muted");
  const hand = h("div.hand");
  const group = (/** @type {string} */ title, /** @type {any[]} */ ...inside) => h(`div.group.${title.toLowerCase()}`, {}, h("h2", {}, title), inside);
  place.append(
    group("Data", data, box, reading),
    group("Band", h("div.pair", {}, low, "–", high, h("span.muted", {}, "Hz")), h("p.hint", {}, "or drag on the strip below the diagram")),
    group("Method", method, used, h("details", {}, h("summary", {}, "Expert"), expert)),
    group("Orders", h("div.pair.three", {}, first, last, step), h("label.slider", {}, "shown up to ", shown, slider)),
    group("Modes", h("label.check", { title: "Maximum likelihood, with standard deviations" }, refine, "refine values"), hand),
  );
  place.addEventListener("keydown", (event) => {
    // what was typed counts, and the keys of the page work again
    if (event.key === "Enter" && /** @type {HTMLElement} */ (event.target).matches("input")) setTimeout(() => /** @type {HTMLElement} */ (event.target).blur());
  });
  let document_ = /** @type {any} */ (null);
  let top = 80;

  function band() {
    const [a, b] = [low.value, high.value].map(Number);
    if (!low.value && !high.value) acts.set({ bands: [] });
    else if (low.value && high.value && b > a) acts.set({ bands: [[a, b]] });
  }
  function orders() {
    if (!first.value && !last.value && !step.value) return acts.set({ orders: null });
    if (!first.value || !last.value) return undefined;
    const [a, b, s] = [Number(first.value), Number(last.value), Number(step.value) || 2];
    if (b < a || s < 1) return undefined;
    const listed = [];
    for (let n = a; n <= b; n += s) listed.push(n);
    return acts.set({ orders: listed });
  }
  function read() {
    acts.read({ columns: columns.value.trim() || null, rows: rows.value.trim() || null, sampling_rate: Number(rate.value) || null });
  }
  function slide() {
    shown.textContent = slider.value;
    acts.order(Number(slider.value) >= top ? Infinity : Number(slider.value));
  }

  return {
    /** @param {any} document */
    set(document) {
      const before = document_;
      document_ = document;
      const { columns: named, rows: taken, sampling_rate } = document.files[0]?.reading ?? {};
      columns.value = named ?? "";
      rows.value = taken ?? "";
      rate.value = sampling_rate ?? "";
      // what somebody is typing stays, as long as the document says nothing new of it
      const changed = (/** @type {string} */ name) => JSON.stringify(document[name]) !== JSON.stringify(before?.[name] ?? (name === "orders" ? null : []));
      const [pair] = document.bands;
      if (changed("bands")) {
        low.value = pair ? number(pair[0], 6) : "";
        high.value = pair ? number(pair[1], 6) : "";
      }
      method.value = document.method ? `${document.method}|${document.domain ?? ""}` : "|";
      if (changed("options")) expert.value = written(document.options);
      if (document.method && method.selectedIndex < 0) method.value = [...known.keys()].find((k) => k.startsWith(`${document.method}|`)) ?? "|";
      const n = document.orders;
      if (changed("orders")) {
        first.value = n ? n[0] : "";
        last.value = n ? n[n.length - 1] : "";
        step.value = n && n.length > 1 ? n[1] - n[0] : "";
      }
      refine.checked = document.refine;
      const byHand = document.taken.length + document.refused.length;
      fill(hand, byHand ? [h("span.muted", {}, `${document.taken.length} taken, ${document.refused.length} refused by hand `), h("button.small", { onclick: acts.automatic, title: "Return to the automatic selection (a)" }, "automatic")] : null);
      for (const field of channels.querySelectorAll("input")) field.checked = !document.exclude.includes(field.value);
    },
    setData(/** @type {string} */ text) {
      fill(data, text);
    },
    setUsed(/** @type {string} */ text) {
      fill(used, text);
    },
    /** @param {string[]} outputs */
    setChannels(outputs) {
      const excluded = document_?.exclude ?? [];
      const all = [...new Set([...outputs, ...excluded])];
      fill(channels, all.map((name) => h("label.check", {}, h("input", { type: "checkbox", value: name, checked: !excluded.includes(name), onchange: (/** @type {any} */ e) => acts.set({ exclude: e.target.checked ? document_.exclude.filter((/** @type {string} */ x) => x !== name) : [...document_.exclude, name] }) }), name)));
    },
    /**
     * The field that an error is about: what shows it, filled where the remedy gives a value.
     * @param {{asked?: string, found?: string, change?: string}} error
     */
    concerned({ asked = "", found = "", change = "" }) {
      const value = (/** @type {RegExp} */ form) => form.exec(change)?.slice(1) ?? [];
      const bands = value(/band=\(([\d.]+), ([\d.]+)\)/);
      const rates = value(/sampling_rate=([\d.]+)/);
      const known = [
        { test: /band/i, words: "set the band", field: low, fill: () => bands.length && ([low.value, high.value] = bands) },
        { test: /order/i, words: "set the orders", field: last, fill: () => {} },
        { test: /sampling.rate/i, words: "give the sampling rate", field: rate, fill: () => rates.length && ([rate.value] = rates) },
        { test: /column|role/i, words: "name the columns", field: columns, fill: () => {} },
        { test: /\brows?\b/i, words: "choose the rows", field: rows, fill: () => {} },
        { test: /block|shifts|subsets|weight|compression|form|references|source|option/i, words: "change the option", field: expert, fill: () => {} },
        { test: /method|domain/i, words: "choose a method", field: method, fill: () => {} },
      ];
      const first = known.find((k) => k.test.test(change)) ?? known.find((k) => k.test.test(`${asked} ${found}`));
      if (!first) return null;
      return {
        words: first.words,
        show() {
          const fold = first.field.closest("details");
          if (fold) fold.open = true;
          first.fill();
          first.field.focus();
        },
      };
    },
    setTop(/** @type {number} */ order) {
      if (order === top && shown.textContent) return;
      top = order;
      slider.max = String(order);
      slider.value = String(order);
      slide();
    },
  };
}

/**
 * Options as they are written, name=value; values as JSON, or words.
 * @param {string} text
 */
function options(text) {
  const parts = text.split(";").map((part) => part.trim()).filter(Boolean);
  return Object.fromEntries(parts.map((part) => {
    const [name, ...rest] = part.split("=");
    const value = rest.join("=").trim();
    try {
      return [name.trim(), JSON.parse(value)];
    } catch {
      return [name.trim(), value];
    }
  }));
}

/** @param {Record<string, any>} given */
function written(given) {
  return Object.entries(given ?? {}).map(([name, value]) => `${name}=${typeof value === "string" ? value : JSON.stringify(value)}`).join("; ");
}

/** @param {string} value */
function split(value) {
  const [method, domain] = value.split("|");
  return { method: method || null, domain: domain || null };
}

/** Methods as the field groups them: each once, in the domain that its data have; other forms of the same are for experts. @param {Map<string, any>} known */
function groups(known) {
  const seen = new Set();
  const of = (/** @type {string} */ domain) =>
    [...known].filter(([, m]) => m.domain === domain && !seen.has(m.name) && seen.add(m.name) && true);
  const lines = of("s");
  const parts = /** @type {[string, [string, any][]][]} */ ([["Frequency responses", [...lines, ...of("z")]], ["Impulse responses, decays, ambient records", [...known].filter(([, m]) => m.domain === "time")]]);
  const told = new Set(parts.flatMap(([, list]) => list.map(([key]) => key)));
  const rest = [...known].filter(([key]) => !told.has(key));
  return [...parts, /** @type {[string, [string, any][]]} */ (["Expert: other forms of the same", rest])].map(([label, list]) => h("optgroup", { label }, list.map(([key, m]) => h("option", { value: key }, m.label))));
}
