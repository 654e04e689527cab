/** Rows of settings: a name, a slider or a menu, and what it means. */

import { make } from "./messages.js";

/**
 * @typedef {object} Row
 * @property {HTMLElement} element
 * @property {(value: string | undefined) => void} update shows a value as a scene file has it; none: the row is not shown
 */

/** What one of a unit is, in SI. @type {Record<string, number>} */
const UNITS = {
  Pa: 1, kPa: 1e3, MPa: 1e6, GPa: 1e9, mPa: 1e-3,
  s: 1, ms: 1e-3, us: 1e-6, "µs": 1e-6,
  "kg/m^3": 1, "g/cm^3": 1e3, "m/s^2": 1, "N/m": 1, "kN/m": 1e3, m: 1, mm: 1e-3, cm: 1e-2, "": 1,
};

let rows = 0;

/** A number for ids that labels refer to. */
function freshId() {
  rows += 1;
  return `row-${rows}`;
}

/** The bare text of a value: without the quotes of a scene file. @param {string} value */
export function bare(value) {
  return value.trim().replace(/^"(.*)"$/, "$1");
}

/**
 * A value of a scene file as a number of another unit: "5100 Pa" is 5.1 in kPa.
 *
 * @param {string} value
 * @param {string} unit
 */
export function numberIn(value, unit) {
  const match = /^([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(.*)$/i.exec(bare(value));
  if (!match) return NaN;
  const [given, wanted] = [UNITS[match[2]], UNITS[unit]];
  return given === undefined || wanted === undefined ? NaN : (Number(match[1]) * given) / wanted;
}

/** Without the digits that nobody chose. @param {number} value */
export function digits(value) {
  return String(Number(value.toPrecision(4)));
}

/**
 * A rail to slide on, and the number itself, which can lie beyond it.
 *
 * @param {object} look
 * @param {string} look.name
 * @param {string} look.help
 * @param {string} [look.unit] as a scene file has it
 * @param {[number, number]} look.rail
 * @param {boolean} [look.logarithmic]
 * @param {boolean} [look.whole]
 * @param {(text: string) => void} set gets a value as a scene file has it
 * @returns {Row}
 */
export function numberRow({ name, help, unit = "", rail, logarithmic = false, whole = false }, set) {
  const id = freshId();
  const shownUnit = unit.replace("^2", "²").replace("^3", "³");
  const steps = whole && !logarithmic ? rail[1] - rail[0] : 200;
  const slider = /** @type {HTMLInputElement} */ (make("input", { type: "range", min: "0", max: String(steps), step: "1", "aria-label": `${name}, slider` }));
  const field = /** @type {HTMLInputElement} */ (make("input", { type: "text", inputmode: "decimal", id, autocomplete: "off", spellcheck: "false" }));
  const box = make("div", { class: "field" }, field, make("span", {}, shownUnit));
  const element = make("div", { class: "row", title: help }, make("label", { for: id }, name), slider, box);
  const [low, high] = logarithmic ? rail.map(Math.log) : rail;
  let shown = NaN;
  const withUnit = (/** @type {string} */ text) => `${text} ${unit}`.trimEnd();
  const place = (/** @type {number} */ value) => {
    const share = ((logarithmic ? Math.log(value) : value) - low) / (high - low);
    return String(Math.round(steps * Math.max(0, Math.min(1, share || 0))));
  };
  const show = (/** @type {number} */ value) => {
    shown = value;
    slider.value = place(value);
    field.value = digits(value);
    slider.setAttribute("aria-valuetext", withUnit(field.value));
  };
  slider.addEventListener("input", () => {
    const at = low + (Number(slider.value) / steps) * (high - low);
    const value = logarithmic ? Math.exp(at) : at;
    const text = whole ? String(Math.round(value)) : String(Number(value.toPrecision(logarithmic ? 2 : 3)));
    field.value = text;
    slider.setAttribute("aria-valuetext", withUnit(text));
    set(withUnit(text));
  });
  field.addEventListener("change", () => {
    const typed = field.value.trim().replace(/,/g, ".");
    if (typed === "") show(shown);
    else set(typed !== "" && Number.isFinite(Number(typed)) ? withUnit(typed) : typed);
  });
  const update = (/** @type {string | undefined} */ value) => {
    const number = value === undefined ? NaN : numberIn(value, unit);
    element.hidden = Number.isNaN(number);
    // What is being typed is not written over.
    if (!element.hidden && document.activeElement !== slider) show(number);
    else if (!element.hidden) shown = number;
  };
  return { element, update };
}

/**
 * A menu of names: each as a scene file has it, and in words.
 *
 * @param {{name: string, help: string, options: [string, string][], words?: (value: string) => string}} look `words` for what is not
 *   in the menu
 * @param {(value: string) => void} set
 * @returns {Row}
 */
export function menuRow({ name, help, options, words = (value) => value }, set) {
  const id = freshId();
  const menu = /** @type {HTMLSelectElement} */ (make("select", { id }));
  menu.append(...options.map(([value, words]) => make("option", { value }, words)));
  menu.addEventListener("change", () => set(menu.value));
  const element = make("div", { class: "row", title: help }, make("label", { for: id }, name), menu);
  const update = (/** @type {string | undefined} */ value) => {
    element.hidden = value === undefined;
    if (value === undefined) return;
    const now = bare(value);
    // A scene may have a value that no menu offers.
    if (![...menu.options].some((option) => option.value === now)) menu.append(make("option", { value: now }, words(now)));
    menu.value = now;
  };
  return { element, update };
}

/**
 * A box to tick.
 *
 * @param {{name: string, help: string}} look
 * @param {(on: boolean) => void} set
 * @returns {Row & {update: (value: string | undefined) => void}}
 */
export function tickRow({ name, help }, set) {
  const box = /** @type {HTMLInputElement} */ (make("input", { type: "checkbox" }));
  box.addEventListener("change", () => set(box.checked));
  const element = make("label", { class: "tick", title: help }, box, name);
  const update = (/** @type {string | undefined} */ value) => {
    element.hidden = value === undefined;
    box.checked = value !== undefined && bare(value) === "true";
  };
  return { element, update };
}

/**
 * A part of the settings that can be folded away.
 *
 * @param {string} title
 * @param {boolean} open
 * @param {...Node} children
 */
export function section(title, open, ...children) {
  const element = make("details", open ? { open: "" } : {}, make("summary", {}, title), ...children);
  return element;
}
