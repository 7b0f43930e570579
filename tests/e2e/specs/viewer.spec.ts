// What can happen to the 3D view, and all the ways to move it.
import { chromium, type Page } from "@playwright/test";
import { BROWSER, BROWSER_ARGS } from "../playwright.config";
import { SMALL, smallListing } from "../support/listings";
import { expect, settled, test } from "../support/shop";
import { canvasMask, canvasPicture, difference, type Mask, share } from "../support/silhouette";

/** Pictures of the same view, but for rounding. */
const SAME = 0.002;
const CHANGED = 0.02;

async function open(page: Page, id: string) {
  await page.goto(`/p/${id}`);
  return settled(page, SMALL);
}

test("the keyboard does all of it", async ({ page, shop }) => {
  const canvas = await open(page, (await smallListing(shop)).id);
  await canvas.focus();
  const first = await canvasPicture(canvas);
  for (const key of ["ArrowRight", "ArrowDown", "Shift+ArrowLeft", "Shift+ArrowUp", "+", "-"]) {
    const before = await canvasPicture(canvas);
    await page.keyboard.press(key);
    await settled(page, SMALL);
    expect(difference(before, await canvasPicture(canvas)), key).toBeGreaterThan(CHANGED);
  }
  await page.keyboard.press("Home");
  await expect.poll(async () => difference(first, await canvasPicture(canvas))).toBeLessThan(SAME);
  await page.keyboard.press("f");
  await expect.poll(() => page.evaluate(() => document.fullscreenElement?.className)).toBe("viewer");
  await page.keyboard.press("f");
  await expect.poll(() => page.evaluate(() => document.fullscreenElement)).toBeNull();
});

test("opposite steps lead back to the same picture", async ({ page, shop }) => {
  const canvas = await open(page, (await smallListing(shop)).id);
  await canvas.focus();
  const first = await canvasPicture(canvas);
  for (const key of ["ArrowRight", "ArrowUp", "ArrowLeft", "ArrowDown"]) await page.keyboard.press(key);
  await settled(page, SMALL);
  expect(difference(first, await canvasPicture(canvas))).toBeLessThan(SAME);
});

test("buttons, right drag, shift drag, point size and reset", async ({ page, shop }) => {
  const canvas = await open(page, (await smallListing(shop)).id);
  const first = await canvasPicture(canvas);
  const firstMask = canvasMask(first);
  const changes = async (what: string, act: () => Promise<void>) => {
    const before = await canvasPicture(canvas);
    await act();
    await settled(page, SMALL);
    expect(difference(before, await canvasPicture(canvas)), what).toBeGreaterThan(0.003);
    await page.getByRole("button", { name: "Reset view" }).click();
    await expect.poll(async () => difference(first, await canvasPicture(canvas))).toBeLessThan(SAME);
  };
  for (const name of ["Turn left", "Turn right", "Zoom in", "Zoom out"]) {
    await changes(name, () => page.getByRole("button", { name }).click());
  }
  const dragBy = async (button: "left" | "right") => {
    await canvas.hover();
    await page.mouse.down({ button });
    await page.mouse.move(300, 300, { steps: 3 });
    await page.mouse.up({ button });
  };
  await changes("right drag", () => dragBy("right"));
  await changes("shift drag", async () => {
    await page.keyboard.down("Shift");
    await dragBy("left");
    await page.keyboard.up("Shift");
  });
  await page.getByLabel("Point size").fill("2");
  await settled(page, SMALL);
  expect(share(canvasMask(await canvasPicture(canvas)))).toBeGreaterThan(share(firstMask));
});

test("a double-click brings the point under it to the middle", async ({ page, shop }) => {
  const canvas = await open(page, (await smallListing(shop)).id);
  const before = canvasMask(await canvasPicture(canvas));
  // The highest pixel of the product is the tower's top.
  const top = firstRow(before);
  await canvas.dblclick({ position: { x: top.x, y: top.y + 6 } });
  await expect
    .poll(async () => Math.abs(firstRow(canvasMask(await canvasPicture(canvas))).y - before.height / 2))
    .toBeLessThan(20);
});

