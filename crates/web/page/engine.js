/** The simulation in the worker: it advances, draws, measures, and says ten times a second how things stand. */

import { Hands } from "./hands.js";
import { Pace, nextPicture } from "./loop.js";
import { Runs } from "./runs.js";
import { Screen } from "./screen.js";
import { BUDGET, Trial, measureGpu } from "./trial.js";
import { Session, choose } from "./viscera.js";

/** @typedef {{about: string, [key: string]: any}} Word what is said to the page */

/** Between two reports [ms]. */
const REPORT = 100;
/** After so long without a change the picture is still [ms]. */
const STILL = 300;
/** After this long no second frame is computed for the same picture [ms]. */
const LONG = 12;

export class Engine {
  /** @type {(word: Word, transfer?: Transferable[]) => void} */
  #say;
  /** @type {Session} */
  session;
  /** @type {Screen} */
  screen;
  pace = new Pace();
  playing = true;
  #visible = true;
  #dirty = true;
  #scheduled = false;
  /** While it is set nothing else may touch the session. */
  #busy = false;
  #stopped = false;
  /** @type {Trial | null} */
  #trial = null;
  #runs;
  #frames = 0;
  #drawn = 0;
  /** When something was last drawn, whether a report is due since, and whether the picture could be sharper. */
  #seen = 0;
  #isNew = false;
  #isRough = false;
  #reported = { at: 0, frames: 0, drawn: 0 };
  /** @type {{count: number, done: () => void, failed: (error: unknown) => void}[]} */
  #steps = [];
  hands;
  /** @type {(error: unknown) => void} */
  #fail;
  /** Takes the canvas that was asked for. @type {(canvas: OffscreenCanvas) => void} */
  give = () => {};

  /**
   * @param {Session} session
   * @param {OffscreenCanvas} canvas
   * @param {(word: Word, transfer?: Transferable[]) => void} say
   * @param {(error: unknown) => void} fail hears of what went wrong in the middle of a frame
   */
  constructor(session, canvas, say, fail) {
    this.session = session;
    this.screen = new Screen(canvas, session);
    this.#say = say;
    this.#fail = fail;
    this.#runs = new Runs(session);
    this.hands = new Hands(session, this.screen);
  }

  /** Whether messages must wait. */
  get isBusy() {
    return this.#busy;
  }

  /** Something changed that is seen: a picture is due. */
  touch() {
    this.#dirty = true;
    this.#schedule();
  }

  #schedule() {
    if (this.#scheduled || this.#busy || this.#stopped || !this.#visible) return;
    this.#scheduled = true;
    nextPicture((now) => {
      this.#scheduled = false;
      this.#guard(() => this.#picture(now));
    });
  }

