// Diagram, modes, shape, curve and MAC of a finished result: in the report and in a notebook.
import { ends, makeDiagram } from "./diagram.js";
import { half } from "./blob.js";
import { h } from "./dom.js";
import { makeMatrix } from "./matrix.js";
import { makeModes } from "./modes.js";
import { makeResponse } from "./response.js";
import { makeShape } from "./shape.js";

/**
 * @param {HTMLElement} root
 * @param {any} data  a blob of modalscope.interfaces.plot.web.alive
 * @param {{select?: (mode: number) => void}} acts
 */
export function makeViewer(root, data, acts = {}) {
  root.classList.add("ms", "viewer");
  const panel = (/** @type {string} */ name) => {
    const made = h(`section.panel.${name}`, { "aria-label": name });
    root.append(made);
    return made;
  };
  const box = h("div.diagram-box");
  const place = panel("diagram");
  place.append(h("div.bar", {}, h("h2", {}, "Stabilization"), h("span.space"), h("button.small", { onclick: () => diagram.toggleLetters() }, "ofdvs"), h("button.small", { onclick: () => diagram.whole() }, "full range")), box);
  const diagram = makeDiagram(box, { select });
  const modes = makeModes(panel("modes"), { select });
  const shape = makeShape(panel("shape"));
  const response = data.channels ? makeResponse(panel("response"), async (o, c) => channelOf(data, o, c)) : null;
  const matrixPlace = panel("matrix");
  matrixPlace.append(h("div.bar", {}, h("h2", {}, "AutoMAC")));
  const matrix = makeMatrix(matrixPlace, select);
  diagram.setKinds(data.kinds);
  diagram.setBlob(data, ends(data.bands));
  shape.set(data, 0);
  matrix.set(data.mac, data.modes.length, data.points.length);
  modes.set({ modes: data.modes, leftOut: data.left_out, refused: [], chosen: 0, unexplained: data.unexplained, warnings: data.warnings });
  response?.setChannels(data.outputs, data.columns, data.fits, data.fit);
  function select(/** @type {number} */ i) {
    modes.choose(i);
    shape.choose(i);
    matrix.choose(i);
    diagram.setModes({ modes: data.modes, leftOut: data.left_out, chosen: i });
    const mode = data.modes[i];
    if (mode) shape.caption(h("b", {}, `Mode ${i + 1}`, mode.name ? ` ${mode.name.split("; ")[0]}` : ""), ` ${mode.shown.frequency} Hz, ${mode.shown.damping} %`, data.over === "inputs" ? ", over the points that were driven" : "");
    acts.select?.(i);
  }
  if (data.modes.length) select(0);
  return { select, diagram };
}

/** One channel of those that came along. @param {any} data @param {number} output @param {number} column */
function channelOf(data, output, column) {
  const [outputs, columns, lines] = data.shapes.measured_real;
  if (output < 0) return sumOf(data);
  const at = (output * columns + column) * lines;
  if (output >= outputs) return null;
  const scale = data.scales[output][column];
  const part = (/** @type {string} */ name) => Float32Array.from(data[name].subarray(at, at + lines), (bits) => scale * half(bits));
  return { lines: data.response_lines, measured_real: part("measured_real"), measured_imag: part("measured_imag"), rebuilt_real: part("rebuilt_real"), rebuilt_imag: part("rebuilt_imag"), unit: data.unit ?? "", output: data.outputs[output], input: data.columns[column] };
}

/** The sum of the magnitudes of all channels. @param {any} data */
function sumOf(data) {
  const [outputs, columns, lines] = data.shapes.measured_real;
  const sides = { measured: new Float64Array(lines), rebuilt: new Float64Array(lines) };
  for (let c = 0; c < outputs * columns; c++) {
    const scale = data.scales[Math.floor(c / columns)][c % columns];
    for (const [name, sum] of Object.entries(sides))
      for (let k = 0, at = c * lines; k < lines; k++, at++) sum[k] += scale * Math.hypot(half(data[`${name}_real`][at]), half(data[`${name}_imag`][at]));
  }
  const none = new Float64Array(lines);
  return { all: true, lines: data.response_lines, measured_real: sides.measured, measured_imag: none, rebuilt_real: sides.rebuilt, rebuilt_imag: none, unit: data.unit ?? "" };
}
