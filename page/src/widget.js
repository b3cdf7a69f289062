// In a notebook, by anywidget: the model holds the blob, and which mode is chosen.
import "./style.css";
import { unpack } from "./blob.js";
import { makeViewer } from "./viewer.js";

/** @param {{model: any, el: HTMLElement}} given */
function render({ model, el }) {
  const view = /** @type {DataView} */ (model.get("blob"));
  const bytes = new Uint8Array(view.byteLength);
  bytes.set(new Uint8Array(view.buffer, view.byteOffset, view.byteLength));
  const root = document.createElement("div");
  el.append(root);
  const viewer = makeViewer(root, unpack(bytes.buffer), {
    select(mode) {
      if (model.get("chosen") === mode) return;
      model.set("chosen", mode);
      model.save_changes();
    },
  });
  model.on("change:chosen", () => viewer.select(model.get("chosen")));
}
export default { render };
