// A view in words: from which of eight sides and how steeply.
import type { Orbit } from "./orbit";

export const SIDES = [
  "front",
  "front right",
  "right",
  "back right",
  "back",
  "back left",
  "left",
  "front left",
] as const;
export type Side = (typeof SIDES)[number];

export interface Facing {
  readonly side: Side;
  /** Whole degrees, positive above. */
  readonly elevationDegrees: number;
}

export function facing(orbit: Orbit): Facing {
  const eighth = Math.round(orbit.azimuth / (Math.PI / 4));
  const side = SIDES[((eighth % 8) + 8) % 8] ?? "front";
  return { side, elevationDegrees: Math.round((orbit.elevation * 180) / Math.PI) };
}
