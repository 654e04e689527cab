/** The panel: measurements, scene, hand, view, materials, solvers. It shows what is and says what a person wants changed. */

import { COLORS, MESH } from "./link.js";
import { button, make } from "./messages.js";
import { Plot } from "./plots.js";
import { digits, menuRow, numberIn, numberRow, section, tickRow } from "./rows.js";
import { solverRows } from "./solver.js";

/** @typedef {import("./rows.js").Row} Row */
/** @typedef {Record<string, string>} Values */
/**
 * @typedef {object} Wishes what the panel asks the page for
 * @property {(run: number | "all", pairs: [string, string][]) => void} set
 * @property {(name: string) => void} scene
 * @property {(mesh: number) => void} mesh
 * @property {(files: File[]) => void} files
 * @property {(kind: string) => void} color
 * @property {(on: boolean) => void} wireframe
 * @property {() => void} home
 * @property {(speed: number) => void} speed
 * @property {(grip: {count: number, stiffness: number, rigid: boolean, keep: boolean}) => void} grip
 * @property {(hold: number) => void} letGo
 * @property {() => void} measure
 */
/** @typedef {{scenes: {name: string, title: string, description: string}[], presets: {name: string, about: string, young: number, poisson: number, density: number, model: string}[]}} Hello */

const LAWS = /** @type {[string, string][]} */ ([["stable_neo_hookean", "stable neo-Hookean"], ["saint_venant_kirchhoff", "Saint Venant-Kirchhoff"]]);
const PRESET_CAUTION = "A preset is a starting point, not a measurement of a patient: published values for one tissue differ by a factor of 2 to 10.";
/** Sizes of a mesh's cells that are offered, as factors. */
const SIZES = [0.5, 0.65, 0.8, 1, 1.25, 1.6, 2, 2.5];

/** @param {number} factor */
function meshWords(factor) {
  if (factor === 1) return "as the scene says";
  return `${factor < 1 ? "finer" : "coarser"}: cells x ${digits(factor)}`;
}

export class Controls {
  #panel;
  #wishes;
  /** @type {Hello} */
  #hello = { scenes: [], presets: [] };
  /** @type {((values: Values[], methods: string[]) => void)[]} */
  #updates = [];
  /** @type {Values[]} */
  #values = [];
  /** @type {string[]} */
  #methods = [];
  #shape = "";
  #grip = { count: 8, stiffness: 5000, rigid: false, keep: false };
  /** Which parts are open: as a person left them. @type {Map<string, boolean>} */
  #open = new Map();
  force = new Plot(/** @type {HTMLCanvasElement} */ (make("canvas", { class: "plot", role: "img", "aria-label": "Forces over time; the numbers stand below" })), { title: "force [N]", logarithmic: false, least: 0.1 });
  residual = new Plot(/** @type {HTMLCanvasElement} */ (make("canvas", { class: "plot", role: "img", "aria-label": "Residual over time; the number stands below" })), { title: "residual", logarithmic: true, least: 1e-3 });
  numbers = make("dl", { class: "numbers" });
  devices = make("div", {});
  holds = make("div", {});

  /**
   * @param {HTMLElement} panel
   * @param {Wishes} wishes
   */
  constructor(panel, wishes) {
    this.#panel = panel;
    this.#wishes = wishes;
  }

  /** @param {Hello} hello */
  greet(hello) {
    this.#hello = hello;
  }

