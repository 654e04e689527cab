/** The page: wires buttons, panel, input and the worker together. */

import { App } from "./app.js";
import { missing } from "./boot.js";
import { Controls } from "./controls.js";
import { onDrop } from "./files.js";
import { showHelp } from "./help.js";
import { offerHook } from "./hook.js";
import { Host } from "./host.js";
import { Input, onKeys } from "./input.js";
import { Messages, byId, make } from "./messages.js";
import { save, share } from "./share.js";
import { Tray } from "./tray.js";
import { View } from "./view.js";

const messages = new Messages();
const host = new Host((word) => hear(word));
const app = new App(host, messages, () => refresh());
const controls = new Controls(byId("panel"), {
  set: (run, pairs) => void app.set(run, pairs),
  scene: (name) => void app.scene(name),
  mesh: (mesh) => void app.mesh(mesh),
  files: (files) => void app.files(files),
  color: (kind) => app.color(kind),
  wireframe: (on) => app.wireframe(on),
  home: () => host.send("home"),
  speed: (speed) => host.send("speed", { speed }),
  grip: ({ keep, ...grip }) => {
    input.keep = keep;
    host.send("grip", grip);
  },
  letGo: (hold) => host.send("letGo", { hold }),
  measure: () => void app.measure(),
});
const view = new View(controls, (hold) => host.send("letGo", { hold }));
const input = new Input(host);
const tray = new Tray(host);
const hook = offerHook(host, app, messages);
let playing = true;
/** @type {any} */
let device = null;

/** @param {{about: string, [key: string]: any}} word */
function hear(word) {
  switch (word.about) {
    case "hello":
      app.hello = word;
      controls.greet(/** @type {any} */ (word));
      void begin();
      break;
    case "device":
      tellDevice(word.device);
      break;
    case "report":
      playing = word.clock.playing;
      byId("loading").hidden = app.loaded !== null;
      view.show(/** @type {any} */ (word), input.place);
      tray.show(word.tools);
      hook.report(word);
      break;
    case "chosen":
      void app.choose(/** @type {any} */ (word));
      break;
    case "tell":
      messages.tell(word.text);
      break;
    case "warn":
      messages.warn(word.text);
      break;
    case "canvas":
      host.send("canvas", ...freshCanvas());
      break;
    case "stopped":
      messages.stop("The simulation has stopped", word.text, [["Begin again from rest", () => host.send("reset")]]);
      break;
    case "fatal":
      messages.stop("Something broke", `${word.text}. The scene and its settings are kept.`, [["Start again", () => restart()]]);
      break;
  }
}

/** The canvas, which only one worker can draw on, once: another one in its place. @returns {[Record<string, unknown>, Transferable[]]} */
function freshCanvas() {
  const old = byId("canvas");
  const fresh = /** @type {HTMLCanvasElement} */ (make("canvas", { id: "canvas" }));
  old.replaceWith(fresh);
  const canvas = fresh.transferControlToOffscreen();
  return [{ canvas }, [canvas]];
}

function area() {
  const { clientWidth: width, clientHeight: height } = byId("stage");
  return { width, height, ratio: window.devicePixelRatio || 1 };
}

/** The module is there: a device, a canvas, a scene. */
async function begin() {
  const [{ canvas }, transfer] = freshCanvas();
  try {
    await host.call("start", { canvas, dark: isDark(), ...area() }, transfer);
    await app.open();
    hook.begun();
  } catch {
    // The worker has said why.
  }
}

/** A new worker, with the scene and the settings that the address holds. */
function restart() {
  controls.force.forget();
  controls.residual.forget();
  host.start();
}

/** @param {any} now */
function tellDevice(now) {
  device = now;
  if (!now.missing) return;
  const http = window.isSecureContext ? "" : " This page came over plain http, where browsers offer no WebGPU: open it with https://.";
  messages.warn(`${now.missing}${http}`);
}

