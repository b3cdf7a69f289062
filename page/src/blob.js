// Blobs of modalscope.interfaces.app.blob: four bytes with the length of the head, the head as JSON, then the arrays.

const KINDS = { f4: Float32Array, f8: Float64Array, i4: Int32Array, u1: Uint8Array, f2: Uint16Array };

/**
 * @param {ArrayBuffer} buffer
 * @returns {any} the head, with every array by its name and `shapes` with their sizes
 */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const begin = 4 + length;
  const found = { ...head, shapes: {} };
  for (const { name, type, shape, at } of head.arrays) {
    const count = shape.reduce((/** @type {number} */ a, /** @type {number} */ b) => a * b, 1);
    found[name] = new KINDS[type](buffer, begin + at, count);
    found.shapes[name] = shape;
  }
  return found;
}

/** The rows of an array of a blob. @param {any} blob @param {string} name @returns {any[]} */
export function rowsOf(blob, name) {
  const [count, long] = blob.shapes[name];
  return Array.from({ length: count }, (_, k) => blob[name].subarray(k * long, (k + 1) * long));
}

/** The number of sixteen bits of half precision. @param {number} bits */
export function half(bits) {
  const [sign, power, rest] = [bits & 0x8000 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  return sign * (power ? 2 ** (power - 15) * (1 + rest / 1024) : 2 ** -24 * rest);
}

/** What zlib compressed. @param {ArrayBuffer} buffer */
export function inflated(buffer) {
  return new Response(new Blob([buffer]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

/** @param {string} text  base64 */
export function fromBase64(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes.buffer;
}
