// The line to the program: its state and its pictures as they come, and back again by itself where the line breaks.
import { ApiError } from "../../src/api/client";
import type { Daemon } from "./client";
import { type Picture, parsePicture } from "./picture";
import type { State } from "./types";

export interface LiveEvents {
  onState(state: State): void;
  onPicture(picture: Picture): void;
  /** The line is gone; `refused` where the program is there but does not know this page. */
  onLost(refused: boolean): void;
  onBack(): void;
}

const FIRST_WAIT_MILLIS = 400;
const LONGEST_WAIT_MILLIS = 4000;
const REFUSED = new Set([401, 403]);

export class Live {
  readonly #daemon: Daemon;
  readonly #events: LiveEvents;
  #socket: WebSocket | null = null;
  #wait = FIRST_WAIT_MILLIS;
  #timer = 0;
  #isEnded = false;

  constructor(daemon: Daemon, events: LiveEvents) {
    this.#daemon = daemon;
    this.#events = events;
    this.#connect();
  }

  end(): void {
    this.#isEnded = true;
    clearTimeout(this.#timer);
    this.#socket?.close();
  }

  #connect(): void {
    const socket = new WebSocket(this.#daemon.liveAddress);
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => {
      this.#wait = FIRST_WAIT_MILLIS;
      this.#events.onBack();
    });
    socket.addEventListener("message", ({ data }) => this.#onMessage(data));
    socket.addEventListener("close", () => void this.#onClose());
    this.#socket = socket;
  }

  #onMessage(data: unknown): void {
    try {
      if (typeof data === "string") this.#events.onState(JSON.parse(data) as State);
      else if (data instanceof ArrayBuffer) this.#events.onPicture(parsePicture(data));
    } catch (error) {
      console.info("A message of the program could not be read:", error);
    }
  }

  async #onClose(): Promise<void> {
    if (this.#isEnded) return;
    this.#events.onLost(false);
    // A WebSocket does not tell why it was refused; a plain request does.
    const why = await this.#daemon.state().catch((error: unknown) => error);
    if (this.#isEnded) return;
    if (why instanceof ApiError && REFUSED.has(why.status)) this.#events.onLost(true);
    this.#timer = window.setTimeout(() => this.#connect(), this.#wait);
    this.#wait = Math.min(LONGEST_WAIT_MILLIS, this.#wait * 1.6);
  }
}
