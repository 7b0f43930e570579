// Runs the real scanner program with its page, on a folder of its own and a free port.
import { type ChildProcess, spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const BINARY = resolve(
  process.env.SCAN_PRODUCT ?? join(import.meta.dirname, "../../../target/release/scan-product"),
);
const START_MILLIS = 20_000;

export class Scanner {
  /** With the token in its fragment. */
  readonly address: string;
  readonly #process: ChildProcess;
  readonly #scans: string;
  readonly #ended: Promise<number | null>;

  private constructor(address: string, scans: string, process: ChildProcess, ended: Promise<number | null>) {
    this.address = address;
    this.#scans = scans;
    this.#process = process;
    this.#ended = ended;
  }

  static async start(...options: string[]): Promise<Scanner> {
    if (!existsSync(BINARY)) throw new Error(`${BINARY} is missing: build it, or set SCAN_PRODUCT`);
    const scans = mkdtempSync(join(tmpdir(), "allround-scans-"));
    const started = spawn(BINARY, ["capture", "--no-browser", "--json", "--out", scans, ...options], {
      stdio: ["ignore", "pipe", "pipe"],
    });
    const ended = new Promise<number | null>((done) => started.once("exit", done));
    const address = await firstAddress(started);
    return new Scanner(address, scans, started, ended);
  }

  get url(): string {
    return new URL(this.address).origin;
  }

  /** The exit code, once it has ended by itself. */
  ended(): Promise<number | null> {
    return this.#ended;
  }

  async stop(): Promise<void> {
    if (this.#process.exitCode === null && this.#process.kill("SIGTERM")) await this.#ended;
    rmSync(this.#scans, { recursive: true, force: true });
  }
}

/** The program prints one JSON object with its address as soon as it listens. */
function firstAddress(program: ChildProcess): Promise<string> {
  return new Promise((found, reject) => {
    let [said, wrong] = ["", ""];
    const fail = () => reject(new Error(`the scanner told no address: ${said} ${wrong}`));
    const timer = setTimeout(fail, START_MILLIS);
    program.stderr?.on("data", (bytes) => {
      wrong += String(bytes);
    });
    program.stdout?.on("data", (bytes) => {
      said += String(bytes);
      const address = /"address"\s*:\s*"([^"]+)"/.exec(said)?.[1];
      if (address === undefined) return;
      clearTimeout(timer);
      found(address);
    });
    program.once("exit", fail);
  });
}
