// Decoder of ARS1, the stream of points or triangles that the server makes of every model (little-endian, metres, z up):
//   "ARS1" · u32 header bytes · header JSON · chunks of points · triangles
// Bytes come in pieces of any size; what has arrived can be drawn at once, for any prefix of the points of a cloud is an even
// sample of the whole. No size from the stream is believed before it is checked. No three.js and no DOM in here.
import { decodeOctahedral } from "../math/octahedral";
import type { Vec3 } from "../math/vec3";

export interface StreamHeader {
  readonly kind: "points" | "mesh";
  readonly points: number;
  readonly triangles: number;
  readonly min: Vec3;
  readonly max: Vec3;
  readonly chunkPoints: number;
  readonly hasNormals: boolean;
  readonly hasDeviations: boolean;
}

/** Arrays as the graphics card takes them: four components each, so that every vertex starts on a whole word. */
export interface Model {
  /** x, y, z of 0..65535 between the header's min and max, and one unused. */
  readonly positions: Uint16Array;
  /** sRGB, and what the point is: MEASURED, INVENTED, or MARKED by a person. */
  readonly colors: Uint8Array;
  /** Unit normals of length 127, and one unused; empty where the stream has none. */
  readonly normals: Int8Array;
  /** Three a triangle, counter-clockwise seen from outside. */
  readonly indices: Uint32Array;
}

export const LANES = 4;
export const MEASURED = 255;
export const INVENTED = 128;
export const MARKED = 0;
/** Deviation of a point that nobody measured. */
const INVENTED_STEP = 255;
const MAGIC = 0x31535241; // "ARS1"
const PREFIX_BYTES = 8;
const MAX_HEADER_BYTES = 64 * 1024;
const MAX_POINTS = 20_000_000;
const MAX_TRIANGLES = 40_000_000;
const MAX_CHUNK_POINTS = 1 << 16;
const TRIANGLE_BYTES = 12;
const TRIANGLES_A_STEP = 8192;
/** Sizes of things on sale: beyond this the numbers are not a product's. */
const MAX_METRES = 1e4;

export class StreamError extends Error {}

export class StreamDecoder {
  header: StreamHeader | null = null;
  model: Model | null = null;
  pointsReady = 0;
  /** Points that have come and that nobody measured. */
  inventedPoints = 0;
  trianglesReady = 0;
  bytesRead = 0;

  readonly #expectedBytes: number | null;
  #pending = new Uint8Array(0);
  #headerBytes: number | null = null;

  /** `expectedBytes`: the length of the whole stream where it is known from elsewhere; any other length is refused. */
  constructor(expectedBytes: number | null = null) {
    this.#expectedBytes = expectedBytes;
  }

  get complete(): boolean {
    const { header } = this;
    return header !== null && this.pointsReady === header.points && this.trianglesReady === header.triangles;
  }

  /** Takes the next piece and decodes all it completes. Throws `StreamError` where the stream is not what it should be. */
  push(piece: Uint8Array): void {
    this.bytesRead += piece.length;
    if (this.#expectedBytes !== null && this.bytesRead > this.#expectedBytes) {
      throw new StreamError(`more than the ${this.#expectedBytes} bytes announced`);
    }
    this.#pending = concat(this.#pending, piece);
    let used = 0;
    for (;;) {
      const need = this.#bytesOfNextSection();
      if (need === 0 || this.#pending.length - used < need) break;
      this.#decodeSection(this.#pending.subarray(used, used + need));
      used += need;
    }
    this.#pending = this.#pending.slice(used);
    if (this.complete && this.#pending.length > 0) throw new StreamError("bytes after the end");
  }

  /** To be called after the last piece: throws where something is missing. */
  finish(): void {
    if (!this.complete) throw new StreamError(`ended after ${this.bytesRead} bytes, before its end`);
  }

  #bytesOfNextSection(): number {
    if (this.#headerBytes === null) return PREFIX_BYTES;
    if (this.header === null) return this.#headerBytes;
    const points = this.#pointsOfNextChunk(this.header);
    if (points > 0) return chunkBytes(points, this.header);
    return TRIANGLE_BYTES * Math.min(TRIANGLES_A_STEP, this.header.triangles - this.trianglesReady);
  }

  #decodeSection(bytes: Uint8Array): void {
    if (this.#headerBytes === null) {
      this.#headerBytes = parsePrefix(bytes);
    } else if (this.header === null || this.model === null) {
      const header = parseHeader(bytes);
      const total = PREFIX_BYTES + bytes.length + bodyBytes(header);
      if (this.#expectedBytes !== null && total !== this.#expectedBytes) {
        throw new StreamError(`its header means ${total} bytes, but ${this.#expectedBytes} were announced`);
      }
      this.model = allocate(header);
      this.header = header;
    } else if (this.pointsReady < this.header.points) {
      const points = this.#pointsOfNextChunk(this.header);
      this.inventedPoints += decodeChunk(bytes, points, this.header, this.model, this.pointsReady);
      this.pointsReady += points;
    } else {
      decodeTriangles(bytes, this.model.indices, this.trianglesReady * 3, this.header.points);
      this.trianglesReady += bytes.length / TRIANGLE_BYTES;
    }
  }

  #pointsOfNextChunk(header: StreamHeader): number {
    return Math.min(header.chunkPoints, header.points - this.pointsReady);
  }
}

