// Bytes over the wire for a product of 100 000 points, headers included, as the browser's network stack counts them.

import { PNG } from "pngjs";
import { writePly } from "../support/cloud";
import { cloud, DETAILS, REPORT, SMALL } from "../support/listings";
import { expect, settled, test } from "../support/shop";
import { canvasPicture } from "../support/silhouette";

const FIRST_PICTURE_BYTES = 100_000;
const WHOLE_MODEL_BYTES = 1_500_000;

test("first picture and whole model stay light", async ({ browser, shop, guard }) => {
  const listing = await shop.add({
    title: "Weighed tower",
    model: { name: "model.ply", bytes: writePly(cloud.small()) },
    report: REPORT,
    details: DETAILS,
    active: true,
  });
  const measure = async () => {
    // A new context each time: nothing comes from a cache.
    const context = await browser.newContext({ baseURL: shop.url });
    const page = await context.newPage();
    guard.watch(page, shop.url);
    const devtools = await context.newCDPSession(page);
    await devtools.send("Network.enable");
    const urls = new Map<string, string>();
    const sizes = new Map<string, number>();
    devtools.on("Network.requestWillBeSent", ({ requestId, request }) => urls.set(requestId, request.url));
    devtools.on("Network.loadingFinished", ({ requestId, encodedDataLength }) =>
      sizes.set(urls.get(requestId) ?? requestId, encodedDataLength),
    );
    await page.goto(`/p/${listing.id}`);
    const canvas = await settled(page, SMALL);
    const picture = await canvasPicture(canvas);
    await context.close();
    return { sizes, picture };
  };
  const { picture } = await measure();
  const poster = await shop.api("seller").put(`/api/products/${listing.id}/poster`, {
    data: PNG.sync.write(noisy(picture)),
    headers: { "content-type": "image/png" },
  });
  expect(poster.ok()).toBe(true);
  const { poster_url } = await poster.json();
  expect(poster_url).not.toBeNull();

  const { sizes } = await measure();
  let first = 0;
  let whole = 0;
  for (const [url, bytes] of [...sizes].sort(([, a], [, b]) => b - a)) {
    console.log(`${String(bytes).padStart(9)} ${new URL(url).pathname}`);
    whole += bytes;
    const isLater = /\/assets\/viewer-/.test(url) || url.endsWith(listing.model?.stream_url ?? "?");
    if (!isLater) first += bytes;
  }
  console.log(
    `first picture ${first} bytes (at most ${FIRST_PICTURE_BYTES}), whole model ${whole} bytes (at most ${WHOLE_MODEL_BYTES})`,
  );
  expect([...sizes.keys()].some((url) => url.endsWith(poster_url))).toBe(true);
  expect(first).toBeLessThanOrEqual(FIRST_PICTURE_BYTES);
  expect(whole).toBeLessThanOrEqual(WHOLE_MODEL_BYTES);
});

/** A photograph compresses worse than a drawing: add a sensor's noise, the same every time. */
function noisy(picture: PNG): PNG {
  let state = 1;
  for (let i = 0; i < picture.data.length; i++) {
    if (i % 4 === 3) continue;
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    picture.data[i] = Math.min(255, Math.max(0, (picture.data[i] ?? 0) + (state >>> 28) - 8));
  }
  return picture;
}
