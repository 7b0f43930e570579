import { expect, it } from "vitest";
import { decodeOctahedral, encodeOctahedral } from "./octahedral";
import { dot, length, scale, type Vec3 } from "./vec3";

function roundTrip(normal: Vec3): Vec3 {
  const [u, v] = encodeOctahedral(normal);
  const out = new Int8Array(3);
  decodeOctahedral(u, v, out, 0);
  const decoded: Vec3 = [out[0] ?? 0, out[1] ?? 0, out[2] ?? 0];
  return scale(decoded, 1 / length(decoded));
}

it("keeps directions all over the sphere within 1.5 degrees", () => {
  for (let i = 0; i < 2000; i++) {
    const z = 1 - (2 * (i + 0.5)) / 2000;
    const angle = i * 2.399963;
    const ring = Math.sqrt(1 - z * z);
    const normal: Vec3 = [ring * Math.cos(angle), ring * Math.sin(angle), z];
    expect(dot(normal, roundTrip(normal))).toBeGreaterThan(Math.cos((1.5 * Math.PI) / 180));
  }
});

it.each<Vec3>([
  [0, 0, 1],
  [0, 0, -1],
  [1, 0, 0],
  [0, -1, 0],
])("keeps the axis %s %s %s exactly", (...axis) => {
  expect(roundTrip(axis as unknown as Vec3)).toEqual(axis);
});

it("stays a unit normal for every pair of bytes", () => {
  const out = new Int8Array(3);
  for (let u = -128; u < 128; u += 5) {
    for (let v = -128; v < 128; v += 5) {
      decodeOctahedral(u, v, out, 0);
      const norm = Math.hypot(out[0] ?? 0, out[1] ?? 0, out[2] ?? 0);
      expect(norm).toBeGreaterThan(125);
      expect(norm).toBeLessThan(129);
    }
  }
});
