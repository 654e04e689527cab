/** Loads the module and scenes. What each part does is written in index.d.ts. */

import { Tissue } from "./tissue.js";
import init, { Session, presets as presetsOf, scenes as scenesOf, settings as settingsOf } from "./viscera.js";

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
  ready ??= locate(wasm ?? new URL("./viscera_bg.wasm", import.meta.url)).then((module) => init({ module_or_path: module }));
  try {
    await ready;
  } catch (error) {
    // The next call may have a better address.
    ready = null;
    throw error;
  }
}

/**
 * @param {NonNullable<LoadOptions["wasm"]>} place
 * @returns {Promise<any>}
 */
async function locate(place) {
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
  const pairs = Object.entries(options.settings ?? {}).map(([key, value]) => /** @type {[string, string]} */ ([key, String(value)]));
  const { name, text, files, balance } = await sourceOf(options, pairs);
  // Frames are computed when they are asked for, which only the CPU does.
  const onCpu = pairs.some(([key]) => key === "solver.device") ? pairs : [...pairs, /** @type {[string, string]} */ (["solver.device", "cpu"])];
  const device = onCpu.find(([key]) => key === "solver.device")?.[1];
  if (device !== "cpu") throw new Error(`solver.device: this package computes on the CPU; leave it out, or say "cpu", not "${device}"`);
  const session = Session.onCpu();
  try {
    session.load(JSON.stringify({ name, text, settings: onCpu, mesh: options.cells ?? 1 }), files, balance);
    return new Tissue(session);
  } catch (error) {
    session.free();
    throw error;
  }
}

/**
 * @typedef {{name: string, text: string, files: Record<string, Uint8Array>, balance?: Uint8Array}} Source
 */

/**
 * @param {LoadOptions} options
 * @param {[string, string][]} settings
 * @returns {Promise<Source>}
 */
async function sourceOf({ scene, mesh, files = {}, filesWasm }, settings) {
  if (mesh && scene === undefined) {
    const { name, bytes } = mesh;
    return prepared({ first: name, settings }, { ...files, [name]: bytes }, filesWasm);
  }
  if (typeof scene === "object") {
    const { name, text } = scene;
    const needs = Object.keys(files).length > 0;
    return needs ? prepared({ scene: [name, text], settings }, files, filesWasm) : { name, text, files };
  }
  const wanted = scene ?? FIRST_SCENE;
  /** @type {{name: string, text: string}[]} */
  const known = JSON.parse(scenesOf());
  const found = known.find(({ name }) => name === wanted);
  if (!found) throw new Error(`there is no scene "${wanted}"; there are ${known.map(({ name }) => name).join(", ")}, or give {name, text} of your own`);
  return { name: found.name, text: found.text, files };
}

/**
 * The second module makes scenes of files, and reads every format.
 *
 * @param {{first?: string, scene?: [string, string], settings: [string, string][]}} request
 * @param {Record<string, Uint8Array>} files
 * @param {LoadOptions["filesWasm"]} wasm
 * @returns {Promise<Source>}
 */
async function prepared(request, files, wasm) {
  const { default: begin, prepare } = await import("./viscera_files.js");
  await begin({ module_or_path: await locate(wasm ?? new URL("./viscera_files_bg.wasm", import.meta.url)) });
  const made = prepare(JSON.stringify(request), files, () => {});
  const { name, text, files: plain, balance, notes } = made;
  made.free();
  for (const note of notes) console.warn(`viscera: ${note}`);
  return { name, text, files: plain, balance };
}