function firstRow(mask: Mask): { x: number; y: number } {
  const at = mask.inside.indexOf(1);
  return { x: at % mask.width, y: Math.floor(at / mask.width) };
}

test("two fingers zoom and one turns", async ({ browser, shop, guard }) => {
  const { id } = await smallListing(shop);
  const context = await browser.newContext({
    baseURL: shop.url,
    hasTouch: true,
    viewport: { width: 360, height: 740 },
  });
  const page = await context.newPage();
  guard.watch(page, shop.url);
  const canvas = await open(page, id);
  const box = await canvas.boundingBox();
  if (!box) throw new Error("no canvas");
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const devtools = await context.newCDPSession(page);
  const touch = (type: "touchStart" | "touchMove" | "touchEnd", ...at: number[]) =>
    devtools.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: at.map((offset, id) => ({ x: x + offset, y, id })),
    });
  const first = canvasMask(await canvasPicture(canvas));
  await touch("touchStart", -20, 20);
  for (const spread of [25, 30, 35, 40]) await touch("touchMove", -spread, spread);
  await touch("touchEnd");
  await settled(page, SMALL);
  const zoomed = await canvasPicture(canvas);
  expect(share(canvasMask(zoomed))).toBeGreaterThan(share(first) * 1.8);
  await touch("touchStart", 0);
  for (const moved of [10, 25, 45]) await touch("touchMove", moved);
  await touch("touchEnd");
  await settled(page, SMALL);
  expect(difference(zoomed, await canvasPicture(canvas))).toBeGreaterThan(CHANGED);
  await context.close();
});

test("the view is told in words", async ({ page, shop }) => {
  const canvas = await open(page, (await smallListing(shop)).id);
  await canvas.focus();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowRight");
  const said = page.locator(".viewer-panel [role=status]");
  await expect(said).toHaveText("Seen from the front, 22° from above, zoom 100 %.");
});

test("points are shown while they arrive, and the rest is fetched again after a break", async ({
  page,
  shop,
  guard,
}) => {
  const { id, model } = await smallListing(shop);
  if (!model) throw new Error("no model");
  const whole = Buffer.from(await (await fetch(shop.url + model.stream_url)).arrayBuffer());
  await page.route(`**${model.stream_url}`, (route) =>
    route.fulfill({ body: whole.subarray(0, whole.length / 4), contentType: "application/octet-stream" }),
  );
  guard.expect(/Failed to load resource/);
  await page.goto(`/p/${id}`);
  const viewer = page.locator(".viewer");
  await expect(viewer).toHaveAttribute("data-state", "failed");
  const drawn = Number(await viewer.getAttribute("data-drawn"));
  expect(drawn).toBeGreaterThan(SMALL / 5);
  expect(drawn).toBeLessThan(SMALL / 3);
  const partly = canvasMask(await canvasPicture(page.locator(".viewer-canvas")));
  await page.unroute(`**${model.stream_url}`);
  await page.getByRole("button", { name: "Try again" }).click();
  const canvas = await settled(page, SMALL);
  const complete = canvasMask(await canvasPicture(canvas));
  // A quarter of the points already showed the whole product.
  expect(share(partly) / share(complete)).toBeGreaterThan(0.9);
});

test("a stream that is no stream is told, not drawn", async ({ page, shop }) => {
  const { id, model } = await smallListing(shop);
  await page.route(`**${model?.stream_url}`, (route) => route.fulfill({ body: "<html>sorry</html>" }));
  await page.goto(`/p/${id}`);
  await expect(page.getByText("The 3D model could not be loaded completely.")).toBeVisible();
  await expect(page.getByRole("button", { name: "Try again" })).toBeVisible();
});

