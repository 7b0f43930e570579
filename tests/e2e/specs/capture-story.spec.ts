// The whole way with the real programs: from the simulated sensor to a listing on the server, through the page alone.
import type { Page } from "@playwright/test";
import { expectClean, heading, picturesPerSecond } from "../support/capture";
import { Scanner } from "../support/scanner";
import { expect, type Listing, type Shop, test } from "../support/shop";

const TITLE = "Old camera, scanned today";

const drawn = async (page: Page): Promise<number> => {
  const viewer = page.locator('.viewer[data-state="ready"][data-settled="true"]');
  await expect(viewer).toBeVisible({ timeout: 60_000 });
  return Number(await viewer.getAttribute("data-drawn"));
};

const viewsTaken = (page: Page) => page.getByRole("button", { name: /^Remove view/ });
const light = (page: Page) => page.locator(".light");

async function previewPoints(page: Page): Promise<number> {
  return Number(await page.locator(".preview").getAttribute("data-points"));
}

async function uploadToken(shop: Shop): Promise<string> {
  const answer = await shop
    .api("seller")
    .post("/api/tokens", { data: { name: "scanner", scopes: ["upload"], expires_in_days: 30 } });
  expect(answer.ok()).toBe(true);
  return ((await answer.json()) as { token: string }).token;
}

test("a seller scans a product and publishes it", async ({ page, shop, guard }) => {
  test.setTimeout(300_000);
  const scanner = await Scanner.start();
  guard.watch(page, scanner.url);
  // The shop's own guard watches the same page for another origin.
  guard.expect(new RegExp(`^foreign: ${scanner.url}/`));
  try {
    await page.goto(scanner.address);
    await scan(page);
    await removeAndUndo(page);
    const url = await publish(page, shop);
    await expectListing(shop, url);
    await page.getByRole("button", { name: "Scan another product" }).click();
    await expect(heading(page, "Take views")).toBeFocused();
    await expect(viewsTaken(page)).toHaveCount(0);
    await page.getByRole("button", { name: "End the program" }).click();
    await page.getByRole("button", { name: "End it" }).click();
    await expect(heading(page, "The scanner program has ended")).toBeFocused();
    expect(await scanner.ended()).toBe(0);
  } finally {
    await scanner.stop();
  }
});

async function scan(page: Page): Promise<void> {
  await test.step("sensor and board", async () => {
    await page.getByRole("button", { name: /^Use this sensor: Simulated/ }).click();
    await expect(heading(page, "Print or choose the board")).toBeFocused();
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page.getByRole("link", { name: "Download PDF of the A3 board" }).click(),
    ]);
    expect(download.suggestedFilename()).toMatch(/\.pdf$/);
    await page.getByRole("button", { name: "Use the A3 board" }).click();
    await expect(heading(page, "Take views")).toBeFocused();
  });

  await test.step("live pictures", async () => {
    await expect(light(page)).toHaveAttribute("data-light", "green", { timeout: 60_000 });
    await expect.poll(() => picturesPerSecond(page), { timeout: 30_000 }).toBeGreaterThan(5);
    const measured = await picturesPerSecond(page);
    test.info().annotations.push({ type: "live pictures a second", description: String(measured) });
    console.log(`live pictures a second in the page: ${measured}`);
  });

  await test.step("views, a growing preview, and one taken back", async () => {
    await heading(page, "Take views").click();
    await page.keyboard.press("Space");
    await expect(viewsTaken(page)).toHaveCount(1, { timeout: 60_000 });
    let points = await previewPoints(page);
    expect(points).toBeGreaterThan(0);
    for (const wanted of [2, 3, 4, 5]) {
      await page.getByRole("button", { name: "Go to the next unseen side" }).click();
      await expect(page.locator("p.visually-hidden[role=status]").last()).toContainText("Walking to");
      await expect(light(page)).toHaveAttribute("data-light", "green", { timeout: 60_000 });
      await page.getByRole("button", { name: "Take view" }).click();
      await expect(viewsTaken(page)).toHaveCount(wanted, { timeout: 60_000 });
      await expect.poll(() => previewPoints(page)).toBeGreaterThan(points);
      points = await previewPoints(page);
    }
    expect(await drawn(page)).toBe(points);
    await expectClean(page);
    await page.getByRole("button", { name: "Undo the last view" }).click();
    await expect(viewsTaken(page)).toHaveCount(4);
    await expect.poll(() => previewPoints(page)).toBeLessThan(points);
    await expect(page.locator(".ring-words")).toContainText("4 views.");
  });

  await test.step("the build", async () => {
    await page.getByRole("button", { name: "Build the 3D model" }).click();
    await expect(heading(page, "Building")).toBeFocused();
    await expect(heading(page, "Look at your 3D model")).toBeFocused({ timeout: 180_000 });
    await expect(page.getByText(/^Length/)).toBeVisible();
    await expect(page.locator(".verdict")).not.toBeEmpty();
  });
}

