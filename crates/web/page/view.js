/** What is written over and below the picture, and in the measurements: forces, times, residual, who computes. */

import { byId, button, make } from "./messages.js";

/** @typedef {import("./controls.js").Controls} Controls */
/** @typedef {import("./plots.js").Curve} Curve */
/** @typedef {[number, number, number]} Vector */
/**
 * @typedef {object} Tool
 * @property {string} name
 * @property {Vector} place
 * @property {Vector} force
 * @property {number | null} error
 * @property {number} torque
 * @property {number} touches
 * @property {number | null} jawAngle
 * @property {boolean} isLocked
 * @property {boolean} hasJumped
 */
/**
 * @typedef {object} Run
 * @property {string} device
 * @property {string | null} warning
 * @property {string} method
 * @property {string} acceleration
 * @property {number} substeps
 * @property {number} iterations
 * @property {string} elements
 * @property {number | null} residual
 * @property {number} rejected
 * @property {number} inverted
 * @property {{id: number, place: Vector, target: Vector, force: Vector}[]} held
 * @property {{name: string, force: Vector}[]} patches
 * @property {Tool[]} tools
 * @property {{work: number, surplus: number, stored: number, mostStored: number} | null} ledger
 */
/**
 * @typedef {object} Report
 * @property {{time: number, frame: number, runs: Run[]}} report
 * @property {{title: string, low: number, high: number, text: string} | null} legend
 * @property {(number | null)[]} costs
 * @property {{playing: boolean, stopped: boolean, rate: number, drawn: number, frames: number}} clock
 * @property {{scale: number, size: [number, number], plain: boolean}} screen
 * @property {{hold: number, key: {x: number, y: number} | null, kept: number[]}} pull
 * @property {{id: number, tool: number, run: number, x: number, y: number}[]} tags `tool`: its number, or -1 for a hold
 * @property {boolean} choosing
 */

const METHODS = /** @type {Record<string, string>} */ ({ auto: "automatic", quasi_newton: "quasi-Newton", xpbd: "XPBD", explicit: "explicit" });
const ELEMENTS = /** @type {Record<string, string>} */ ({ plain: "linear", recovered: "recovered-gradient" });
const ACCELERATIONS = /** @type {Record<string, string>} */ ({ chebyshev: "Chebyshev", anderson: "Anderson" });

/** So near to the finger a force is the finger's own [CSS pixels]: it may be a moment behind. */
const NEAR = 160;
/** Colours of curves: a point that a hand pulls has that of its arrow; a patch keeps its own, whatever else is pulled. */
const POINTS = [0, 3, 2, 1];
const PATCHES = [1, 2, 3];
const TOOLS = [0, 1, 2, 3];

/** A force as it is written everywhere: "1.25 N". @param {number} force */
export function newtons(force) {
  if (!Number.isFinite(force)) return "…";
  if (force < 0.1) return `${(1e3 * force).toFixed(1)} mN`;
  return force < 100 ? `${force.toFixed(2)} N` : `${force.toFixed(0)} N`;
}

/**
 * A force with what it may be off by, rounded up: "1.25 ± 0.03 N".
 *
 * @param {number} force
 * @param {number | null} error
 */
export function newtonsWithin(force, error) {
  if (error === null || !Number.isFinite(error) || !Number.isFinite(force)) return newtons(force);
  const large = Math.max(force, error);
  const [factor, digits, unit] = large < 0.1 ? [1e3, 1, "mN"] : large < 100 ? [1, 2, "N"] : [1, 0, "N"];
  const up = Math.ceil(factor * error * 10 ** digits - 1e-9) / 10 ** digits;
  return `${(factor * force).toFixed(digits)} ± ${up.toFixed(digits)} ${unit}`;
}

/** An energy with three digits. @param {number} energy [J] */
export function joules(energy) {
  const [factor, unit] = [[1, "J"], [1e3, "mJ"], [1e6, "µJ"], [1e9, "nJ"]].find(([factor]) => Math.abs(energy) * Number(factor) >= 1) ?? [1, "J"];
  return `${Number((energy * Number(factor)).toPrecision(3))} ${unit}`;
}

/** @param {Vector} vector */
export function size(vector) {
  return Math.hypot(...vector);
}

/** @param {number | null | undefined} cost */
function milliseconds(cost) {
  return cost === null || cost === undefined ? "…" : `${cost.toFixed(1)} ms`;
}

/** @param {number | null} value */
function scientific(value) {
  return value !== null && Number.isFinite(value) ? value.toExponential(1).replace("e+", "e") : "…";
}

export class View {
  #controls;
  #stage = byId("stage");
  #tags = byId("tags");
  /** What follows the finger. @type {HTMLElement | null} */
  #finger = null;
  #status = byId("status");
  /** @type {(hold: number) => void} */
  #letGo;
  #lines = "";
  frame = 1 / 60;

