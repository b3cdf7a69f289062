// ?bench: the page measures itself on made-up data of the size of a large test.
import { h } from "./dom.js";

const LINES = 200_000;
const POLES = 20_000;
const NODES = 10_000;

/** Poles, modes and shapes that nobody measured. */
function madeUp() {
  const lines = Float64Array.from({ length: LINES }, (_, i) => 1 + i * 0.01);
  const curves = Float32Array.from({ length: LINES }, (_, i) => 1e-3 + 1 / (1 + ((i % 5000) - 2500) ** 2));
  const frequency = Float64Array.from({ length: POLES }, (_, i) => 26 + 50 * (i % 40) + Math.sin(i) * (i % 7 ? 0.05 : 20));
  const order = Int32Array.from({ length: POLES }, (_, i) => 2 * (1 + Math.floor((i / POLES) * 500)));
  const kind = Int32Array.from({ length: POLES }, (_, i) => (i % 7 ? 4 : i % 4));
  const damping = new Float32Array(POLES).fill(0.01);
  const std = new Float32Array(POLES).fill(0.01);
  const indicators = [{ name: "cmif", words: "CMIF", level: "mode indicator", linear: false }];
  const poles = { indicators, cmif_lines: lines, cmif_curves: curves, frequency, order, kind, damping, std, bands: [[1, 2001]], orders: [2, 1000], label: "made up", shapes: { cmif_curves: [1, LINES] } };
  const side = Math.sqrt(NODES);
  const rest = Float32Array.from({ length: NODES * 3 }, (_, i) => [((i / 3) | 0) % side / side - 0.5, Math.floor(((i / 3) | 0) / side) / side - 0.5, 0][i % 3]);
  const moved = Float32Array.from({ length: NODES * 3 }, (_, i) => (i % 3 === 2 ? Math.sin(6 * rest[i - 2]) * Math.cos(6 * rest[i - 1]) : 0));
  const signed = Float32Array.from({ length: NODES }, (_, i) => moved[3 * i + 2]);
  const lines_ = [];
  for (let i = 0; i < NODES; i++) if ((i + 1) % side) lines_.push(i, i + 1);
  const shown = { frequency: "26.00", frequency_half: "0.01", damping: "1.00", damping_half: "0.01", grade: "good", mpc: "1.00", reason: "" };
  const modes = [{ frequency: 26, damping: 0.01, shown, indicators: {}, text: "" }];
  const found = {
    modes, left_out: [], findings: [], notes: [], outputs: ["1"], points: ["1", "2"], mac: new Float32Array([1]), nodes: Array.from({ length: NODES }, String), rest, lines: Int32Array.from(lines_), faces: new Int32Array(0),
    measured: new Uint8Array(NODES).fill(1), moved_real: moved, moved_imag: new Float32Array(NODES * 3), signed_real: signed, signed_imag: new Float32Array(NODES), shape_real: new Float32Array(1), shape_imag: new Float32Array(1),
  };
  return { poles, found };
}

const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));

/** @param {HTMLElement} root @param {any} begin @param {(begin: any, state: any) => any} makeWork */
export async function bench(root, begin, makeWork) {
  const document_ = { files: [], bands: [], exclude: [], taken: [], refused: [], orders: null, method: null, domain: null, refine: true, names: {} };
  const { poles, found } = madeUp();
  const told = {};
  const from = performance.now();
  makeWork(begin, { key: "bench", name: "made up", document: document_, edition: 0, undo: false, redo: false, blobs: {}, stage: { stage: "done" }, failed: null });
  const page = globalThis.modalscope;
  page.setPoles(poles);
  await frame();
  await frame();
  told.interactive = performance.now() - from + (performance.getEntriesByType("navigation")[0]?.["domInteractive"] ?? 0);
  const slider = /** @type {HTMLInputElement} */ (root.querySelector(".slider input"));
  const slid = performance.now();
  slider.value = "400";
  slider.dispatchEvent(new Event("input"));
  await frame();
  await frame();
  told.slider = performance.now() - slid;
  page.setFound(found);
  await frame();
  const clicked = performance.now();
  page.take(126.02);
  await frame(); // what was clicked is on the screen with the frame after this one
  told.click = performance.now() - clicked;
  const [begun, before] = [performance.now(), page.shape.frames];
  while (performance.now() - begun < 2000) await frame();
  told.frames = (1000 * (page.shape.frames - before)) / (performance.now() - begun);
  globalThis.benched = told;
  root.append(h("pre.bench", {}, JSON.stringify(told, null, 1)));
}
