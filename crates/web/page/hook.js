/**
 * `window.viscera`: what a test of the page can see and do. Also of use in the browser's console.
 *
 *     await viscera.ready                      the first scene is loaded
 *     viscera.state()                          {frames, time, playing, report, costs, screen, pull, choosing, loaded, values, link, chosen, messages, card, own}
 *     await viscera.frame(n)                   when n more frames have been computed
 *     await viscera.step(n)                    pauses, and computes exactly n frames
 *     await viscera.pause(), viscera.run()
 *     await viscera.vertices(run)              Float32Array [m], three numbers each, of the tetrahedra
 *     await viscera.positions(run)             the same of the surface
 *     await viscera.replay()                   text of a scene that repeats everything
 *     await viscera.isTissue(x, y)             whether a press there, in CSS pixels of the window, would take hold
 *     viscera.pointAt(u, v)                    CSS pixels of the window of a place of the canvas: 0, 0 left above; 1, 1 right below
 *     viscera.scale                            pixels of the picture per CSS pixel
 *     await viscera.lose()                     takes the graphics device away, as a driver would
 *     viscera.panic()                          as if the module had died
 *     viscera.worker.post(what, fields)        any order to the worker (worker.js), answered
 */

import { byId } from "./messages.js";

/** @typedef {import("./host.js").Host} Host */

/**
 * @param {Host} host
 * @param {import("./app.js").App} app
 * @param {import("./messages.js").Messages} messages
 */
export function offerHook(host, app, messages) {
  /** @type {any} */
  let last = null;
  /** @type {() => void} */
  let begun = () => {};
  const ready = new Promise((done) => {
    begun = () => done(true);
  });
  /** @type {Set<() => void>} */
  const waiting = new Set();

  const state = () => ({
    frames: last?.clock.frames ?? 0,
    time: last?.report.time ?? 0,
    playing: last?.clock.playing ?? false,
    report: last?.report ?? null,
    costs: last?.costs ?? [],
    screen: last?.screen ?? null,
    pull: last?.pull ?? null,
    choosing: last?.choosing ?? false,
    loaded: app.loaded,
    values: app.values,
    link: app.link,
    chosen: app.chosen,
    own: app.own,
    messages: messages.texts,
    log: messages.log,
    card: messages.card,
  });
  const frame = (count = 1) => {
    const wanted = state().frames + count;
    return new Promise((done) => {
      const look = () => {
        if (state().frames < wanted) return;
        waiting.delete(look);
        done(state().frames);
      };
      waiting.add(look);
    });
  };
  const within = (/** @type {number} */ x, /** @type {number} */ y) => {
    const area = byId("canvas-frame").getBoundingClientRect();
    return { x: x - area.left, y: y - area.top };
  };
  const tools = {
    ready,
    state,
    frame,
    step: async (count = 1) => {
      await host.call("play", { on: false });
      await host.call("step", { count });
      await host.call("report");
      return state().frames;
    },
    pause: () => host.call("play", { on: false }),
    run: () => host.call("play", { on: true }),
    vertices: (run = 0) => host.call("vertices", { run }),
    positions: (run = 0) => host.call("positions", { run }),
    replay: () => host.call("replay"),
    isTissue: (/** @type {number} */ x, /** @type {number} */ y) => host.call("isTissue", within(x, y)),
    pointAt: (/** @type {number} */ u, /** @type {number} */ v) => {
      const area = byId("canvas-frame").getBoundingClientRect();
      return { x: area.left + u * area.width, y: area.top + v * area.height };
    },
    lose: () => host.call("lose"),
    panic: () => host.send("panic"),
    worker: { post: (/** @type {string} */ what, /** @type {any} */ fields) => host.call(what, fields) },
  };
  Object.assign(window, { viscera: tools });
  Object.defineProperty(tools, "scale", { get: () => last?.screen.scale ?? 1 });
  return {
    /** @param {any} report */
    report(report) {
      last = report;
      for (const look of waiting) look();
    },
    begun: () => begun(),
  };
}
