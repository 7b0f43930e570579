// Speaks the scanner program's side of its contract with the page, as far as tests of the page alone need it: every state can
// be set, every order is noted. Serves the built page with the program's own Content-Security-Policy.
import { createReadStream, existsSync } from "node:fs";
import { createServer, type IncomingMessage, type Server, type ServerResponse } from "node:http";
import type { AddressInfo } from "node:net";
import { extname, join, resolve } from "node:path";
import { PNG } from "pngjs";
import { type WebSocket, WebSocketServer } from "ws";
import type { PictureHeader, State } from "../../../web/capture/daemon/types";
import { encodeStream } from "../../../web/src/viewer/stream.fixture";
import { makeCloud } from "./cloud";

const PAGE = resolve(import.meta.dirname, "../../../web/dist-capture");
const CSP =
  "default-src 'self'; img-src 'self' blob:; connect-src 'self' ws://127.0.0.1:*; object-src 'none'; base-uri 'none'; frame-ancestors 'none'";
const TYPES: Record<string, string> = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".css": "text/css",
  ".svg": "image/svg+xml",
};
export const TOKEN = "5a".repeat(32);
const PICTURE_MILLIS = 33;
const [WIDTH, HEIGHT] = [640, 480];
const POSITIONS = 12;

export interface Order {
  readonly method: string;
  readonly path: string;
  readonly body: Buffer;
}

type Answer = (order: Order, daemon: MockDaemon) => Partial<State> | Problem | undefined;

export class Problem {
  constructor(
    readonly status: number,
    readonly detail: string,
  ) {}
}

export class MockDaemon {
  readonly orders: Order[] = [];
  state: State;
  /** Changes the live picture's header. */
  picture: Partial<PictureHeader> = {};
  /** Points of the preview and of the model. */
  points = 4000;
  isSilent = false;
  readonly #server: Server;
  readonly #sockets = new Set<WebSocket>();
  readonly #answers = new Map<string, Answer>();
  #timer: NodeJS.Timeout | undefined;
  #port = 0;
  #index = 0;
  #images: { color: Buffer; depth: Buffer }[] = [];

  constructor(state: State) {
    this.state = state;
    this.#server = createServer((request, response) => void this.#serve(request, response));
    const live = new WebSocketServer({ noServer: true });
    this.#server.on("upgrade", (request, socket, head) => {
      if (new URL(request.url ?? "", "http://x").searchParams.get("token") !== TOKEN) return socket.destroy();
      live.handleUpgrade(request, socket, head, (client) => this.#welcome(client));
    });
  }

  get url(): string {
    return `http://127.0.0.1:${this.#port}`;
  }

  get address(): string {
    return `${this.url}/#token=${TOKEN}`;
  }

  async start(): Promise<this> {
    this.#images = Array.from({ length: POSITIONS }, (_, i) => drawPictures(i / POSITIONS));
    await new Promise<void>((done) => this.#server.listen(this.#port, "127.0.0.1", done));
    this.#port = (this.#server.address() as AddressInfo).port;
    this.#timer = setInterval(() => this.#sendPicture(), PICTURE_MILLIS);
    return this;
  }

  async stop(): Promise<void> {
    clearInterval(this.#timer);
    for (const socket of this.#sockets) socket.terminate();
    this.#server.closeAllConnections();
    await new Promise((done) => this.#server.close(done));
  }

  /** What an order does: a change of the state, or a problem. `path` as "POST /api/views". */
  on(path: string, answer: Answer): void {
    this.#answers.set(path, answer);
  }

  set(change: Partial<State>): void {
    this.state = { ...this.state, ...change };
    for (const socket of this.#sockets) socket.send(JSON.stringify(this.state));
  }

  ordersOf(path: string): Order[] {
    return this.orders.filter((order) => `${order.method} ${order.path}` === path);
  }

  #welcome(client: WebSocket): void {
    this.#sockets.add(client);
    client.on("close", () => this.#sockets.delete(client));
    client.send(JSON.stringify(this.state));
  }

  #sendPicture(): void {
    const images = this.#images[this.#index % POSITIONS];
    if (this.isSilent || !images || this.#sockets.size === 0) return;
    const { color, depth } = images;
    const json = Buffer.from(
      JSON.stringify({
        ...HEADER,
        ...this.picture,
        index: this.#index,
        color_bytes: color.length,
        depth_bytes: depth.length,
      }),
    );
    this.#index += 1;
    const length = Buffer.alloc(4);
    length.writeUInt32LE(json.length);
    const message = Buffer.concat([length, json, color, depth]);
    for (const socket of this.#sockets) if (socket.bufferedAmount === 0) socket.send(message);
  }

  async #serve(request: IncomingMessage, response: ServerResponse): Promise<void> {
    const url = new URL(request.url ?? "/", this.url);
    if (!url.pathname.startsWith("/api/")) return this.#file(url.pathname, response);
    const isKnown =
      request.headers.authorization === `Bearer ${TOKEN}` || url.searchParams.get("token") === TOKEN;
    if (!isKnown) return problem(response, new Problem(403, "The key is wrong."));
    const pieces: Buffer[] = [];
    for await (const piece of request) pieces.push(piece as Buffer);
    const order = { method: request.method ?? "", path: url.pathname, body: Buffer.concat(pieces) };
    this.orders.push(order);
    this.#answer(order, response);
  }

  #answer(order: Order, response: ServerResponse): void {
    const { method, path } = order;
    if (method === "GET" && (path === "/api/preview" || path === "/api/model")) {
      response.writeHead(200, { "content-type": "application/octet-stream" });
      response.end(modelStream(this.points));
    } else if (method === "GET" && path === "/api/leaving") {
      json(response, LEAVING);
    } else {
      this.#obey(order, response);
    }
  }

  #obey(order: Order, response: ServerResponse): void {
    const { method, path } = order;
    const done = this.#answers.get(`${method} ${path}`)?.(order, this);
    if (done instanceof Problem) {
      problem(response, done);
    } else {
      if (done) this.set(done);
      json(response, this.state);
    }
  }

  #file(path: string, response: ServerResponse): void {
    const file = join(PAGE, path === "/" ? "index.html" : path);
    if (!file.startsWith(PAGE) || !existsSync(file)) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, {
      "content-type": TYPES[extname(file)] ?? "application/octet-stream",
      "content-security-policy": CSP,
      "x-content-type-options": "nosniff",
    });
    createReadStream(file).pipe(response);
  }
}