test("recovers from a lost context", async ({ page, shop }) => {
  const canvas = await open(page, (await smallListing(shop)).id);
  const first = await canvasPicture(canvas);
  await canvas.evaluate((element: HTMLCanvasElement) => {
    const extension = element.getContext("webgl2")?.getExtension("WEBGL_lose_context");
    Object.assign(window, { lost: extension });
    extension?.loseContext();
  });
  await expect(page.locator(".viewer")).toHaveAttribute("data-state", "lost");
  await expect(page.getByText("The 3D view was interrupted")).toBeVisible();
  await page.evaluate(() => (window as unknown as { lost: WEBGL_lose_context }).lost.restoreContext());
  await settled(page, SMALL);
  await expect(page.getByText("The 3D view was interrupted")).toHaveCount(0);
  expect(difference(first, await canvasPicture(canvas))).toBeLessThan(SAME);
});

test("without WebGL there is the picture, a message and the measurements", async ({ shop, guard }) => {
  const listing = await shop.add({
    title: "Seen without WebGL",
    model: { name: "model.asc", bytes: Buffer.from("0 0 0 255 0 0\n10 0 0 0 255 0\n0 10 5 0 0 255\n") },
    poster: await posterPng(),
    active: true,
  });
  const args = [
    ...BROWSER_ARGS.filter((arg) => !arg.includes("swiftshader")),
    "--disable-gpu",
    "--disable-3d-apis",
  ];
  const browser = await chromium.launch({ executablePath: BROWSER, args });
  const page = await browser.newPage();
  guard.watch(page, shop.url);
  const scripts: string[] = [];
  page.on("request", (sent) => scripts.push(sent.url()));
  await page.goto(`${shop.url}/p/${listing.id}`);
  await expect(page.getByText("Your browser cannot show 3D here")).toBeVisible();
  const poster = page.getByRole("img", { name: "Picture of Seen without WebGL" });
  await expect(poster).toBeVisible();
  expect(await poster.evaluate((image: HTMLImageElement) => image.naturalWidth)).toBeGreaterThan(0);
  await expect(page.locator("canvas")).toHaveCount(0);
  expect(
    scripts.filter((url) => /viewer-|stream/.test(url)),
    "three.js is not fetched in vain",
  ).toEqual([]);
  await browser.close();
});

async function posterPng(): Promise<Buffer> {
  const { PNG } = await import("pngjs");
  const picture = new PNG({ width: 320, height: 240 });
  for (let i = 0; i < picture.data.length; i++) picture.data[i] = i % 4 === 3 ? 255 : (i * 7) % 256;
  return PNG.sync.write(picture);
}

test("twenty visits leave no context behind", async ({ page, shop }) => {
  const { title } = await smallListing(shop);
  await page.addInitScript(() => {
    const contexts = new Set<WebGL2RenderingContext>();
    Object.assign(window, { contexts });
    const original = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, ...args: unknown[]) {
      const context = Reflect.apply(original, this, args);
      if (context instanceof WebGL2RenderingContext) contexts.add(context);
      return context;
    } as typeof original;
  });
  const alive = () =>
    page.evaluate(() => {
      const { contexts } = window as unknown as { contexts: Set<WebGL2RenderingContext> };
      return [...contexts].filter((context) => !context.isContextLost()).length;
    });
  await page.goto("/");
  for (let visit = 0; visit < 20; visit++) {
    await page.getByRole("link", { name: title }).click();
    // Every other time the page is left while the model is still on its way.
    if (visit % 2 === 0) await expect(page.locator(".viewer[data-drawn]")).toBeVisible();
    else await expect(page.locator(".viewer")).toBeVisible();
    await page.getByRole("link", { name: "Back to the shop" }).click();
    await expect(page.getByRole("heading", { level: 1, name: "Find something good" })).toBeVisible();
  }
  await expect.poll(alive).toBe(0);
  await page.getByRole("link", { name: title }).click();
  await settled(page, SMALL);
  expect(await alive()).toBe(1);
});
