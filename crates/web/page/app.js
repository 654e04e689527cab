/** What the page is about at the moment: the scene, its settings, and what leads from one to the next. */

import { makeScene, readFiles } from "./files.js";
import { emptyLink, parseLink, problemText, put, writeLink } from "./link.js";

/** @typedef {import("./host.js").Host} Host */
/** @typedef {import("./link.js").Link} Link */
/** @typedef {import("./link.js").Pair} Pair */
/** @typedef {import("./messages.js").Messages} Messages */

export class App {
  #host;
  #messages;
  /** Hears that something else is loaded or set. */
  #changed;
  /** What the module offers. @type {any} */
  hello = null;
  /** @type {Link} */
  link = emptyLink();
  /** Keys that the link came with: the page does not choose those. @type {Set<string>} */
  #given = new Set();
  /** Names of a person's own files; null: a built-in scene. @type {string | null} */
  own = null;
  /** @type {any} */
  loaded = null;
  /** @type {Record<string, string>[]} */
  values = [];
  /** What was chosen for this device. @type {any} */
  chosen = null;
  /** Settings whose last change is under way, and what came after it. @type {Map<string, Pair[] | null>} */
  #under = new Map();
  /** A link to a file that is not here yet. @type {Link | null} */
  #waiting = null;

  /**
   * @param {Host} host
   * @param {Messages} messages
   * @param {() => void} changed
   */
  constructor(host, messages, changed) {
    this.#host = host;
    this.#messages = messages;
    this.#changed = changed;
  }

  /** Reads the address and loads what it says. */
  async open() {
    const { link, problems } = parseLink(location.hash, {
      scenes: this.hello.scenes.map((/** @type {{name: string}} */ scene) => scene.name),
      settings: this.hello.settings,
    });
    await this.#load(link, problems);
  }

  /** Another scene, with none of the settings of the last one. @param {string} name */
  async scene(name) {
    const { color, wireframe } = this.link;
    await this.#load({ ...emptyLink(), scene: name, color, wireframe }, []);
  }

