/** The tray over the picture: instruments to take, and what is done with the one in hand. */

import { button, byId, make } from "./messages.js";

/** @typedef {import("./host.js").Host} Host */
/**
 * @typedef {object} Tools
 * @property {string[]} tray
 * @property {{id: number, name: string, isActive: boolean, hasJaws: boolean, isLocked: boolean}[]} inHand
 * @property {string} drag
 */

/** What one finger does to the instrument in hand. @type {[string, string, string][]} */
const DRAGS = [
  ["across", "move", "One finger moves it in the plane of the picture"],
  ["depth", "depth", "One finger moves it away (up) and nearer (down)"],
  ["tilt", "turn", "One finger turns it: its handle follows"],
  ["roll", "roll", "One finger turns it about its shaft"],
];

/** Jaws that are pressed for so long go on [ms], by so much each time [rad]. */
const EVERY = 40;
const OPENING = 0.035;

export class Tray {
  #host;
  #bar = byId("tray");
  /** Of what the bar was built. */
  #shown = "";
  #timer = 0;

  /** @param {Host} host */
  constructor(host) {
    this.#host = host;
    for (const name of ["pointerup", "pointercancel", "blur"]) window.addEventListener(name, () => this.#still());
  }

  /** @param {Tools} tools */
  show(tools) {
    const text = JSON.stringify(tools);
    if (text === this.#shown) return;
    this.#shown = text;
    const focused = document.activeElement instanceof HTMLElement && this.#bar.contains(document.activeElement) ? document.activeElement.textContent : null;
    this.#still();
    this.#bar.replaceChildren(...this.#instruments(tools), ...this.#inHand(tools));
    if (focused === null) return;
    for (const element of this.#bar.querySelectorAll("button")) if (element.textContent === focused) element.focus();
  }

  /** @param {Tools} tools */
  #instruments({ tray }) {
    const chips = tray.map((name, number) => {
      const chip = button(name, () => this.#host.send("takeTool", { number }));
      chip.title = "Take it in hand";
      return chip;
    });
    return [make("div", { class: "chips", role: "group", "aria-label": "Instruments to take" }, ...chips)];
  }

  /** @param {Tools} tools */
  #inHand({ inHand, drag }) {
    const active = inHand.find((held) => held.isActive);
    if (!active) return [];
    const chips = inHand.map((held) => this.#toggle(held.name, held.isActive, "Led by finger and keys", () => this.#host.send("activateTool", { hand: held.id })));
    const drags = DRAGS.map(([kind, name, title]) => this.#toggle(name, drag === kind, title, () => this.#host.send("drag", { kind })));
    const jaws = active.hasJaws
      ? [this.#holding("close", -OPENING), this.#holding("open", OPENING), this.#toggle("lock", active.isLocked, "What the jaws press on stays tied to them", () => this.#host.send("lockJaws"))]
      : [];
    const group = (/** @type {string} */ label, /** @type {HTMLElement[]} */ of) => make("div", { class: "chips", role: "group", "aria-label": label }, ...of);
    return [
      group("Instruments in hand", [...chips, button("put away", () => this.#host.send("putAway"))]),
      group(`One finger on the ${active.name}`, [...drags, ...jaws]),
    ];
  }

  /**
   * @param {string} name
   * @param {boolean} on
   * @param {string} title
   * @param {() => void} act
   */
  #toggle(name, on, title, act) {
    const chip = button(name, act);
    chip.title = title;
    chip.setAttribute("aria-pressed", String(on));
    return chip;
  }

  /**
   * A button that acts as long as it is pressed, and once by key.
   *
   * @param {string} name
   * @param {number} by
   */
  #holding(name, by) {
    const send = () => this.#host.send("jaws", { by });
    const chip = button(name, () => {});
    chip.title = "Jaws: as long as it is pressed";
    chip.addEventListener("pointerdown", () => {
      send();
      this.#timer = window.setInterval(send, EVERY);
    });
    chip.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === " ") send();
    });
    return chip;
  }

  #still() {
    window.clearInterval(this.#timer);
  }
}
