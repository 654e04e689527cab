/** Loads the module and scenes. What each part does is written in index.d.ts. */

import { Tissue } from "./tissue.js";
import init, { Session, presets as presetsOf, sceneForMesh, scenes as scenesOf, settings as settingsOf } from "./viscera.js";

/** @typedef {import("./index.js").LoadOptions} LoadOptions */

/** The scene that is loaded where none is named. */
const FIRST_SCENE = "liver_lifted";

/** @type {Promise<unknown> | null} */
let ready = null;

/**
 * Loads the module, once.
 *
 * @param {LoadOptions["wasm"]} [wasm]
 */
async function begin(wasm) {
  ready ??= locate(wasm).then((module) => init({ module_or_path: module }));
  try {
    await ready;
  } catch (error) {
    // The next call may have a better address.
    ready = null;
    throw error;
  }
}

/**
 * @param {LoadOptions["wasm"]} wasm
 * @returns {Promise<any>}
 */
async function locate(wasm) {
  const place = wasm ?? new URL("./viscera_bg.wasm", import.meta.url);
  if (!(place instanceof URL) || place.protocol !== "file:") return place;
  // Node fetches no files. A name that bundlers do not follow: browsers never come here.
  const files = "node:fs/promises";
  const { readFile } = await import(/* @vite-ignore */ /* webpackIgnore: true */ files);
  return readFile(place);
}

/** @type {typeof import("./index.js").scenes} */
export async function scenes() {
  await begin();
  return JSON.parse(scenesOf());
}

/** @type {typeof import("./index.js").settings} */
export async function settings() {
  await begin();
  return JSON.parse(settingsOf());
}

/** @type {typeof import("./index.js").presets} */
export async function presets() {
  await begin();
  return JSON.parse(presetsOf());
}

/** @type {typeof import("./index.js").load} */
export async function load(options = {}) {
  await begin(options.wasm);
  const { name, text, files } = sourceOf(options);
  const pairs = Object.entries(options.settings ?? {}).map(([key, value]) => [key, String(value)]);
  // Frames are computed when they are asked for, which only the CPU does.
  const onCpu = pairs.some(([key]) => key === "solver.device") ? pairs : [...pairs, ["solver.device", "cpu"]];
  const device = onCpu.find(([key]) => key === "solver.device")?.[1];
  if (device !== "cpu") throw new Error(`solver.device: this package computes on the CPU; leave it out, or say "cpu", not "${device}"`);
  const session = Session.onCpu();
  try {
    session.load(JSON.stringify({ name, text, settings: onCpu, mesh: options.cells ?? 1 }), files);
    return new Tissue(session);
  } catch (error) {
    session.free();
    throw error;
  }
}

/** @param {LoadOptions} options */
function sourceOf({ scene, mesh, files = {} }) {
  if (mesh && scene === undefined) {
    return { name: mesh.name, text: sceneForMesh(mesh.name, mesh.bytes), files: { ...files, [mesh.name]: mesh.bytes } };
  }
  if (typeof scene === "object") return { name: scene.name, text: scene.text, files };
  const wanted = scene ?? FIRST_SCENE;
  /** @type {{name: string, text: string}[]} */
  const known = JSON.parse(scenesOf());
  const found = known.find(({ name }) => name === wanted);
  if (!found) throw new Error(`there is no scene "${wanted}"; there are ${known.map(({ name }) => name).join(", ")}, or give {name, text} of your own`);
  return { name: found.name, text: found.text, files };
}
