/**
 * The worker: it owns the module, the canvas, the graphics device and the simulations, so that the page answers whatever the
 * mesh costs. The page sends messages `{do, id?, ...}`; those with an `id` are answered.
 */

import { Engine } from "./engine.js";
import init, { Session, limits, presets, scenes, settings } from "./viscera.js";

/** @typedef {{do: string, id?: number, [key: string]: any}} Order */

/** @type {Engine | null} */
let engine = null;
let hasFailed = false;
/** What came while nothing might touch the session. @type {Order[]} */
const waiting = [];
/** The last line that was logged as an error: of a panic it says where. */
let lastError = "";
/** What was loaded last, for another mesh size. @type {import("./files.js").OwnScene | null} */
let source = null;
/**
 * @param {{about: string, [key: string]: any}} word
 * @param {Transferable[]} [transfer]
 */
function say(word, transfer = []) {
  self.postMessage(word, { transfer });
  // The session is free again: orders that came meanwhile are next.
  if (word.about === "free") next();
}

/**
 * Something went wrong that no control can answer for.
 *
 * @param {unknown} error
 */
function fail(error) {
  if (hasFailed) return;
  const text = error instanceof Error ? error.message : String(error);
  if (error instanceof WebAssembly.RuntimeError) {
    hasFailed = true;
    engine?.stop();
    say({ about: "fatal", text: lastError.split("\n").slice(0, 2).join(" ") || text });
  } else say({ about: "stopped", text });
}

const log = console.error;
console.error = (/** @type {unknown[]} */ ...words) => {
  lastError = String(words[0]);
  log(...words);
};

/** Takes the module that the page has compiled meanwhile; null: it could not. @type {(module: WebAssembly.Module | null) => void} */
let takeModule = () => {};
/** @type {Promise<WebAssembly.Module | null>} */
const compiled = new Promise((take) => {
  takeModule = take;
});
const loaded = compiled.then((module) => init({ module_or_path: module ?? new URL("./viscera_bg.wasm", import.meta.url) }));
loaded.then(() => {
  say({
    about: "hello",
    scenes: JSON.parse(scenes()),
    settings: JSON.parse(settings()),
    presets: JSON.parse(presets()),
    limits: JSON.parse(limits()),
  });
}, (error) => say({ about: "fatal", text: `The simulation could not be loaded (${error}): check the connection` }));

/** @param {Order} order */
async function start(order) {
  await loaded;
  const session = await Session.open(order.canvas);
  engine = new Engine(session, order.canvas, say, fail);
  session.theme(order.dark);
  engine.screen.resize(order.width, order.height, order.ratio);
  const device = JSON.parse(session.device());
  if (device.missing) engine.screen.plain(order.canvas);
  say({ about: "device", device });
}

/**
 * Loads a scene. Settings that it does not take are left out and named.
 *
 * @param {Engine} engine
 * @param {Order} order
 */
function load(engine, order) {
  const { session } = engine;
  const next = order.again && source ? source : order.own ?? { name: order.name, text: order.text, files: {} };
  const request = { name: next.name, text: next.text, settings: order.settings, mesh: order.mesh };
  /** @type {string[]} */
  const problems = [];
  try {
    session.load(JSON.stringify(request), next.files, next.balance);
  } catch (error) {
    if (error instanceof WebAssembly.RuntimeError || order.settings.length === 0) throw error;
    // One of the settings, or the scene itself: without any of them the scene is heard for itself.
    session.load(JSON.stringify({ ...request, settings: [] }), next.files, next.balance);
    for (const [key, value] of order.settings) attempt(problems, key, () => session.set(0, key, value));
  }
  source = next;
  if (order.beside) besides(session, order.beside, problems);
  if (!order.again) engine.screen.home();
  const about = JSON.parse(session.loaded());
  engine.began({ frame: about.frame, measure: order.measure });
  return { ...state(engine), problems };
}

/**
 * @param {string[]} problems
 * @param {string} key
 * @param {() => void} work
 */
function attempt(problems, key, work) {
  try {
    work();
  } catch (error) {
    if (error instanceof WebAssembly.RuntimeError) throw error;
    const text = error instanceof Error ? error.message : String(error);
    problems.push(text.includes(key) ? text : `${key}: ${text}`);
  }
}

/**
 * @param {Session} session
 * @param {[string, string][]} pairs
 * @param {string[]} problems
 */
function besides(session, pairs, problems) {
  try {
    session.beside(JSON.stringify(pairs));
  } catch (error) {
    if (error instanceof WebAssembly.RuntimeError) throw error;
    session.beside("[]");
    for (const [key, value] of pairs) attempt(problems, `b.${key}`, () => session.set(1, key, value));
  }
}

const MATERIAL = ["model", "young", "poisson", "density", "viscosity"];

