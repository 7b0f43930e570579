import { expect, it } from "vitest";
import { facing, type Side } from "./facing";

it.each<[number, Side]>([
  [0, "front"],
  [20, "front"],
  [30, "front right"],
  [90, "right"],
  [180, "back"],
  [-180, "back"],
  [-90, "left"],
  [-50, "front left"],
])("%i degrees round is the %s", (degrees, side) => {
  const orbit = {
    target: [0, 0, 0],
    azimuth: (degrees * Math.PI) / 180,
    elevation: 0.5,
    distance: 1,
  } as const;
  expect(facing(orbit)).toEqual({ side, elevationDegrees: 29 });
});