function concat(a: Uint8Array, b: Uint8Array): Uint8Array<ArrayBuffer> {
  const joined = new Uint8Array(a.length + b.length);
  joined.set(a);
  joined.set(b, a.length);
  return joined;
}

type Attributes = Pick<StreamHeader, "hasNormals" | "hasDeviations">;

function chunkBytes(points: number, { hasNormals, hasDeviations }: Attributes): number {
  const bytes = points * (9 + (hasNormals ? 2 : 0) + (hasDeviations ? 1 : 0));
  return bytes + ((4 - (bytes % 4)) % 4);
}

/** All bytes after the header. */
export function bodyBytes(header: StreamHeader): number {
  const { points, chunkPoints, triangles } = header;
  const whole = Math.floor(points / chunkPoints);
  const rest = points - whole * chunkPoints;
  return whole * chunkBytes(chunkPoints, header) + chunkBytes(rest, header) + triangles * TRIANGLE_BYTES;
}

function view(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

function parsePrefix(bytes: Uint8Array): number {
  if (view(bytes).getUint32(0, true) !== MAGIC) throw new StreamError("not an ARS1 stream");
  const headerBytes = view(bytes).getUint32(4, true);
  if (headerBytes === 0 || headerBytes > MAX_HEADER_BYTES || headerBytes % 4 !== 0) {
    throw new StreamError(`header of ${headerBytes} bytes`);
  }
  return headerBytes;
}

function parseHeader(bytes: Uint8Array): StreamHeader {
  let json: unknown;
  try {
    json = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes));
  } catch {
    throw new StreamError("header is not JSON");
  }
  if (typeof json !== "object" || json === null) throw new StreamError("header is not an object");
  const fields = json as Record<string, unknown>;
  if (fields.version !== 1) throw new StreamError(`version ${String(fields.version)}`);
  if (fields.kind !== "points" && fields.kind !== "mesh")
    throw new StreamError(`kind ${String(fields.kind)}`);
  if (fields.up !== "z") throw new StreamError("up is not z");
  if (typeof fields.has_normals !== "boolean") throw new StreamError("has_normals is missing");
  const min = metres(fields.min, "min");
  const max = metres(fields.max, "max");
  if (min.some((low, axis) => low > (max[axis] ?? 0))) throw new StreamError("min is above max");
  return {
    kind: fields.kind,
    points: count(fields.points, "points", 1, MAX_POINTS),
    triangles: count(fields.triangles, "triangles", 0, fields.kind === "mesh" ? MAX_TRIANGLES : 0),
    min,
    max,
    chunkPoints: count(fields.chunk_points, "chunk_points", 1, MAX_CHUNK_POINTS),
    hasNormals: fields.has_normals,
    hasDeviations: fields.has_deviations === true,
  };
}

function count(value: unknown, name: string, least: number, most: number): number {
  if (typeof value !== "number" || !Number.isInteger(value) || value < least || value > most) {
    throw new StreamError(`${name} is ${String(value)}`);
  }
  return value;
}

function metres(value: unknown, name: string): Vec3 {
  if (!Array.isArray(value) || value.length !== 3) throw new StreamError(`${name} is no point`);
  const [x, y, z] = value as unknown[];
  const fine = (n: unknown): n is number => typeof n === "number" && Math.abs(n) <= MAX_METRES;
  if (!fine(x) || !fine(y) || !fine(z)) throw new StreamError(`${name} is no point`);
  return [x, y, z];
}

function allocate({ points, triangles, hasNormals }: StreamHeader): Model {
  return {
    positions: new Uint16Array(points * LANES),
    colors: new Uint8Array(points * LANES),
    normals: new Int8Array(hasNormals ? points * LANES : 0),
    indices: new Uint32Array(triangles * 3),
  };
}

/** Returns how many of the points nobody measured. */
function decodeChunk(
  bytes: Uint8Array,
  points: number,
  { hasNormals, hasDeviations }: Attributes,
  model: Model,
  first: number,
): number {
  const data = view(bytes);
  const colorsAt = points * 6;
  const normalsAt = points * 9;
  const deviationsAt = normalsAt + (hasNormals ? points * 2 : 0);
  let invented = 0;
  for (let i = 0; i < points; i++) {
    const out = (first + i) * LANES;
    for (let axis = 0; axis < 3; axis++) {
      model.positions[out + axis] = data.getUint16((i * 3 + axis) * 2, true);
      model.colors[out + axis] = data.getUint8(colorsAt + i * 3 + axis);
    }
    const isInvented = hasDeviations && data.getUint8(deviationsAt + i) === INVENTED_STEP;
    model.colors[out + 3] = isInvented ? INVENTED : MEASURED;
    if (isInvented) invented++;
    if (!hasNormals) continue;
    const at = normalsAt + i * 2;
    decodeOctahedral(data.getInt8(at), data.getInt8(at + 1), model.normals, out);
  }
  return invented;
}

function decodeTriangles(bytes: Uint8Array, indices: Uint32Array, first: number, points: number): void {
  const data = view(bytes);
  for (let i = 0; i * 4 < bytes.length; i++) {
    const index = data.getUint32(i * 4, true);
    if (index >= points) throw new StreamError(`triangle names vertex ${index} of ${points}`);
    indices[first + i] = index;
  }
}
