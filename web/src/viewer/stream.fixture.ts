// Writes ARS1 streams for tests: the decoder's counterpart, kept apart from it so that a mistake shows.
import { encodeOctahedral } from "../math/octahedral";
import type { Vec3 } from "../math/vec3";

export interface FixturePoint {
  position: Vec3;
  color: Vec3;
  normal: Vec3;
}

export interface FixtureOptions {
  chunkPoints?: number;
  normals?: boolean;
  /** Steps of deviation, one a point; 255: invented. */
  deviations?: number[];
  triangles?: Vec3[];
  header?: Record<string, unknown>;
}

export function encodeStream(points: FixturePoint[], options: FixtureOptions = {}): Uint8Array {
  const { chunkPoints = 4096, normals = true, deviations, triangles = [] } = options;
  const axis = (i: number) => points.map((point) => point.position[i] ?? 0);
  const min = [0, 1, 2].map((i) => Math.min(...axis(i)));
  const max = [0, 1, 2].map((i) => Math.max(...axis(i)));
  const header = {
    version: 1,
    kind: triangles.length > 0 ? "mesh" : "points",
    points: points.length,
    triangles: triangles.length,
    min,
    max,
    chunk_points: chunkPoints,
    has_normals: normals,
    ...(deviations ? { has_deviations: true } : {}),
    up: "z",
    ...options.header,
  };
  const bytes: number[] = [];
  for (let start = 0; start < points.length; start += chunkPoints) {
    const chunk = points.slice(start, start + chunkPoints);
    for (const { position } of chunk) {
      for (let i = 0; i < 3; i++) bytes.push(...u16(quantise(position[i] ?? 0, min[i] ?? 0, max[i] ?? 0)));
    }
    for (const { color } of chunk) bytes.push(...color);
    if (normals) for (const { normal } of chunk) bytes.push(...encodeOctahedral(normal).map((c) => c & 255));
    if (deviations) bytes.push(...deviations.slice(start, start + chunkPoints));
    while (bytes.length % 4 !== 0) bytes.push(0);
  }
  for (const triangle of triangles) for (const index of triangle) bytes.push(...u32(index));
  const json = new TextEncoder().encode(JSON.stringify(header));
  const padding = new Array<number>((4 - (json.length % 4)) % 4).fill(32);
  const prefix = [...new TextEncoder().encode("ARS1"), ...u32(json.length + padding.length)];
  return Uint8Array.from([...prefix, ...json, ...padding, ...bytes]);
}

function quantise(value: number, min: number, max: number): number {
  return max > min ? Math.round(((value - min) / (max - min)) * 65535) : 0;
}

const u16 = (n: number): number[] => [n & 255, n >> 8];
const u32 = (n: number): number[] => [n & 255, (n >> 8) & 255, (n >> 16) & 255, n >>> 24];