/** What is loaded or set has changed. */
function refresh() {
  const { loaded, values, link, own } = app;
  if (!loaded) return;
  controls.show({ loaded, values, link, own });
  view.frame = loaded.frame;
  byId("beside").setAttribute("aria-pressed", String(link.beside !== null));
  document.title = `${loaded.title || loaded.name} · viscera`;
  const lines = [];
  if (device?.missing) lines.push(device.missing);
  else if (device) lines.push(`Drawn by ${device.name}${device.software ? ", which is software" : ""}.`);
  if (app.chosen) lines.push(app.choiceText);
  controls.devices.querySelectorAll(".about").forEach((line) => line.remove());
  controls.devices.append(...lines.map((line) => make("p", { class: "about" }, line)));
}

// ---- colours ----

const preferred = matchMedia("(prefers-color-scheme: dark)");
/** What a person chose, over what the system says. @type {string | null} */
let chosenTheme = remembered("theme");

function isDark() {
  return chosenTheme ? chosenTheme === "dark" : preferred.matches;
}

function showTheme() {
  const dark = isDark();
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  byId("theme").setAttribute("aria-pressed", String(dark));
  host.send("theme", { dark });
}

/** @param {string} key */
function remembered(key) {
  try {
    return localStorage.getItem(`viscera.${key}`);
  } catch {
    // A browser that keeps nothing.
    return null;
  }
}

/**
 * @param {string} key
 * @param {string} value
 */
function remember(key, value) {
  try {
    localStorage.setItem(`viscera.${key}`, value);
  } catch {
    // As above.
  }
}

// ---- buttons and keys ----

function play() {
  playing = !playing;
  host.send("play", { on: playing });
}

function step() {
  if (playing) play();
  void host.call("step", { count: 1 }).catch(() => {});
}

function reset() {
  messages.clear();
  controls.force.forget();
  controls.residual.forget();
  host.send("reset");
}

/** @param {boolean} open */
function openPanel(open) {
  byId("app").classList.toggle("closed", !open);
  byId("settings").setAttribute("aria-expanded", String(open));
}

const isNarrow = () => matchMedia("(max-width: 760px)").matches;
const press = (/** @type {string} */ id, /** @type {() => void} */ act) => byId(id).addEventListener("click", act);
press("play", play);
press("step", step);
press("reset", reset);
press("beside", () => void app.beside());
press("settings", () => openPanel(byId("app").classList.contains("closed")));
press("share", () => void share(app, messages));
press("save", () => void save(app, host, messages));
press("help", showHelp);
press("theme", () => {
  chosenTheme = isDark() ? "light" : "dark";
  remember("theme", chosenTheme);
  showTheme();
});
press("skip", () => byId("canvas-frame").focus());
preferred.addEventListener("change", showTheme);
onKeys({
  " ": play,
  ".": step,
  r: reset,
  f: () => host.send("home"),
  Escape: () => host.send("letGo"),
  x: () => host.send("lockJaws"),
  n: () => host.send("activateTool"),
  Delete: () => host.send("putAway"),
  "?": showHelp,
  F1: showHelp,
});
input.onMove = () => view.follow(input.place);
input.onGrabKey = () => {
  const said = /** @type {Record<string, string>} */ ({
    held: "The tissue is held: arrow keys pull, Enter lets go.",
    released: "Let go.",
    "nothing there": "There is no tissue in the picture: press F to see all of it, then Enter.",
  });
  host.call("keyGrab").then((what) => messages.tell(said[what]), () => {});
};
onDrop((files) => void app.files(files));
new ResizeObserver(() => host.send("resize", area())).observe(byId("stage"));
document.addEventListener("visibilitychange", () => host.send("show", { on: !document.hidden }));
window.addEventListener("hashchange", () => void app.open());

openPanel(!isNarrow());
showTheme();
const why = missing();
if (why) messages.stop("This browser cannot run it", why);
else host.start();

// The page works without a network after the first visit.
if ("serviceWorker" in navigator && (location.protocol === "https:" || ["localhost", "127.0.0.1"].includes(location.hostname))) {
  navigator.serviceWorker.register("./offline.js").catch((error) => console.info(`not available offline: ${error}`));
}
