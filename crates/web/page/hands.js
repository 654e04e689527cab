/** What is held, by fingers, by the mouse and by keys. */

import { Gestures } from "./gestures.js";

/** @typedef {import("./viscera.js").Session} Session */
/** @typedef {import("./screen.js").Screen} Screen */

/** What a wheel leads an instrument by, as a drag [CSS pixels]: ten lines of it half the size of things. */
const WHEEL = 400;
/** Turning by one press of a key [CSS pixels]; pulling by a third of it. */
const KEY_STEP = 24;

/** Places in a picture, as shares of its sides from the middle outwards. @type {[number, number][]} */
const AROUND = Array.from({ length: 169 }, (_, at) => /** @type {[number, number]} */ ([((at % 13) - 6) / 13, (Math.floor(at / 13) - 6) / 13]))
  .sort((a, b) => Math.hypot(...a) - Math.hypot(...b));

export class Hands {
  /** @type {Session} */
  #session;
  /** @type {Screen} */
  #screen;
  /** Holds that stay when the finger has gone. @type {Set<number>} */
  #kept = new Set();
  /** What the keyboard holds, and where it pulls to [CSS pixels]. */
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
      grab: (id, x, y) => session.grab(id, this.#pixels(x), this.#pixels(y)),
      lead: (id, x, y) => session.lead(id, this.#pixels(x), this.#pixels(y)),
      release: (id, keep) => this.#release(id, keep),
      press: (x, y, anywhere) => session.pressTool(this.#pixels(x), this.#pixels(y), anywhere),
      drag: (from, to) => this.#drag(from, to),
      orbit: (dx, dy) => session.orbit(this.#pixels(dx), this.#pixels(dy)),
      pan: (dx, dy) => session.pan(this.#pixels(dx), this.#pixels(dy)),
      zoom: (factor) => this.zoom(factor),
    });
  }

  /** What a drag does to an instrument: "across", "depth", "tilt" or "roll". */
  drag = "across";

  /**
   * @param {{x: number, y: number}} from
   * @param {{x: number, y: number}} to
   * @param {string} [drag]
   */
  #drag(from, to, drag = this.drag) {
    const [x0, y0, x1, y1] = [from.x, from.y, to.x, to.y].map((length) => this.#pixels(length));
    this.#session.dragTool(x0, y0, x1, y1, drag);
  }

  /** Fingers count in CSS pixels: those of the picture may change in the middle of a gesture. @param {number} length */
  #pixels(length) {
    return length * this.#screen.scale;
  }

  /** The hold that is being pulled, whether by key and where to [CSS pixels], and those that stay. */
  get held() {
    const { id, x, y } = this.#key;
    return { hold: this.gestures.hold || id, key: id > 0 ? { x, y } : null, kept: [...this.#kept] };
  }

  /**
   * Where what is held is led to, and where tools touch, in each picture [CSS pixels].
   *
   * @param {{runs: {held: {id: number, target: number[]}[], tools: {place: number[], touches: number}[]}[]}} report
   */
  tags(report) {
    const seen = (/** @type {number} */ run, /** @type {number[]} */ [x, y, z], /** @type {{id: number, tool: number}} */ of) => {
      const place = this.#session.seen(run, x, y, z);
      if (place.length < 2) return [];
      return [{ ...of, run, x: place[0] / this.#screen.scale, y: place[1] / this.#screen.scale }];
    };
    return report.runs.flatMap(({ held, tools }, run) => [
      ...held.flatMap(({ id, target }) => seen(run, target, { id, tool: -1 })),
      ...tools.flatMap(({ place, touches }, tool) => (touches > 0 ? seen(run, place, { id: 0, tool }) : [])),
    ]);
  }

  /** Whether an instrument is in hand. */
  get hasTool() {
    return JSON.parse(this.#session.inHand()).length > 0;
  }

  /** The wheel: nearer and farther, or an instrument that is being led in depth. @param {number} factor above 1: nearer */
  zoom(factor) {
    if (this.gestures.mode !== "lead") this.#session.zoom(1 / factor);
    else this.#drag({ x: 0, y: 0 }, { x: 0, y: WHEEL * Math.log(factor) }, "depth");
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
   * Takes hold of the tissue nearest to the middle of the picture, without a pointer, or lets go of it again.
   *
   * @returns {"held" | "released" | "nothing there"}
   */
  keyGrab() {
    if (this.#key.id > 0) {
      this.letGo(this.#key.id);
      return "released";
    }
    const [width, height] = this.#screen.size.map((length) => length / this.#screen.scale);
    const id = this.gestures.number();
    for (const [right, below] of AROUND) {
      const [x, y] = [(0.5 + right) * width, (0.5 + below) * height];
      if (!this.#session.grab(id, this.#pixels(x), this.#pixels(y))) continue;
      this.#key = { id, x, y };
      return "held";
    }
    return "nothing there";
  }

  /**
   * An arrow key: pulls what the keyboard holds, leads the instrument in hand, else turns or moves the view.
   *
   * @param {number} dx -1, 0, 1
   * @param {number} dy
   * @param {boolean} pan
   */
  keyMove(dx, dy, pan) {
    const step = this.#pixels(KEY_STEP);
    const key = this.#key;
    if (key.id > 0) {
      key.x += (dx * KEY_STEP) / 3;
      key.y += (dy * KEY_STEP) / 3;
      this.#session.lead(key.id, this.#pixels(key.x), this.#pixels(key.y));
    } else if (this.hasTool) {
      const middle = { x: this.#screen.size[0] / this.#screen.scale / 2, y: this.#screen.size[1] / this.#screen.scale / 2 };
      const to = { x: middle.x + (dx * KEY_STEP) / 3, y: middle.y + (dy * KEY_STEP) / 3 };
      this.#drag(middle, to, pan ? "tilt" : this.drag);
    } else if (pan) this.#session.pan(dx * step, dy * step);
    else this.#session.orbit(dx * step, dy * step);
  }
}
