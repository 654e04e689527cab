/** What is held, by fingers, by the mouse and by keys. */

import { Gestures } from "./gestures.js";

/** @typedef {import("./viscera.js").Session} Session */
/** @typedef {import("./screen.js").Screen} Screen */

/** Turning by one press of a key [CSS pixels]; pulling by a third of it. */
const KEY_STEP = 24;

export class Hands {
  /** @type {Session} */
  #session;
  /** @type {Screen} */
  #screen;
  /** Holds that stay when the finger has gone. @type {Set<number>} */
  #kept = new Set();
  /** What the keyboard holds, and where it pulls to [pixels]. */
  #key = { id: 0, x: 0, y: 0 };
  gestures;

  /**
   * @param {Session} session
   * @param {Screen} screen
   */
  constructor(session, screen) {
    this.#session = session;
    this.#screen = screen;
    this.gestures = new Gestures({
      grab: (id, x, y) => session.grab(id, x, y),
      lead: (id, x, y) => session.lead(id, x, y),
      release: (id, keep) => this.#release(id, keep),
      orbit: (dx, dy) => session.orbit(dx, dy),
      pan: (dx, dy) => session.pan(dx, dy),
      zoom: (factor) => this.zoom(factor),
    });
  }

  /** The hold that is being pulled, whether by key and where to [CSS pixels], and those that stay. */
  get held() {
    const { id, x, y } = this.#key;
    const scale = this.#screen.scale;
    const key = id > 0 ? { x: x / scale, y: y / scale } : null;
    return { hold: this.gestures.hold || id, key, kept: [...this.#kept] };
  }

  /** @param {number} factor above 1: nearer */
  zoom(factor) {
    this.#session.zoom(1 / factor);
  }

  /** Nothing is held any more: the scene begins anew. */
  forget() {
    this.gestures.cancelAll();
    this.letGo();
  }

  /**
   * @param {number} id
   * @param {boolean} keep
   */
  #release(id, keep) {
    if (keep) this.#kept.add(id);
    else this.#session.release(id);
  }

  /**
   * Lets go of one point, or of all.
   *
   * @param {number} [id]
   */
  letGo(id) {
    if (id === undefined) this.gestures.cancelAll();
    for (const hold of id === undefined ? [...this.#kept, this.#key.id] : [id]) {
      if (hold > 0) this.#session.release(hold);
      this.#kept.delete(hold);
      if (hold === this.#key.id) this.#key.id = 0;
    }
  }

  /**
   * Takes hold in the middle of the picture, without a pointer, or lets go of it again.
   *
   * @returns {"held" | "released" | "nothing there"}
   */
  keyGrab() {
    if (this.#key.id > 0) {
      this.letGo(this.#key.id);
      return "released";
    }
    const [width, height] = this.#screen.size;
    const [id, x, y] = [this.gestures.number(), width / 2, height / 2];
    if (!this.#session.grab(id, x, y)) return "nothing there";
    this.#key = { id, x, y };
    return "held";
  }

  /**
   * An arrow key: pulls what the keyboard holds, else turns or moves the view.
   *
   * @param {number} dx -1, 0, 1
   * @param {number} dy
   * @param {boolean} pan
   */
  keyMove(dx, dy, pan) {
    const step = KEY_STEP * this.#screen.scale;
    const key = this.#key;
    if (key.id > 0) {
      key.x += (dx * step) / 3;
      key.y += (dy * step) / 3;
      this.#session.lead(key.id, key.x, key.y);
    } else if (pan) this.#session.pan(dx * step, dy * step);
    else this.#session.orbit(dx * step, dy * step);
  }
}
