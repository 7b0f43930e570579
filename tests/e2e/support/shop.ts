// A running shop for the tests: the real server with an admin, a seller and whatever listings a test asks for.
import {
  type APIRequestContext,
  type BrowserContext,
  test as base,
  expect,
  type Page,
  request,
} from "@playwright/test";
import { Server } from "./server";

export { expect };

export const PASSWORDS = { admin: "correct horse battery", seller: "staple of the seller" };
export type Person = keyof typeof PASSWORDS;

export interface Listing {
  readonly id: string;
  readonly title: string;
  readonly version: number;
  readonly status: string;
  readonly model: { points: number; stream_url: string; stream_bytes: number } | null;
  readonly poster_url: string | null;
}

export interface NewListing {
  readonly title: string;
  readonly model?: { name: string; bytes: Buffer };
  readonly poster?: Buffer;
  readonly report?: object;
  readonly active?: boolean;
  readonly details?: Record<string, unknown>;
}

export class Shop {
  readonly #apis = new Map<Person, APIRequestContext>();

  private constructor(readonly server: Server) {}

  static async open(): Promise<Shop> {
    const shop = new Shop(await Server.start());
    const token = new URL(await shop.server.setupPath(), shop.server.url).searchParams.get("token");
    const admin = await shop.#context();
    await ok(admin.post("/api/setup", { data: { token, name: "admin", password: PASSWORDS.admin } }));
    shop.#apis.set("admin", admin);
    await ok(
      admin.post("/api/users", { data: { name: "seller", password: PASSWORDS.seller, role: "seller" } }),
    );
    const seller = await shop.#context();
    await ok(seller.post("/api/session", { data: { name: "seller", password: PASSWORDS.seller } }));
    shop.#apis.set("seller", seller);
    return shop;
  }

  get url(): string {
    return this.server.url;
  }

  #context(): Promise<APIRequestContext> {
    return request.newContext({ baseURL: this.url, extraHTTPHeaders: { origin: this.url } });
  }

  api(person: Person): APIRequestContext {
    const api = this.#apis.get(person);
    if (!api) throw new Error(`${person} is not logged in`);
    return api;
  }

  /** Logs a browser in without its form: logging in is limited to a few times a minute. */
  async logIn(context: BrowserContext, person: Person): Promise<void> {
    const { cookies } = await this.api(person).storageState();
    await context.addCookies(cookies);
  }

  async add(what: NewListing): Promise<Listing> {
    const seller = this.api("seller");
    let listing = await json<Listing>(
      seller.post("/api/products", { data: { title: what.title, ...what.details } }),
    );
    const put = (kind: string, name: string, type: string, data: Buffer) =>
      json<Listing>(
        seller.put(`/api/products/${listing.id}/${kind}`, {
          data,
          headers: { "content-type": type, "x-filename": name },
          timeout: 60_000,
        }),
      );
    if (what.model)
      listing = await put("model", what.model.name, "application/octet-stream", what.model.bytes);
    if (what.poster) listing = await put("poster", "poster.png", "image/png", what.poster);
    if (what.report) {
      listing = await put(
        "report",
        "report.json",
        "application/json",
        Buffer.from(JSON.stringify(what.report)),
      );
    }
    if (what.active) {
      listing = await json(
        this.api("admin").post(`/api/products/${listing.id}/status`, { data: { status: "active" } }),
      );
    }
    return listing;
  }

  async close(): Promise<void> {
    for (const api of this.#apis.values()) await api.dispose();
    await this.server.stop();
  }
}

async function ok(answer: ReturnType<APIRequestContext["get"]>): Promise<void> {
  const response = await answer;
  if (!response.ok()) throw new Error(`${response.url()}: ${response.status()} ${await response.text()}`);
}

async function json<T>(answer: ReturnType<APIRequestContext["get"]>): Promise<T> {
  await ok(answer);
  return (await answer).json() as Promise<T>;
}

/** What a page did that no page may do, but for what a test expects of it. */
export class Guard {
  readonly #wrong: string[] = [];
  readonly #expected: RegExp[] = [];

  watch(page: Page, origin: string): void {
    page.on("console", (message) => {
      if (message.type() === "error" || /Too many active WebGL/.test(message.text()))
        this.#note(message.text());
    });
    page.on("pageerror", (error) => this.#note(error.message));
    page.on("dialog", (dialog) => {
      this.#note(`dialog: ${dialog.message()}`);
      void dialog.dismiss();
    });
    page.on("request", (sent) => {
      const url = new URL(sent.url());
      if (url.origin !== origin && !["data:", "blob:"].includes(url.protocol))
        this.#note(`foreign: ${sent.url()}`);
    });
  }

  expect(pattern: RegExp): void {
    this.#expected.push(pattern);
  }

  #note(what: string): void {
    this.#wrong.push(what);
  }

  get wrong(): string[] {
    return this.#wrong.filter((what) => !this.#expected.some((pattern) => pattern.test(what)));
  }
}

interface Fixtures {
  guard: Guard;
}

export const test = base.extend<Fixtures, { shop: Shop }>({
  shop: [
    // biome-ignore lint/correctness/noEmptyPattern: Playwright reads the parameter's shape.
    async ({}, use) => {
      const shop = await Shop.open();
      await use(shop);
      await shop.close();
    },
    { scope: "worker", timeout: 60_000 },
  ],
  baseURL: async ({ shop }, use) => use(shop.url),
  guard: [
    async ({ context, shop }, use) => {
      const guard = new Guard();
      context.on("page", (page) => guard.watch(page, shop.url));
      await use(guard);
      expect(guard.wrong, "console errors, dialogs and requests to other origins").toEqual([]);
    },
    { auto: true },
  ],
});

/** The canvas once the whole model is drawn and nothing moves. */
export async function settled(page: Page, points?: number) {
  const viewer = page.locator('.viewer[data-state="ready"][data-settled="true"]');
  await expect(viewer).toBeVisible({ timeout: 60_000 });
  if (points !== undefined) await expect(viewer).toHaveAttribute("data-drawn", String(points));
  return page.locator(".viewer-canvas");
}
