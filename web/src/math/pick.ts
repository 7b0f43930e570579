// Which point of a model lies under a place of the picture. Points are quantised between min and max (see viewer/stream.ts).
import { type Bounds, basis, eye, FIELD_OF_VIEW, type Orbit } from "./orbit";
import { add, cross, dot, scale, sub, type Vec3 } from "./vec3";

/** A line of sight: from `origin` along the unit vector `direction`. */
export interface Ray {
  readonly origin: Vec3;
  readonly direction: Vec3;
}

/** Through the picture at (x, y): -1..1 to the right and up. */
export function sightLine(orbit: Orbit, aspect: number, x: number, y: number): Ray {
  const { right, up, forward } = basis(orbit);
  const tan = Math.tan(FIELD_OF_VIEW / 2);
  const along = add(add(forward, scale(right, x * tan * aspect)), scale(up, y * tan));
  return { origin: eye(orbit), direction: scale(along, 1 / Math.sqrt(dot(along, along))) };
}

/** The nearest point within `slope` (metres off the ray for each metre along it), or null. */
export function pickPoint(
  ray: Ray,
  bounds: Bounds,
  positions: Uint16Array,
  lanes: number,
  points: number,
  slope: number,
): Vec3 | null {
  let best: Vec3 | null = null;
  let bestAlong = Number.POSITIVE_INFINITY;
  for (let i = 0; i < points; i++) {
    const point = decode(positions, i * lanes, bounds);
    const offset = sub(point, ray.origin);
    const along = dot(offset, ray.direction);
    if (along <= 0 || along >= bestAlong) continue;
    const reach = slope * along;
    if (dot(offset, offset) - along * along > reach * reach) continue;
    best = point;
    bestAlong = along;
  }
  return best;
}

/** Where the ray first meets a triangle (Moeller and Trumbore 1997), or null. */
export function pickTriangle(
  ray: Ray,
  bounds: Bounds,
  positions: Uint16Array,
  lanes: number,
  indices: Uint32Array,
): Vec3 | null {
  let nearest = Number.POSITIVE_INFINITY;
  for (let i = 0; i + 2 < indices.length; i += 3) {
    const a = decode(positions, (indices[i] ?? 0) * lanes, bounds);
    const ab = sub(decode(positions, (indices[i + 1] ?? 0) * lanes, bounds), a);
    const ac = sub(decode(positions, (indices[i + 2] ?? 0) * lanes, bounds), a);
    const p = cross(ray.direction, ac);
    const det = dot(ab, p);
    if (det === 0) continue;
    const t = sub(ray.origin, a);
    const u = dot(t, p) / det;
    const q = cross(t, ab);
    const v = dot(ray.direction, q) / det;
    if (u < 0 || v < 0 || u + v > 1) continue;
    const along = dot(ac, q) / det;
    if (along > 0 && along < nearest) nearest = along;
  }
  return Number.isFinite(nearest) ? add(ray.origin, scale(ray.direction, nearest)) : null;
}

function decode(positions: Uint16Array, at: number, { min, max }: Bounds): Vec3 {
  const axis = (i: 0 | 1 | 2) => min[i] + ((positions[at + i] ?? 0) / 65535) * (max[i] - min[i]);
  return [axis(0), axis(1), axis(2)];
}
