// A thing of known shape that looks different from every side: a foot, a tower on one corner and a ball on the opposite side.
// World: metres, z up. Points lie evenly on its surfaces.

export type Point = [number, number, number];

export interface Cloud {
  readonly points: Point[];
  readonly colors: Point[];
}

interface Patch {
  readonly area: number;
  readonly color: Point;
  /** A point of the surface for two numbers in 0..1. */
  at(u: number, v: number): Point;
}

/** Steps of the R2 sequence (Roberts 2018): even in the plane without a grid's lines. */
const STEP_U = 0.7548776662466927;
const STEP_V = 0.5698402909980532;

function surfaces(): Patch[] {
  return [
    ...box([-0.08, -0.05, 0], [0.08, 0.05, 0.05], [190, 60, 40]),
    ...box([-0.08, -0.05, 0.05], [-0.035, -0.01, 0.17], [40, 90, 170]),
    sphere([0.045, 0.02, 0.085], 0.035, [60, 140, 60]),
  ];
}

export function makeCloud(count: number): Cloud {
  const patches = surfaces();
  const total = patches.reduce((sum, patch) => sum + patch.area, 0);
  const points: Point[] = [];
  const colors: Point[] = [];
  let areaSoFar = 0;
  for (const patch of patches) {
    areaSoFar += patch.area;
    const upTo = Math.round((areaSoFar / total) * count);
    for (let i = points.length; i < upTo; i++) {
      points.push(patch.at((i * STEP_U) % 1, (i * STEP_V) % 1));
      colors.push(patch.color);
    }
  }
  return { points, colors };
}

function box(min: Point, max: Point, color: Point): Patch[] {
  const [x, y, z] = [max[0] - min[0], max[1] - min[1], max[2] - min[2]];
  const face = (area: number, at: (u: number, v: number) => Point): Patch => ({ area, color, at });
  return [min, max].flatMap((side) => [
    face(y * z, (u, v) => [side[0], min[1] + u * y, min[2] + v * z]),
    face(x * z, (u, v) => [min[0] + u * x, side[1], min[2] + v * z]),
    face(x * y, (u, v) => [min[0] + u * x, min[1] + v * y, side[2]]),
  ]);
}

function sphere(middle: Point, radius: number, color: Point): Patch {
  return {
    area: 4 * Math.PI * radius * radius,
    color,
    at(u, v) {
      const z = 1 - 2 * u;
      const ring = Math.sqrt(1 - z * z);
      const angle = 2 * Math.PI * v;
      return [
        middle[0] + radius * ring * Math.cos(angle),
        middle[1] + radius * ring * Math.sin(angle),
        middle[2] + radius * z,
      ];
    },
  };
}

/** Text, a point a line, millimetres with three decimals. */
export function writeAsc({ points, colors }: Cloud): Buffer {
  const line = (point: Point, i: number) =>
    `${point.map((c) => (c * 1000).toFixed(3)).join(" ")} ${(colors[i] ?? [0, 0, 0]).join(" ")}\n`;
  return Buffer.from(points.map(line).join(""));
}

/** Binary little-endian, metres. */
export function writePly({ points, colors }: Cloud): Buffer {
  const properties = [
    ...["x", "y", "z"].map((name) => `property float ${name}`),
    ...["red", "green", "blue"].map((name) => `property uchar ${name}`),
  ];
  const header = ["ply", "format binary_little_endian 1.0", `element vertex ${points.length}`, ...properties];
  const body = Buffer.alloc(points.length * 15);
  for (const [i, [x, y, z]] of points.entries()) {
    body.writeFloatLE(x, i * 15);
    body.writeFloatLE(y, i * 15 + 4);
    body.writeFloatLE(z, i * 15 + 8);
    body.set(colors[i] ?? [0, 0, 0], i * 15 + 12);
  }
  return Buffer.concat([Buffer.from(`${header.join("\n")}\nend_header\n`), body]);
}

/** The same thing as triangles in a glTF 2.0 binary, y up; every surface is a grid of `cells` by `cells`. */
export function writeGlb(cells: number): { readonly bytes: Buffer; readonly triangles: number } {
  const positions: number[] = [];
  const colors: number[] = [];
  const indices: number[] = [];
  for (const patch of surfaces()) {
    const first = positions.length / 3;
    for (let i = 0; i <= cells; i++) {
      for (let j = 0; j <= cells; j++) {
        const [x, y, z] = patch.at(i / cells, j / cells);
        positions.push(x, z, -y);
        colors.push(...patch.color, 255);
        if (i === cells || j === cells) continue;
        const corner = first + i * (cells + 1) + j;
        indices.push(
          corner,
          corner + 1,
          corner + cells + 1,
          corner + 1,
          corner + cells + 2,
          corner + cells + 1,
        );
      }
    }
  }
  const parts = [Float32Array.from(positions), Uint8Array.from(colors), Uint32Array.from(indices)];
  const bin = Buffer.concat(parts.map((part) => Buffer.from(part.buffer)));
  const [positionBytes, colorBytes] = [positions.length * 4, colors.length];
  const axis = (k: number) => positions.filter((_, i) => i % 3 === k);
  const bound = (pick: (a: number, b: number) => number) => [0, 1, 2].map((k) => axis(k).reduce(pick));
  const vertices = positions.length / 3;
  const json = JSON.stringify({
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, COLOR_0: 1 }, indices: 2 }] }],
    buffers: [{ byteLength: bin.length }],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: positionBytes },
      { buffer: 0, byteOffset: positionBytes, byteLength: colorBytes },
      { buffer: 0, byteOffset: positionBytes + colorBytes, byteLength: indices.length * 4 },
    ],
    accessors: [
      {
        bufferView: 0,
        componentType: 5126,
        count: vertices,
        type: "VEC3",
        min: bound(Math.min),
        max: bound(Math.max),
      },
      { bufferView: 1, componentType: 5121, normalized: true, count: vertices, type: "VEC4" },
      { bufferView: 2, componentType: 5125, count: indices.length, type: "SCALAR" },
    ],
  });
  const text = Buffer.from(json.padEnd(Math.ceil(json.length / 4) * 4));
  const chunk = (type: string, data: Buffer) => Buffer.concat([u32(data.length), Buffer.from(type), data]);
  const body = Buffer.concat([chunk("JSON", text), chunk("BIN\0", bin)]);
  const bytes = Buffer.concat([Buffer.from("glTF"), u32(2), u32(12 + body.length), body]);
  return { bytes, triangles: indices.length / 3 };
}

function u32(value: number): Buffer {
  const bytes = Buffer.alloc(4);
  bytes.writeUInt32LE(value);
  return bytes;
}
