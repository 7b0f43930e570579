import { expect, it } from "vitest";
import type { Bounds, Orbit } from "./orbit";
import { pickPoint, pickTriangle, sightLine } from "./pick";
import { length, sub, type Vec3 } from "./vec3";

const BOUNDS: Bounds = { min: [-1, -1, -1], max: [1, 1, 1] };
const FRONT: Orbit = { target: [0, 0, 0], azimuth: 0, elevation: 0, distance: 5 };
// In front of each other on the y axis, and one aside.
const POSITIONS = quantise([
  [0, 1, 0],
  [0, -1, 0],
  [1, 0, 0],
]);

function quantise(points: Vec3[]): Uint16Array {
  return Uint16Array.from(points.flatMap((p) => [...p.map((c) => Math.round(((c + 1) / 2) * 65535)), 0]));
}

function checkAt(found: Vec3 | null, expected: Vec3) {
  expect(found).not.toBeNull();
  if (found) expect(length(sub(found, expected))).toBeLessThan(1e-4);
}

it("picks the nearest of the points under the middle", () => {
  checkAt(pickPoint(sightLine(FRONT, 1, 0, 0), BOUNDS, POSITIONS, 4, 3, 0.01), [0, -1, 0]);
});

it("sees the other one from behind", () => {
  const behind = { ...FRONT, azimuth: Math.PI };
  checkAt(pickPoint(sightLine(behind, 1, 0, 0), BOUNDS, POSITIONS, 4, 3, 0.01), [0, 1, 0]);
});

it("picks aside from the middle, with the picture's aspect", () => {
  const x = 1 / 5 / Math.tan((35 * Math.PI) / 360);
  checkAt(pickPoint(sightLine(FRONT, 2, x / 2, 0), BOUNDS, POSITIONS, 4, 3, 0.01), [1, 0, 0]);
});

it("picks nothing beside the product and nothing not yet loaded", () => {
  expect(pickPoint(sightLine(FRONT, 1, 0.5, 0.8), BOUNDS, POSITIONS, 4, 3, 0.01)).toBeNull();
  expect(pickPoint(sightLine(FRONT, 1, 0, 0), BOUNDS, POSITIONS, 4, 0, 0.01)).toBeNull();
});

it("meets the nearer of two triangles where the ray goes through", () => {
  const positions = quantise([
    [-1, 0.5, -1],
    [1, 0.5, -1],
    [0, 0.5, 1],
    [-1, -0.5, -1],
    [1, -0.5, -1],
    [0, -0.5, 1],
  ]);
  const indices = Uint32Array.of(0, 1, 2, 3, 4, 5);
  checkAt(pickTriangle(sightLine(FRONT, 1, 0, 0), BOUNDS, positions, 4, indices), [0, -0.5, 0]);
  expect(pickTriangle(sightLine(FRONT, 1, 0.9, 0.9), BOUNDS, positions, 4, indices)).toBeNull();
});
