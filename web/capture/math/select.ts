// Which points of a model lie inside an outline drawn on its picture. Places are pixels from the picture's top left.
import { basis, eye, FIELD_OF_VIEW, type Orbit } from "../../src/math/orbit";
import { dot, type Vec3 } from "../../src/math/vec3";
import { LANES } from "../../src/viewer/stream";
import type { Sight } from "../../src/viewer/viewer";

export interface Place {
  readonly x: number;
  readonly y: number;
}

export interface Size {
  readonly width: number;
  readonly height: number;
}

/** How far behind the nearest point of a place a point may lie and still count as seen, in shares of the model's size. */
const FRONT_SHARE = 0.05;
const CELL_PX = 6;

/** Indices in rising order. `onlyFront` leaves out what lies hidden behind other points. */
export function pointsInside(
  sight: Sight,
  size: Size,
  outline: readonly Place[],
  onlyFront = false,
): Uint32Array<ArrayBuffer> {
  if (outline.length < 3) return new Uint32Array(0);
  const projected = project(sight, size);
  const nearest = onlyFront ? nearestByCell(projected, size) : null;
  const slack = onlyFront ? FRONT_SHARE * diagonal(sight) : 0;
  const isInside = insideOf(outline);
  const found: number[] = [];
  for (let i = 0; i < sight.points; i++) {
    const [x, y, depth] = [projected[i * 3] ?? 0, projected[i * 3 + 1] ?? 0, projected[i * 3 + 2] ?? 0];
    if (depth <= 0 || !isInside(x, y)) continue;
    if (nearest && depth > (nearest[cellOf(x, y, size)] ?? 0) + slack) continue;
    found.push(i);
  }
  return Uint32Array.from(found);
}

/** x, y in pixels and the depth along the view in metres, three numbers a point; the renderer's own camera. */
export function project({ orbit, bounds, positions, points }: Sight, { width, height }: Size): Float64Array {
  const camera = cameraOf(orbit, height);
  const { min, max } = bounds;
  const scale = [0, 1, 2].map((axis) => ((max[axis] ?? 0) - (min[axis] ?? 0)) / 65535);
  const out = new Float64Array(points * 3);
  for (let i = 0; i < points; i++) {
    const at = (axis: 0 | 1 | 2) =>
      min[axis] + (positions[i * LANES + axis] ?? 0) * (scale[axis] ?? 0) - camera.place[axis];
    const offset: Vec3 = [at(0), at(1), at(2)];
    const depth = dot(offset, camera.forward);
    out[i * 3] = width / 2 + (camera.focal * dot(offset, camera.right)) / depth;
    out[i * 3 + 1] = height / 2 - (camera.focal * dot(offset, camera.up)) / depth;
    out[i * 3 + 2] = depth;
  }
  return out;
}

function cameraOf(orbit: Orbit, height: number) {
  return { ...basis(orbit), place: eye(orbit), focal: height / (2 * Math.tan(FIELD_OF_VIEW / 2)) };
}

function diagonal({ bounds: { min, max } }: Sight): number {
  return Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]);
}

function nearestByCell(projected: Float64Array, size: Size): Float64Array {
  const nearest = new Float64Array(columns(size) * rows(size)).fill(Number.POSITIVE_INFINITY);
  for (let i = 0; i < projected.length; i += 3) {
    const depth = projected[i + 2] ?? 0;
    const cell = cellOf(projected[i] ?? 0, projected[i + 1] ?? 0, size);
    if (depth > 0 && cell >= 0 && depth < (nearest[cell] ?? 0)) nearest[cell] = depth;
  }
  return nearest;
}

const columns = ({ width }: Size): number => Math.max(1, Math.ceil(width / CELL_PX));
const rows = ({ height }: Size): number => Math.max(1, Math.ceil(height / CELL_PX));

function cellOf(x: number, y: number, size: Size): number {
  const [column, row] = [Math.floor(x / CELL_PX), Math.floor(y / CELL_PX)];
  const isOutside = column < 0 || row < 0 || column >= columns(size) || row >= rows(size);
  return isOutside ? -1 : row * columns(size) + column;
}

/** Even-odd rule, after a quick look at the box round the outline. */
export function insideOf(outline: readonly Place[]): (x: number, y: number) => boolean {
  const [xs, ys] = [outline.map(({ x }) => x), outline.map(({ y }) => y)];
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const [top, bottom] = [Math.min(...ys), Math.max(...ys)];
  return (x, y) => {
    if (x < left || x > right || y < top || y > bottom) return false;
    let inside = false;
    let before = outline.at(-1);
    for (const corner of outline) {
      if (before && corner.y > y !== before.y > y) {
        const crossing = before.x + ((y - before.y) / (corner.y - before.y)) * (corner.x - before.x);
        if (x < crossing) inside = !inside;
      }
      before = corner;
    }
    return inside;
  };
}

export function boxOutline(a: Place, b: Place): Place[] {
  const [left, right] = [Math.min(a.x, b.x), Math.max(a.x, b.x)];
  const [top, bottom] = [Math.min(a.y, b.y), Math.max(a.y, b.y)];
  return [
    { x: left, y: top },
    { x: right, y: top },
    { x: right, y: bottom },
    { x: left, y: bottom },
  ];
}

/** Both selections together, in rising order. */
export function union(a: Uint32Array, b: Uint32Array): Uint32Array<ArrayBuffer> {
  return Uint32Array.from(new Set([...a, ...b])).sort();
}
