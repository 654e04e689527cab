/**
 * A worker that makes a scene of a person's own files, and ends with it: meshes, surfaces and segmented scans are read, filled
 * and held here, while the page goes on. It alone has the second module.
 */

import init, { prepare } from "./viscera_files.js";

/** @param {{files: import("./files.js").Own[], settings: [string, string][]}} order */
async function make({ files, settings }) {
  await init();
  const first = files[0].name;
  const byName = Object.fromEntries(files.map((file) => [file.name, file.bytes]));
  const tell = (/** @type {string} */ text) => self.postMessage({ about: "doing", text });
  const made = prepare(JSON.stringify({ first, settings }), byName, tell);
  const { name, text, files: plain, balance, notes } = made;
  const scene = { name, text, files: plain, balance };
  const buffers = [...Object.values(plain), ...(balance ? [balance] : [])].map((bytes) => bytes.buffer);
  self.postMessage({ about: "made", scene, notes }, { transfer: buffers });
}

self.onmessage = (event) => {
  make(event.data).catch((error) => {
    // What a panic was about is in the console; most that stop so need more memory than a page gets.
    const text = error instanceof WebAssembly.RuntimeError
      ? "This file takes more memory than a page has: make the mesh coarser or cut the scan, or use the program viscera on a computer."
      : error instanceof Error ? error.message : String(error);
    self.postMessage({ about: "failed", text });
  });
};
