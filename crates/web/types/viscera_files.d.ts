/** What the second wasm module exports: `viscera_files.js`, which wasm-bindgen writes beside the page's files. */

/** Loads the module; to be awaited before anything else. */
export default function init(options?: {
  module_or_path: URL | string | Request | Response | ArrayBuffer | WebAssembly.Module;
}): Promise<{ memory: WebAssembly.Memory }>;
export function prepare(
  request: string,
  files: Record<string, Uint8Array>,
  observe: (text: string) => void,
): Prepared;

export class Prepared {
  private constructor();
  readonly name: string;
  readonly text: string;
  readonly files: Record<string, Uint8Array>;
  readonly balance: Uint8Array | undefined;
  readonly notes: string[];
  free(): void;
}
