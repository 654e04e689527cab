/** What the wasm module exports: `viscera.js`, which wasm-bindgen writes beside the page's files. */

/** Loads the module; to be awaited before anything else. */
export default function init(options: {
  module_or_path: URL | string | Request | Response | ArrayBuffer | WebAssembly.Module;
}): Promise<{ memory: WebAssembly.Memory }>;
export function scenes(): string;
export function settings(): string;
export function presets(): string;
export function limits(): string;
export function choose(measured: string): string;

export class Session {
  private constructor();
  static open(canvas?: OffscreenCanvas): Promise<Session>;
  static onCpu(): Session;
  device(): string;
  lost(): string | undefined;
  reopen(canvas?: OffscreenCanvas): Promise<void>;
  load(request: string, files: Record<string, Uint8Array>, balance?: Uint8Array): void;
  loaded(): string;
  loseDevice(): void;
  set(run: number, key: string, value: string): void;
  setAll(run: number, settings: string): void;
  setting(run: number, key: string): string;
  reset(): void;
  beside(settings?: string): void;
  runs(): number;
  ready(): boolean;
  advance(run: number): void;
  settled(): Promise<void>;
  measure(): void;
  report(): string;
  grip(count: number, stiffness: number, rigid: boolean): void;
  grab(id: number, x: number, y: number): boolean;
  lead(id: number, x: number, y: number): void;
  grabAt(id: number, x: number, y: number, z: number): boolean;
  leadBy(id: number, dx: number, dy: number, dz: number): void;
  tray(): string;
  inHand(): string;
  told(): string | undefined;
  takeTool(number: number): void;
  pressTool(x: number, y: number, anywhere: boolean): boolean;
  dragTool(x0: number, y0: number, x1: number, y1: number, kind: string): void;
  openJaws(by: number): void;
  lockJaws(): void;
  activateTool(hand?: number): void;
  putAway(): void;
  release(id: number): void;
  force(id: number): Float64Array;
  orbit(dx: number, dy: number): void;
  pan(dx: number, dy: number): void;
  zoom(factor: number): void;
  home(): void;
  resize(width: number, height: number): void;
  theme(dark: boolean): void;
  color(kind: string): void;
  wireframe(on: boolean): void;
  legend(): string;
  draw(): void;
  pixels(): Uint8ClampedArray<ArrayBuffer>;
  positions(run: number): Float32Array;
  triangles(): Uint32Array;
  vertices(run: number): Float32Array;
  replay(): string;
  ray(x: number, y: number): Float64Array;
  seen(run: number, x: number, y: number, z: number): Float64Array;
  free(): void;
}
