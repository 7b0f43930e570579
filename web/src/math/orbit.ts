// Camera that circles a target. World: metres, z up, right-handed; angles in radians.
// Azimuth 0 stands in front of the product (on the -y side), grows to the product's right-hand side (+x);
// elevation 0 is level, +pi/2 looks straight down. The basis comes from the angles alone, so the poles are no special case.
import { add, length, mix, scale, sub, type Vec3 } from "./vec3";

export interface Orbit {
  readonly target: Vec3;
  readonly azimuth: number;
  readonly elevation: number;
  /** From the camera to the target, metres. */
  readonly distance: number;
}

export interface Bounds {
  readonly min: Vec3;
  readonly max: Vec3;
}

/** Right, up and forward unit vectors of the camera in the world. */
export interface Basis {
  readonly right: Vec3;
  readonly up: Vec3;
  readonly forward: Vec3;
}

/** Vertical field of view. */
export const FIELD_OF_VIEW = (35 * Math.PI) / 180;
/** A drag of 360 pixels turns the product by half a turn. */
export const TURN_PER_PIXEL = Math.PI / 360;
/** Where a product is first seen from: a little from the right and from above, as things are photographed. */
export const START_AZIMUTH = (30 * Math.PI) / 180;
export const START_ELEVATION = (22 * Math.PI) / 180;

const MAX_ELEVATION = Math.PI / 2;
/** Air round the product in the first view. */
const FIT_MARGIN = 1.08;

export function basis(orbit: Orbit): Basis {
  const [sinA, cosA] = [Math.sin(orbit.azimuth), Math.cos(orbit.azimuth)];
  const [sinE, cosE] = [Math.sin(orbit.elevation), Math.cos(orbit.elevation)];
  return {
    right: [cosA, sinA, 0],
    up: [-sinE * sinA, sinE * cosA, cosE],
    forward: [-cosE * sinA, cosE * cosA, -sinE],
  };
}

/** The camera's place in the world. */
export function eye(orbit: Orbit): Vec3 {
  return sub(orbit.target, scale(basis(orbit).forward, orbit.distance));
}

export function turn(orbit: Orbit, azimuth: number, elevation: number): Orbit {
  const tilted = Math.min(MAX_ELEVATION, Math.max(-MAX_ELEVATION, orbit.elevation + elevation));
  return { ...orbit, azimuth: wrapAngle(orbit.azimuth + azimuth), elevation: tilted };
}

/** Divides the distance by `factor`, within what makes sense for a product of this radius. */
export function zoom(orbit: Orbit, factor: number, radius: number): Orbit {
  const distance = Math.min(radius * 20, Math.max(radius * 0.1, orbit.distance / factor));
  return { ...orbit, distance };
}

/** Moves the target so that what lies at its depth follows the pointer by (dx, dy) pixels, y down. */
export function pan(orbit: Orbit, dx: number, dy: number, viewHeightPx: number): Orbit {
  const { right, up } = basis(orbit);
  const metresPerPx = (2 * orbit.distance * Math.tan(FIELD_OF_VIEW / 2)) / Math.max(1, viewHeightPx);
  const moved = add(scale(right, -dx * metresPerPx), scale(up, dy * metresPerPx));
  return { ...orbit, target: add(orbit.target, moved) };
}

export function center(bounds: Bounds): Vec3 {
  return mix(bounds.min, bounds.max, 0.5);
}

/** Radius of the ball round the box; never zero, so that a single point can be looked at. */
export function radius(bounds: Bounds): number {
  return Math.max(length(sub(bounds.max, bounds.min)) / 2, 1e-4);
}

/** The first view: the ball round the product fills the narrower side of the picture. */
export function fit(bounds: Bounds, aspect: number): Orbit {
  const halfVertical = FIELD_OF_VIEW / 2;
  const halfHorizontal = Math.atan(Math.tan(halfVertical) * aspect);
  const half = Math.min(halfVertical, halfHorizontal);
  const distance = (radius(bounds) * FIT_MARGIN) / Math.sin(half);
  return { target: center(bounds), azimuth: START_AZIMUTH, elevation: START_ELEVATION, distance };
}

/** Between two views, the shorter way round; `t` from 0 to 1. */
export function between(a: Orbit, b: Orbit, t: number): Orbit {
  return {
    target: mix(a.target, b.target, t),
    azimuth: wrapAngle(a.azimuth + wrapAngle(b.azimuth - a.azimuth) * t),
    elevation: a.elevation + (b.elevation - a.elevation) * t,
    distance: a.distance * (b.distance / a.distance) ** t,
  };
}

/** Into (-pi, pi]. */
export function wrapAngle(angle: number): number {
  const turns = Math.ceil(angle / (2 * Math.PI) - 0.5);
  return angle - turns * 2 * Math.PI;
}
