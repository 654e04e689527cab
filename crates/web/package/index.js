/** Soft tissue in real time, for other people's pages. */

export { load, presets, scenes, settings } from "./load.js";