  /** @param {() => void} work */
  #guard(work) {
    try {
      work();
    } catch (error) {
      this.stop();
      this.#fail(error);
    }
  }

  /** Nothing moves any more, until another scene, or a reset. */
  stop() {
    this.#stopped = true;
    for (const step of this.#steps.splice(0)) step.failed(new Error("the simulation has stopped"));
  }

  /** @param {number} now */
  #picture(now) {
    if (this.#busy || this.#stopped) return;
    const lost = this.session.lost();
    if (lost !== undefined) {
      void this.#recover(lost);
      return;
    }
    if (this.session.ready()) {
      this.#advance(now);
      this.#draw(now);
      if (this.#isNew && now - this.#reported.at >= REPORT) this.report(now);
    }
    if (this.playing || this.#dirty || this.#isNew || this.#isRough || this.#steps.length > 0) this.#schedule();
  }

  /** @param {number} now */
  #draw(now) {
    if (this.#dirty) {
      this.#dirty = false;
      this.screen.draw(!this.#runs.useDevice);
      this.#drawn += 1;
      this.#seen = now;
      this.#isNew = true;
      this.#isRough = !this.playing;
    } else if (this.#isRough && now - this.#seen > STILL) {
      // Nothing moves: there is time for a sharp picture.
      this.#isRough = false;
      this.screen.sharpen();
    }
  }

  /** @param {number} now */
  #advance(now) {
    // A step is done when its last frame has arrived: then only it is seen from outside.
    while (this.#steps[0]?.count === 0) this.#steps.shift()?.done();
    const due = this.playing ? this.pace.due(now) : 0;
    const step = this.#steps[0];
    const wanted = step ? step.count : due;
    const began = performance.now();
    for (let frame = 0; frame < wanted; frame += 1) {
      if (frame > 0 && (performance.now() - began > LONG || !this.session.ready())) break;
      for (let run = 0; run < this.session.runs(); run += 1) this.#runs.advance(run, this.#trial);
      this.#frames += 1;
      this.#dirty = true;
      if (step) step.count -= 1;
    }
    if (this.#trial?.isDone(now) && this.hands.gestures.hold === 0) void this.#choose();
  }

  /** The first second is over: what suits this device? */
  async #choose() {
    const cost = this.#trial?.cost ?? 0;
    this.#trial = null;
    await this.alone(async () => {
      const gpuMs = await measureGpu(this.session);
      const { canChangeMesh } = JSON.parse(this.session.loaded());
      const measured = { cpuMs: cost, gpuMs, budgetMs: BUDGET, canChangeMesh };
      this.#say({ about: "chosen", measured, choice: JSON.parse(choose(JSON.stringify(measured))) });
    });
  }

  /**
   * Does something during which nothing else may touch the session.
   *
   * @param {() => Promise<void>} work
   */
  async alone(work) {
    this.#busy = true;
    try {
      await work();
    } catch (error) {
      this.#fail(error);
    } finally {
      this.#busy = false;
      this.pace.forget();
      this.#say({ about: "free" });
      this.touch();
    }
  }

  /** @param {string} why */
  async #recover(why) {
    this.hands.gestures.cancelAll();
    await this.alone(async () => {
      this.#say({ about: "warn", text: `The graphics device is gone: ${why}. Another one is being opened.` });
      // What the lost device drew on may be lost with it: a canvas of its own for the next one.
      const canvas = await new Promise((/** @type {(canvas: OffscreenCanvas) => void} */ give) => {
        this.give = give;
        this.#say({ about: "canvas" });
      });
      await this.session.reopen(canvas);
      const device = JSON.parse(this.session.device());
      this.#say({ about: "device", device });
      if (device.missing) this.screen.plain(canvas);
      else this.#say({ about: "tell", text: `The simulation goes on where it was, on ${device.name}.` });
      this.screen.renew();
      this.#runs.seeDevices();
    });
  }

  /** A scene was loaded: everything begins anew. @param {{frame: number, measure: boolean}} options */
  began({ frame, measure }) {
    this.hands.forget();
    this.pace.frame = frame;
    this.pace.forget();
    this.#trial = measure ? new Trial() : null;
    this.#stopped = false;
    this.changed();
  }

  /** Settings changed. */
  changed() {
    this.#runs.seeDevices();
    this.#runs.forget();
    this.report(performance.now());
    this.touch();
  }

  reset() {
    this.hands.forget();
    this.session.reset();
    this.#stopped = false;
    this.pace.forget();
    this.changed();
  }

  /** @param {boolean} on */
  play(on) {
    this.playing = on;
    this.pace.forget();
    this.report(performance.now());
    this.touch();
  }

  /** The first second is not measured: a person has chosen. */
  doNotChoose() {
    this.#trial = null;
  }

  /** @param {boolean} on */
  show(on) {
    this.#visible = on;
    this.pace.forget();
    if (!on) this.hands.gestures.cancelAll();
    else this.touch();
  }

  /**
   * Exactly so many frames, paused or not.
   *
   * @param {number} count
   * @returns {Promise<void>}
   */
  step(count) {
    return new Promise((done, failed) => {
      this.#steps.push({ count, done, failed });
      this.touch();
    });
  }

  /** How things stand. @param {number} now */
  report(now) {
    this.#isNew = false;
    this.session.measure();
    const seconds = Math.max(1e-3, (now - this.#reported.at) / 1000);
    const rate = (this.#frames - this.#reported.frames) / seconds;
    const drawn = (this.#drawn - this.#reported.drawn) / seconds;
    this.#reported = { at: now, frames: this.#frames, drawn: this.#drawn };
    const report = JSON.parse(this.session.report());
    const told = this.session.told();
    if (told !== undefined) this.#say({ about: "warn", text: told });
    this.#say({
      about: "report",
      report,
      legend: JSON.parse(this.session.legend()),
      costs: this.#runs.costs(),
      clock: { playing: this.playing, stopped: this.#stopped, rate, drawn, frames: this.#frames },
      screen: { scale: this.screen.scale, size: this.screen.size, plain: this.screen.isPlain },
      pull: this.hands.held,
      tools: { tray: JSON.parse(this.session.tray()), inHand: JSON.parse(this.session.inHand()), drag: this.hands.drag },
      tags: this.hands.tags(report),
      choosing: this.#trial !== null,
    });
  }
}
