/**
 * What a link carries: a scene, settings, mesh size and view, written behind the `#` of the page's address.
 *
 *     #scene=twist&mesh=1.4&solver.method=xpbd&body.bar.material.young=8+kPa&b.solver.method=explicit&color=strain
 *
 * Keys are those of a scene file; `b.` begins those in which the second simulation of A | B differs. Anyone may have written
 * a link, so everything in it is checked, and what is wrong is named and left out.
 */

/** @typedef {[string, string]} Pair a key of a scene file and its value */
/**
 * @typedef {object} Link
 * @property {string} scene name of a built-in scene
 * @property {Pair[]} settings
 * @property {Pair[] | null} beside what the second simulation differs in; null: one simulation
 * @property {number | null} mesh factor of the element size; null: the page is to choose it
 * @property {string} color
 * @property {boolean} wireframe
 * @property {string | null} own name of a file of a person's own, which a link cannot carry; null: a built-in scene
 */
/**
 * @typedef {object} Known what there is to choose from
 * @property {string[]} scenes
 * @property {{key: string, kind: string, values: string[] | null}[]} settings
 */

/** The scene that a link without one shows: the retractor of `liver_retraction` is a tool, which the page does not draw. */
export const FIRST_SCENE = "liver_lifted";
export const COLORS = ["tissue", "displacement", "strain", "stress", "contact"];
/** Finest and coarsest mesh that the module takes: with half the edges a mesh has eight times the tetrahedra. */
export const MESH = { finest: 0.25, coarsest: 4 };

/** The longest link that is read: addresses beyond it were not written here. */
const LONGEST = 8000;
const LONGEST_VALUE = 120;
const MATERIAL = /^body\.[A-Za-z0-9_-]{1,64}\.material\.(preset|model|young|poisson|density|viscosity)$/;
/** Free text of a value: what scene files are written with, no control characters. */
const VALUE = /^[\x20-\x7e\u00b2\u00b3\u00b5]+$/;

/** @returns {Link} */
export function emptyLink() {
  return { scene: FIRST_SCENE, settings: [], beside: null, mesh: null, color: "tissue", wireframe: false, own: null };
}

/**
 * Reads a link.
 *
 * @param {string} hash with or without its `#`
 * @param {Known} known
 * @returns {{link: Link, problems: string[]}} what is right in it, and what is wrong, each part in words
 */
export function parseLink(hash, known) {
  const link = emptyLink();
  /** @type {string[]} */
  const problems = [];
  const text = hash.replace(/^#/, "");
  if (text.length > LONGEST) {
    problems.push(`it has ${text.length} characters, and at most ${LONGEST} are read`);
    return { link, problems };
  }
  const seen = new Set();
  for (const [key, value] of new URLSearchParams(text)) {
    if (seen.has(key)) {
      problems.push(`${shown(key)} stands in it twice; the first one holds`);
      continue;
    }
    seen.add(key);
    const problem = read(link, key, value, known);
    if (problem) problems.push(problem);
  }
  return { link, problems };
}

/**
 * @param {Link} link
 * @param {string} key
 * @param {string} value
 * @param {Known} known
 * @returns {string | null} what is wrong with it
 */
function read(link, key, value, known) {
  switch (key) {
    case "scene":
      if (!known.scenes.includes(value)) return `there is no scene ${shown(value)}: ${known.scenes.join(", ")}`;
      link.scene = value;
      return null;
    case "mesh": {
      const factor = Number(value);
      if (value.trim() === "" || !(factor >= MESH.finest && factor <= MESH.coarsest)) {
        return `mesh ${shown(value)} is no number from ${MESH.finest} to ${MESH.coarsest}`;
      }
      link.mesh = factor;
      return null;
    }
    case "color":
      if (!COLORS.includes(value)) return `there is no colouring ${shown(value)}: ${COLORS.join(", ")}`;
      link.color = value;
      return null;
    case "own":
      if (value.trim() === "" || value.length > LONGEST_VALUE) return `own ${shown(value)} is no name of a file`;
      link.own = value;
      return null;
    case "wireframe":
    case "beside":
      if (value !== "1" && value !== "0") return `${key} is 1 or 0, not ${shown(value)}`;
      if (key === "wireframe") link.wireframe = value === "1";
      else if (value === "1") link.beside ??= [];
      return null;
    default:
      return readSetting(link, key, value, known);
  }
}

/**
 * @param {Link} link
 * @param {string} key
 * @param {string} value
 * @param {Known} known
 * @returns {string | null}
 */
function readSetting(link, key, value, known) {
  const second = key.startsWith("b.");
  const name = second ? key.slice(2) : key;
  const setting = known.settings.find((setting) => setting.key === name);
  if (!setting && !MATERIAL.test(name)) return `there is no setting ${shown(key)}`;
  if (second && !name.startsWith("solver.")) return `${shown(key)}: A and B differ in solver settings only`;
  const problem = wrongValue(value, setting);
  if (problem) return `${key}: ${problem}`;
  if (second) (link.beside ??= []).push([name, value]);
  else link.settings.push([name, value]);
  return null;
}

/**
 * What can be seen of a value without a simulation; the rest is for the module to say.
 *
 * @param {string} value
 * @param {Known["settings"][number] | undefined} setting
 */
function wrongValue(value, setting) {
  if (value.length > LONGEST_VALUE || !VALUE.test(value)) return `${shown(value)} cannot be a value`;
  const bare = value.replace(/^"(.*)"$/, "$1");
  if (setting?.kind === "choice" && setting.values && !setting.values.includes(bare)) {
    return `${shown(value)} is none of ${setting.values.join(", ")}`;
  }
  const isName = bare === "auto" || setting?.values?.includes(bare);
  if (setting?.kind === "number" && !isName && !/^[-+.\d]/.test(bare)) return `${shown(value)} is no number`;
  return null;
}

/**
 * Writes a link, such that {@link parseLink} reads the same.
 *
 * @param {Link} link
 * @returns {string} with its `#`
 */
export function writeLink(link) {
  const parts = new URLSearchParams();
  if (link.own === null) parts.append("scene", link.scene);
  else parts.append("own", link.own);
  if (link.mesh !== null) parts.append("mesh", String(link.mesh));
  for (const [key, value] of link.settings) parts.append(key, value);
  if (link.beside) {
    if (link.beside.length === 0) parts.append("beside", "1");
    for (const [key, value] of link.beside) parts.append(`b.${key}`, value);
  }
  if (link.color !== "tissue") parts.append("color", link.color);
  if (link.wireframe) parts.append("wireframe", "1");
  return `#${parts}`;
}

/**
 * Sets a key in a list of settings, where it stands already in its place.
 *
 * @param {Pair[]} settings
 * @param {string} key
 * @param {string} value
 */
export function put(settings, key, value) {
  const known = settings.find((pair) => pair[0] === key);
  if (known) known[1] = value;
  else settings.push([key, value]);
}

/**
 * Problems as one message.
 *
 * @param {string[]} problems
 */
export function problemText(problems) {
  const count = problems.length;
  const listed = problems.slice(0, 4).join("; ");
  const more = count > 4 ? `; and ${count - 4} more` : "";
  return `This link has ${count === 1 ? "a part" : "parts"} that cannot be used: ${listed}${more}. The rest of it is used.`;
}

/**
 * Foreign text, short and in quotes.
 *
 * @param {string} text
 */
function shown(text) {
  const printable = text.replace(/[^\x20-\x7e\u00a0-\uffff]/g, "?");
  return `“${printable.length > 40 ? `${printable.slice(0, 40)}…` : printable}”`;
}
