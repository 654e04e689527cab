/** Pointers, the wheel and keys: what the browser says, handed to the worker in CSS pixels of the canvas. */

import { byId } from "./messages.js";

/** @typedef {import("./host.js").Host} Host */

/** Nearer by this factor for one line of the wheel, and for one press of + or -. */
const PER_LINE = 1.05;
const PER_KEY = 1.15;
/** Pixels of a line of the wheel, where it counts in lines. */
const LINE = 20;

/**
 * Where the pointer is, for what is written beside it.
 *
 * @typedef {{x: number, y: number, touch: boolean}} Place
 */

export class Input {
  #host;
  #frame = byId("canvas-frame");
  /** Whether holds stay after the release. */
  keep = false;
  /** @type {Place} */
  place = { x: 0, y: 0, touch: false };
  /** Hears that the pointer moved. */
  onMove = () => {};

  /** @param {Host} host */
  constructor(host) {
    this.#host = host;
    const on = (/** @type {string} */ name, /** @type {(event: any) => void} */ hear, options = {}) =>
      this.#frame.addEventListener(name, hear, options);
    on("pointerdown", (event) => this.#down(event));
    on("pointermove", (event) => this.#move(event));
    on("pointerup", (event) => this.#up(event));
    on("pointercancel", (event) => host.send("cancel", { pointer: event.pointerId }));
    on("lostpointercapture", (event) => host.send("cancel", { pointer: event.pointerId }));
    on("contextmenu", (event) => event.preventDefault());
    on("wheel", (event) => this.#wheel(event), { passive: false });
    // Older Safari zooms the page by a gesture of its own.
    on("gesturestart", (event) => event.preventDefault());
    on("touchmove", (event) => event.preventDefault(), { passive: false });
    on("keydown", (event) => this.#key(event));
  }

  /** @param {PointerEvent} event */
  #order(event) {
    const area = this.#frame.getBoundingClientRect();
    const [x, y] = [event.clientX - area.left, event.clientY - area.top];
    this.place = { x, y, touch: event.pointerType === "touch" };
    return { pointer: event.pointerId, x, y, button: event.button, shift: event.shiftKey, touch: event.pointerType === "touch", keep: this.keep };
  }

  /** @param {PointerEvent} event */
  #down(event) {
    this.#frame.setPointerCapture(event.pointerId);
    this.#host.send("down", this.#order(event));
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (!this.#frame.hasPointerCapture(event.pointerId)) return;
    this.#host.send("move", this.#order(event));
    this.onMove();
  }

  /** @param {PointerEvent} event */
  #up(event) {
    this.#host.send("up", this.#order(event));
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 0 ? event.deltaY / LINE : event.deltaY;
    // A pinch on a touch pad comes as a wheel with Ctrl, in smaller numbers.
    const share = event.ctrlKey ? 4 * lines : lines;
    this.#host.send("zoom", { factor: PER_LINE ** -Math.max(-10, Math.min(10, share)) });
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const arrow = arrows[/** @type {keyof typeof arrows} */ (event.key)];
    if (arrow) this.#host.send("keyMove", { dx: arrow[0], dy: arrow[1], pan: event.shiftKey });
    else if (event.key === "+" || event.key === "=") this.#host.send("zoom", { factor: PER_KEY });
    else if (event.key === "-" || event.key === "_") this.#host.send("zoom", { factor: 1 / PER_KEY });
    else if (event.key === "Home") this.#host.send("home");
    else if (event.key === "Enter") this.onGrabKey();
    else return;
    event.preventDefault();
  }

  /** Enter on the tissue. */
  onGrabKey = () => {};
}

/**
 * Keys of the whole page.
 *
 * @param {Record<string, () => void>} keys
 */
export function onKeys(keys) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const target = /** @type {HTMLElement} */ (event.target);
    // A control keeps its keys; a dialog as well.
    if (target.closest("input, select, textarea, dialog")) return;
    if (event.key === " " && target.closest("button, summary")) return;
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
