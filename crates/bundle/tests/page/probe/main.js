// What a page may do that the tests' driver has to see: two canvases drawn by a worker, and what was done by hand.
import { version } from "./version.js";

window.version = version;
window.events = [];
for (const kind of ["pointerdown", "pointermove", "pointerup", "wheel", "keydown", "drop"]) {
  addEventListener(kind, (event) => {
    const { pointerType, pointerId, clientX, clientY, deltaY, key } = event;
    const files = [...(event.dataTransfer?.files ?? [])].map((file) => file.name);
    window.events.push({ kind, pointerType, pointerId, clientX, clientY, deltaY, key, files });
    if (kind === "drop") event.preventDefault();
  });
}
addEventListener("dragover", (event) => event.preventDefault());
document.body.style.touchAction = "none";

const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
worker.onmessage = (event) => (window.result = event.data);
const canvases = ["gpu", "flat"].map((id) => document.getElementById(id).transferControlToOffscreen());
worker.postMessage(canvases, canvases);
window.failInWorker = () => worker.postMessage("fail");

navigator.serviceWorker.register("./offline.js");