function json(response: ServerResponse, value: unknown): void {
  response.writeHead(200, { "content-type": "application/json" }).end(JSON.stringify(value));
}

function problem(response: ServerResponse, { status, detail }: Problem): void {
  response.writeHead(status, { "content-type": "application/problem+json" });
  response.end(JSON.stringify({ type: "about:blank", title: "Not possible", status, detail }));
}

const LEAVING = {
  files: [
    { name: "model.ply", bytes: 1_234_567, what: "the points you see" },
    { name: "poster.png", bytes: 45_678, what: "the picture of the listing" },
    { name: "report.json", bytes: 2345, what: "sizes and how well the views fit" },
  ],
  stays: ["the recording, which has pictures of your room", "the serial number of your sensor"],
};

const HEADER: Omit<PictureHeader, "index" | "color_bytes" | "depth_bytes"> = {
  fps: 30,
  width: WIDTH,
  height: HEIGHT,
  tags: [
    { id: 0, corners: corners(120, 330, 60) },
    { id: 1, corners: corners(440, 330, 60) },
  ],
  region: [
    [200, 300],
    [430, 300],
    [470, 420],
    [160, 420],
  ],
  hints: [{ level: "green", code: "ok", text: "Good: a view can be taken." }],
  light: "green",
  still_seconds: 2,
  valid_depth: 0.83,
  lost_packets: 0,
  distance_metres: 0.81,
};

function corners(x: number, y: number, side: number): [number, number][] {
  return [
    [x, y],
    [x + side, y],
    [x + side, y + side],
    [x, y + side],
  ];
}

/** A ball that rolls, in colour and in depth. The page reads any kind of picture that the browser knows. */
function drawPictures(share: number): { color: Buffer; depth: Buffer } {
  const middle = 320 + 60 * Math.cos(2 * Math.PI * share);
  const paint = (ball: number[], floor: number[], wall: number[]): Buffer => {
    const picture = new PNG({ width: WIDTH, height: HEIGHT, colorType: 2 });
    for (let i = 0; i < WIDTH * HEIGHT; i++) {
      const [x, y] = [i % WIDTH, Math.floor(i / WIDTH)];
      const isBall = Math.hypot(x - middle, y - 300) < 80;
      const level = isBall ? ball : y > 260 ? floor : wall;
      for (const c of [0, 1, 2]) picture.data[i * 4 + c] = level[c] ?? 0;
      picture.data[i * 4 + 3] = 255;
    }
    return PNG.sync.write(picture, { colorType: 2, deflateLevel: 1 });
  };
  return {
    color: paint([190, 70, 40], [222, 218, 205], [120, 130, 140]),
    depth: paint([240, 140, 40], [90, 90, 90], [0, 0, 0]),
  };
}

const streams = new Map<number, Buffer>();

function modelStream(count: number): Buffer {
  const known = streams.get(count);
  if (known) return known;
  const { points, colors } = makeCloud(count);
  const stream = Buffer.from(
    encodeStream(
      points.map((position, i) => ({ position, color: colors[i] ?? [0, 0, 0], normal: [0, 0, 1] })),
      { normals: false },
    ),
  );
  streams.set(count, stream);
  return stream;
}
