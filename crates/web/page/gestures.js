/**
 * What fingers and the mouse do: from pointers to commands. A pure state machine; it runs in the worker, where a press is
 * answered at once by what lies under it.
 *
 * One finger (or the left button) on tissue pulls, beside it turns the view. Two fingers turn and zoom, three move the view.
 * The right and the middle button, and Shift, move it. A second finger in the middle of a pull ends the pull.
 *
 * With an instrument in hand one finger leads it wherever the finger is; the mouse does where it presses on one.
 */

/**
 * @typedef {object} Actions
 * @property {(id: number, x: number, y: number) => boolean} grab takes hold; false where there is nothing
 * @property {(id: number, x: number, y: number) => void} lead
 * @property {(id: number, keep: boolean) => void} release
 * @property {(x: number, y: number, anywhere: boolean) => boolean} press takes an instrument up; false where the pointer leads none
 * @property {(from: {x: number, y: number}, to: {x: number, y: number}) => void} drag leads it
 * @property {(dx: number, dy: number) => void} orbit
 * @property {(dx: number, dy: number) => void} pan
 * @property {(factor: number) => void} zoom above 1: nearer
 */
/**
 * @typedef {object} Pointer
 * @property {number} id the browser's
 * @property {number} x CSS pixels of the canvas
 * @property {number} y
 * @property {number} [button] 0 left, 1 middle, 2 right
 * @property {boolean} [shift]
 * @property {boolean} [touch] whether it is a finger
 */
/** @typedef {"idle" | "pull" | "lead" | "orbit" | "pan" | "fingers"} Mode */

export class Gestures {
  /** @type {Actions} */
  #act;
  /** @type {Map<number, {x: number, y: number}>} */
  #down = new Map();
  /** @type {Mode} */
  #mode = "idle";
  /** The hold that is being pulled. */
  #hold = 0;
  /** Holds are numbered from 1. */
  #holds = 0;

  /** @param {Actions} act */
  constructor(act) {
    this.#act = act;
  }

  /** What is being done. */
  get mode() {
    return this.#mode;
  }

  /** The hold that is being pulled; 0: none. */
  get hold() {
    return this.#mode === "pull" ? this.#hold : 0;
  }

  /** A number for a hold that is taken by other means. */
  number() {
    this.#holds += 1;
    return this.#holds;
  }

  /** @param {Pointer} pointer */
  down(pointer) {
    const { id, x, y } = pointer;
    this.#down.set(id, { x, y });
    if (this.#down.size > 1) {
      this.#endPull(false);
      this.#mode = "fingers";
    } else if ((pointer.button ?? 0) !== 0 || pointer.shift) {
      this.#mode = "pan";
    } else if (this.#act.press(x, y, pointer.touch === true)) {
      this.#mode = "lead";
    } else {
      const hold = this.number();
      this.#mode = this.#act.grab(hold, x, y) ? "pull" : "orbit";
      this.#hold = hold;
    }
  }

  /** @param {Pointer} pointer */
  move(pointer) {
    const before = this.#down.get(pointer.id);
    if (!before) return;
    const [dx, dy] = [pointer.x - before.x, pointer.y - before.y];
    if (dx === 0 && dy === 0) return;
    const spread = this.#spread();
    this.#down.set(pointer.id, { x: pointer.x, y: pointer.y });
    if (this.#mode === "pull") this.#act.lead(this.#hold, pointer.x, pointer.y);
    else if (this.#mode === "lead") this.#act.drag(before, pointer);
    else if (this.#mode === "orbit") this.#act.orbit(dx, dy);
    else if (this.#mode === "pan") this.#act.pan(dx, dy);
    else if (this.#mode === "fingers") this.#fingers(dx, dy, spread);
  }

  /**
   * The middle of the fingers moves by its share of what one of them does.
   *
   * @param {number} dx
   * @param {number} dy
   * @param {number} spread before the move
   */
  #fingers(dx, dy, spread) {
    const count = this.#down.size;
    if (count > 2) {
      this.#act.pan(dx / count, dy / count);
      return;
    }
    this.#act.orbit(dx / count, dy / count);
    const now = this.#spread();
    // Two fingers in one place say nothing of a zoom.
    if (spread > 1 && now > 1 && now !== spread) this.#act.zoom(now / spread);
  }

  /** Mean distance of the pointers from their middle. */
  #spread() {
    const places = [...this.#down.values()];
    if (places.length < 2) return 0;
    const x = places.reduce((sum, place) => sum + place.x, 0) / places.length;
    const y = places.reduce((sum, place) => sum + place.y, 0) / places.length;
    return places.reduce((sum, place) => sum + Math.hypot(place.x - x, place.y - y), 0) / places.length;
  }

  /**
   * @param {Pointer} pointer
   * @param {boolean} [keep] whether the hold stays
   */
  up(pointer, keep = false) {
    if (!this.#down.delete(pointer.id)) return;
    this.#endPull(keep || Boolean(pointer.shift));
    // The finger that is left turns the view: it takes hold of nothing in passing.
    if (this.#down.size === 0) this.#mode = "idle";
    else if (this.#down.size === 1) this.#mode = "orbit";
  }

  /**
   * The system took the pointer away.
   *
   * @param {number} id
   */
  cancel(id) {
    if (!this.#down.delete(id)) return;
    this.#endPull(false);
    this.#mode = this.#down.size === 0 ? "idle" : this.#down.size === 1 ? "orbit" : "fingers";
  }

  /** All of them are gone: the tab is hidden, the scene is another one. */
  cancelAll() {
    for (const id of [...this.#down.keys()]) this.cancel(id);
  }

  /** @param {boolean} keep */
  #endPull(keep) {
    if (this.#mode !== "pull") return;
    this.#mode = "idle";
    this.#act.release(this.#hold, keep);
  }
}