/** What is loaded and how everything is set. @param {Engine} engine */
function state({ session }) {
  const about = JSON.parse(session.loaded());
  /** @type {string[]} */
  const keys = JSON.parse(settings()).map((/** @type {{key: string}} */ setting) => setting.key);
  for (const body of about.bodies) keys.push(...MATERIAL.map((name) => `body.${body.name}.material.${name}`));
  const values = [];
  for (let run = 0; run < session.runs(); run += 1) {
    /** @type {Record<string, string>} */
    const of = {};
    for (const key of keys) attempt([], key, () => (of[key] = session.setting(run, key)));
    values.push(of);
  }
  return { loaded: about, values };
}

/**
 * @param {Engine} engine
 * @param {Order} order
 * @returns {any} the answer
 */
function obey(engine, order) {
  const { session, hands, screen } = engine;
  switch (order.do) {
    case "load":
      return load(engine, order);
    case "set":
      for (const run of order.runs) session.setAll(run, JSON.stringify(order.settings));
      if (!order.choice) engine.doNotChoose();
      engine.changed();
      return state(engine);
    case "beside":
      session.beside(order.settings ? JSON.stringify(order.settings) : undefined);
      engine.doNotChoose();
      engine.changed();
      return state(engine);
    case "state":
      return state(engine);
    case "report":
      return engine.report(performance.now());
    case "reset":
      return engine.reset();
    case "play":
      return engine.play(order.on);
    case "step":
      return engine.step(order.count);
    case "speed":
      engine.pace.speed = order.speed;
      return;
    case "show":
      return engine.show(order.on);
    case "grip":
      return session.grip(order.count, order.stiffness, order.rigid);
    case "letGo":
      return hands.letGo(order.hold);
    case "takeTool":
      return session.takeTool(order.number);
    case "activateTool":
      return session.activateTool(order.hand);
    case "drag":
      hands.drag = order.kind;
      return;
    case "jaws":
      return session.openJaws(order.by);
    case "lockJaws":
      return session.lockJaws();
    case "putAway":
      return session.putAway();
    case "lose":
      return session.loseDevice();
    case "replay":
      return session.replay();
    case "vertices":
      return session.vertices(order.run ?? 0);
    case "positions":
      return session.positions(order.run ?? 0).slice();
    case "isTissue": {
      const hold = hands.gestures.number();
      const isTissue = session.grab(hold, order.x * screen.scale, order.y * screen.scale);
      if (isTissue) session.release(hold);
      return isTissue;
    }
    case "panic":
      throw new WebAssembly.RuntimeError("a test asked for it");
    default:
      return look(engine, order);
  }
}

/**
 * Pointers, keys and what the view shows.
 *
 * @param {Engine} engine
 * @param {Order} order
 */
function look(engine, order) {
  const { session, hands, screen } = engine;
  const { gestures } = hands;
  const pointer = { id: order.pointer, x: order.x, y: order.y, button: order.button, shift: order.shift, touch: order.touch };
  switch (order.do) {
    case "down":
      return gestures.down(pointer);
    case "move":
      return gestures.move(pointer);
    case "up":
      return gestures.up(pointer, order.keep);
    case "cancel":
      return gestures.cancel(order.pointer);
    case "keyGrab":
      return hands.keyGrab();
    case "keyMove":
      return hands.keyMove(order.dx, order.dy, order.pan);
    case "zoom":
      return hands.zoom(order.factor);
    case "home":
      return screen.home();
    case "resize":
      return screen.resize(order.width, order.height, order.ratio);
    case "theme":
      return session.theme(order.dark);
    case "color":
      return session.color(order.kind);
    case "wireframe":
      return session.wireframe(order.on);
    default:
      throw new Error(`the worker knows no order “${order.do}”`);
  }
}

/** @param {Order} order */
async function take(order) {
  if (hasFailed) return;
  try {
    if (order.do === "module") return void takeModule(order.module);
    if (order.do === "start") await start(order);
    else if (order.do === "canvas") return void engine?.give(order.canvas);
    else if (!engine || engine.isBusy) return void waiting.push(order);
    const value = order.do === "start" ? true : await obey(/** @type {Engine} */ (engine), order);
    engine?.touch();
    if (order.id !== undefined) say({ about: "answer", id: order.id, value });
    if (order.do === "start") next();
  } catch (error) {
    const text = error instanceof Error ? error.message : String(error);
    if (order.id !== undefined) say({ about: "answer", id: order.id, error: text });
    if (error instanceof WebAssembly.RuntimeError) fail(error);
    else if (order.do === "start") say({ about: "fatal", text });
    else if (order.id === undefined) say({ about: "warn", text });
  }
}

/** What has waited goes on. */
function next() {
  for (const order of waiting.splice(0)) void take(order);
}

self.onmessage = (event) => void take(event.data);
