// Every page: no axe-core violation and no sideways scrolling, on a desktop and at 360 pixels.
import AxeBuilder from "@axe-core/playwright";
import type { Page } from "@playwright/test";
import { smallListing } from "../support/listings";
import { expect, type Person, type Shop, settled, test } from "../support/shop";

interface Visit {
  readonly name: string;
  readonly person: Person | null;
  path(shop: Shop): Promise<string> | string;
  /** Brings the page into the state to be checked. */
  ready(page: Page): Promise<unknown>;
}

const heading = (name: string | RegExp) => (page: Page) =>
  expect(page.getByRole("heading", { level: 1, name })).toBeVisible();

const VISITS: Visit[] = [
  {
    name: "gallery",
    person: null,
    path: () => "/",
    ready: (page) => expect(page.locator(".card").first()).toBeVisible(),
  },
  {
    name: "empty gallery",
    person: null,
    path: () => "/?q=nosuchthing",
    ready: (page) => expect(page.getByText("Nothing found")).toBeVisible(),
  },
  {
    name: "product",
    person: null,
    path: async (shop) => `/p/${(await smallListing(shop)).id}`,
    ready: settled,
  },
  { name: "missing product", person: null, path: () => "/p/none", ready: heading("Page not found") },
  { name: "log in", person: null, path: () => "/login", ready: heading("Log in") },
  { name: "set up", person: null, path: () => "/setup?token=abc", ready: heading("Create the first admin") },
  {
    name: "set up without token",
    person: null,
    path: () => "/setup",
    ready: (page) => expect(page.getByRole("alert")).toBeVisible(),
  },
  {
    name: "all listings",
    person: "admin",
    path: () => "/manage",
    ready: (page) => expect(page.getByRole("table")).toBeVisible(),
  },
  {
    name: "own listings",
    person: "seller",
    path: () => "/manage",
    ready: (page) => expect(page.getByRole("table")).toBeVisible(),
  },
  { name: "new listing", person: "seller", path: () => "/manage/new", ready: heading("Add a listing") },
  {
    name: "edit",
    person: "admin",
    path: async (shop) => `/manage/${(await smallListing(shop)).id}`,
    ready: settled,
  },
  {
    name: "users",
    person: "admin",
    path: () => "/manage/users",
    ready: (page) => expect(page.getByRole("table")).toBeVisible(),
  },
  { name: "tokens", person: "seller", path: () => "/manage/tokens", ready: makeToken },
  { name: "account", person: "seller", path: () => "/manage/account", ready: heading("Account") },
  { name: "unknown address", person: null, path: () => "/no/such/page", ready: heading("Page not found") },
];

async function makeToken(page: Page): Promise<void> {
  await page.getByLabel("What is it for?").fill("Scanner in the workshop");
  await page.getByRole("button", { name: "Create a token" }).click();
  await expect(page.getByLabel("New token")).toHaveValue(/^arp_/);
}

for (const width of [1280, 360]) {
  for (const { name, person, path, ready } of VISITS) {
    test(`${name} at ${width} px`, async ({ page, shop, guard }) => {
      guard.expect(/status of 404/);
      await smallListing(shop);
      await page.setViewportSize({ width, height: width === 360 ? 740 : 900 });
      if (person) await shop.logIn(page.context(), person);
      await page.goto(await path(shop));
      await ready(page);
      const { violations } = await new AxeBuilder({ page }).analyze();
      expect(
        violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" | ")}`),
      ).toEqual([]);
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
      expect(overflow, "pixels that stick out sideways").toBeLessThanOrEqual(0);
    });
  }
}
