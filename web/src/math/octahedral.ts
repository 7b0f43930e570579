// Unit normals in two signed bytes: octahedral mapping after Meyer et al. 2010, as ARS1 streams carry it.
import type { Vec3 } from "./vec3";

const FULL = 127;

/** Writes the unit normal of (u, v), each -127..127, as three signed bytes to `out` at `offset`. */
export function decodeOctahedral(u: number, v: number, out: Int8Array, offset: number): void {
  let x = Math.max(-1, u / FULL);
  let y = Math.max(-1, v / FULL);
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) {
    const foldedX = (1 - Math.abs(y)) * sign(x);
    y = (1 - Math.abs(x)) * sign(y);
    x = foldedX;
  }
  const norm = FULL / Math.sqrt(x * x + y * y + z * z);
  out[offset] = Math.round(x * norm);
  out[offset + 1] = Math.round(y * norm);
  out[offset + 2] = Math.round(z * norm);
}

/** The two signed bytes of a unit normal. */
export function encodeOctahedral([x, y, z]: Vec3): [number, number] {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  let [u, v] = [x / sum, y / sum];
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * sign(u), (1 - Math.abs(u)) * sign(v)];
  return [Math.round(u * FULL), Math.round(v * FULL)];
}

/** Zero counts as positive: the fold must not collapse onto an axis. */
function sign(value: number): number {
  return value < 0 ? -1 : 1;
}
