import { describe, expect, it } from "vitest";
import { type Orbit, turn } from "../../src/math/orbit";
import { sightLine } from "../../src/math/pick";
import { add, scale, type Vec3 } from "../../src/math/vec3";
import { LANES } from "../../src/viewer/stream";
import type { Sight } from "../../src/viewer/viewer";
import { boxOutline, insideOf, pointsInside, project, union } from "./select";

const SIZE = { width: 640, height: 480 };
const ORBIT: Orbit = { target: [0, 0, 0.1], azimuth: 0.5, elevation: 0.3, distance: 0.8 };
const BOUNDS = { min: [-0.2, -0.2, 0] as Vec3, max: [0.2, 0.2, 0.3] as Vec3 };

function sightOf(points: readonly Vec3[], orbit = ORBIT): Sight {
  const positions = new Uint16Array(points.length * LANES);
  for (const [i, point] of points.entries()) {
    for (const axis of [0, 1, 2] as const) {
      const share = (point[axis] - BOUNDS.min[axis]) / (BOUNDS.max[axis] - BOUNDS.min[axis]);
      positions[i * LANES + axis] = Math.round(share * 65535);
    }
  }
  return { orbit, bounds: BOUNDS, positions, points: points.length };
}

/** The point that the picture shows at a place, so far away. */
function pointAt(x: number, y: number, metres: number, orbit = ORBIT): Vec3 {
  const ray = sightLine(orbit, SIZE.width / SIZE.height, (2 * x) / SIZE.width - 1, 1 - (2 * y) / SIZE.height);
  return add(ray.origin, scale(ray.direction, metres));
}

describe("project", () => {
  it("is the inverse of the line of sight", () => {
    const orbit = turn(ORBIT, 1.1, 0.2);
    const places: [number, number][] = [
      [320, 240],
      [200, 150],
      [410, 300],
    ];
    const sight = sightOf(
      places.map(([x, y]) => pointAt(x, y, 0.8, orbit)),
      orbit,
    );
    const found = project(sight, SIZE);
    for (const [i, [x, y]] of places.entries()) {
      expect(found[i * 3]).toBeCloseTo(x, 1);
      expect(found[i * 3 + 1]).toBeCloseTo(y, 1);
      expect(found[i * 3 + 2]).toBeGreaterThan(0.7);
    }
  });
});

describe("points inside an outline", () => {
  const near = pointAt(300, 200, 0.7);
  const behind = pointAt(300, 200, 0.9);
  const aside = pointAt(420, 200, 0.8);
  const sight = sightOf([near, behind, aside]);
  const box = boxOutline({ x: 310, y: 210 }, { x: 290, y: 190 });

  it("are those in the box, whatever its corners' order", () => {
    expect([...pointsInside(sight, SIZE, box)]).toEqual([0, 1]);
  });

  it("are only those in front where asked for", () => {
    expect([...pointsInside(sight, SIZE, box, true)]).toEqual([0]);
  });

  it("are none for an outline without an inside", () => {
    expect(pointsInside(sight, SIZE, box.slice(0, 2))).toHaveLength(0);
  });

  it("follow a lasso's bay", () => {
    const bay = [
      { x: 250, y: 150 },
      { x: 450, y: 150 },
      { x: 450, y: 250 },
      { x: 350, y: 250 },
      { x: 350, y: 170 },
      { x: 250, y: 170 },
    ];
    expect([...pointsInside(sight, SIZE, bay)]).toEqual([2]);
    expect(insideOf(bay)(300, 160)).toBe(true);
    expect(insideOf(bay)(300, 200)).toBe(false);
  });

  it("leave out what lies behind the camera", () => {
    const inside = { ...ORBIT, distance: 0.05 };
    const back = sightOf([pointAt(320, 240, -0.1, inside)], inside);
    expect(pointsInside(back, SIZE, boxOutline({ x: 0, y: 0 }, { x: 640, y: 480 }))).toHaveLength(0);
  });
});

describe("union", () => {
  it("has each once, in rising order", () => {
    expect([...union(Uint32Array.of(5, 1), Uint32Array.of(300, 5, 20))]).toEqual([1, 5, 20, 300]);
  });
});
