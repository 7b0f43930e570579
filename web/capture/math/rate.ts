// Pictures a second, over the last two seconds.

const WINDOW_MILLIS = 2000;

export class Rate {
  #times: number[] = [];

  note(nowMillis: number): void {
    this.#times.push(nowMillis);
    this.#forget(nowMillis);
  }

  perSecond(nowMillis: number): number {
    this.#forget(nowMillis);
    const [first] = this.#times;
    if (first === undefined || this.#times.length < 2) return 0;
    return ((this.#times.length - 1) * 1000) / Math.max(1, nowMillis - first);
  }

  #forget(nowMillis: number): void {
    this.#times = this.#times.filter((time) => nowMillis - time <= WINDOW_MILLIS);
  }
}
