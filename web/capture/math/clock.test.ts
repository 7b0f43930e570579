import { describe, expect, it } from "vitest";
import type { Sector } from "../daemon/types";
import { clockOf, hourOf, hourRanges, sectorAt, widestGap, wrapTurn } from "./clock";

const STEP = Math.PI / 6;

function ring(seen: readonly number[] = []): Sector[] {
  return Array.from({ length: 12 }, (_, i) => ({
    from: i * STEP,
    to: (i + 1) * STEP,
    seen: seen.includes(i),
  }));
}

describe("the clock round the product", () => {
  it("has the first view at 6 and runs clockwise seen from above", () => {
    const sectors = ring();
    for (const first of [0, 3, 11]) {
      const azimuth = (first + 0.3) * STEP;
      const clock = clockOf(sectors, azimuth);
      expect(hourOf(clock, sectors, azimuth)).toBe(6);
      // Counter-clockwise from 6 lies 5; the far side is 12.
      expect(hourOf(clock, sectors, azimuth + STEP)).toBe(5);
      expect(hourOf(clock, sectors, azimuth + Math.PI)).toBe(12);
      expect(hourOf(clock, sectors, azimuth - STEP)).toBe(7);
      expect(new Set(clock.hours).size).toBe(12);
    }
  });

  it("draws the first view's sector at the bottom", () => {
    const sectors = ring();
    const { turn } = clockOf(sectors, 3.4 * STEP);
    expect(wrapTurn(3.5 * STEP + turn)).toBeCloseTo(1.5 * Math.PI);
  });

  it("finds the sector of any angle", () => {
    const sectors = ring();
    expect(sectorAt(sectors, 0.01)).toBe(0);
    expect(sectorAt(sectors, -0.01)).toBe(11);
    expect(sectorAt(sectors, 2 * Math.PI + 1.5 * STEP)).toBe(1);
    for (let i = 0; i < 24; i++)
      expect(sectorAt(sectors, (i * STEP) / 2), "on and between borders").not.toBe(-1);
    expect(sectorAt([], 1)).toBe(-1);
  });
});

describe("hours in a row", () => {
  it("joins neighbours, past 12 too", () => {
    expect(hourRanges([1, 2, 3, 7])).toEqual([
      [1, 3],
      [7, 7],
    ]);
    expect(hourRanges([12, 1, 11])).toEqual([[11, 1]]);
    expect(hourRanges([])).toEqual([]);
    expect(hourRanges([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12])).toEqual([[1, 12]]);
  });
});

describe("the widest gap", () => {
  it("is the middle of what is unseen in a row, past the beginning too", () => {
    expect(widestGap(ring([1, 2, 3, 4, 5, 6, 7, 8, 9]))).toBeCloseTo(11.5 * STEP);
    expect(widestGap(ring([0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 11]))).toBeCloseTo(7.5 * STEP);
  });

  it("is nowhere where all is seen", () => {
    expect(widestGap(ring([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]))).toBeNull();
  });
});