  /**
   * @param {Controls} controls
   * @param {(hold: number) => void} letGo
   */
  constructor(controls, letGo) {
    this.#controls = controls;
    this.#letGo = letGo;
  }

  /**
   * @param {Report} report
   * @param {import("./input.js").Place} place of the pointer
   */
  show(report, place) {
    const { runs } = report.report;
    this.#measure(report);
    this.#showStatus(report);
    this.#showTags(report, place);
    this.#showLegend(report);
    const names = byId("names");
    names.hidden = runs.length < 2;
    const [width, height] = report.screen.size;
    names.classList.toggle("column", width <= height);
    byId("canvas-frame").classList.toggle("pull", report.pull.hold > 0);
    byId("play").textContent = report.clock.playing ? "Pause" : "Run";
    this.#controls.follow(runs.map((run) => run.method));
  }

  /** Curves and numbers. @param {Report} report */
  #measure({ report, costs, pull, clock }) {
    /** @type {Curve[]} */
    const curves = [];
    /** @type {[string, string][]} */
    const lines = [["time", `${report.time.toFixed(2)} s`]];
    report.runs.forEach((run, side) => {
      const suffix = report.runs.length > 1 ? `, ${"AB"[side]}` : "";
      const forces = [
        ...run.held.map((held, number) => ({ name: `point ${number + 1}`, force: held.force, color: POINTS[number % POINTS.length] })),
        ...run.patches.map((patch, number) => ({ ...patch, color: PATCHES[number % PATCHES.length] })),
      ];
      // Their curves stay at zero where they touch nothing: one sees when a touch began and ended.
      run.tools.forEach(({ name, force, error, torque }, number) => {
        const color = TOOLS[number % TOOLS.length];
        curves.push({ name: name + suffix, color, dashed: side === 1, value: size(force), error: side === 0 ? error : null });
        lines.push([name + suffix, `${newtonsWithin(size(force), error)}, ${(1e3 * torque).toFixed(1)} N mm`]);
      });
      forces.filter(({ force }) => size(force) > 0).forEach(({ name, force, color }) => {
        const value = size(force);
        curves.push({ name: name + suffix, color, dashed: side === 1, value });
        lines.push([name + suffix, newtons(value)]);
      });
    });
    const residuals = report.runs.map((run, side) => ({ name: "AB"[side], color: side, dashed: side === 1, value: run.residual ?? NaN }));
    report.runs.forEach((run, side) => {
      const suffix = report.runs.length > 1 ? `, ${"AB"[side]}` : "";
      const cost = costs[side];
      lines.push([`frame${suffix}`, `${milliseconds(cost)} of ${(1e3 * this.frame).toFixed(1)} ms`]);
      lines.push([`residual${suffix}`, scientific(run.residual)]);
      if (run.ledger) {
        const { work, stored, mostStored, surplus } = run.ledger;
        lines.push([`work of tools${suffix}`, joules(work)], [`stored energy${suffix}`, `${joules(stored)}, at most ${joules(mostStored)}`]);
        lines.push([`surplus${suffix}`, joules(surplus)]);
      }
      if (run.inverted > 0) lines.push([`inverted tetrahedra${suffix}`, String(run.inverted)]);
      if (run.rejected > 0) lines.push([`rejected substeps${suffix}`, String(run.rejected)]);
    });
    if (clock.frames > 0 && report.time > 0) {
      this.#controls.force.push(report.time, curves);
      this.#controls.residual.push(report.time, residuals);
    }
    this.#controls.force.draw();
    this.#controls.residual.draw();
    fill(this.#controls.numbers, lines);
    this.#showHolds(report.runs[0], pull.kept);
  }

