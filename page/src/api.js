// Requests to the server. An error has the three parts of a DataError: asked, found, change.
import { unpack } from "./blob.js";

export class Refused extends Error {
  /** @param {{asked?: string, found?: string, change?: string, text?: string}} parts @param {number} status */
  constructor(parts, status) {
    super(parts.text ?? `${parts.asked}${parts.asked?.endsWith(":") ? "" : ", but"} ${parts.found}.`);
    this.parts = parts;
    this.status = status;
  }
}

/** @param {string} path @param {RequestInit} [options] @returns {Promise<Response>} */
async function ask(path, options = {}) {
  let answer;
  try {
    answer = await fetch(path, { credentials: "same-origin", ...options });
  } catch {
    throw new Refused({ asked: "a request was sent", found: "the server does not answer", change: "Start the page again. Documents are kept." }, 0);
  }
  if (answer.ok) return answer;
  const text = await answer.text();
  let parts;
  try {
    parts = JSON.parse(text);
  } catch {
    parts = { asked: "a request was sent", found: text.trim() || `the server answered ${answer.status}`, change: answer.status === 401 ? "Open the address that it printed." : "Try again." };
  }
  throw new Refused(parts, answer.status);
}

/** @param {string} path @param {any} [body] */
async function post(path, body = {}) {
  return (await ask(path, { method: "POST", body: JSON.stringify(body) })).json();
}

export const start = async () => (await ask("/api/start")).json();

/** @param {File} file @param {(share: number) => void} progress @returns {Promise<string>} */
export function upload(file, progress) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `/api/upload?name=${encodeURIComponent(file.name)}`);
    request.upload.onprogress = (event) => event.lengthComputable && progress(event.loaded / event.total);
    request.onload = () => {
      const parts = request.response ?? {};
      if (request.status === 200) resolve(parts.file);
      else reject(new Refused(parts, request.status));
    };
    request.onerror = () => reject(new Refused({ asked: `uploading ${file.name}:`, found: "the server rejected it", change: "Check its size, and whether the server is running." }, 0));
    request.responseType = "json";
    request.send(file);
  });
}

/** @param {string[]} files */
export const open = (files) => post("/api/open", { files });
/** @param {string} key */
export const look = async (key) => (await ask(`/api/documents/${key}`)).json();
/** @param {string} key @param {string} action @param {any} given @param {number} edition */
export const act = (key, action, given, edition) => post(`/api/documents/${key}/act`, { action, given, edition });
/** @param {string} key */
export const cancel = (key) => post(`/api/documents/${key}/cancel`);
/** @param {string} key */
export const forget = (key) => post(`/api/documents/${key}/close`);
/** @param {string} key */
export const compare = (key) => post(`/api/documents/${key}/compare`);
/** @param {string} key @param {string} file */
export const against = (key, file) => post(`/api/documents/${key}/against`, { file });
/** @param {string} key @param {string} ask @returns {Promise<string[]>} */
export const planned = (key, ask) => post(`/api/documents/${key}/planned`, { ask });
/** @param {string} key @param {string} name */
export const blob = async (key, name) => unpack(await (await ask(`/api/documents/${key}/blob/${name}`)).arrayBuffer());
/** @param {string} key @param {number} output @param {number} input */
export const channel = async (key, output, input) => unpack(await (await ask(`/api/documents/${key}/channel${output < 0 ? "" : `?output=${output}&input=${input}`}`)).arrayBuffer());
/** @param {string} key */
export const measured = async (key) => (await ask(`/api/documents/${key}/measured`)).json();
/** @param {string} key @param {string} name */
export const picture = async (key, name) => unpack(await (await ask(`/api/documents/${key}/picture/${name}`)).arrayBuffer());
/** @param {string} key @param {string} suffix @param {number} mode  of a film */
export async function exported(key, suffix, mode = 0) {
  const answer = await ask(`/api/documents/${key}/export/${suffix}?mode=${mode}`);
  const named = /filename="([^"]+)"/.exec(answer.headers.get("content-disposition") ?? "");
  return { name: named?.[1] ?? `modes.${suffix}`, data: await answer.blob() };
}

/** @param {string} key @param {(message: any) => void} hear @param {(alive: boolean) => void} alive */
export function events(key, hear, alive) {
  const source = new EventSource(`/api/documents/${key}/events`);
  source.onmessage = (event) => hear(JSON.parse(event.data));
  source.onopen = () => alive(true);
  source.onerror = () => alive(false);
  return () => source.close();
}
