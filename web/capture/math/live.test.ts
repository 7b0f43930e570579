import { describe, expect, it } from "vitest";
import { littleEndian } from "../daemon/client";
import { PictureError, parsePicture } from "../daemon/picture";
import type { Hint } from "../daemon/types";
import { Rate } from "./rate";
import { Speaker } from "./speaker";

const hint = (code: string, text = code): Hint => ({ level: "red", code, text });

describe("the speaker", () => {
  it("says a hint once it has stood a while, and once only", () => {
    const speaker = new Speaker();
    expect(speaker.next([hint("too_near", "0.41 m")], 0)).toBeNull();
    expect(speaker.next([hint("too_near", "0.42 m")], 1000)).toBeNull();
    expect(speaker.next([hint("too_near", "0.43 m")], 1300)).toBe("0.43 m");
    expect(speaker.next([hint("too_near", "0.44 m")], 60_000)).toBeNull();
  });

  it("is silent while hints come and go", () => {
    const speaker = new Speaker();
    for (let now = 0; now < 20_000; now += 500) {
      expect(speaker.next([hint(now % 1000 === 0 ? "moving" : "ok")], now)).toBeNull();
    }
  });

  it("leaves a pause between two", () => {
    const speaker = new Speaker();
    speaker.next([hint("moving")], 0);
    expect(speaker.next([hint("moving")], 1500)).toBe("moving");
    speaker.next([hint("ok")], 1600);
    expect(speaker.next([hint("ok")], 3000)).toBeNull();
    expect(speaker.next([hint("ok")], 5600)).toBe("ok");
  });
});

describe("the rate", () => {
  it("counts the last two seconds", () => {
    const rate = new Rate();
    expect(rate.perSecond(0)).toBe(0);
    for (let now = 0; now <= 3000; now += 50) rate.note(now);
    expect(rate.perSecond(3000)).toBeCloseTo(20);
    expect(rate.perSecond(9000)).toBe(0);
  });
});

describe("a live picture", () => {
  const message = (header: object, body: number[], headerBytes?: number): ArrayBuffer => {
    const json = new TextEncoder().encode(JSON.stringify(header));
    const out = new Uint8Array(4 + json.length + body.length);
    new DataView(out.buffer).setUint32(0, headerBytes ?? json.length, true);
    out.set(json, 4);
    out.set(body, 4 + json.length);
    return out.buffer;
  };
  const HEADER = { width: 640, height: 480, color_bytes: 3, depth_bytes: 2 };

  it("is taken apart", () => {
    const { header, color, depth } = parsePicture(message(HEADER, [1, 2, 3, 4, 5]));
    expect(header.width).toBe(640);
    expect([...color]).toEqual([1, 2, 3]);
    expect([...(depth ?? [])]).toEqual([4, 5]);
  });

  it("may lack depth", () => {
    expect(parsePicture(message({ ...HEADER, depth_bytes: 0 }, [1, 2, 3])).depth).toBeNull();
  });

  it.each([
    ["nothing", new ArrayBuffer(0)],
    ["a header beyond the end", message(HEADER, [1, 2, 3, 4, 5], 5000)],
    ["a header of no JSON", message(HEADER, [1, 2, 3, 4, 5], 10)],
    ["a piece missing", message(HEADER, [1, 2, 3, 4])],
    ["a piece too many", message(HEADER, [1, 2, 3, 4, 5, 6])],
    ["a negative length", message({ ...HEADER, color_bytes: -1, depth_bytes: 6 }, [1, 2, 3, 4, 5])],
  ])("is refused: %s", (_, bytes) => {
    expect(() => parsePicture(bytes)).toThrow(PictureError);
  });
});

describe("indices", () => {
  it("go out with their smallest byte first", () => {
    expect([...littleEndian(Uint32Array.of(1, 0x01020304))]).toEqual([1, 0, 0, 0, 4, 3, 2, 1]);
  });
});
