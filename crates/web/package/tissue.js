/** A scene in motion, and hands on it. What each part does is written in index.d.ts. */

/** @typedef {import("./viscera.js").Session} Session */
/** @typedef {import("./index.js").Tissue} TissueInterface */
/** @typedef {import("./index.js").Grip} GripInterface */
/** @typedef {import("./index.js").Vector} Vector */

/** Frames computed at once, at most: more would let a slow machine fall ever further behind. */
const MOST_FRAMES = 2;
/** Between two measurements of the residual and of the scene's own patches [ms]. */
const MEASURED = 100;

/** @implements {TissueInterface} */
export class Tissue {
  #session;
  #loaded;
  #triangles;
  /** @type {Set<(tissue: TissueInterface) => void>} */
  #callbacks = new Set();
  /** @type {Set<Grip>} */
  #grips = new Set();
  #hands = 0;
  #running = false;
  #owed = 0;
  #last = 0;
  #measured = -Infinity;
  #disposed = false;

  /** @param {Session} session */
  constructor(session) {
    this.#session = session;
    this.#loaded = JSON.parse(session.loaded());
    this.#triangles = session.triangles();
  }

  get title() {
    return this.#loaded.title;
  }

  get size() {
    return { tetrahedra: this.#loaded.tets, vertices: this.#loaded.vertices };
  }

  get frame() {
    return this.#loaded.frame;
  }

  get time() {
    return this.report().time;
  }

  get bodies() {
    return JSON.parse(this.#open().loaded()).bodies;
  }

  get positions() {
    // Asked anew each time: a view of memory that has grown since has length 0.
    return this.#open().positions(0);
  }

  get triangles() {
    return this.#triangles;
  }

  /** @returns {Vector} */
  get force() {
    return [...this.#grips].map((grip) => grip.force).reduce(plus, [0, 0, 0]);
  }

  get running() {
    return this.#running;
  }

  /**
   * @param {string} key
   * @param {string | number | boolean} value
   */
  set(key, value) {
    this.#open().set(0, key, String(value));
  }

  /** @param {string} key */
  get(key) {
    return this.#open().setting(0, key);
  }

  step(frames = 1) {
    if (!Number.isInteger(frames) || frames < 0) throw new Error(`step: ${frames} is no number of frames`);
    const session = this.#open();
    if (frames === 0) return;
    for (let frame = 1; frame < frames; frame += 1) session.advance(0);
    // What report() says is of now and then: it costs some of a frame.
    const now = performance.now();
    if (frames > 1 || now - this.#measured >= MEASURED) {
      this.#measured = now;
      session.measure();
    }
    session.advance(0);
    for (const callback of [...this.#callbacks]) callback(this);
  }

  /**
   * @param {Readonly<Vector>} at
   * @param {import("./index.js").GrabOptions} [options]
   */
  grab(at, { vertices = 8, stiffness = 5000, rigid = false } = {}) {
    const session = this.#open();
    this.#hands += 1;
    session.grip(vertices, stiffness, rigid);
    if (!session.grabAt(this.#hands, at[0], at[1], at[2])) {
      const place = at.map((x) => `${Math.round(1e3 * x)} mm`).join(", ");
      throw new Error(`grab: there is no tissue within a centimetre of (${place}); nearest() gives a point that has some`);
    }
    const grip = new Grip(session, this.#hands, at, () => this.#grips.delete(grip));
    this.#grips.add(grip);
    return grip;
  }

  /**
   * @param {Readonly<Vector>} from
   * @param {Readonly<Vector>} [direction]
   * @returns {Vector}
   */
  nearest(from, direction) {
    const positions = this.positions;
    const length = direction ? Math.hypot(...direction) : 0;
    const way = direction && length > 0 ? direction.map((x) => x / length) : null;
    let best = Infinity;
    let found = 0;
    for (let at = 0; at < positions.length; at += 3) {
      const [x, y, z] = [positions[at] - from[0], positions[at + 1] - from[1], positions[at + 2] - from[2]];
      const along = way ? x * way[0] + y * way[1] + z * way[2] : 0;
      if (along < 0) continue;
      const aside = Math.max(0, x * x + y * y + z * z - along * along);
      // Of vertices that a ray passes alike the first: a point aside counts far more than one behind.
      const distance = way ? aside * 400 + along * along : aside;
      if (distance < best) [best, found] = [distance, at];
    }
    return [positions[found], positions[found + 1], positions[found + 2]];
  }

  /** @param {(tissue: TissueInterface) => void} callback */
  onFrame(callback) {
    // One of its own, so that a function that is given twice is called twice.
    const own = (/** @type {TissueInterface} */ tissue) => callback(tissue);
    this.#callbacks.add(own);
    return () => void this.#callbacks.delete(own);
  }

  start() {
    this.#open();
    if (this.#running) return;
    this.#running = true;
    this.#owed = 0;
    this.#last = performance.now();
    this.#next();
  }

  stop() {
    this.#running = false;
  }

  #next() {
    const picture = () => {
      if (!this.#running) return;
      const now = performance.now();
      this.#owed += (now - this.#last) / 1000;
      this.#last = now;
      const frames = Math.min(MOST_FRAMES, Math.floor(this.#owed / this.frame + 0.05));
      this.#owed = Math.min(this.#owed - frames * this.frame, this.frame);
      try {
        this.step(frames);
      } catch (error) {
        this.#running = false;
        throw error;
      }
      if (this.#running) this.#next();
    };
    if (typeof requestAnimationFrame === "function") requestAnimationFrame(picture);
    else setTimeout(picture, 1000 * this.frame);
  }

  reset() {
    this.#open().reset();
    for (const grip of this.#grips) grip.forget();
    this.#grips.clear();
  }

  report() {
    const { time, runs } = JSON.parse(this.#open().report());
    const { device, method, substeps, iterations, residual, inverted, patches, tools, ledger } = runs[0];
    return { time, device, method, substeps, iterations, residual, inverted, patches, tools, ledger };
  }

  save() {
    return this.#open().replay();
  }

  dispose() {
    if (this.#disposed) return;
    this.stop();
    for (const grip of this.#grips) grip.forget();
    this.#callbacks.clear();
    this.#disposed = true;
    this.#session.free();
  }

  #open() {
    if (this.#disposed) throw new Error("this tissue was disposed of; load another one");
    return this.#session;
  }
}

/** @implements {GripInterface} */
class Grip {
  /** @type {Session | null} */
  #session;
  #id;
  #released;
  /** @type {Vector} */
  taken;

  /**
   * @param {Session} session
   * @param {number} id
   * @param {Readonly<Vector>} at
   * @param {() => void} released
   */
  constructor(session, id, at, released) {
    this.#session = session;
    this.#id = id;
    this.taken = [at[0], at[1], at[2]];
    this.#released = released;
  }

  /** @param {Readonly<Vector>} to */
  lead(to) {
    if (!this.#session) throw new Error("lead: this grip has let go; grab again");
    const [x, y, z] = this.taken;
    this.#session.leadBy(this.#id, to[0] - x, to[1] - y, to[2] - z);
  }

  /** @returns {Vector} */
  get force() {
    const [x, y, z] = this.#session?.force(this.#id) ?? [0, 0, 0];
    return [x, y, z];
  }

  release() {
    const session = this.#session;
    if (!session) return;
    this.forget();
    session.release(this.#id);
  }

  /** The scene began anew, or is gone: nothing is held any more. */
  forget() {
    this.#session = null;
    this.#released();
  }
}

/**
 * @param {Vector} a
 * @param {Vector} b
 * @returns {Vector}
 */
function plus(a, b) {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}
