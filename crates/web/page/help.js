/** Gestures and keys: what each does, in one list. */

import { button, byId, make } from "./messages.js";

/** @type {[string, [string, string][]][]} */
const LISTS = [
  ["Touch", [
    ["one finger, on tissue", "take hold and pull; the force stands beside the finger"],
    ["one finger, beside it", "turn the view"],
    ["two fingers", "turn the view; apart or together: nearer, farther. A second finger during a pull ends it"],
    ["three fingers", "move the view"],
    ["one finger, with an instrument in hand", "leads it, wherever the finger is; the bar says whether it moves, turns or goes in depth"],
  ]],
  ["Mouse", [
    ["left, on tissue", "take hold and pull"],
    ["left, beside it", "turn the view"],
    ["right, or middle, or Shift", "move the view"],
    ["left, on an instrument", "leads it; the wheel meanwhile in depth. A tool of the scene is taken in hand by that"],
    ["wheel", "nearer, farther"],
    ["Shift at release", "hold on; Esc lets go"],
  ]],
  ["Keys", [
    ["space", "run or pause"],
    [".", "one frame"],
    ["R", "begin again from rest"],
    ["F", "fit view"],
    ["Esc", "let go of everything"],
    ["N, X, Del", "the next instrument; lock its jaws, or unlock them; put it away"],
    ["?", "this list"],
  ]],
  ["Keys on the tissue (reach it with Tab)", [
    ["arrow keys", "turn the view; with Shift move it. With an instrument in hand: lead it, with Shift turn it"],
    ["+ and -", "nearer, farther"],
    ["Enter", "take hold of the tissue nearest to the middle; then arrow keys pull; Enter lets go"],
  ]],
];

const TEXTS = [
  "The stiffness you type is the stiffness the tissue has, in kPa; forces are in newtons. Everything is computed on this device: files that you drop here are not sent anywhere.",
  "A | B puts a second solver beside the first one, from the same state, under the same hand. The address of the page always holds scene and settings; Share copies it. Save scene writes a file that repeats everything done here: the program’s “viscera run” takes it.",
];

/** Opens the list. */
export function showHelp() {
  const dialog = /** @type {HTMLDialogElement} */ (byId("help-dialog"));
  if (dialog.open) {
    dialog.close();
    return;
  }
  if (dialog.childElementCount === 0) fill(dialog);
  dialog.showModal();
}

/** @param {HTMLDialogElement} dialog */
function fill(dialog) {
  const title = make("h2", { id: "help-title" }, "Touch, mouse and keys");
  dialog.append(make("header", {}, title, button("Close", () => dialog.close())));
  for (const text of TEXTS) dialog.append(make("p", {}, text));
  for (const [name, list] of LISTS) {
    const lines = list.flatMap(([keys, what]) => [make("dt", {}, keys), make("dd", {}, what)]);
    dialog.append(make("h3", {}, name), make("dl", {}, ...lines));
  }
  // Beside the dialog: its backdrop belongs to it.
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
}
