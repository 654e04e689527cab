/** How steps are solved: rows of one solver. The words are the window's. */

import { button, make } from "./messages.js";
import { bare, menuRow, numberRow, tickRow } from "./rows.js";

/** @typedef {import("./rows.js").Row} Row */
/** @typedef {Record<string, string>} Values by keys of a scene file */
/** @typedef {(pairs: [string, string][]) => void} Set */

/**
 * Solvers worth comparing, by one press. Each says everything that another may have changed.
 *
 * @type {[string, string, string[]][]}
 */
const KNOWN = [
  ["default", "What is cheapest at the accuracy below: every step solved in a dozen passes, whatever the mesh.",
    ["auto", "unlimited", "auto", "auto", "none", "true"]],
  ["XPBD (exact at rest)", "Rebase and kept multipliers: in balance when it comes to rest. Coloured Gauss-Seidel, two iterations per substep.",
    ["xpbd", "unlimited", "10", "2", "none", "true"]],
  ["Jacobi 40", "One colour, 40 iterations of one step per frame.", ["xpbd", "1", "1", "40", "none", "true"]],
  ["Anderson 40", "The same with Anderson acceleration.", ["xpbd", "1", "1", "40", "anderson", "true"]],
  ["as published", "XPBD as published: its stiffness depends on substeps and iterations.",
    ["xpbd", "unlimited", "10", "2", "none", "false"]],
];
const KEYS = ["method", "colors", "substeps", "iterations", "acceleration", "rebase"];

/**
 * @param {string[]} values
 * @returns {[string, string][]}
 */
function knownPairs(values) {
  const pairs = KEYS.map((key, at) => /** @type {[string, string]} */ ([`solver.${key}`, values[at]]));
  return [...pairs, ["solver.keep_multipliers", values[5]], ["solver.elements", "auto"]];
}

/**
 * Rows for one solver.
 *
 * @param {Set} set
 * @returns {{elements: HTMLElement[], update: (values: Values, method: string) => void}} `method`: the one that computes
 */
