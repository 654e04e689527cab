import assert from "node:assert/strict";
import { test } from "node:test";
import { Trial, measureGpu } from "../page/trial.js";

test("a second is measured, without the first frames", () => {
  const trial = new Trial();
  let now = 0;
  for (let frame = 0; frame < 70; frame += 1) {
    now += 1000 / 60;
    assert.equal(trial.isDone(now), frame > 60, `frame ${frame}`);
    trial.add(frame < 3 ? 100 : 4, now);
  }
  assert.equal(trial.cost, 4);
});

test("a slow device is measured by a few frames", () => {
  const trial = new Trial();
  for (let frame = 0; frame < 7; frame += 1) {
    assert.ok(!trial.isDone(900 * frame));
    trial.add(900, 900 * frame);
  }
  assert.ok(trial.isDone(6300));
  assert.equal(trial.cost, 900);
});

/** A session whose device takes so many milliseconds for a frame. */
function session(device, runs, costs = 5) {
  const done = { beside: [], frames: 0 };
  const says = {
    device: () => JSON.stringify(device),
    runs: () => 1,
    report: () => JSON.stringify({ runs }),
    beside: (settings) => done.beside.push(settings),
    advance: (run) => {
      assert.equal(run, 1);
      done.frames += 1;
    },
    ready: () => true,
    settled: () => new Promise((over) => setTimeout(over, costs)),
  };
  return { done, says };
}
const DEVICE = { name: "a card", software: false, missing: null };
const RUNS = [{ onGpu: false }, { onGpu: true }];

test("a graphics device is measured beside the scene, which is left as it was", async () => {
  const { done, says } = session(DEVICE, RUNS);
  const cost = await measureGpu(says);
  assert.ok(cost >= 4.5 && cost < 60, `${cost} ms`);
  assert.deepEqual(done.beside, [JSON.stringify([["solver.device", "gpu"]]), undefined]);
});

test("no device, software, or a scene that the device cannot compute: nothing is measured", async () => {
  for (const device of [{ missing: "none" }, { ...DEVICE, software: true }]) {
    const { done, says } = session(device, RUNS);
    assert.equal(await measureGpu(says), null);
    assert.equal(done.beside.length, 0);
  }
  const { done, says } = session(DEVICE, [RUNS[0], { onGpu: false }]);
  assert.equal(await measureGpu(says), null);
  assert.equal(done.frames, 0);
  assert.equal(done.beside.at(-1), undefined);
  const refuses = session(DEVICE, RUNS).says;
  refuses.advance = () => {
    throw new Error("this law is not for devices");
  };
  assert.equal(await measureGpu(refuses), null);
});
