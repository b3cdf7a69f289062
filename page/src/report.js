// In a report: the data stand in the page itself; without scripts its pictures stay.
import "./style.css";
import { fromBase64, inflated, unpack } from "./blob.js";
import { makeViewer } from "./viewer.js";

const place = document.getElementById("alive");
const data = document.getElementById("alive-data");
if (place && data) {
  inflated(fromBase64(data.textContent.trim())).then((blob) => {
    document.body.classList.add("alive");
    makeViewer(place, unpack(blob));
  });
}
