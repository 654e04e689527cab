/** Curves over the last seconds, on a small canvas: a linear or a logarithmic axis, crisp on every display, dark and light. */

/** Seconds of simulated time that a plot shows. */
const REMEMBERED = 12;
/** Samples kept: ten a second, with room for slow motion. */
const MOST = 400;
const MARGIN = { left: 48, right: 8, top: 8, bottom: 30 };
const FONT = "12px system-ui, sans-serif";

/**
 * @typedef {object} Curve
 * @property {string} name
 * @property {number} color which of the page's colours
 * @property {boolean} dashed
 * @property {number} value
 * @property {number | null} [error] what the value may be off by, drawn as a band
 */

/** @typedef {{marks: number[], share: (value: number) => number, text: (value: number) => string}} Axis */

/**
 * Values where an axis is marked: 1, 2 or 5 times a power of ten, at most `most` of them.
 *
 * @param {number} low
 * @param {number} high
 * @param {number} most
 */
export function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough * (1 - 1e-9)) ?? rough;
  const marks = [];
  for (let mark = Math.ceil(low / step - 1e-9); mark * step <= high + 1e-9 * step; mark += 1) marks.push(mark * step + 0);
  return marks;
}

export class Plot {
  canvas;
  #look;
  /** @type {{time: number, curves: Curve[]}[]} */
  #samples = [];

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {{title: string, logarithmic: boolean, least: number}} look `least`: the axis reaches at least to here
   */
  constructor(canvas, look) {
    this.canvas = canvas;
    this.#look = look;
  }