export function solverRows(set) {
  const chips = make("div", { class: "chips", role: "group", "aria-label": "Known solvers" });
  chips.append(...KNOWN.map(([name, help, values]) => button(name, () => set(knownPairs(values)), { title: help })));
  const one = (/** @type {string} */ key) => (/** @type {string} */ value) => set([[key, value]]);
  const method = menuRow({
    name: "method",
    help: "Automatic takes the cheapest at the accuracy below, and quasi-Newton on a device that is named. XPBD sweeps over constraints in large steps. Quasi-Newton solves each step in a dozen passes, whatever the mesh. Explicit takes many small steps.",
    options: [["auto", "automatic"], ["quasi_newton", "quasi-Newton"], ["xpbd", "XPBD"], ["explicit", "explicit"]],
  }, one("solver.method"));
  const accuracy = menuRow({
    name: "accuracy",
    help: "The error of motion for which substeps and passes are chosen: about 15 % for a draft, 5 %, or 0.5 %. Where tissue comes to rest does not depend on it.",
    options: [["draft", "draft"], ["standard", "standard"], ["fine", "fine"]],
  }, one("solver.accuracy"));
  const elements = menuRow({
    name: "tetrahedra",
    help: "Linear tetrahedra bend too little where the mesh is coarse. Recovered-gradient ones also see how their neighbours are deformed. Automatic takes these.",
    options: [["auto", "automatic"], ["recovered", "recovered-gradient"], ["plain", "linear"]],
  }, one("solver.elements"));
  const substeps = countRows("substeps", "Divide every frame. More lose less motion to numerical damping; the cost grows alike.", "solver.substeps", [1, 100], 10, one);
  const iterations = countRows("iterations", "XPBD: sweeps over all constraints in each substep. Quasi-Newton: passes over the mesh in each of the two solves of a substep.", "solver.iterations", [1, 200], 10, one);
  const colors = menuRow({
    name: "colours",
    help: "Colours of the constraint graph: unlimited for Gauss-Seidel, 1 for Jacobi, a few for clique separation. Fewer run more in parallel and need more sweeps.",
    options: [["unlimited", "unlimited (Gauss-Seidel)"], ["1", "1 (Jacobi)"], ...["2", "4", "8", "16"].map((n) => /** @type {[string, string]} */ ([n, n]))],
  }, one("solver.colors"));
  const acceleration = menuRow({
    name: "acceleration",
    help: "How the sequence of sweeps of a substep is accelerated. Pays with several iterations only.",
    options: [["none", "none"], ["chebyshev", "Chebyshev"], ["anderson", "Anderson"]],
  }, one("solver.acceleration"));
  const exact = [
    tick("rebase", "solver.rebase", "Stabilised rebase before each sweep: the iteration converges to implicit Euler exactly.", one),
    tick("keep multipliers", "solver.keep_multipliers", "With the rebase this makes the stiffness independent of the number of iterations; without it the body freezes.", one),
    tick("step guard", "solver.step_guard", "Reject a step that raises the incremental potential, and slow down tissue that would gain energy. Acts with the rebase.", one),
  ];
  const device = menuRow({
    name: "device",
    help: "The device that computes the steps: auto takes the one that is expected to be faster.",
    options: [["auto", "auto"], ["cpu", "CPU"], ["gpu", "GPU"]],
  }, one("solver.device"));
  const reason = make("p", {});
  const update = (/** @type {Values} */ values, /** @type {string} */ inForce) => {
    const isXpbd = inForce === "xpbd";
    const chooses = inForce === "auto" || inForce === "quasi_newton";
    const show = (/** @type {Row} */ row, /** @type {string} */ key, shown = true) => row.update(shown ? values[key] : undefined);
    show(method, "solver.method");
    show(accuracy, "solver.accuracy", chooses);
    show(elements, "solver.elements", !isXpbd);
    substeps.update(values["solver.substeps"]);
    iterations.update(inForce === "explicit" ? undefined : values["solver.iterations"], isXpbd ? "iterations" : "passes");
    show(colors, "solver.colors", isXpbd);
    show(acceleration, "solver.acceleration", isXpbd);
    for (const { row, key } of exact) show(row, key, isXpbd);
    show(device, "solver.device");
  };
  const rows = [method, accuracy, elements, ...substeps.rows, ...iterations.rows, colors, acceleration, ...exact.map((e) => e.row), device];
  return { elements: [chips, ...rows.map((row) => row.element), reason], update };
}

/**
 * @param {string} name
 * @param {string} key
 * @param {string} help
 * @param {(key: string) => (value: string) => void} one
 */
function tick(name, key, help, one) {
  return { key, row: tickRow({ name, help }, (on) => one(key)(String(on))) };
}

/**
 * A number that the method can choose by itself: a box for that, and a slider where it is not ticked.
 *
 * @param {string} name
 * @param {string} help
 * @param {string} key
 * @param {[number, number]} rail
 * @param {number} usual what the slider begins with
 * @param {(key: string) => (value: string) => void} one
 */
function countRows(name, help, key, rail, usual, one) {
  const automatic = tickRow({ name: `automatic ${name}`, help }, (on) => one(key)(on ? "auto" : String(usual)));
  const number = numberRow({ name, help, rail, whole: true, logarithmic: true }, one(key));
  const label = /** @type {Text} */ (automatic.element.lastChild);
  const update = (/** @type {string | undefined} */ value, words = name) => {
    const isAuto = value !== undefined && bare(value) === "auto";
    automatic.update(value === undefined ? undefined : String(isAuto));
    number.update(isAuto ? undefined : value);
    label.textContent = `automatic ${words}`;
    const title = number.element.querySelector("label");
    if (title) title.textContent = words;
  };
  return { rows: [automatic, number], update };
}
