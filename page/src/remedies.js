// What an error says is to be changed, in the page's own words, with what does it: options of the terminal and of Python become buttons.

/** A value of an option as it is written: in quotes, or up to the next sign. */
const VALUE = `(?:'[^']*'|"[^"]*"|[^\\s,;()]*[^\\s,;().])`;
const OPTION = new RegExp(`--([a-z][a-z-]+)((?: (?!--|or\\b|and\\b)${VALUE})*)`, "g");
const ARGUMENT = /\b[a-z_]+=(?:\[[^\]]*\]|\([^)]*\)|\{[^}]*\}|'[^']*'|"[^"]*"|[\w.+-]*\w|\.\.\.)/g;
const CALL = /\bmodalscope\.[\w.]+(?:\([^)]*\))?/g;

const unquoted = (/** @type {string} */ text) => text.replace(/^['"]|['"]$/g, "");
/** The values of an option. @param {string} text */
const valuesOf = (text) => (text.match(new RegExp(VALUE, "g")) ?? []).map(unquoted);

/** Roles of columns as they are said. @type {Record<string, string>} */
const ROLES = { in: "input", out: "output" };
const roled = (/** @type {string} */ roles) => roles.replace(/(\w+)=/g, (_, role) => `${ROLES[role] ?? role} `).replace(/,(?=[a-z])/g, ", ");

/** Routes as they are said. @type {Record<string, string>} */
const AS = { correlation: "ambient vibration", frf: "responses", records: "records with forces", markov: "a decay" };

/** What an option does on the page: the words of its button, and options of reading or fields of the document. @type {Record<string, (values: string[]) => any>} */
const KNOWN = {
  ignore: (values) => values.length && { words: `leave out ${/^\d/.test(values[0]) ? "column " : ""}${values.join(", ")}`, read: { ignore: values } },
  skip: ([lines]) => Number(lines) > 0 && { words: `leave out the first ${lines} lines`, read: { skip: Number(lines) } },
  rows: ([rows]) => /^\d+-\d*$/.test(rows ?? "") && { words: `read rows ${rows}`, read: { rows } },
  transpose: () => ({ words: "exchange rows and columns", read: { transpose: true } }),
  resample: ([rate]) => (rate === "auto" ? { words: "resample evenly", read: { resample: "auto" } } : Number(rate) > 0 && { words: `resample to ${rate} Hz`, read: { resample: Number(rate) } }),
  "sampling-rate": ([rate]) => Number(rate) > 0 && { words: `take ${rate} Hz`, read: { sampling_rate: Number(rate) } },
  columns: ([roles]) => roles?.includes("=") && { words: `read ${roled(roles)}`, read: { columns: roles } },
  decimal: ([sign]) => sign && { words: `decimal sign ${sign}`, read: { decimal: sign } },
  delimiter: ([sign]) => sign && { words: `columns parted by ${sign}`, read: { delimiter: sign } },
  sheet: ([name]) => name && { words: `read the sheet ${name}`, read: { sheet: name } },
  exclude: (values) => values.length && { words: `exclude ${values.join(", ")}`, exclude: values },
  band: ([low, high]) => Number(high) > Number(low) && { words: `band ${low} to ${high} Hz`, set: { bands: [[Number(low), Number(high)]] } },
  route: ([route]) => route && { words: `take as ${AS[route] ?? route}`, set: { route } },
  "no-reciprocal": () => ({ words: "keep inputs and outputs", set: { reciprocal: false } }),
  "no-refine": () => ({ words: "without refinement", set: { refine: false } }),
};

/** What stands between backquotes: a name, or a command, which the page has no place for. @param {string} _ @param {string} text */
const quoted = (_, text) => (/^(modalscope|pip)\b|\(/.test(text) ? "the program" : text);
/** Options that the page has fields for. */
const SAID = /\b(method|domain|band|form|block_rows|block_columns)=('[^']*'|\w+)/g;
const said = (/** @type {string} */ _, /** @type {string} */ name, /** @type {string} */ value) => `${name.replace("_", " ")} ${value}`;

/** A fault, its options said as words. @param {string} fault */
export const faultInWords = (fault) => fault.replace(/`([^`]*)`/g, quoted).replace(/(?<!\w)--(?=[a-z])/g, "").replace(/\b([a-z]\w*)=(?=\S)/g, (_, name) => `${name.replace(/_/g, " ")} `);

/** What is to be changed, without options of the terminal and of Python. @param {string} change */
export function inWords(change) {
  const bare = change
    .replace(/`([^`]*)`/g, quoted)
    .replace(/(for instance )--[a-z-]+ "([^"]*)"/g, (_, before, text) => before + text.replace(/=/g, "\u0001"))
    .replace(OPTION, "\u0000")
    .replace(SAID, said)
    .replace(ARGUMENT, "\u0000")
    .replace(CALL, "\u0000")
    .replace(/\s*\((?:[^()]*\u0000)[^()]*\)/g, "")
    .replace(/(?:\s*(?:,|:|;)?\s*(?:or|and|with)?\s*\u0000)+/g, "")
    .replace(/\s+([.,;])(?=\s|$)/g, "$1")
    .replace(/[,:;]?\s*\.$/, ".")
    .replace(/\u0001/g, "=");
  return bare.trim() === "." ? "" : bare.trim();
}

/** Buttons that do what an error says. @param {string} change @returns {{words: string, read?: any, set?: any, exclude?: string[]}[]} */
export function remediesOf(change) {
  const found = [...change.matchAll(OPTION)].map(([, name, values]) => KNOWN[name]?.(valuesOf(values))).filter(Boolean);
  const leave = /exclude=\[([^\]]*)\]/.exec(change);
  if (leave && !found.some((one) => one.exclude)) found.push(KNOWN.exclude([...leave[1].matchAll(/'([^']*)'/g)].map((one) => one[1])));
  const rate = /sampling_rate=([\d.]+)/.exec(change);
  if (rate && !found.some((one) => one.read?.sampling_rate)) found.push(KNOWN["sampling-rate"]([rate[1]]));
  const seen = new Set();
  return found.filter((one) => one && !seen.has(one.words) && seen.add(one.words));
}
