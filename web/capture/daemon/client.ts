// The program's orders as functions. Every failure is an ApiError whose message can be shown to a person.
import { ApiError, problem } from "../../src/api/client";
import { texts } from "../texts";
import type { AutoMode, Leaving, Listing, Paper, State } from "./types";

type Body = { readonly json: unknown } | { readonly bytes: Uint8Array<ArrayBuffer> } | null;

export type BackStep = "sensor" | "board" | "views" | "result";

export class Daemon {
  readonly #token: string;

  constructor(token: string) {
    this.#token = token;
  }

  /** For addresses that the browser fetches by itself. */
  withToken(path: string): string {
    return `${path}${path.includes("?") ? "&" : "?"}token=${encodeURIComponent(this.#token)}`;
  }

  get authorization(): Record<string, string> {
    return { authorization: `Bearer ${this.#token}` };
  }

  get liveAddress(): string {
    return `ws://${location.host}${this.withToken("/api/live")}`;
  }

  state = () => this.#send<State>("GET", "/api/state");
  leaving = () => this.#send<Leaving>("GET", "/api/leaving");
  lookForSensors = () => this.#order("/api/sensors", {});
  openSensor = (address: string) => this.#order("/api/sensor", { address });
  standAt = (azimuth: number) => this.#order("/api/control", { what: "station", value: azimuth });
  boardOfPaper = (paper: Paper) => this.#order("/api/board", { paper });
  boardOfFile = (file: unknown) => this.#order("/api/board", { file });
  takeView = () => this.#order("/api/views", {});
  removeView = (name: string) => this.#send<State>("DELETE", `/api/views/${encodeURIComponent(name)}`);
  auto = (mode: AutoMode, seconds: number) => this.#order("/api/auto", { mode, seconds });
  build = () => this.#order("/api/build", {});
  cancelBuild = () => this.#order("/api/build/cancel", {});
  removePoints = (indices: Uint32Array) =>
    this.#send<State>("POST", "/api/model/remove", { bytes: littleEndian(indices) });
  undoRemoval = () => this.#order("/api/model/undo", {});
  publish = (listing: Listing) => this.#order("/api/publish", listing);
  goBack = (step: BackStep) => this.#order("/api/step", { step });
  newProduct = () => this.#order("/api/new", {});
  quit = () => this.#send<unknown>("POST", "/api/quit", { json: {} });

  #order(path: string, json: unknown): Promise<State> {
    return this.#send<State>("POST", path, { json });
  }

  async #send<T>(method: string, path: string, body: Body = null): Promise<T> {
    const headers: Record<string, string> = { accept: "application/json", ...this.authorization };
    const init: RequestInit = { method, headers, cache: "no-store" };
    if (body && "json" in body) {
      headers["content-type"] = "application/json";
      init.body = JSON.stringify(body.json);
    } else if (body) {
      headers["content-type"] = "application/octet-stream";
      init.body = body.bytes;
    }
    let response: Response;
    let text: string;
    try {
      response = await fetch(path, init);
      text = await response.text();
    } catch {
      throw new ApiError(0, "network", texts.connection.orderLost);
    }
    if (!response.ok) throw problem(response.status, text);
    try {
      return (text === "" ? undefined : JSON.parse(text)) as T;
    } catch {
      throw new ApiError(0, "unreadable", texts.connection.unreadable);
    }
  }
}

/** As the program counts them, whatever this machine's own order of bytes. */
export function littleEndian(indices: Uint32Array): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(indices.length * 4);
  const view = new DataView(bytes.buffer);
  for (const [i, index] of indices.entries()) view.setUint32(i * 4, index, true);
  return bytes;
}
