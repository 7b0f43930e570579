// How many points to draw: all of them while nothing moves; while it moves, as many as this device draws smoothly.
// A prefix of the points is an even sample of the whole, so fewer points still show the whole product.

const SMOOTH_MILLIS = 33;
const TOO_SLOW_MILLIS = 50;
const LEAST_POINTS = 25_000;

export class DrawBudget {
  #points = Number.POSITIVE_INFINITY;

  /** Points to draw of those that are there. */
  points(available: number, moving: boolean): number {
    return moving ? Math.min(available, this.#points) : available;
  }

  /** Learns from a frame that was drawn while moving. */
  learn(drawn: number, frameMillis: number): void {
    if (frameMillis > TOO_SLOW_MILLIS) {
      // Halve at most: one hiccup must not empty the picture.
      const factor = Math.max(0.5, SMOOTH_MILLIS / frameMillis);
      this.#points = Math.max(LEAST_POINTS, Math.floor(drawn * factor));
    } else if (frameMillis < SMOOTH_MILLIS * 0.7 && drawn >= this.#points) {
      this.#points = Math.floor(this.#points * 1.15);
    }
  }
}