  /**
   * @param {number} time simulated [s]
   * @param {Curve[]} curves
   */
  push(time, curves) {
    const last = this.#samples.at(-1);
    if (last && time < last.time) this.#samples = [];
    if (last && time === last.time) this.#samples.pop();
    this.#samples.push({ time, curves });
    while (this.#samples.length > MOST || this.#samples[0].time < time - REMEMBERED) this.#samples.shift();
  }

  forget() {
    this.#samples = [];
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const context = this.canvas.getContext("2d");
    // Folded away.
    if (!context || width === 0 || height === 0) return;
    const ratio = window.devicePixelRatio || 1;
    const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== across || this.canvas.height !== down) {
      this.canvas.width = across;
      this.canvas.height = down;
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const style = getComputedStyle(document.documentElement);
    const color = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
    const area = { left: MARGIN.left, top: MARGIN.top, right: width - MARGIN.right, bottom: height - MARGIN.bottom };
    const now = this.#samples.at(-1)?.time ?? 0;
    const [from, to] = [Math.max(0, now - REMEMBERED), Math.max(now, REMEMBERED / 4)];
    const axis = this.#axis();
    const x = (/** @type {number} */ time) => area.left + ((time - from) / (to - from)) * (area.right - area.left);
    const y = (/** @type {number} */ value) => area.bottom - axis.share(value) * (area.bottom - area.top);
    context.font = FONT;
    context.lineWidth = 1;
    context.strokeStyle = color("--line");
    context.fillStyle = color("--quiet");
    this.#marks(context, area, ticks(from, to, 6), axis, x, y);
    context.save();
    context.beginPath();
    context.rect(area.left, area.top - 2, area.right - area.left, area.bottom - area.top + 4);
    context.clip();
    const colors = ["--pull", "--second", "--third", "--fourth"].map(color);
    for (const name of this.#names()) this.#curve(context, name, colors, x, y);
    context.restore();
  }

  /** Names of all curves that are to be seen. */
  #names() {
    return [...new Set(this.#samples.flatMap((sample) => sample.curves.map((curve) => curve.name)))];
  }

  /** @returns {Axis} */
  #axis() {
    const values = this.#samples.flatMap((sample) => sample.curves.map((curve) => curve.value)).filter((v) => v > 0 && v < Infinity);
    const { least, logarithmic } = this.#look;
    if (!logarithmic) {
      const high = 1.08 * Math.max(least, ...values);
      return { marks: ticks(0, high, 4), share: (/** @type {number} */ value) => value / high, text: (/** @type {number} */ v) => String(Number(v.toPrecision(3))) };
    }
    const high = Math.ceil(Math.log10(Math.max(least, ...values)) + 1e-9);
    const low = Math.min(high - 2, Math.floor(Math.log10(Math.min(least, ...values)) + 1e-9));
    const every = Math.ceil((high - low) / 4);
    const marks = [];
    for (let power = high; power >= low; power -= every) marks.push(10 ** power);
    const share = (/** @type {number} */ value) => (Math.log10(Math.max(value, 1e-30)) - low) / (high - low);
    return { marks, share, text: (/** @type {number} */ v) => `1e${Math.round(Math.log10(v))}` };
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {{left: number, top: number, right: number, bottom: number}} area
   * @param {number[]} times
   * @param {Axis} axis
   * @param {(time: number) => number} x
   * @param {(value: number) => number} y
   */
  #marks(context, area, times, axis, x, y) {
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const mark of axis.marks) {
      const at = Math.round(y(mark)) + 0.5;
      line(context, area.left, at, area.right, at);
      context.fillText(axis.text(mark), area.left - 5, at);
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const time of times) {
      const at = Math.round(x(time)) + 0.5;
      line(context, at, area.bottom, at, area.bottom + 4);
      context.fillText(String(Number(time.toPrecision(6))), at, area.bottom + 5);
    }
    context.textBaseline = "bottom";
    context.fillText("time in s", (area.left + area.right) / 2, area.bottom + MARGIN.bottom + 1);
    context.save();
    context.translate(2, (area.top + area.bottom) / 2);
    context.rotate(-Math.PI / 2);
    context.textBaseline = "top";
    context.fillText(this.#look.title, 0, 0);
    context.restore();
  }

  /**
   * From the value less its error to the value and its error, where errors are known.
   *
   * @param {CanvasRenderingContext2D} context
   * @param {string} name
   * @param {string[]} colors
   * @param {(time: number) => number} x
   * @param {(value: number) => number} y
   */
  #band(context, name, colors, x, y) {
    const known = this.#samples.flatMap(({ time, curves }) => {
      const curve = curves.find((curve) => curve.name === name);
      const error = curve?.error ?? NaN;
      return curve && Number.isFinite(curve.value + error) ? [{ time, value: curve.value, error, color: curve.color }] : [];
    });
    if (known.length < 2) return;
    context.beginPath();
    for (const { time, value, error } of known) context.lineTo(x(time), y(value + error));
    for (const { time, value, error } of known.reverse()) context.lineTo(x(time), y(Math.max(0, value - error)));
    context.closePath();
    context.globalAlpha = 0.25;
    context.fillStyle = colors[known[0].color % colors.length];
    context.fill();
    context.globalAlpha = 1;
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {string} name
   * @param {string[]} colors
   * @param {(time: number) => number} x
   * @param {(value: number) => number} y
   */
  #curve(context, name, colors, x, y) {
    this.#band(context, name, colors, x, y);
    context.beginPath();
    let isOpen = false;
    for (const { time, curves } of this.#samples) {
      const curve = curves.find((curve) => curve.name === name);
      if (!curve || !Number.isFinite(curve.value)) {
        isOpen = false;
        continue;
      }
      if (isOpen) context.lineTo(x(time), y(curve.value));
      else context.moveTo(x(time), y(curve.value));
      isOpen = true;
      context.strokeStyle = colors[curve.color % colors.length];
      context.setLineDash(curve.dashed ? [5, 4] : []);
    }
    context.lineWidth = 2;
    context.lineJoin = "round";
    context.stroke();
    context.setLineDash([]);
  }
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} x0
 * @param {number} y0
 * @param {number} x1
 * @param {number} y1
 */
function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}
