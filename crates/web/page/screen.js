/**
 * The canvas in the worker. With a graphics device the module draws onto it by itself; without one it hands over pixels, and
 * they are put onto a 2D context, in as many pixels as the processor draws in time.
 */

/** @typedef {import("./viscera.js").Session} Session */

/**
 * Pixels of the picture per CSS pixel, drawn by a device or by the processor: at most (beyond it a phone's battery pays for what
 * no eye sees), at least (a coarser picture is none), and what a picture may cost [ms]. The processor simulates as well.
 */
const DEVICE = { sharpest: 2, coarsest: 0.5, cost: 12 };
const PROCESSOR = { sharpest: 1.5, coarsest: 0.35, cost: 8 };
/** Pictures between two changes of their size, so that it does not flicker; fewer where it is far too slow. */
const SETTLE = 12;
const HURRY = 3;
/** A sharp picture that would take longer than this is not drawn [ms]: a hand may come meanwhile. */
const LONGEST = 80;

/** Vertices that are looked at to see everything, at most, and the share of the width that they are to be in. */
const LOOKED_AT = 2000;
const WITHIN = 0.92;

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
  #ratio = 0;
  /** Pixels of the picture per CSS pixel. */
  #scale = 1;
  #cost = 0;
  #drawn = 0;
  #timing = false;
  /** The scale of pictures in motion, while a sharp one is shown; 0: none is. */
  #rough = 0;
  /** The scale of the next picture; 0: as it is. */
  #wanted = 0;

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
    if (ratio !== this.#ratio) {
      this.#ratio = ratio;
      this.#wanted = 0;
      this.#rough = 0;
      this.#scale = Math.min(ratio, this.#limits.sharpest);
    }
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

  /** @param {boolean} alone whether the device does nothing else: only then is it known what the picture costs */
  draw(alone) {
    if (this.#rough > 0) {
      this.#scale = this.#rough;
      this.#rough = 0;
      this.#apply();
    }
    // Not where it was found out: the session may have been busy at that moment.
    if (this.#wanted > 0) {
      this.#scale = this.#wanted;
      this.#wanted = 0;
      this.#drawn = 0;
      this.#apply();
    }
    const began = performance.now();
    if (!this.#context) {
      this.#session.draw();
      if (alone && !this.#timing) this.#time(began);
      return;
    }
    this.#paint(this.#context);
    this.#adapt(performance.now() - began);
  }

  /** Draws once with all pixels there are; the next picture is as the ones before. */
  sharpen() {
    const sharp = Math.min(this.#ratio, this.#limits.sharpest);
    if (this.#scale > 0.95 * sharp || this.#cost * (sharp / this.#scale) ** 2 > LONGEST) return;
    this.#rough = this.#scale;
    this.#scale = sharp;
    this.#apply();
    if (this.#context) this.#paint(this.#context);
    else this.#session.draw();
  }

  /** @param {OffscreenCanvasRenderingContext2D} context */
  #paint(context) {
    const [width, height] = this.size;
    const pixels = this.#session.pixels();
    if (pixels.length === 4 * width * height) context.putImageData(new ImageData(pixels, width, height), 0, 0);
  }

  get #limits() {
    return this.#context ? PROCESSOR : DEVICE;
  }

  /** Looks at everything, from so far away that its width is seen as well: cameras frame by height, and phones are upright. */
  home() {
    this.#session.home();
    const vertices = this.#session.vertices(0);
    const every = 3 * Math.ceil(vertices.length / 3 / LOOKED_AT);
    const [width, height] = this.size;
    const across = this.#session.runs() > 1 && width >= height ? width / 2 : width;
    // Twice: what is nearer to the viewer moves by more.
    for (let round = 0; round < 2; round += 1) {
      let most = 0;
      for (let at = 0; at + 2 < vertices.length; at += every) {
        const place = this.#session.seen(0, vertices[at], vertices[at + 1], vertices[at + 2]);
        if (place.length > 0) most = Math.max(most, Math.abs((2 * place[0]) / across - 1));
      }
      if (most > WITHIN) this.#session.zoom(most / WITHIN);
    }
  }

  /** The device draws on its own: when it is done is heard later. @param {number} began */
  #time(began) {
    this.#timing = true;
    const over = () => {
      this.#timing = false;
    };
    this.#session.settled().then(() => {
      over();
      if (!this.#context) this.#adapt(performance.now() - began);
    }, over);
  }

  /** Another device: what the last one was sent never ends. */
  renew() {
    this.#timing = false;
  }

  /** @param {number} cost of one picture [ms] */
  #adapt(cost) {
    const { sharpest, coarsest, cost: allowed } = this.#limits;
    this.#cost = this.#drawn === 0 ? cost : 0.8 * this.#cost + 0.2 * cost;
    this.#drawn += 1;
    if (this.#drawn < (this.#cost > 4 * allowed ? HURRY : SETTLE)) return;
    // The cost goes with the number of pixels.
    const share = Math.sqrt(allowed / Math.max(this.#cost, 0.1));
    const wanted = this.#scale * Math.min(Math.max(share, 0.6), 1.3);
    const scale = Math.max(Math.min(wanted, this.#ratio, sharpest), Math.min(coarsest, this.#ratio));
    if (Math.abs(scale / this.#scale - 1) >= 0.15) this.#wanted = scale;
  }
}
