/**
 * The canvas in the worker. With a graphics device the module draws onto it by itself; without one it hands over pixels, and
 * they are put onto a 2D context, in as many pixels as the processor draws in time.
 */

/** @typedef {import("./viscera.js").Session} Session */

/** Device pixels per CSS pixel, at most: beyond it a phone's battery pays for what no eye sees. */
const SHARPEST = 2;
/** The same without a graphics device, and the coarsest picture that is still one. */
const SHARPEST_2D = 1.5;
const COARSEST_2D = 0.35;
/** What a picture may cost without a graphics device [ms]: half of a frame at 60 per second, the other half simulates. */
const PICTURE_2D = 8;
/** Pictures between two changes of their size, so that it does not flicker. */
const SETTLE = 12;

export class Screen {
  /** @type {OffscreenCanvas} */
  #canvas;
  /** @type {Session} */
  #session;
  /** @type {OffscreenCanvasRenderingContext2D | null} */
  #context = null;
  /** CSS pixels. */
  #width = 1;
  #height = 1;
  #ratio = 1;
  /** Pixels of the picture per CSS pixel. */
  #scale = 1;
  #cost = 0;
  #drawn = 0;

  /**
   * @param {OffscreenCanvas} canvas
   * @param {Session} session
   */
  constructor(canvas, session) {
    this.#canvas = canvas;
    this.#session = session;
  }

  /** Pixels of the picture per CSS pixel. */
  get scale() {
    return this.#scale;
  }

  /** Size of the picture [pixels]. */
  get size() {
    const side = (/** @type {number} */ length) => Math.max(1, Math.round(length * this.#scale));
    return [side(this.#width), side(this.#height)];
  }

  /** Whether the processor draws. */
  get isPlain() {
    return this.#context !== null;
  }

  /**
   * Draws with the processor from now on: there is no graphics device.
   *
   * @param {OffscreenCanvas} canvas one that no device has drawn on
   */
  plain(canvas) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d", { alpha: false });
    if (!this.#context) throw new Error("This browser gives no 2D canvas in a worker: nothing can be drawn.");
    // A first guess that old phones manage as well; it is corrected after a few pictures.
    this.#scale = Math.min(this.#ratio, 0.75);
    this.#apply();
  }

  /**
   * @param {number} width CSS pixels
   * @param {number} height
   * @param {number} ratio device pixels per CSS pixel
   */
  resize(width, height, ratio) {
    this.#width = Math.max(1, width);
    this.#height = Math.max(1, height);
    this.#ratio = ratio;
    if (!this.#context) this.#scale = Math.min(ratio, SHARPEST);
    this.#apply();
  }

  #apply() {
    const [width, height] = this.size;
    this.#session.resize(width, height);
    if (this.#context) {
      this.#canvas.width = width;
      this.#canvas.height = height;
    }
  }

  draw() {
    if (!this.#context) {
      this.#session.draw();
      return;
    }
    const began = performance.now();
    const [width, height] = this.size;
    const pixels = this.#session.pixels();
    if (pixels.length === 4 * width * height) this.#context.putImageData(new ImageData(pixels, width, height), 0, 0);
    this.#adapt(performance.now() - began);
  }

  /** @param {number} cost of one picture [ms] */
  #adapt(cost) {
    this.#cost = this.#drawn === 0 ? cost : 0.8 * this.#cost + 0.2 * cost;
    this.#drawn += 1;
    if (this.#drawn < SETTLE) return;
    // The cost goes with the number of pixels.
    const share = Math.sqrt(PICTURE_2D / Math.max(this.#cost, 0.1));
    const wanted = this.#scale * Math.min(Math.max(share, 0.7), 1.3);
    const scale = Math.min(Math.max(wanted, COARSEST_2D), Math.min(this.#ratio, SHARPEST_2D));
    if (Math.abs(scale / this.#scale - 1) < 0.15) return;
    this.#scale = scale;
    this.#drawn = 0;
    this.#apply();
  }
}
