// The product's outline twice: from the viewer's canvas, and projected here with the viewer's documented camera, written down
// again and not imported, so that a mistake in the one shows against the other.
import type { Locator } from "@playwright/test";
import { PNG } from "pngjs";
import type { Point } from "./cloud";

export interface Mask {
  readonly width: number;
  readonly height: number;
  readonly inside: Uint8Array;
}

/** Where a viewer's camera stands; degrees, and how much nearer than at first. */
export interface View {
  readonly azimuth: number;
  readonly elevation: number;
  readonly zoom: number;
}

/** Documented: 30 degrees to the right, 22 above, 35 degrees of view, the ball round the product with 8 % of air. */
export const FIRST_VIEW: View = { azimuth: 30, elevation: 22, zoom: 1 };
const FIELD_OF_VIEW = radians(35);
const AIR = 1.08;
/** The viewer's plain backdrop, and how far a colour must be from it to be the product's. */
const BACKDROP: Point = [0xee, 0xf1, 0xee];
const DIFFERENT = 24;
/** The line round the view, which a screenshot of the canvas may touch. */
const FRAME_PX = 2;

function radians(degrees: number): number {
  return (degrees * Math.PI) / 180;
}

export async function canvasPicture(canvas: Locator): Promise<PNG> {
  return PNG.sync.read(await canvas.screenshot());
}

export function canvasMask({ width, height, data }: PNG): Mask {
  const inside = new Uint8Array(width * height);
  for (let i = 0; i < inside.length; i++) {
    const [x, y] = [i % width, Math.floor(i / width)];
    if (Math.min(x, y, width - 1 - x, height - 1 - y) < FRAME_PX) continue;
    const off = BACKDROP.map((level, c) => Math.abs((data[i * 4 + c] ?? 0) - level));
    inside[i] = Math.max(...off) > DIFFERENT ? 1 : 0;
  }
  return { width, height, inside };
}

/** The points as discs of `radiusPx`, seen from `view` in a picture of this size. */
export function projectedMask(
  points: Point[],
  view: View,
  width: number,
  height: number,
  radiusPx = 1.5,
): Mask {
  const project = projection(points, view, width, height);
  const inside = new Uint8Array(width * height);
  for (const point of points) {
    const [x, y] = project(point);
    for (let row = Math.ceil(y - radiusPx - 0.5); row <= y + radiusPx - 0.5; row++) {
      for (let column = Math.ceil(x - radiusPx - 0.5); column <= x + radiusPx - 0.5; column++) {
        const off = Math.hypot(column + 0.5 - x, row + 0.5 - y);
        const isInPicture = row >= 0 && row < height && column >= 0 && column < width;
        if (off <= radiusPx && isInPicture) inside[row * width + column] = 1;
      }
    }
  }
  return { width, height, inside };
}

function projection(
  points: Point[],
  view: View,
  width: number,
  height: number,
): (point: Point) => [number, number] {
  const low: Point = [Infinity, Infinity, Infinity];
  const high: Point = [-Infinity, -Infinity, -Infinity];
  for (const point of points) {
    for (const axis of [0, 1, 2] as const) {
      low[axis] = Math.min(low[axis], point[axis]);
      high[axis] = Math.max(high[axis], point[axis]);
    }
  }
  const middle = low.map((value, axis) => (value + (high[axis] ?? 0)) / 2) as Point;
  const radius = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) / 2;
  const halfView = Math.min(FIELD_OF_VIEW / 2, Math.atan((Math.tan(FIELD_OF_VIEW / 2) * width) / height));
  const distance = (AIR * radius) / Math.sin(halfView) / view.zoom;
  const focalPx = height / 2 / Math.tan(FIELD_OF_VIEW / 2);
  const [a, e] = [radians(view.azimuth), radians(view.elevation)];
  return (point) => {
    const [x, y, z] = [point[0] - middle[0], point[1] - middle[1], point[2] - middle[2]];
    // Turn the world by -azimuth about z, then tip it towards the camera by the elevation.
    const right = x * Math.cos(a) + y * Math.sin(a);
    const away = -x * Math.sin(a) + y * Math.cos(a);
    const up = z * Math.cos(e) + away * Math.sin(e);
    const depth = distance + away * Math.cos(e) - z * Math.sin(e);
    return [width / 2 + (focalPx * right) / depth, height / 2 - (focalPx * up) / depth];
  };
}

/** Intersection over union. */
export function overlap(a: Mask, b: Mask): number {
  if (a.width !== b.width || a.height !== b.height) throw new Error("masks of two sizes");
  let both = 0;
  let either = 0;
  for (let i = 0; i < a.inside.length; i++) {
    const sum = (a.inside[i] ?? 0) + (b.inside[i] ?? 0);
    if (sum === 2) both++;
    if (sum > 0) either++;
  }
  return either === 0 ? 0 : both / either;
}

export function share(mask: Mask): number {
  return mask.inside.reduce((sum, bit) => sum + bit, 0) / mask.inside.length;
}

/** Share of pixels that differ between two pictures. */
export function difference(a: PNG, b: PNG): number {
  let changed = 0;
  for (let i = 0; i < a.data.length; i += 4) {
    const off = [0, 1, 2].map((c) => Math.abs((a.data[i + c] ?? 0) - (b.data[i + c] ?? 0)));
    if (Math.max(...off) > 8) changed++;
  }
  return changed / (a.data.length / 4);
}
