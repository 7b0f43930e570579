// The product's outline in the canvas against one projected here, before and after a drag by a known angle and a zoom.
import type { Page } from "@playwright/test";
import type { Cloud } from "../support/cloud";
import { cloud, LARGE, largeListing, SMALL, smallListing } from "../support/listings";
import { expect, type Listing, type Shop, settled, test } from "../support/shop";
import {
  canvasMask,
  canvasPicture,
  FIRST_VIEW,
  overlap,
  projectedMask,
  type View,
} from "../support/silhouette";

/** Documented: a drag of 360 pixels is half a turn; the wheel zooms by e for each 1/0.0015 pixels. */
const DEGREES_PER_PX = 0.5;
const ZOOM_PER_WHEEL_PX = 0.0015;
const LEAST_OVERLAP = 0.9;

const SIZES: [number, () => Cloud, (shop: Shop) => Promise<Listing>][] = [
  [SMALL, cloud.small, smallListing],
  [LARGE, cloud.large, largeListing],
];

for (const [points, shape, listing] of SIZES) {
  test(`outline of ${points} points`, async ({ page, shop }) => {
    test.setTimeout(180_000);
    const { id } = await listing(shop);
    await page.goto(`/p/${id}`);
    await check(page, shape(), FIRST_VIEW);

    await drag(page, 90, 40);
    const turned = { azimuth: 30 - 90 * DEGREES_PER_PX, elevation: 22 + 40 * DEGREES_PER_PX, zoom: 1 };
    await check(page, shape(), turned);

    await page.mouse.wheel(0, -200);
    await check(page, shape(), { ...turned, zoom: Math.exp(200 * ZOOM_PER_WHEEL_PX) });

    await drag(page, -300, -110);
    const below = { azimuth: turned.azimuth + 150, elevation: turned.elevation - 55 };
    await check(page, shape(), { ...below, zoom: Math.exp(200 * ZOOM_PER_WHEEL_PX) });
  });
}

async function drag(page: Page, dx: number, dy: number): Promise<void> {
  const box = await page.locator(".viewer-canvas").boundingBox();
  if (!box) throw new Error("no canvas");
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + dx, y + dy, { steps: 5 });
  await page.mouse.up();
}

async function check(page: Page, { points }: Cloud, view: View): Promise<void> {
  const canvas = await settled(page, points.length);
  const seen = canvasMask(await canvasPicture(canvas));
  const expected = projectedMask(points, view, seen.width, seen.height);
  const agreement = overlap(seen, expected);
  const from = `${view.azimuth}°, ${view.elevation}°, zoom ${view.zoom.toFixed(2)}`;
  console.log(`outline of ${points.length} points from ${from}: IoU ${agreement.toFixed(3)}`);
  expect(agreement).toBeGreaterThanOrEqual(LEAST_OVERLAP);
  // The test can fail: a view 20 degrees off does not agree as well.
  const off = projectedMask(points, { ...view, azimuth: view.azimuth + 20 }, seen.width, seen.height);
  expect(overlap(seen, off)).toBeLessThan(agreement - 0.05);
}