  /**
   * @param {Link} link
   * @param {string[]} problems that are known already
   */
  async #load(link, problems) {
    const scene = this.hello.scenes.find((/** @type {{name: string}} */ scene) => scene.name === link.scene) ?? this.hello.scenes[0];
    const order = { name: scene.name, text: scene.text };
    this.#waiting = link.own === null ? null : link;
    const { color, wireframe } = link;
    const shown = link.own === null ? { ...link, scene: scene.name } : { ...emptyLink(), color, wireframe };
    this.#given = new Set(shown.settings.map(([key]) => key));
    let isOpen = await this.#order(shown, order, problems);
    // A mesh that is too fine is no reason to show nothing.
    if (!isOpen && shown.mesh !== null) isOpen = await this.#order({ ...shown, mesh: null }, order, problems);
    if (isOpen) this.own = null;
    if (link.own !== null) this.#messages.tell(`This link is of a file on its maker’s device, ${link.own}: open that file here, and its settings follow.`);
    this.#changed();
  }

  /** A mesh, a surface, a scan or a scene of a person's own. @param {File[]} files */
  async files(files) {
    try {
      const own = await readFiles(files, this.hello.limits.fileBytes);
      const names = files.map((file) => file.name).join(", ");
      const { color, wireframe } = this.link;
      const link = this.#waiting?.own === names ? this.#waiting : { ...emptyLink(), color, wireframe, own: names };
      this.#given = new Set(link.settings.map(([key]) => key));
      const made = await makeScene(own, link.settings, (text, stop) => this.#messages.busy(text, stop))
        .finally(() => this.#messages.idle());
      if (!made) return;
      const { scene, notes } = made;
      const transfer = [...Object.values(scene.files), ...(scene.balance ? [scene.balance] : [])]
        .map((bytes) => /** @type {Transferable} */ (bytes.buffer));
      if (await this.#order(link, { own: scene }, [], transfer)) {
        this.own = names;
        this.#waiting = null;
        for (const note of notes) this.#messages.warn(note);
        this.#messages.tell(`${names} is open. It stays on this device; the link names it and carries the settings.`);
      }
    } catch (error) {
      this.#messages.warn(text(error));
    }
    this.#changed();
  }

  /**
   * @param {Link} link
   * @param {Record<string, unknown>} order
   * @param {string[]} problems
   * @param {Transferable[]} [transfer]
   * @returns {Promise<boolean>}
   */
  async #order(link, order, problems, transfer = []) {
    const measure = link.mesh === null;
    const fields = { ...order, settings: link.settings, mesh: link.mesh ?? 1, beside: link.beside, measure };
    try {
      const answer = await this.#host.call("load", fields, transfer);
      this.#messages.clear();
      this.#take(answer);
      // What the module did not take is not kept.
      const taken = (/** @type {string} */ prefix) => (/** @type {Pair} */ [key]) =>
        !answer.problems.some((/** @type {string} */ problem) => problem.includes(prefix + key));
      link.settings = link.settings.filter(taken(""));
      if (link.beside) link.beside = link.beside.filter(taken("b."));
      this.link = link;
      const all = [...problems, ...answer.problems];
      if (all.length > 0) this.#messages.warn(problemText(all));
      this.#host.send("color", { kind: link.color });
      this.#host.send("wireframe", { on: link.wireframe });
      this.write();
      return true;
    } catch (error) {
      this.#messages.warn(text(error));
      return false;
    }
  }

  /** @param {{loaded: any, values: Record<string, string>[]}} state */
  #take({ loaded, values }) {
    this.loaded = loaded;
    this.values = values;
  }

  /** The address says what is shown. */
  write() {
    history.replaceState(null, "", writeLink(this.link));
  }

  /**
   * Changes settings while everything runs. Of a slider that moves faster than the worker answers, the last place counts.
   *
   * @param {number | "all"} run
   * @param {Pair[]} pairs
   */
  async set(run, pairs) {
    const slot = `${run} ${pairs.map(([key]) => key).join()}`;
    if (this.#under.has(slot)) {
      this.#under.set(slot, pairs);
      return;
    }
    this.#under.set(slot, null);
    try {
      await this.#set(run, pairs);
    } finally {
      const next = this.#under.get(slot);
      this.#under.delete(slot);
      if (next) await this.set(run, next);
    }
  }

  /**
   * @param {number | "all"} run
   * @param {Pair[]} pairs
   * @param {boolean} [choice] whether the page chose it
   */
  async #set(run, pairs, choice = false) {
    const runs = run === "all" ? this.values.map((_, at) => at) : [run];
    try {
      const before = this.values;
      const answer = await this.#host.call("set", { runs, settings: pairs, choice });
      for (const [key, value] of pairs) this.#note(run, key, value, before);
      if (!choice && pairs.some(([key]) => key.startsWith("solver."))) this.link.mesh ??= this.loaded.mesh;
      this.#take(answer);
      this.write();
    } catch (error) {
      this.#messages.warn(text(error));
      await this.#host.call("state").then((state) => this.#take(state), () => {});
    }
    this.#changed();
  }

  /**
   * @param {number | "all"} run
   * @param {string} key
   * @param {string} value
   * @param {Record<string, string>[]} before
   */
  #note(run, key, value, before) {
    const { beside, settings } = this.link;
    if (run === 1 && beside) put(beside, key, value);
    else {
      // B keeps what it had, in the link as well, when A alone changes.
      if (run === 0 && beside && before[1] && !beside.some(([known]) => known === key)) put(beside, key, before[1][key]);
      put(settings, key, value);
    }
  }

  /** Another size of cells; begins from rest. @param {number} mesh */
  async mesh(mesh) {
    await this.#order({ ...this.link, mesh }, { again: true }, []);
    this.#changed();
  }

  /** Two simulations, or one. */
  async beside() {
    const beside = this.link.beside ? null : /** @type {Pair[]} */ ([["solver.method", this.isXpbd ? "quasi_newton" : "xpbd"]]);
    try {
      this.#take(await this.#host.call("beside", { settings: beside }));
      this.link.beside = beside;
      this.link.mesh ??= this.loaded.mesh;
      this.write();
    } catch (error) {
      this.#messages.warn(text(error));
    }
    this.#changed();
  }

  get isXpbd() {
    return /xpbd/.test(this.values[0]?.["solver.method"] ?? "");
  }

  /**
   * The first second was measured: what suits this device is set, and noted in the link. What the link came with stays.
   *
   * @param {{choice: {device: string, accuracy: string, mesh: number, why: string}, measured: any}} word
   */
  async choose({ choice, measured }) {
    this.chosen = { ...choice, measured };
    /** @type {Pair[]} */
    const wanted = [["solver.accuracy", choice.accuracy], ["solver.device", choice.device]];
    const pairs = wanted.filter(([key]) => !this.#given.has(key));
    const mesh = this.loaded.canChangeMesh ? choice.mesh : this.loaded.mesh;
    const link = { ...this.link, mesh, settings: this.link.settings.map((pair) => /** @type {Pair} */ ([...pair])) };
    if (mesh !== this.loaded.mesh) {
      for (const [key, value] of pairs) put(link.settings, key, value);
      await this.#order(link, { again: true }, []);
    } else {
      this.link = link;
      const changes = pairs.filter(([key, value]) => this.values[0]?.[key]?.replaceAll('"', "") !== value);
      if (changes.length > 0) await this.#set(0, changes, true);
      for (const [key, value] of pairs) put(this.link.settings, key, value);
      this.write();
    }
    this.#messages.tell(this.choiceText);
    this.#changed();
  }

  /** What was chosen, and why. */
  get choiceText() {
    const { device, accuracy, mesh, why } = this.chosen;
    const cells = mesh === 1 ? "the scene’s own mesh" : `cells ${mesh} times as large`;
    return `Chosen for 60 frames per second on this device: ${device.toUpperCase()}, accuracy “${accuracy}”, ${cells}; ${why.replace(/\.$/, "")}.`;
  }

  /** Measures once more, and chooses anew. */
  async measure() {
    const chosen = new Set(["solver.device", "solver.accuracy"]);
    const settings = this.link.settings.filter(([key]) => !chosen.has(key));
    this.#given = new Set(settings.map(([key]) => key));
    await this.#order({ ...this.link, settings, beside: null, mesh: null }, { again: true }, []);
    this.#changed();
  }

  /** @param {string} color */
  color(color) {
    this.link.color = color;
    this.#host.send("color", { kind: color });
    this.write();
    this.#changed();
  }

  /** @param {boolean} on */
  wireframe(on) {
    this.link.wireframe = on;
    this.#host.send("wireframe", { on });
    this.write();
  }
}

/** What went wrong, for people. @param {unknown} error */
export function text(error) {
  return error instanceof Error ? error.message : String(error);
}