  /**
   * What is loaded, and how everything is set.
   *
   * @param {{loaded: any, values: Values[], link: import("./link.js").Link, own: string | null}} state
   */
  show(state) {
    const { loaded, values, link } = state;
    this.#values = values;
    const shape = JSON.stringify([loaded.name, loaded.bodies.map((/** @type {any} */ body) => body.name), values.length, state.own]);
    if (shape !== this.#shape) {
      this.#shape = shape;
      this.#build(state);
    }
    for (const update of this.#updates) update(values, this.#methods);
    this.#panel.querySelectorAll("[data-color]").forEach((chip) => {
      chip.setAttribute("aria-pressed", String(chip.getAttribute("data-color") === link.color));
    });
    this.sceneLine.textContent = `${loaded.tets.toLocaleString("en")} tetrahedra, ${loaded.vertices.toLocaleString("en")} vertices`;
    this.#mesh?.update(String(loaded.mesh));
    this.#wire?.update(String(link.wireframe));
  }

  sceneLine = make("p", { class: "strong" });
  /** @type {Row | null} */
  #mesh = null;
  /** @type {Row | null} */
  #wire = null;

  /** Which methods compute: rows depend on them. @param {string[]} methods */
  follow(methods) {
    if (methods.join() === this.#methods.join()) return;
    this.#methods = methods;
    for (const update of this.#updates) update(this.#values, methods);
  }

  /** @param {{loaded: any, values: Values[], own: string | null}} state */
  #build({ loaded, values, own }) {
    this.#updates = [];
    const scroll = this.#panel.scrollTop;
    const parts = [
      this.#part("Forces", true, this.force.canvas, this.numbers, this.residual.canvas),
      this.#part("Scene", true, ...this.#scene(loaded, own)),
      ...loaded.bodies.map((/** @type {any} */ body) =>
        this.#part(loaded.bodies.length === 1 ? "Material" : `Material of ${body.name}`, true, ...this.#material(body))),
      ...values.map((_, run) => {
        const { elements, update } = solverRows((pairs) => this.#wishes.set(run, pairs));
        this.#updates.push((values, methods) => update(values[run] ?? {}, methods[run] ?? ""));
        return this.#part(values.length === 1 ? "Solver" : `Solver ${"AB"[run]}`, true, ...elements);
      }),
      this.#part("Device", true, this.devices, this.#again()),
      this.#part("Hand", true, ...this.#hand()),
      this.#part("View", true, ...this.#view()),
    ];
    this.#panel.replaceChildren(...parts);
    this.#panel.scrollTop = scroll;
  }

  /**
   * @param {string} title
   * @param {boolean} open
   * @param {...Node} children
   */
  #part(title, open, ...children) {
    const part = section(title, this.#open.get(title) ?? open, ...children);
    part.addEventListener("toggle", () => this.#open.set(title, part.hasAttribute("open")));
    return part;
  }

  /**
   * @param {any} loaded
   * @param {string | null} own
   */
  #scene(loaded, own) {
    /** @type {[string, string][]} */
    const scenes = this.#hello.scenes.map(({ name, title }) => [name, title]);
    if (own) scenes.unshift(["", `${own} (your own)`]);
    const scene = menuRow({ name: "scene", help: "Another scene begins from rest", options: scenes }, (name) => name && this.#wishes.scene(name));
    scene.update(own ? "" : loaded.name);
    const about = this.#hello.scenes.find((known) => known.name === loaded.name && !own)?.description ?? loaded.title;
    const sizes = SIZES.filter((size) => size >= MESH.finest && size <= MESH.coarsest);
    this.#mesh = menuRow({ name: "mesh size", help: "Size of the cells; another one begins from rest", options: sizes.map((size) => [String(size), meshWords(size)]), words: (size) => meshWords(Number(size)) }, (size) => this.#wishes.mesh(Number(size)));
    this.#mesh.element.hidden = true;
    const input = /** @type {HTMLInputElement} */ (make("input", { type: "file", multiple: "", "aria-label": "Open a mesh, a scan or a scene" }));
    input.addEventListener("change", () => {
      this.#wishes.files([...(input.files ?? [])]);
      input.value = "";
    });
    const gravity = numberRow({ name: "gravity", help: "Acceleration downwards, along -z.", unit: "m/s^2", rail: [0, 20] }, (text) => this.#wishes.set("all", [["world.gravity", text]]));
    this.#updates.push(([values]) => gravity.update(downwards(values["world.gravity"])));
    const rows = [scene.element, make("p", {}, about.trim()), this.sceneLine];
    if (loaded.canChangeMesh) {
      this.#mesh.element.hidden = false;
      rows.push(this.#mesh.element);
    } else this.#mesh = null;
    return [...rows, gravity.element, make("div", { class: "chips" }, make("label", { class: "file" }, "Open a mesh, scan or scene…", input)),
      make("p", {}, "Or drop it anywhere: tetrahedra (Gmsh, VTK, TetGen, Medit, Abaqus), a surface (OBJ, STL, PLY), a segmented scan (NIfTI, NRRD), or a scene file with its meshes. Your files stay on this device.")];
  }

  /** @param {any} body */
  #material(body) {
    const key = (/** @type {string} */ name) => `body.${body.name}.material.${name}`;
    const set = (/** @type {string} */ name) => (/** @type {string} */ text) => this.#wishes.set("all", [[key(name), text]]);
    const { presets } = this.#hello;
    const words = (/** @type {string} */ name) => name.replaceAll("_", " ");
    const tissue = menuRow({ name: "tissue", help: PRESET_CAUTION, options: [["", "own numbers"], ...presets.map(({ name }) => /** @type {[string, string]} */ ([name, words(name)]))] }, (name) => {
      const preset = presets.find((preset) => preset.name === name);
      if (preset) this.#wishes.set("all", [[key("young"), `${digits(preset.young / 1e3)} kPa`], [key("poisson"), digits(preset.poisson)], [key("density"), `${digits(preset.density)} kg/m^3`]]);
    });
    const about = make("p", {});
    const rows = {
      model: menuRow({ name: "law", help: "The law between strain and energy. Stable neo-Hookean tissue withstands compression and inversion.", options: LAWS }, set("model")),
      young: numberRow({ name: "stiffness E", help: "Young’s modulus at small strain.", unit: "kPa", rail: [0.1, 1000], logarithmic: true }, set("young")),
      poisson: numberRow({ name: "Poisson’s ratio", help: "0.5 would keep its volume exactly; tissue is at 0.45 to 0.49. The nearer to 0.5, the more iterations a step needs.", rail: [0, 0.499] }, set("poisson")),
      density: numberRow({ name: "density", help: "Mass per volume.", unit: "kg/m^3", rail: [500, 2000] }, set("density")),
      viscosity: numberRow({ name: "viscosity", help: "Kelvin-Voigt retardation time. More makes tissue settle sooner.", unit: "ms", rail: [0, 100] }, set("viscosity")),
    };
    this.#updates.push(([values]) => {
      for (const [name, row] of Object.entries(rows)) row.update(values[key(name)]);
      const preset = presetOf(presets, values, key);
      tissue.update(preset?.name ?? "");
      about.textContent = preset ? preset.about : "";
      about.hidden = !preset;
    });
    return [tissue.element, about, ...Object.values(rows).map((row) => row.element)];
  }

  #again() {
    const again = button("Measure this device again", () => this.#wishes.measure(), { title: "Measures a second and chooses device, mesh size and accuracy for 60 frames per second" });
    return make("div", { class: "chips" }, again);
  }

  #hand() {
    const say = () => this.#wishes.grip({ ...this.#grip });
    const grip = numberRow({ name: "grip", help: "How many vertices the next press takes hold of", rail: [1, 60], whole: true }, (text) => {
      this.#grip.count = Math.max(1, Math.round(Number(text)) || 8);
      say();
    });
    const spring = numberRow({ name: "spring", help: "Stiffness of the spring between hand and tissue, all vertices together", unit: "N/m", rail: [10, 20000], logarithmic: true }, (text) => {
      const value = parseFloat(text);
      if (value > 0 && value <= 1e6) this.#grip.stiffness = value;
      say();
    });
    const rigid = tickRow({ name: "rigid", help: "Hold without a spring" }, (on) => {
      this.#grip.rigid = on;
      say();
    });
    const keep = tickRow({ name: "keep", help: "Hold on when the finger is lifted, as with Shift" }, (on) => {
      this.#grip.keep = on;
      say();
    });
    grip.update(String(this.#grip.count));
    spring.update(`${this.#grip.stiffness} N/m`);
    rigid.update(String(this.#grip.rigid));
    keep.update(String(this.#grip.keep));
    return [grip.element, spring.element, rigid.element, keep.element, this.holds];
  }

  #view() {
    const chips = COLORS.map((kind) => button(kind, () => this.#wishes.color(kind), { "data-color": kind, "aria-pressed": "false" }));
    this.#wire = tickRow({ name: "wireframe", help: "Draw the surface’s triangles" }, (on) => this.#wishes.wireframe(on));
    const speed = numberRow({ name: "speed", help: "Simulated seconds per second of the clock", rail: [0.05, 1], logarithmic: true }, (text) => this.#wishes.speed(Number(text)));
    speed.update("1");
    return [make("div", { class: "chips", role: "group", "aria-label": "Colours" }, ...chips), this.#wire.element, speed.element,
      make("div", { class: "chips" }, button("Fit view", () => this.#wishes.home(), { title: "Show everything (F)" }))];
  }
}

/**
 * Gravity where it pulls straight down, as one number; elsewhere nothing.
 *
 * @param {string | undefined} value
 */
function downwards(value) {
  const list = value && /^\[(.*)\]$/.exec(value);
  if (!list) return value;
  const [x, y, z] = list[1].split(",").map((part) => part.trim().replace(/^"(.*)"$/, "$1"));
  if (parseFloat(x) !== 0 || parseFloat(y) !== 0 || parseFloat(z) > 0) return undefined;
  return z.replace("-", "");
}

/**
 * @param {Hello["presets"]} presets
 * @param {Values} values
 * @param {(name: string) => string} key
 */
function presetOf(presets, values, key) {
  const number = (/** @type {string} */ name, /** @type {string} */ unit) => numberIn(values[key(name)] ?? "", unit);
  return presets.find((preset) => near(number("young", "Pa"), preset.young) && near(number("poisson", ""), preset.poisson)
    && near(number("density", "kg/m^3"), preset.density));
}

/**
 * @param {number} a
 * @param {number} b
 */
function near(a, b) {
  return Math.abs(a - b) <= 1e-6 * Math.abs(b);
}
