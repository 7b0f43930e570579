// Sides of the product as hours of a clock seen from above: the first view stands at 6 o'clock, where the reader stands too.
// Angles in radians, counter-clockwise from the board's x.
import type { Sector } from "../daemon/types";

const TURN = 2 * Math.PI;
const FIRST_HOUR = 6;
const DOWN = -Math.PI / 2;

/** How the ring is turned, and which hour each sector is. */
export interface Clock {
  /** To be added to an angle on the board to get the angle in the drawing, counter-clockwise from its right. */
  readonly turn: number;
  readonly hours: readonly number[];
}

/** `firstAzimuth`: of the first view, or null where there is none yet. */
export function clockOf(sectors: readonly Sector[], firstAzimuth: number | null): Clock {
  const first = firstAzimuth === null ? -1 : sectorAt(sectors, firstAzimuth);
  const sector = sectors[first];
  const turn = sector ? DOWN - middle(sector) : 0;
  const width = TURN / Math.max(1, sectors.length);
  const hours = sectors.map((each) => {
    const steps = Math.round((middle(each) + turn - DOWN) / width);
    // Seen from above the hours run clockwise, the angles the other way.
    return wrapHour(FIRST_HOUR - (steps * 12) / Math.max(1, sectors.length));
  });
  return { turn, hours };
}

export function middle({ from, to }: Sector): number {
  return (from + to) / 2;
}

/** The sector round the angle: the one whose middle is nearest, for a border belongs to one side only. -1 where there are none. */
export function sectorAt(sectors: readonly Sector[], angle: number): number {
  const away = sectors.map((sector) => Math.abs(wrapTurn(angle - middle(sector) + Math.PI) - Math.PI));
  return away.indexOf(Math.min(...away));
}

/** Hours in a row as [first, last], clockwise: [1, 2, 3, 7] becomes [1, 3], [7, 7]; a row may pass 12. */
export function hourRanges(hours: readonly number[]): [number, number][] {
  const there = new Set(hours);
  if (there.size === 12) return [[1, 12]];
  const starts = [...there].filter((hour) => !there.has(wrapHour(hour - 1))).sort((a, b) => a - b);
  return starts.map((start) => {
    let last = start;
    while (there.has(wrapHour(last + 1))) last = wrapHour(last + 1);
    return [start, last];
  });
}

/** Middle of the widest run of unseen sectors, or null where all are seen. */
export function widestGap(sectors: readonly Sector[]): number | null {
  let best: { from: number; length: number } | null = null;
  for (let start = 0; start < sectors.length; start++) {
    let length = 0;
    while (length < sectors.length && sectors[(start + length) % sectors.length]?.seen === false) length++;
    if (length > (best?.length ?? 0)) best = { from: start, length };
  }
  if (!best) return null;
  const [first, width] = [sectors[best.from], TURN / sectors.length];
  return first ? wrapTurn(first.from + (best.length * width) / 2) : null;
}

export function hourOf(clock: Clock, sectors: readonly Sector[], azimuth: number): number | null {
  return clock.hours[sectorAt(sectors, azimuth)] ?? null;
}

/** Into [0, 2 pi). */
export function wrapTurn(angle: number): number {
  return angle - Math.floor(angle / TURN) * TURN;
}

/** Into 1..12. */
function wrapHour(hour: number): number {
  const whole = Math.round(hour);
  return ((((whole - 1) % 12) + 12) % 12) + 1;
}
