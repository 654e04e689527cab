/** The page's side of the worker: orders go out, answers and news come back. */

import { first, startWorker } from "./boot.js";

/** @typedef {{about: string, [key: string]: any}} Word */

export class Host {
  /** @type {Worker | null} */
  #worker = null;
  /** @type {(word: Word) => void} */
  #hear;
  /** @type {Map<number, {done: (value: any) => void, failed: (error: Error) => void}>} */
  #open = new Map();
  #orders = 0;

  /** @param {(word: Word) => void} hear gets everything that is no answer */
  constructor(hear) {
    this.#hear = hear;
  }

  /** Takes over the worker that has been started with the page, or starts another one. */
  start() {
    const taken = this.#worker ? null : first;
    this.#worker?.terminate();
    for (const call of this.#open.values()) call.failed(new Error("begun again"));
    this.#open.clear();
    const worker = taken?.worker ?? startWorker();
    this.#worker = worker;
    worker.onmessage = (event) => this.#take(event.data);
    worker.onerror = (event) => {
      event.preventDefault();
      const text = event.message || "The worker could not be loaded: check the connection, then start again.";
      this.#hear({ about: "fatal", text });
    };
    for (const word of taken?.early.splice(0) ?? []) this.#take(word);
  }

  /** @param {Word} word */
  #take(word) {
    if (word.about !== "answer") {
      this.#hear(word);
      return;
    }
    const call = this.#open.get(word.id);
    this.#open.delete(word.id);
    if ("error" in word) call?.failed(new Error(word.error));
    else call?.done(word.value);
  }

  /**
   * An order that nobody waits for.
   *
   * @param {string} what
   * @param {Record<string, unknown>} [fields]
   * @param {Transferable[]} [transfer]
   */
  send(what, fields = {}, transfer = []) {
    this.#worker?.postMessage({ ...fields, do: what }, transfer);
  }

  /**
   * An order with an answer.
   *
   * @param {string} what
   * @param {Record<string, unknown>} [fields]
   * @param {Transferable[]} [transfer]
   * @returns {Promise<any>}
   */
  call(what, fields = {}, transfer = []) {
    this.#orders += 1;
    const id = this.#orders;
    return new Promise((done, failed) => {
      this.#open.set(id, { done, failed });
      this.#worker?.postMessage({ ...fields, do: what, id }, transfer);
    });
  }
}
