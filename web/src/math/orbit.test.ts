import { describe, expect, it } from "vitest";
import * as orbit from "./orbit";
import { cross, dot, length, sub, type Vec3 } from "./vec3";

const BOX: orbit.Bounds = { min: [-0.1, -0.05, 0], max: [0.1, 0.05, 0.2] };

function checkClose(actual: Vec3, expected: Vec3) {
  expect(length(sub(actual, expected))).toBeLessThan(1e-9);
}

function at(azimuthDeg: number, elevationDeg: number): orbit.Orbit {
  const rad = Math.PI / 180;
  return { target: [0, 0, 0], azimuth: azimuthDeg * rad, elevation: elevationDeg * rad, distance: 2 };
}

describe("orbit", () => {
  it("stands in front, to the right and above where the angles say so", () => {
    checkClose(orbit.eye(at(0, 0)), [0, -2, 0]);
    checkClose(orbit.eye(at(90, 0)), [2, 0, 0]);
    checkClose(orbit.eye(at(180, 0)), [0, 2, 0]);
    checkClose(orbit.eye(at(0, 90)), [0, 0, 2]);
  });

  it("has a right-handed orthonormal basis everywhere, the poles included", () => {
    for (const azimuth of [-170, -45, 0, 30, 123]) {
      for (const elevation of [-90, -30, 0, 60, 90]) {
        const { right, up, forward } = orbit.basis(at(azimuth, elevation));
        checkClose(cross(right, forward), up);
        expect(Math.abs(dot(right, up))).toBeLessThan(1e-12);
        expect(length(forward)).toBeCloseTo(1, 12);
      }
    }
  });

  it("never tips over the poles", () => {
    const up = orbit.turn(at(0, 80), 0, 1);
    expect(up.elevation).toBeCloseTo(Math.PI / 2, 12);
    expect(orbit.turn(at(0, -80), 0, -1).elevation).toBeCloseTo(-Math.PI / 2, 12);
  });

  it("comes back to the same view after a whole turn", () => {
    let view = at(10, 20);
    for (let step = 0; step < 24; step++) view = orbit.turn(view, Math.PI / 12, 0);
    checkClose(orbit.eye(view), orbit.eye(at(10, 20)));
  });

  it("pans by the pixels it was given", () => {
    const view = at(35, 25);
    const moved = orbit.pan(view, 40, -30, 500);
    const { right, up, forward } = orbit.basis(view);
    // Project the old target with the new camera.
    const offset = sub(view.target, orbit.eye(moved));
    const focalPx = 250 / Math.tan(orbit.FIELD_OF_VIEW / 2);
    expect((dot(offset, right) / dot(offset, forward)) * focalPx).toBeCloseTo(40, 6);
    expect((-dot(offset, up) / dot(offset, forward)) * focalPx).toBeCloseTo(-30, 6);
  });

  it("zooms within limits that depend on the product", () => {
    const view = at(0, 0);
    expect(orbit.zoom(view, 2, 1).distance).toBeCloseTo(1, 12);
    expect(orbit.zoom(view, 1e9, 1).distance).toBeCloseTo(0.1, 12);
    expect(orbit.zoom(view, 1e-9, 1).distance).toBeCloseTo(20, 12);
  });

  it.each([0.5, 1, 1.8])("fits every corner into a picture of aspect %f", (aspect) => {
    const view = orbit.fit(BOX, aspect);
    const { right, up, forward } = orbit.basis(view);
    const tan = Math.tan(orbit.FIELD_OF_VIEW / 2);
    for (const x of [BOX.min[0], BOX.max[0]]) {
      for (const y of [BOX.min[1], BOX.max[1]]) {
        for (const z of [BOX.min[2], BOX.max[2]]) {
          const offset = sub([x, y, z], orbit.eye(view));
          const depth = dot(offset, forward);
          expect(Math.abs(dot(offset, up) / depth / tan)).toBeLessThan(1);
          expect(Math.abs(dot(offset, right) / depth / tan / aspect)).toBeLessThan(1);
        }
      }
    }
  });

  it("looks at a single point from a finite distance", () => {
    const view = orbit.fit({ min: [1, 2, 3], max: [1, 2, 3] }, 1);
    expect(view.distance).toBeGreaterThan(0);
    expect(Number.isFinite(view.distance)).toBe(true);
  });

  it("goes the shorter way between two views", () => {
    const middle = orbit.between(at(170, 0), at(-170, 0), 0.5);
    expect(Math.abs(middle.azimuth)).toBeCloseTo(Math.PI, 9);
    expect(orbit.between(at(0, 0), at(90, 10), 1).azimuth).toBeCloseTo(Math.PI / 2, 12);
  });
});
