// What every step gets and gives.
import type { Daemon } from "./daemon/client";
import type { Picture } from "./daemon/picture";
import type { State } from "./daemon/types";

export interface App {
  readonly daemon: Daemon;
  /** Sends an order; why it is not carried out is shown as an alert. Resolves to whether it is. */
  run(order: () => Promise<State>): Promise<boolean>;
  /** As `run`, but what goes wrong is the caller's to show. */
  take(order: () => Promise<State>): Promise<void>;
  /** Said aloud, politely. */
  say(text: string): void;
  fail(text: string): void;
  /** Between looking at the result and filling in the listing, which only this page tells apart. */
  openListing(open: boolean): void;
}

export interface Step {
  readonly content: HTMLElement;
  update(state: State): void;
  onPicture?(picture: Picture): void;
}

/** Everything a step starts ends with the signal. */
export type MakeStep = (app: App, state: State, signal: AbortSignal) => Step;

/** Calls `change` only where what `read` gives differs from last time, so that focus and reading aloud are left alone. */
export function whenChanged<T>(
  read: (state: State) => T,
  change: (value: T, state: State) => void,
): (state: State) => void {
  let last: string | undefined;
  return (state) => {
    const value = read(state);
    const key = JSON.stringify(value) ?? "";
    if (key === last) return;
    last = key;
    change(value, state);
  };
}
