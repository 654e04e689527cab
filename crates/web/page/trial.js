/**
 * What this device can do: the first second of a scene is measured, and the module chooses from it what runs at 60 frames per
 * second.
 */

/** @typedef {import("./viscera.js").Session} Session */

/** How long the processor is measured [ms], and how many frames at least. */
const DURATION = 1000;
const LEAST = 4;
/** The first frames are slower: code is being compiled, caches are cold. */
const WARM = 3;
/** How long the graphics device is measured [ms]: the picture stands still meanwhile. */
const GPU_DURATION = 250;
/** Milliseconds of a frame at 60 per second. */
export const BUDGET = 1000 / 60;

/** Collects what frames cost on the processor. */
export class Trial {
  #frames = 0;
  #sum = 0;
  #began = 0;

  /**
   * @param {number} cost of a frame [ms]
   * @param {number} now [ms]
   */
  add(cost, now) {
    this.#frames += 1;
    if (this.#frames === 1) this.#began = now;
    if (this.#frames > WARM) this.#sum += cost;
  }

  /** @param {number} now [ms] */
  isDone(now) {
    return this.#frames >= WARM + LEAST && now - this.#began >= DURATION;
  }

  /** Milliseconds of a frame. */
  get cost() {
    return this.#sum / Math.max(1, this.#frames - WARM);
  }
}

/**
 * Milliseconds of a frame on the graphics device, beside the scene that runs, which it leaves as it was.
 *
 * @param {Session} session
 * @returns {Promise<number | null>} null: there is no such device, or it cannot
 */
export async function measureGpu(session) {
  const device = JSON.parse(session.device());
  if (device.missing || device.software || session.runs() !== 1) return null;
  try {
    session.beside(JSON.stringify([["solver.device", "gpu"]]));
    if (!JSON.parse(session.report()).runs[1].onGpu) return null;
    for (let frame = 0; frame < WARM; frame += 1) await oneFrame(session);
    const began = performance.now();
    let frames = 0;
    while (frames < LEAST || performance.now() - began < GPU_DURATION) {
      await oneFrame(session);
      frames += 1;
    }
    return (performance.now() - began) / frames;
  } catch (error) {
    if (error instanceof WebAssembly.RuntimeError) throw error;
    console.warn(`the graphics device was not measured: ${error}`);
    return null;
  } finally {
    session.beside(undefined);
  }
}

/** @param {Session} session */
async function oneFrame(session) {
  session.advance(1);
  await session.settled();
  // What was read back arrives a little later than the device is done.
  while (!session.ready()) await new Promise((done) => setTimeout(done, 0));
}
