// The check of an outline: what the canvas shows against what a projection of the shape gives.
import type { Page } from "@playwright/test";
import type { Cloud } from "./cloud";
import { expect, settled } from "./shop";
import { canvasMask, canvasPicture, overlap, projectedMask, type View } from "./silhouette";

/** Documented: a drag of 360 pixels is half a turn; the wheel zooms by e for each 1/0.0015 pixels. */
export const DEGREES_PER_PX = 0.5;
export const ZOOM_PER_WHEEL_PX = 0.0015;
const LEAST_OVERLAP = 0.9;

export async function drag(page: Page, dx: number, dy: number): Promise<void> {
  const box = await page.locator(".viewer-canvas").boundingBox();
  if (!box) throw new Error("no canvas");
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + dx, y + dy, { steps: 5 });
  await page.mouse.up();
}

/** `drawn` is what the viewer says it has drawn: points, or triangles of a mesh. */
export async function check(page: Page, { points }: Cloud, view: View, drawn: number): Promise<void> {
  const canvas = await settled(page, drawn);
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
