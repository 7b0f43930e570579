// Decides which hints are said aloud: only those that have stood a while, none twice, and never one on the heels of another.
import type { Hint } from "../daemon/types";

const STEADY_MILLIS = 1200;
const PAUSE_MILLIS = 4000;

export class Speaker {
  #steady = { key: "", since: 0 };
  #saidKey = "";
  #saidAt = Number.NEGATIVE_INFINITY;

  /** The words to say now, or null. The hints' codes count, for their numbers change with every picture. */
  next(hints: readonly Hint[], nowMillis: number): string | null {
    const key = hints.map(({ code }) => code).join(" ");
    if (key !== this.#steady.key) this.#steady = { key, since: nowMillis };
    if (key === "" || key === this.#saidKey) return null;
    if (nowMillis - this.#steady.since < STEADY_MILLIS || nowMillis - this.#saidAt < PAUSE_MILLIS)
      return null;
    this.#saidKey = key;
    this.#saidAt = nowMillis;
    return hints.map(({ text }) => text).join(" ");
  }
}
