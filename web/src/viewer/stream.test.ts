import { describe, expect, it } from "vitest";
import { bodyBytes, INVENTED, LANES, MEASURED, StreamDecoder, StreamError } from "./stream";
import { encodeStream, type FixtureOptions, type FixturePoint } from "./stream.fixture";

const UP = [0, 0, 1] as const;

function cloud(count: number): FixturePoint[] {
  return Array.from({ length: count }, (_, i) => ({
    position: [i * 0.001, (i % 7) * 0.01, (i % 3) * 0.02],
    color: [i % 256, (i * 3) % 256, 7],
    normal: UP,
  }));
}

function decode(bytes: Uint8Array, pieceBytes = bytes.length, expected: number | null = bytes.length) {
  const decoder = new StreamDecoder(expected);
  for (let at = 0; at < bytes.length; at += pieceBytes) decoder.push(bytes.subarray(at, at + pieceBytes));
  decoder.finish();
  return decoder;
}

/** What the decoder says of a stream that must be refused. */
function refusal(bytes: Uint8Array, expected: number | null = null): string {
  try {
    decode(bytes, bytes.length, expected);
  } catch (error) {
    expect(error).toBeInstanceOf(StreamError);
    return (error as Error).message;
  }
  throw new Error("the stream was accepted");
}

function refusedHeader(header: Record<string, unknown>): string {
  return refusal(encodeStream(cloud(5), { header }));
}

describe("StreamDecoder", () => {
  it.each([1, 3, 7, 64, 100_000])("gives the same model in pieces of %i bytes", (pieceBytes) => {
    const points = cloud(50);
    const decoder = decode(encodeStream(points, { chunkPoints: 8 }), pieceBytes);
    expect(decoder.pointsReady).toBe(50);
    const { model, header } = decoder;
    if (model === null || header === null) throw new Error("nothing decoded");
    points.forEach((point, i) => {
      for (let axis = 0; axis < 3; axis++) {
        const [low, high] = [header.min[axis] ?? 0, header.max[axis] ?? 0];
        const value = low + ((model.positions[i * LANES + axis] ?? 0) / 65535) * (high - low);
        expect(value).toBeCloseTo(point.position[axis] ?? 0, 5);
        expect(model.colors[i * LANES + axis]).toBe(point.color[axis]);
      }
      expect([...model.normals.subarray(i * LANES, i * LANES + 3)]).toEqual([0, 0, 127]);
    });
  });

  it("tells invented points from measured ones", () => {
    const bytes = encodeStream(cloud(7), { chunkPoints: 4, deviations: [3, 255, 0, 254, 255, 9, 10] });
    const { model, inventedPoints } = decode(bytes, 5);
    const flags = Array.from({ length: 7 }, (_, i) => model?.colors[i * LANES + 3]);
    const [m, i] = [MEASURED, INVENTED];
    expect(flags).toEqual([m, i, m, m, i, m, m]);
    expect(inventedPoints).toBe(2);
  });

  it.each<[string, FixtureOptions]>([
    ["one point", {}],
    ["without normals", { normals: false, chunkPoints: 3 }],
    ["whole chunks", { chunkPoints: 5 }],
  ])("knows the length of %s", (_, options) => {
    const bytes = encodeStream(cloud(options.chunkPoints ? 10 : 1), options);
    const decoder = decode(bytes);
    if (decoder.header === null) throw new Error("no header");
    const headerBytes = new DataView(bytes.buffer).getUint32(4, true);
    expect(8 + headerBytes + bodyBytes(decoder.header)).toBe(bytes.length);
  });

  it("shows points before the end has come", () => {
    const bytes = encodeStream(cloud(100), { chunkPoints: 10 });
    const decoder = new StreamDecoder(bytes.length);
    decoder.push(bytes.subarray(0, bytes.length / 2));
    expect(decoder.pointsReady).toBeGreaterThan(20);
    expect(decoder.pointsReady).toBeLessThan(80);
    expect(decoder.complete).toBe(false);
    expect(() => decoder.finish()).toThrow(/before its end/);
  });

  it("reads triangles", () => {
    const decoder = decode(
      encodeStream(cloud(4), {
        triangles: [
          [0, 1, 2],
          [2, 1, 3],
        ],
      }),
      5,
    );
    expect([...(decoder.model?.indices ?? [])]).toEqual([0, 1, 2, 2, 1, 3]);
  });

  it("refuses what is not a stream or lies about itself", () => {
    expect(refusal(new TextEncoder().encode("<!doctype html>"))).toMatch(/not an ARS1/);
    expect(refusedHeader({ points: 1e9 })).toMatch(/points is 1000000000/);
    expect(refusedHeader({ points: -1 })).toMatch(/points/);
    expect(refusedHeader({ points: 2.5 })).toMatch(/points/);
    expect(refusedHeader({ points: 0 })).toMatch(/points/);
    expect(refusedHeader({ triangles: 3 })).toMatch(/triangles/);
    expect(refusedHeader({ chunk_points: 0 })).toMatch(/chunk_points/);
    expect(refusedHeader({ min: [0, null, 0] })).toMatch(/min/);
    expect(refusedHeader({ max: [1e9, 1, 1] })).toMatch(/max/);
    expect(refusedHeader({ min: [5, 5, 5] })).toMatch(/above max/);
    expect(refusedHeader({ version: 2 })).toMatch(/version 2/);
    expect(refusedHeader({ kind: "voxels" })).toMatch(/kind voxels/);
    expect(refusedHeader({ up: "y" })).toMatch(/up/);
    expect(refusedHeader({ has_normals: "yes" })).toMatch(/has_normals/);
  });

  it("refuses a header that does not add up to the bytes announced, before it allocates", () => {
    const bytes = encodeStream(cloud(5), { header: { points: 15_000_000 } });
    const decoder = new StreamDecoder(bytes.length);
    expect(() => decoder.push(bytes)).toThrow(/were announced/);
    expect(decoder.model).toBeNull();
  });

  it("refuses bytes after the end and triangles that name no vertex", () => {
    const bytes = encodeStream(cloud(5));
    expect(refusal(Uint8Array.from([...bytes, 0]))).toMatch(/after the end/);
    expect(refusal(Uint8Array.from([...bytes, 0]), bytes.length)).toMatch(/more than/);
    expect(refusal(encodeStream(cloud(3), { triangles: [[0, 1, 3]] }))).toMatch(/vertex 3 of 3/);
  });

  it("refuses a header that is too long or not JSON", () => {
    const long = encodeStream(cloud(1));
    new DataView(long.buffer).setUint32(4, 1 << 20, true);
    expect(refusal(long)).toMatch(/header of 1048576 bytes/);
    const broken = encodeStream(cloud(1));
    broken[8] = 0x5b;
    expect(refusal(broken)).toMatch(/not JSON/);
  });

  it("survives any single changed byte", () => {
    const bytes = encodeStream(cloud(6), { chunkPoints: 4 });
    for (let at = 0; at < bytes.length; at++) {
      for (const flip of [0x01, 0x80, 0xff]) {
        const changed = bytes.slice();
        changed[at] = (changed[at] ?? 0) ^ flip;
        try {
          decode(changed);
        } catch (error) {
          expect(error).toBeInstanceOf(StreamError);
        }
      }
    }
  });
});
