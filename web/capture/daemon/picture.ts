// One live picture as it comes over the WebSocket (little-endian):
//   u32 header bytes · header JSON · colour JPEG · depth JPEG (or nothing)
import type { PictureHeader } from "./types";

export interface Picture {
  readonly header: PictureHeader;
  readonly color: Uint8Array<ArrayBuffer>;
  readonly depth: Uint8Array<ArrayBuffer> | null;
}

export class PictureError extends Error {}

const PREFIX_BYTES = 4;
const MAX_HEADER_BYTES = 1 << 20;

/** Throws `PictureError` where the lengths are not what the header says. */
export function parsePicture(message: ArrayBuffer): Picture {
  if (message.byteLength < PREFIX_BYTES) throw new PictureError("shorter than its own length");
  const headerBytes = new DataView(message).getUint32(0, true);
  if (headerBytes > MAX_HEADER_BYTES || PREFIX_BYTES + headerBytes > message.byteLength) {
    throw new PictureError(`header of ${headerBytes} bytes`);
  }
  const header = parseHeader(new Uint8Array(message, PREFIX_BYTES, headerBytes));
  const colorAt = PREFIX_BYTES + headerBytes;
  const depthAt = colorAt + header.color_bytes;
  if (depthAt + header.depth_bytes !== message.byteLength) {
    throw new PictureError(`${message.byteLength} bytes do not hold what the header names`);
  }
  return {
    header,
    color: new Uint8Array(message, colorAt, header.color_bytes),
    depth: header.depth_bytes > 0 ? new Uint8Array(message, depthAt, header.depth_bytes) : null,
  };
}

function parseHeader(bytes: Uint8Array): PictureHeader {
  try {
    const header = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes)) as PictureHeader;
    const sizes = [header.color_bytes, header.depth_bytes, header.width, header.height];
    if (sizes.every((size) => Number.isInteger(size) && size >= 0)) return header;
  } catch {
    // Said below.
  }
  throw new PictureError("the header cannot be read");
}
