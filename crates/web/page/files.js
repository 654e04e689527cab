/** Files of a person's own: chosen or dropped, read here, and sent nowhere but into the worker. */

import { byId } from "./messages.js";

/** @typedef {{name: string, bytes: Uint8Array}} Own */
/**
 * @typedef {object} OwnScene a scene of a person's own files, as the simulation reads it
 * @property {string} name
 * @property {string} text
 * @property {Record<string, Uint8Array>} files
 * @property {Uint8Array} [balance] how bodies carry gravity that rest as they are
 */

/** @param {number} bytes */
function megabytes(bytes) {
  return `${(bytes / 1e6).toLocaleString("en", { maximumFractionDigits: bytes < 1e7 ? 1 : 0 })} MB`;
}

/**
 * Reads files, unless they are too large: that is seen before they are read.
 *
 * @param {File[]} files
 * @param {number} most bytes of all of them together
 * @returns {Promise<Own[]>}
 */
export async function readFiles(files, most) {
  if (files.length === 0) throw new Error("There was no file in what was dropped: drop a mesh, a surface, a segmented scan or a scene (.toml).");
  const size = files.reduce((sum, file) => sum + file.size, 0);
  if (size > most) {
    const name = files.length === 1 ? `“${files[0].name}” has` : "These files have";
    throw new Error(`${name} ${megabytes(size)}, and this page takes at most ${megabytes(most)}: the program viscera on a computer takes larger ones, or make the mesh coarser.`);
  }
  return Promise.all(files.map(async (file) => {
    try {
      return { name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) };
    } catch (error) {
      throw new Error(`“${file.name}” cannot be read (${error instanceof Error ? error.message : error}): is it a folder, or has it been moved?`);
    }
  }));
}

/** Stops the scene that is being made. */
let stopMaking = () => {};

/**
 * Makes a scene of files, in a worker of its own; one at a time, the last one.
 *
 * @param {Own[]} files
 * @param {[string, string][]} settings laid over the scene
 * @param {(text: string, stop: () => void) => void} observe hears what is being done, and how to stop it
 * @returns {Promise<{scene: OwnScene, notes: string[]} | null>} null: it was stopped
 */
export function makeScene(files, settings, observe) {
  stopMaking();
  const worker = new Worker(new URL("./maker.js", import.meta.url), { type: "module" });
  return new Promise((/** @type {(made: {scene: OwnScene, notes: string[]} | null) => void} */ done, failed) => {
    stopMaking = () => done(null);
    observe("Reading", stopMaking);
    worker.onmessage = ({ data }) => {
      if (data.about === "doing") observe(data.text, stopMaking);
      else if (data.about === "made") done(data);
      else failed(new Error(data.text));
    };
    worker.onerror = (event) => {
      event.preventDefault();
      failed(new Error(event.message || "What reads files could not be loaded: check the connection, then open the file again."));
    };
    worker.postMessage({ files, settings }, files.map((file) => /** @type {Transferable} */ (file.bytes.buffer)));
  }).finally(() => worker.terminate());
}

/**
 * Hears of files that are dropped anywhere on the page.
 *
 * @param {(files: File[]) => void} take
 */
export function onDrop(take) {
  const sign = byId("drop");
  let depth = 0;
  const hasFiles = (/** @type {DragEvent} */ event) => event.dataTransfer?.types.includes("Files") ?? false;
  const on = (/** @type {string} */ name, /** @type {(event: DragEvent) => void} */ hear) =>
    document.addEventListener(name, (event) => {
      const drag = /** @type {DragEvent} */ (event);
      if (!hasFiles(drag)) return;
      drag.preventDefault();
      hear(drag);
      sign.hidden = depth <= 0;
    });
  on("dragenter", () => {
    depth += 1;
  });
  on("dragover", () => {});
  on("dragleave", () => {
    depth -= 1;
  });
  on("drop", (event) => {
    depth = 0;
    take([...(event.dataTransfer?.files ?? [])]);
  });
}

/**
 * Saves a text as a file.
 *
 * @param {string} name
 * @param {string} text
 */
export function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "application/toml" }));
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
