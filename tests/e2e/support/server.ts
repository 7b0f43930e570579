// Runs the real server on a folder of its own and a free port.
import { type ChildProcess, spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const BINARY = resolve(
  process.env.PRODUCT_SERVER ?? join(import.meta.dirname, "../../../target/release/product-server"),
);
const START_MILLIS = 20_000;
const POLL_MILLIS = 50;

export class Server {
  readonly url: string;
  readonly #process: ChildProcess;
  readonly #data: string;
  #output = "";

  private constructor(url: string, data: string, port: number) {
    this.url = url;
    this.#data = data;
    this.#process = spawn(BINARY, ["--data", data, "--listen", `127.0.0.1:${port}`], {
      stdio: ["ignore", "pipe", "pipe"],
    });
    for (const stream of [this.#process.stdout, this.#process.stderr]) {
      stream?.on("data", (bytes) => {
        this.#output += String(bytes);
      });
    }
  }

  static async start(): Promise<Server> {
    if (!existsSync(BINARY)) throw new Error(`${BINARY} is missing: build it, or set PRODUCT_SERVER`);
    const data = mkdtempSync(join(tmpdir(), "allround-e2e-"));
    const port = await freePort();
    const server = new Server(`http://127.0.0.1:${port}`, data, port);
    await server.#untilReady();
    return server;
  }

  /** The path of the one-time link that makes the first admin. */
  async setupPath(): Promise<string> {
    return poll("the one-time link", () => /\/setup\?token=[\w.~-]+/.exec(this.#output)?.[0]);
  }

  async stop(): Promise<void> {
    const ended = new Promise((done) => this.#process.once("exit", done));
    if (this.#process.exitCode === null && this.#process.kill("SIGTERM")) await ended;
    rmSync(this.#data, { recursive: true, force: true });
  }

  async #untilReady(): Promise<void> {
    await poll("a ready server", async () => {
      if (this.#process.exitCode !== null) throw new Error(`the server ended: ${this.#output}`);
      const answer = await fetch(`${this.url}/readyz`).catch(() => null);
      return answer?.ok || undefined;
    });
  }
}

async function poll<T>(what: string, look: () => T | undefined | Promise<T | undefined>): Promise<T> {
  const deadline = Date.now() + START_MILLIS;
  for (;;) {
    const found = await look();
    if (found !== undefined) return found;
    if (Date.now() > deadline) throw new Error(`no sign of ${what}`);
    await new Promise((later) => setTimeout(later, POLL_MILLIS));
  }
}

function freePort(): Promise<number> {
  return new Promise((resolvePort, reject) => {
    const probe = createServer();
    probe.once("error", reject);
    probe.listen(0, "127.0.0.1", () => {
      const address = probe.address();
      const port = typeof address === "object" && address ? address.port : 0;
      probe.close(() => resolvePort(port));
    });
  });
}
