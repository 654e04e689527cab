import assert from "node:assert/strict";
import { test } from "node:test";
import { Gestures } from "../page/gestures.js";

/** Tissue lies where x is below 100. Notes what is done. */
function hands() {
  /** @type {any[]} */
  const done = [];
  const note = (name) => (...what) => void done.push([name, ...what]);
  const grab = (id, x, y) => {
    done.push(["grab", id, x, y]);
    return x < 100;
  };
  /** What instrument is in hand, where x is above 300. */
  const held = { instrument: false };
  const press = (x, y, anywhere) => held.instrument && (anywhere || x > 300);
  const gestures = new Gestures({ grab, press, drag: note("drag"), lead: note("lead"), release: note("release"), orbit: note("orbit"), pan: note("pan"), zoom: note("zoom") });
  return { done, gestures, held };
}

test("one finger on tissue pulls and lets go", () => {
  const { done, gestures } = hands();
  gestures.down({ id: 7, x: 50, y: 50 });
  assert.equal(gestures.mode, "pull");
  assert.equal(gestures.hold, 1);
  gestures.move({ id: 7, x: 60, y: 40 });
  gestures.up({ id: 7, x: 60, y: 40 });
  assert.deepEqual(done, [["grab", 1, 50, 50], ["lead", 1, 60, 40], ["release", 1, false]]);
  assert.equal(gestures.mode, "idle");
});

test("one finger beside tissue turns the view", () => {
  const { done, gestures } = hands();
  gestures.down({ id: 1, x: 200, y: 50 });
  gestures.move({ id: 1, x: 205, y: 47 });
  gestures.up({ id: 1, x: 205, y: 47 });
  assert.deepEqual(done.slice(1), [["orbit", 5, -3]]);
});

test("every hold has a number of its own", () => {
  const { done, gestures } = hands();
  for (let press = 0; press < 2; press += 1) {
    gestures.down({ id: 1, x: 5, y: 5 });
    gestures.up({ id: 1, x: 5, y: 5 });
  }
  assert.deepEqual(done.filter(([what]) => what === "grab").map(([, id]) => id), [1, 2]);
});

test("a second finger ends the pull, and both turn and zoom", () => {
  const { done, gestures } = hands();
  gestures.down({ id: 1, x: 50, y: 50 });
  gestures.down({ id: 2, x: 150, y: 50 });
  assert.equal(gestures.mode, "fingers");
  assert.equal(gestures.hold, 0);
  gestures.move({ id: 2, x: 250, y: 50 });
  assert.deepEqual(done, [["grab", 1, 50, 50], ["release", 1, false], ["orbit", 50, 0], ["zoom", 2]]);
});

test("after two fingers the one that is left takes hold of nothing", () => {
  const { done, gestures } = hands();
  gestures.down({ id: 1, x: 50, y: 50 });
  gestures.down({ id: 2, x: 60, y: 50 });
  gestures.up({ id: 2, x: 60, y: 50 });
  done.length = 0;
  gestures.move({ id: 1, x: 55, y: 50 });
  gestures.up({ id: 1, x: 55, y: 50 });
  assert.deepEqual(done, [["orbit", 5, 0]]);
  assert.equal(gestures.mode, "idle");
});

test("two fingers that move alike turn without a zoom", () => {
  const { done, gestures } = hands();
  gestures.down({ id: 1, x: 200, y: 50 });
  gestures.down({ id: 2, x: 300, y: 50 });
  done.length = 0;
  for (const id of [1, 2]) gestures.move({ id, x: 210 + 100 * (id - 1), y: 50 });
  const turned = done.filter(([what]) => what === "orbit").reduce((sum, [, dx]) => sum + dx, 0);
  const zoomed = done.filter(([what]) => what === "zoom").reduce((product, [, factor]) => product * factor, 1);
  assert.equal(turned, 10);
  assert.ok(Math.abs(zoomed - 1) < 1e-12);
});

test("three fingers, the other buttons and Shift move the view", () => {
  const { done, gestures } = hands();
  for (const id of [1, 2, 3]) gestures.down({ id, x: 200 + id, y: 50 });
  gestures.move({ id: 3, x: 206, y: 50 });
  assert.deepEqual(done.at(-1), ["pan", 1, 0]);
  for (const press of [{ button: 1 }, { button: 2 }, { button: 0, shift: true }]) {
    const { done, gestures } = hands();
    gestures.down({ id: 1, x: 50, y: 50, ...press });
    gestures.move({ id: 1, x: 51, y: 52, ...press });
    assert.deepEqual(done, [["pan", 1, 2]]);
  }
});

test("the system takes the pointer away: the pull ends, and what comes after is heard of no more", () => {
  const { done, gestures } = hands();
  gestures.down({ id: 1, x: 50, y: 50 });
  gestures.cancel(1);
  gestures.move({ id: 1, x: 60, y: 50 });
  gestures.up({ id: 1, x: 60, y: 50 });
  assert.deepEqual(done, [["grab", 1, 50, 50], ["release", 1, false]]);
  assert.equal(gestures.mode, "idle");
});

test("Shift at release, or the box, keeps the hold", () => {
  for (const [shift, keep] of [[true, false], [false, true]]) {
    const { done, gestures } = hands();
    gestures.down({ id: 1, x: 50, y: 50 });
    gestures.up({ id: 1, x: 50, y: 50, shift }, keep);
    assert.deepEqual(done.at(-1), ["release", 1, true]);
  }
});

test("a hidden tab lets go of everything", () => {
  const { done, gestures } = hands();
  gestures.down({ id: 1, x: 50, y: 50 });
  gestures.cancelAll();
  assert.deepEqual(done.at(-1), ["release", 1, false]);
  assert.equal(gestures.mode, "idle");
});

test("with an instrument in hand one finger leads it wherever it is, and two turn the view", () => {
  const { done, gestures, held } = hands();
  held.instrument = true;
  gestures.down({ id: 1, x: 50, y: 50, touch: true });
  assert.equal(gestures.mode, "lead");
  gestures.move({ id: 1, x: 53, y: 48 });
  assert.equal(done[0][0], "drag");
  assert.deepEqual([done[0][1].x, done[0][1].y, done[0][2].x, done[0][2].y], [50, 50, 53, 48]);
  gestures.down({ id: 2, x: 80, y: 50, touch: true });
  gestures.move({ id: 2, x: 84, y: 50 });
  assert.deepEqual(done[1], ["orbit", 2, 0]);
  gestures.up({ id: 2, x: 84, y: 50 });
  gestures.up({ id: 1, x: 53, y: 48 });
  assert.equal(gestures.mode, "idle");
});

test("a mouse leads an instrument where it presses on one, and pulls tissue elsewhere", () => {
  const { done, gestures, held } = hands();
  held.instrument = true;
  gestures.down({ id: 1, x: 50, y: 50 });
  assert.equal(gestures.mode, "pull");
  gestures.up({ id: 1, x: 50, y: 50 });
  gestures.down({ id: 1, x: 320, y: 50 });
  assert.equal(gestures.mode, "lead");
  gestures.cancel(1);
  assert.equal(gestures.mode, "idle");
  assert.deepEqual(done.map(([what]) => what), ["grab", "release"]);
});