  /** Points that stay held, each with a button.
   *
   * @param {Run} run
   * @param {number[]} kept
   */
  #showHolds(run, kept) {
    const { holds } = this.#controls;
    const known = [...holds.children].map((line) => Number(line.getAttribute("data-hold")));
    if (known.join() !== kept.join()) {
      holds.replaceChildren(...kept.map((id) => make("div", { class: "held", "data-hold": String(id) }, make("span", {}), button("let go", () => this.#letGo(id)))));
    }
    kept.forEach((id, at) => {
      const held = run.held.find((held) => held.id === id);
      const text = holds.children[at]?.firstChild;
      if (text) text.textContent = `point ${run.held.findIndex((held) => held.id === id) + 1}: ${held ? newtons(size(held.force)) : "…"}`;
    });
  }

  /** The line below, and who computes what. @param {Report} report */
  #showStatus({ report, costs, clock, screen }) {
    const names = report.runs.map((_, side) => (report.runs.length > 1 ? `${"AB"[side]} ` : ""));
    const times = report.runs.map((_, side) => `${names[side]}${milliseconds(costs[side])}`).join(", ");
    const pace = clock.stopped ? "stopped" : clock.playing ? `${(clock.rate * this.frame).toFixed(2)} x real time` : "paused";
    const drawn = clock.playing ? ` · ${clock.drawn.toFixed(0)} drawn/s` : "";
    const residuals = report.runs.map((run, side) => `${names[side]}${scientific(run.residual)}`).join(", ");
    const numbers = make("p", {}, `t = ${report.time.toFixed(2)} s · `, make("b", {}, times),
      ` per frame of ${(1e3 * this.frame).toFixed(1)} ms · ${pace} · residual ${residuals}${drawn}`);
    const who = report.runs.map((run, side) => make("p", { class: "who", title: run.device }, `${names[side]}${METHODS[run.method] ?? run.method}. ${run.device}`));
    this.#status.replaceChildren(numbers, ...who);
    const lines = report.runs.map((run, side) => computes(run, report.runs.length > 1 ? `${"AB"[side]}: ` : ""));
    if (screen.plain) lines.push(`The picture is drawn by the processor, ${screen.size.join(" x ")} pixels.`);
    const text = lines.join("\n");
    if (text === this.#lines) return;
    this.#lines = text;
    this.#controls.devices.querySelectorAll(".computes").forEach((line) => line.remove());
    this.#controls.devices.prepend(...lines.map((line) => make("p", { class: "computes strong" }, line)));
  }

  /**
   * Forces, each beside where it pulls to.
   *
   * @param {Report} report
   * @param {import("./input.js").Place} place
   */
  #showTags({ report, pull, tags }, place) {
    while (this.#tags.children.length > tags.length) this.#tags.lastElementChild?.remove();
    while (this.#tags.children.length < tags.length) this.#tags.append(make("div", { class: "tag" }));
    this.#finger = null;
    tags.forEach((tag, at) => {
      const element = /** @type {HTMLElement} */ (this.#tags.children[at]);
      const run = report.runs[tag.run];
      const [held, tool] = [run?.held.find((held) => held.id === tag.id), run?.tools[tag.tool]];
      element.id = held && tag.id === pull.hold && tag.run === 0 ? "tag" : "";
      element.textContent = tool ? `${tool.name} ${newtonsWithin(size(tool.force), tool.error)}` : held ? newtons(size(held.force)) : "";
      // What the finger holds follows it at once, in the picture that the finger is in.
      const isFinger = held !== undefined && tag.id === pull.hold && !pull.key && Math.hypot(tag.x - place.x, tag.y - place.y) < NEAR;
      if (isFinger) this.#finger = element;
      this.#placeTag(element, isFinger ? place : { ...tag, touch: false });
    });
  }

  /** The finger has moved. @param {import("./input.js").Place} place */
  follow(place) {
    if (this.#finger) this.#placeTag(this.#finger, place);
  }

  /**
   * @param {HTMLElement} tag
   * @param {import("./input.js").Place} place
   */
  #placeTag(tag, { x, y, touch }) {
    const half = tag.offsetWidth / 2 + 6;
    const high = tag.offsetHeight;
    const above = touch ? 52 : 22;
    // At the upper edge it goes below the pointer.
    const top = y - above - high < 4 ? y + above + high : y - above;
    tag.style.left = `${Math.min(Math.max(x, half), this.#stage.clientWidth - half)}px`;
    tag.style.top = `${Math.max(high + 4, Math.min(top, this.#stage.clientHeight - 4))}px`;
  }

  /** @param {Report} report */
  #showLegend({ legend }) {
    byId("legend").hidden = legend === null;
    if (!legend) return;
    const [, high, unit] = /^([\d.]+)\s*(.*)$/.exec(legend.text) ?? ["", "", legend.text];
    byId("legend-title").textContent = legend.title;
    byId("legend-high").textContent = legend.text;
    byId("legend-middle").textContent = high ? `${Number(high) / 2} ${unit}` : "";
    byId("legend-low").textContent = `0 ${unit}`;
  }
}

/**
 * Which method is computed, by what and why.
 *
 * @param {Run} run
 * @param {string} name
 */
function computes(run, name) {
  const method = METHODS[run.method] ?? run.method;
  const how = ACCELERATIONS[run.acceleration] ? `, ${ACCELERATIONS[run.acceleration]}` : "";
  const counts = `${run.substeps} x ${run.iterations}`;
  const elements = ELEMENTS[run.elements] ?? run.elements;
  const warning = run.warning ? ` ${run.warning}` : "";
  return `${name}${method}${how}, substeps x iterations ${counts}, ${elements} tetrahedra. ${run.device}.${warning}`;
}

/**
 * Writes a list of terms, reusing its elements: it changes ten times a second.
 *
 * @param {HTMLElement} list
 * @param {[string, string][]} lines
 */
function fill(list, lines) {
  while (list.children.length > 2 * lines.length) list.lastElementChild?.remove();
  while (list.children.length < 2 * lines.length) list.append(make(list.children.length % 2 === 0 ? "dt" : "dd"));
  lines.flat().forEach((text, at) => {
    if (list.children[at].textContent !== text) list.children[at].textContent = text;
  });
}
