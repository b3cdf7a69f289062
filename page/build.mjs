// Bundles the front end: page (served), viewer (report), widget (notebook). The folder to write is the first argument.
import { build } from "esbuild";
import { copyFile, mkdir } from "node:fs/promises";
import { join } from "node:path";

const out = process.argv[2] ?? "dist";
await mkdir(out, { recursive: true });
const shared = { bundle: true, minify: true, target: "es2022", legalComments: "none", logLevel: "warning", loader: { ".css": "css" } };
await Promise.all([
  build({ ...shared, entryPoints: { page: "src/main.js" }, outdir: out, format: "esm" }),
  build({ ...shared, entryPoints: { viewer: "src/report.js" }, outdir: out, format: "iife" }),
  build({ ...shared, entryPoints: { widget: "src/widget.js" }, outdir: out, format: "esm" }),
]);
await copyFile("src/index.html", join(out, "index.html"));
