// The product's outline in the canvas against one projected here, before and after a drag by a known angle and a zoom.
import type { Cloud } from "../support/cloud";
import { cloud, LARGE, largeListing, SMALL, smallListing } from "../support/listings";
import { check, DEGREES_PER_PX, drag, ZOOM_PER_WHEEL_PX } from "../support/outline";
import { type Listing, type Shop, test } from "../support/shop";
import { FIRST_VIEW } from "../support/silhouette";

const SIZES: [number, () => Cloud, (shop: Shop) => Promise<Listing>][] = [
  [SMALL, cloud.small, smallListing],
  [LARGE, cloud.large, largeListing],
];

for (const [points, shape, listing] of SIZES) {
  test(`outline of ${points} points`, async ({ page, shop }) => {
    test.setTimeout(180_000);
    const { id } = await listing(shop);
    await page.goto(`/p/${id}`);
    await check(page, shape(), FIRST_VIEW, points);

    await drag(page, 90, 40);
    const turned = { azimuth: 30 - 90 * DEGREES_PER_PX, elevation: 22 + 40 * DEGREES_PER_PX, zoom: 1 };
    await check(page, shape(), turned, points);

    await page.mouse.wheel(0, -200);
    await check(page, shape(), { ...turned, zoom: Math.exp(200 * ZOOM_PER_WHEEL_PX) }, points);

    await drag(page, -300, -110);
    const below = { azimuth: turned.azimuth + 150, elevation: turned.elevation - 55 };
    await check(page, shape(), { ...below, zoom: Math.exp(200 * ZOOM_PER_WHEEL_PX) }, points);
  });
}
