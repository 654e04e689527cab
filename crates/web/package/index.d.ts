/**
 * Soft tissue in real time. Everything is in SI units: metres, seconds, newtons, pascals, kilograms; +z is up.
 *
 * @packageDocumentation
 */

/** A point or a vector: x, y, z. Points in metres, forces in newtons. */
export type Vector = [number, number, number];

/** What to load. */
export interface LoadOptions {
  /**
   * A built-in scene by its name ({@link scenes} lists them), or a scene file's name and text. Where only
   * {@link LoadOptions.mesh} is given, a scene is made around that: materials by its name, held where organs are.
   */
  scene?: string | { name: string; text: string };
  /** Files that the scene names, by the names it uses: meshes as bytes, in every format that the program reads. */
  files?: Record<string, Uint8Array>;
  /**
   * Settings laid over the scene file, by its keys: `{"body.liver.material.young": "8 kPa", "solver.accuracy": "draft"}`.
   * Numbers without a unit are given as text or number; {@link settings} lists keys and what they take.
   */
  settings?: Record<string, string | number | boolean>;
  /** A mesh, a surface or a segmented scan of one's own, in place of a scene. A mesh's unit is guessed from its size: an organ's. */
  mesh?: { name: string; bytes: Uint8Array };
  /** Factor of the element size of bodies that the scene describes by a shape: 1 as it says, 1.4 coarser, 0.7 finer. Default 1. */
  cells?: number;
  /**
   * Where the module `viscera_bg.wasm` lies, where it is not beside `index.js`: an address, its bytes, or it compiled. Only the
   * first call of {@link load} uses it.
   */
  wasm?: string | URL | Response | ArrayBuffer | Uint8Array<ArrayBuffer> | WebAssembly.Module;
  /** The same for `viscera_files_bg.wasm`, the second module: it is loaded where files of one's own are given. */
  filesWasm?: string | URL | Response | ArrayBuffer | Uint8Array<ArrayBuffer> | WebAssembly.Module;
}

/** How a hand takes hold. */
export interface GrabOptions {
  /** How many vertices, those nearest to the point. Default 8. */
  vertices?: number;
  /** Total stiffness of the springs between hand and tissue [N/m]. Default 5000. */
  stiffness?: number;
  /** Hold without springs. Default false. */
  rigid?: boolean;
}

/** A hand on the tissue. */
export interface Grip {
  /** Leads the hand to a point [m]. The point where it took hold is where it begins. */
  lead(to: Readonly<Vector>): void;
  /** Lets go. Nothing happens the second time. */
  release(): void;
  /** Force of the hand on the tissue after the last frame [N]. */
  readonly force: Vector;
  /** Where it took hold [m]. */
  readonly taken: Vector;
}

/** How a frame was computed. */
export interface Report {
  /** Simulated time [s]. */
  time: number;
  /** What computes, and why. */
  device: string;
  /** The method in force: "quasi_newton", "xpbd", "explicit". */
  method: string;
  /** Steps per frame. */
  substeps: number;
  /** Iterations per step. */
  iterations: number;
  /** Unbalanced forces over loads, measured ten times a second; at rest, how well the equations hold. Null before the first frame. */
  residual: number | null;
  /** Tetrahedra turned inside out: their stress means nothing. */
  inverted: number;
  /** What the scene itself moves or pulls, with its force on the tissue [N], measured ten times a second. */
  patches: { name: string; force: Vector }[];
  /**
   * The scene's tools: working end [m], force on the tissue and what it may be off by [N], size of the torque about the working
   * end [N m].
   */
  tools: { name: string; place: Vector; force: Vector; error: number | null; torque: number; touches: number }[];
  /** Work of tools on the tissue and stored energy [J]; null where there are no tools. */
  ledger: { work: number; surplus: number; stored: number; mostStored: number } | null;
}

/** A scene in motion. */
export interface Tissue {
  /** Its title. */
  readonly title: string;
  /** Tetrahedra, vertices of the tetrahedra. */
  readonly size: { tetrahedra: number; vertices: number };
  /** Duration of a frame [s], mostly 1/60. */
  readonly frame: number;
  /** Simulated time [s]. */
  readonly time: number;
  /** Names and numbers of its bodies: stiffness `young` [Pa], Poisson's ratio, density [kg/m^3]. */
  readonly bodies: { name: string; young: number; poisson: number; density: number; preset: string | null }[];
  /**
   * Vertices of the surface [m], three numbers each, as they are now. A view of the module's memory, valid until the next call:
   * read it anew each frame, and copy what you want to keep.
   */
  readonly positions: Float32Array;
  /** Triangles of the surface, three numbers of vertices each, outside counterclockwise. The same array every time. */
  readonly triangles: Uint32Array;
  /** Sum of the forces of all hands on the tissue [N]. */
  readonly force: Vector;
  /** Changes a setting while it runs: `set("body.liver.material.young", "8 kPa")`. Throws what is wrong; then nothing has changed. */
  set(key: string, value: string | number | boolean): void;
  /** A setting of the solver, or of a material, as it stands. */
  get(key: string): string;
  /** Computes frames now. Default one. Callbacks of {@link onFrame} are called once, after the last of them. */
  step(frames?: number): void;
  /** Takes hold of the tissue near a point [m]. Throws where there is none within a centimetre. */
  grab(at: Readonly<Vector>, options?: GrabOptions): Grip;
  /** The surface vertex nearest to a point [m], or, with a direction, the first that a ray passes by. */
  nearest(from: Readonly<Vector>, direction?: Readonly<Vector>): Vector;
  /** Calls back after every frame that was computed. Returns a function that ends it. */
  onFrame(callback: (tissue: Tissue) => void): () => void;
  /** Runs in real time, by animation frames where there are some. At most two frames are computed at once; lost time is not made up. */
  start(): void;
  /** Pauses. */
  stop(): void;
  /** Whether it runs. */
  readonly running: boolean;
  /** Begins again from rest; hands let go. */
  reset(): void;
  /** How it stands. */
  report(): Report;
  /** A scene file that repeats everything done here: `viscera run` takes it. */
  save(): string;
  /** Ends it and frees its memory. */
  dispose(): void;
}

/** Loads a scene, from rest. Rejects with an `Error` whose message names the place and what to do. */
export function load(options?: LoadOptions): Promise<Tissue>;
/** The built-in scenes. */
export function scenes(): Promise<{ name: string; title: string; description: string; text: string }[]>;
/** Settings of solver and world: key, meaning, names to choose from, default. */
export function settings(): Promise<{ key: string; about: string; values: string[] | null; kind: "choice" | "number" | "text"; default: string }[]>;
/** Tissues of the literature: `young` [Pa], `density` [kg/m^3], with their source. */
export function presets(): Promise<{ name: string; about: string; young: number; poisson: number; density: number; model: string }[]>;
