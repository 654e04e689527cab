/** What leaves the page when a person wants it to: the link, and the scene as a file. */

import { text } from "./app.js";
import { download } from "./files.js";

/** @typedef {import("./app.js").App} App */
/** @typedef {import("./host.js").Host} Host */
/** @typedef {import("./messages.js").Messages} Messages */

/**
 * Copies the address.
 *
 * @param {App} app
 * @param {Messages} messages
 */
export async function share(app, messages) {
  app.write();
  const own = app.own ? ` It names your file, ${app.own}, and does not carry it.` : "";
  try {
    await navigator.clipboard.writeText(location.href);
    messages.tell(`The link to this scene with these settings is copied.${own}`);
  } catch {
    messages.tell(`This browser does not let the page copy: the address of the page is the link.${own}`);
  }
}

/**
 * A file that repeats everything done here.
 *
 * @param {App} app
 * @param {Host} host
 * @param {Messages} messages
 */
export async function save(app, host, messages) {
  try {
    const scene = await host.call("replay");
    const stem = String(app.loaded.name).replace(/\.[a-z]+$/i, "").replace(/[^\w-]+/g, "_");
    download(`${stem}_changed.toml`, scene);
  } catch (error) {
    messages.warn(text(error));
  }
}
