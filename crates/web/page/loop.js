/** When frames are due: real time, without catching up. */

/** Frames computed for one picture, at most: more would let a slow machine fall ever further behind. */
const MOST = 2;
/** An interval between pictures this near to a frame counts as one, so that displays at 59.9 Hz do not stutter. */
const NEAR = 0.12;

/** Turns the clock into numbers of frames. */
export class Pace {
  /** Seconds of a frame. */
  frame = 1 / 60;
  /** Simulated seconds per second. */
  speed = 1;
  /** Simulated seconds that are owed. */
  #debt = 0;
  /** @type {number | null} */
  #last = null;

  /** The time until now is not made up for. */
  forget() {
    this.#last = null;
    this.#debt = 0;
  }

  /**
   * Frames that are due; asked once per picture.
   *
   * @param {number} now milliseconds
   */
  due(now) {
    const last = this.#last;
    this.#last = now;
    if (last === null) return 1;
    let passed = (Math.max(0, now - last) / 1000) * this.speed;
    if (Math.abs(passed - this.frame) < NEAR * this.frame) passed = this.frame;
    this.#debt += passed;
    const frames = Math.min(MOST, Math.floor(this.#debt / this.frame + 1e-6));
    this.#debt -= frames * this.frame;
    // What is still owed beyond part of a frame is lost time.
    if (this.#debt >= this.frame) this.#debt = 0;
    return frames;
  }
}

/** The mean of what was added since it was last taken. */
export class Mean {
  #sum = 0;
  #count = 0;
  /** What was taken last; null: nothing yet. */
  #last = /** @type {number | null} */ (null);

  /** @param {number} value */
  add(value) {
    this.#sum += value;
    this.#count += 1;
  }

  /** Where nothing was added, the one before. */
  take() {
    if (this.#count > 0) this.#last = this.#sum / this.#count;
    this.#sum = 0;
    this.#count = 0;
    return this.#last;
  }

  forget() {
    this.#sum = 0;
    this.#count = 0;
    this.#last = null;
  }
}

/**
 * Calls back before the next picture. Workers of some browsers have no animation frames.
 *
 * @param {(now: number) => void} callback
 */
export function nextPicture(callback) {
  if (typeof requestAnimationFrame === "function") requestAnimationFrame(callback);
  else setTimeout(() => callback(performance.now()), 15);
}
