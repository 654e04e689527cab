/** What the page says: short messages that go away, and cards that stand in the way. */

/** How long a message stays [ms]; each character gives it a little longer, so that it can be read. */
const SHOWN = 5000;
const PER_CHARACTER = 35;

/** @param {string} id */
export function byId(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no “${id}”`);
  return element;
}

/**
 * An element with text and attributes.
 *
 * @param {string} tag
 * @param {Record<string, string>} [attributes]
 * @param {...(Node | string)} children
 * @returns {HTMLElement}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/**
 * @param {string} text
 * @param {() => void} press
 * @param {Record<string, string>} [attributes]
 */
export function button(text, press, attributes = {}) {
  const made = make("button", { type: "button", ...attributes }, text);
  made.addEventListener("click", press);
  return made;
}

export class Messages {
  #list = byId("messages");
  #card = byId("card");
  /** @type {HTMLElement | null} */
  #busy = null;
  /** All that was said, for tests and for bug reports. @type {{text: string, isWarning: boolean}[]} */
  log = [];

  /** Something worth knowing. @param {string} text */
  tell(text) {
    this.#show(text, false);
  }

  /** Something that did not work. @param {string} text */
  warn(text) {
    this.#show(text, true);
  }

  /**
   * Something that takes a while: the same message until {@link idle}.
   *
   * @param {string} text
   * @param {() => void} stop
   */
  busy(text, stop) {
    this.idle();
    this.#busy = make("div", { class: "message", role: "status" }, make("p", {}, `${text} …`), button("Stop", stop));
    this.#list.append(this.#busy);
  }

  /** It is over. */
  idle() {
    this.#busy?.remove();
    this.#busy = null;
  }

  /** Texts that are to be seen now. */
  get texts() {
    return [...this.#list.querySelectorAll("p")].map((line) => line.textContent ?? "");
  }

  /** Title and text of the card; null: none. */
  get card() {
    if (this.#card.hidden) return null;
    return { title: byId("card-title").textContent ?? "", text: byId("card-text").textContent ?? "" };
  }

  /**
   * @param {string} text
   * @param {boolean} isWarning
   */
  #show(text, isWarning) {
    this.log.push({ text, isWarning });
    if (this.log.length > 200) this.log.shift();
    // A slider that is dragged beyond what is possible says it once.
    for (const old of this.#list.children) if (old.firstChild?.textContent === text) old.remove();
    const message = make("div", { class: isWarning ? "message warn" : "message" }, make("p", {}, text));
    const remove = () => message.remove();
    message.append(button("×", remove, { "aria-label": "Dismiss" }));
    this.#list.append(message);
    while (this.#list.children.length > 4) [...this.#list.children].find((old) => old !== this.#busy)?.remove();
    this.#list.scrollTop = this.#list.scrollHeight;
    let timer = setTimeout(remove, SHOWN + PER_CHARACTER * text.length);
    // Nobody loses a message that is being read or is reached by key.
    const hold = () => clearTimeout(timer);
    const go = () => {
      clearTimeout(timer);
      timer = setTimeout(remove, SHOWN);
    };
    message.addEventListener("pointerenter", hold);
    message.addEventListener("focusin", hold);
    message.addEventListener("pointerleave", go);
    message.addEventListener("focusout", go);
  }

  /**
   * A card in the way of everything else.
   *
   * @param {string} title
   * @param {string} text
   * @param {[string, () => void][]} [buttons] each removes the card
   */
  stop(title, text, buttons = []) {
    byId("card-title").textContent = title;
    byId("card-text").textContent = text;
    const made = buttons.map(([name, press]) => button(name, () => {
      this.clear();
      press();
    }));
    byId("card-buttons").replaceChildren(...made);
    this.#card.hidden = false;
    if (made[0]) {
      made[0].classList.add("strong");
      made[0].focus();
    }
    this.log.push({ text: `${title}: ${text}`, isWarning: true });
  }

  /** Removes the card. */
  clear() {
    this.#card.hidden = true;
  }
}
