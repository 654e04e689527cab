/** Starts the worker, and with it the module, before anything else of the page is there. */

/**
 * `(func (drop (i8x16.splat (i32.const 0))))`: valid where WebAssembly has SIMD.
 */
const SIMD = [0, 0x61, 0x73, 0x6d, 1, 0, 0, 0, 1, 4, 1, 0x60, 0, 0, 3, 2, 1, 0, 10, 9, 1, 7, 0, 0x41, 0, 0xfd, 0x0f, 0x1a, 0x0b];

/** Why nothing can be computed in this browser; null: it can. */
export function missing() {
  if (typeof WebAssembly === "undefined") {
    return "This browser runs no WebAssembly, or has it turned off: allow it, or use a current Chrome, Edge, Firefox or Safari.";
  }
  if (!WebAssembly.validate(new Uint8Array(SIMD))) {
    return "This browser’s WebAssembly has no SIMD, without which tissue would move too slowly: update it (Chrome 91, Firefox 114, Safari 16.4 or newer).";
  }
  if (typeof OffscreenCanvas === "undefined") {
    return "This browser cannot draw in a worker (OffscreenCanvas): update it (Chrome 80, Firefox 114, Safari 16.4 or newer).";
  }
  return null;
}

/** The module, on its way while the worker's own files are still being fetched; a worker that is started again has it at once. */
const compiled = missing() ? Promise.resolve(null) : compile();

async function compile() {
  try {
    return await WebAssembly.compileStreaming(fetch(new URL("./viscera_bg.wasm", import.meta.url)));
  } catch (error) {
    // A server that calls it by another type: the worker reads it by itself, and says what is wrong.
    console.info(`the module is fetched by the worker: ${error}`);
    return null;
  }
}

export function startWorker() {
  const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
  void compiled.then((module) => worker.postMessage({ do: "module", module }));
  return worker;
}

/** The first worker, and what it says before anybody listens. */
export const first = (() => {
  if (missing()) return null;
  const worker = startWorker();
  /** @type {any[]} */
  const early = [];
  worker.onmessage = (event) => early.push(event.data);
  return { worker, early };
})();