async function removeAndUndo(page: Page): Promise<void> {
  // a surface is drawn by triangles: those that lose a corner go too
  const all = await drawn(page);
  expect(all).toBeGreaterThan(1000);
  await page.getByRole("button", { name: "Lasso" }).click();
  const surface = await page.locator(".cut-surface").boundingBox();
  if (!surface) throw new Error("there is nothing to draw on");
  const at = (x: number, y: number) =>
    [surface.x + x * surface.width, surface.y + y * surface.height] as const;
  await page.mouse.move(...at(0.5, 0.3));
  await page.mouse.down();
  for (const place of [at(0.7, 0.45), at(0.6, 0.65), at(0.4, 0.6), at(0.38, 0.4)]) {
    await page.mouse.move(...place, { steps: 5 });
  }
  await page.mouse.up();
  const count = page.locator(".cut-count");
  await expect(count).toContainText("points selected");
  const selected = Number(await count.getAttribute("data-selected"));
  expect(selected).toBeGreaterThan(0);
  await page.keyboard.press("Delete");
  await expect(count).toHaveText("Nothing is selected.");
  await expect.poll(() => drawn(page)).toBeLessThan(all - selected);
  await page.getByRole("button", { name: "Undo" }).click();
  await expect.poll(() => drawn(page)).toBe(all);
}

async function publish(page: Page, shop: Shop): Promise<string> {
  await page.getByRole("button", { name: "Go on to publish" }).click();
  await expect(heading(page, "Publish your listing")).toBeFocused();
  await expect(page.getByRole("listitem").filter({ hasText: "model.ply" })).toBeVisible();
  await page.getByLabel("Title").fill(TITLE);
  await page.getByLabel("Description").fill("Works. Strap missing.");
  await page.getByLabel("Price").fill("49.90");
  await page.getByLabel("Category").selectOption("Electronics");
  await page.getByLabel("Condition").selectOption("Good");
  await page.getByLabel("Address of the shop").fill(shop.url);
  await page.getByLabel("Upload token").fill(await uploadToken(shop));
  await expectClean(page);
  await page.getByRole("button", { name: "Publish", exact: true }).click();
  await expect(heading(page, "Your listing is on the server")).toBeFocused({ timeout: 60_000 });
  const link = page.getByRole("link", { name: shop.url });
  return (await link.getAttribute("href")) ?? "";
}

async function expectListing(shop: Shop, url: string): Promise<void> {
  expect(url).toContain(shop.url);
  const id = url.split("/").at(-1) ?? "";
  const answer = await shop.api("seller").get(`/api/products/${id}`);
  expect(answer.ok(), url).toBe(true);
  const listing = (await answer.json()) as Listing & Record<string, unknown>;
  expect(listing).toMatchObject({
    title: TITLE,
    price_minor: 4990,
    currency: "EUR",
    category: "electronics",
    condition: "good",
  });
  expect(listing.model?.points).toBeGreaterThan(1000);
  expect(listing.poster_url).not.toBeNull();
}
