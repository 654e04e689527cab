/** Frames of the simulations, and what each costs. */

import { Mean } from "./loop.js";

/** @typedef {import("./viscera.js").Session} Session */
/** @typedef {import("./trial.js").Trial} Trial */

export class Runs {
  #session;
  /** Milliseconds of a frame. */
  #costs = [new Mean(), new Mean()];
  /** Which are computed by the graphics device. @type {boolean[]} */
  #onDevice = [];
  /** Whether the end of a frame is waited for. */
  #waits = [false, false];

  /** @param {Session} session */
  constructor(session) {
    this.#session = session;
  }

  /** Whether the graphics device computes any. */
  get useDevice() {
    return this.#onDevice.includes(true);
  }

  /** Settings, or the device, have changed. */
  seeDevices() {
    const { runs } = JSON.parse(this.#session.report());
    this.#waits = [false, false];
    this.#onDevice = runs.map((/** @type {{onGpu: boolean}} */ run) => run.onGpu);
  }

  /** Milliseconds of a frame since this was last asked; null: not yet known. */
  costs() {
    return this.#costs.map((cost) => cost.take());
  }

  forget() {
    for (const cost of this.#costs) cost.forget();
  }

  /**
   * One frame. The processor has computed it then; what a device takes is heard of when it is done.
   *
   * @param {number} run
   * @param {Trial | null} trial hears what the first simulation costs the processor
   */
  advance(run, trial) {
    const began = performance.now();
    this.#session.advance(run);
    if (!this.#onDevice[run]) {
      const now = performance.now();
      this.#costs[run].add(now - began);
      if (run === 0) trial?.add(now - began, now);
      return;
    }
    if (this.#waits[run]) return;
    this.#waits[run] = true;
    const over = () => {
      this.#waits[run] = false;
    };
    this.#session.settled().then(() => {
      over();
      this.#costs[run].add(performance.now() - began);
    }, over);
  }
}
