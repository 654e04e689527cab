import assert from "node:assert/strict";
import { test } from "node:test";
import { Mean, Pace } from "../page/loop.js";
import { ticks } from "../page/plots.js";
import { numberIn } from "../page/rows.js";

/** Frames for pictures at these intervals [ms]. */
function frames(pace, intervals) {
  let now = 1000;
  pace.due(now);
  return intervals.map((interval) => {
    now += interval;
    return pace.due(now);
  });
}

test("a display at sixty, or nearly, gets one frame for each picture", () => {
  for (const interval of [1000 / 60, 1000 / 59.94, 16.5, 17]) {
    assert.deepEqual(new Set(frames(new Pace(), Array(200).fill(interval))), new Set([1]));
  }
});

test("time is real on displays at 30, 120 and 144 pictures a second", () => {
  for (const rate of [30, 120, 144]) {
    const sum = frames(new Pace(), Array(10 * rate).fill(1000 / rate)).reduce((a, b) => a + b, 0);
    assert.ok(Math.abs(sum - 600) <= 1, `${rate}: ${sum}`);
  }
});

test("lost time is not caught up", () => {
  const due = frames(new Pace(), [1000 / 60, 5000, 1000 / 60, 1000 / 60, 1000 / 60]);
  assert.deepEqual(due, [1, 2, 1, 1, 1]);
});

test("half the speed is half the frames", () => {
  const pace = new Pace();
  pace.speed = 0.5;
  assert.equal(frames(pace, Array(120).fill(1000 / 60)).reduce((a, b) => a + b, 0), 60);
});

test("a mean is of what came since, and of the last time where nothing came", () => {
  const mean = new Mean();
  assert.equal(mean.take(), null);
  mean.add(1);
  mean.add(3);
  assert.equal(mean.take(), 2);
  assert.equal(mean.take(), 2);
});

test("axes are marked at round numbers, ends included", () => {
  assert.deepEqual(ticks(0, 10, 4), [0, 5, 10]);
  assert.deepEqual(ticks(0, 8.4, 4), [0, 5]);
  assert.deepEqual(ticks(0, 0.1, 5).map((mark) => Number(mark.toFixed(9))), [0, 0.02, 0.04, 0.06, 0.08, 0.1]);
});

test("values of a scene file are read in the unit of their row", () => {
  assert.equal(numberIn('"5100 Pa"', "kPa"), 5.1);
  assert.equal(numberIn("0.45", ""), 0.45);
  assert.equal(numberIn("1e3 Pa", "kPa"), 1);
  assert.ok(Number.isNaN(numberIn("auto", "")));
  assert.ok(Number.isNaN(numberIn("5 furlongs", "kPa")));
});
