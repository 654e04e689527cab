import assert from "node:assert/strict";
import { test } from "node:test";
import { emptyLink, parseLink, problemText, put, writeLink } from "../page/link.js";

const KNOWN = {
  scenes: ["liver_lifted", "twist"],
  settings: [
    { key: "solver.method", kind: "choice", values: ["auto", "xpbd", "explicit", "quasi_newton"] },
    { key: "solver.iterations", kind: "number", values: null },
    { key: "solver.accuracy", kind: "number", values: ["draft", "standard", "fine"] },
    { key: "world.gravity", kind: "text", values: null },
  ],
};

test("a link is read as it was written", () => {
  const link = {
    ...emptyLink(),
    scene: "twist",
    settings: [["solver.method", "xpbd"], ["body.bar.material.young", "5.1 kPa"], ["world.gravity", '[0, 0, "-9.81 m/s^2"]']],
    beside: [["solver.method", "explicit"]],
    mesh: 1.4,
    color: "strain",
    wireframe: true,
  };
  const { link: read, problems } = parseLink(writeLink(link), KNOWN);
  assert.deepEqual(problems, []);
  assert.deepEqual(read, link);
});

test("two simulations with the same settings stay two", () => {
  const { link } = parseLink(writeLink({ ...emptyLink(), beside: [] }), KNOWN);
  assert.deepEqual(link.beside, []);
  assert.equal(parseLink("#scene=twist", KNOWN).link.beside, null);
});

test("a file of one's own is named, with its settings and no scene", () => {
  const link = { ...emptyLink(), own: "liver.msh", settings: [["body.tissue.material.young", "8 kPa"]] };
  const written = writeLink(link);
  assert.ok(!written.includes("scene="));
  assert.deepEqual(parseLink(written, KNOWN), { link, problems: [] });
  assert.match(parseLink("#own=", KNOWN).problems[0], /no name of a file/);
});

test("an empty link is the first scene, whose mesh is still to be chosen", () => {
  for (const hash of ["", "#"]) {
    const { link, problems } = parseLink(hash, KNOWN);
    assert.deepEqual(problems, []);
    assert.equal(link.scene, "liver_lifted");
    assert.equal(link.mesh, null);
  }
});

const NONSENSE = [
  ["scene=nowhere", /scene “nowhere”.*twist/],
  ["mesh=0", /mesh “0”/],
  ["mesh=", /mesh “”/],
  ["mesh=NaN", /mesh “NaN”/],
  ["mesh=1e9", /mesh “1e9”/],
  ["color=plaid", /colouring “plaid”/],
  ["wireframe=yes", /wireframe is 1 or 0/],
  ["solver.method=magic", /solver.method: “magic” is none of auto/],
  ["solver.iterations=many", /solver.iterations: “many” is no number/],
  ["solver.nothing=1", /no setting “solver.nothing”/],
  ["__proto__=1", /no setting “__proto__”/],
  ["constructor=1", /no setting “constructor”/],
  ["body.bar.material.colour=red", /no setting/],
  ["body.bar.material.young=5%00kPa", /cannot be a value/],
  ["body.bar.material.young=", /cannot be a value/],
  [`solver.accuracy=${"9".repeat(200)}`, /cannot be a value/],
  ["b.world.gravity=0", /differ in solver settings only/],
  ["%3Cscript%3E=1", /no setting “<script>”/],
  ["scene=twist&scene=twist", /“scene” stands in it twice/],
];

for (const [part, message] of NONSENSE) {
  test(`what is wrong is named and what is right is used: ${part.slice(0, 40)}`, () => {
    const { link, problems } = parseLink(`#${part}&solver.accuracy=fine`, KNOWN);
    if (part.startsWith("solver.accuracy")) assert.deepEqual(link.settings, []);
    else assert.deepEqual(link.settings, [["solver.accuracy", "fine"]]);
    assert.match(problems[0], message);
    assert.equal(link.mesh, null);
  });
}

test("a link without end is not read", () => {
  const { link, problems } = parseLink(`#scene=twist&x=${"y".repeat(9000)}`, KNOWN);
  assert.equal(link.scene, "liver_lifted");
  assert.equal(problems.length, 1);
});

test("many problems are one message that stays short", () => {
  const many = Array.from({ length: 30 }, (_, at) => `x${at}=${at}`).join("&");
  const text = problemText(parseLink(`#${many}`, KNOWN).problems);
  assert.match(text, /and 26 more\. The rest of it is used\.$/);
  assert.ok(text.length < 400);
});

test("a setting is put in its place", () => {
  /** @type {[string, string][]} */
  const settings = [["a", "1"], ["b", "2"]];
  put(settings, "a", "3");
  put(settings, "c", "4");
  assert.deepEqual(settings, [["a", "3"], ["b", "2"], ["c", "4"]]);
});
