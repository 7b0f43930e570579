// What the program on this computer tells its page. Metres, radians, seconds, bytes.

export type StepName = "sensor" | "board" | "views" | "building" | "result" | "publishing" | "published";
export type Light = "red" | "yellow" | "green";
export type AutoMode = "manual" | "timer" | "still";
export type Paper = "a4" | "a3" | "a2";

export interface SensorFound {
  readonly address: string;
  readonly backend: string;
  readonly model: string;
  readonly serial: string;
  readonly usable: boolean;
  readonly problem: string | null;
  readonly advice: string | null;
  readonly abilities: readonly string[];
}

export interface Library {
  readonly name: string;
  readonly found: boolean;
  readonly path: string | null;
  readonly version: string | null;
  readonly advice: string | null;
}

export interface SensorOpen {
  readonly address: string;
  readonly model: string;
  readonly serial: string;
  readonly calibrated: boolean;
  readonly running: boolean;
  readonly trouble: string | null;
  /** Azimuth at which it stands, where it stands where it is told to. */
  readonly station: number | null;
}

export interface Board {
  readonly name: string;
  readonly tags: number;
  readonly warnings: readonly string[];
}

export interface TakenView {
  readonly name: string;
  /** Counter-clockwise from the board's x, seen from above. */
  readonly azimuth: number;
  readonly elevation: number;
  readonly distance: number;
  readonly tags: number;
  readonly frames: number;
  readonly points: number;
  readonly seconds: number;
}

export interface Sector {
  readonly from: number;
  readonly to: number;
  readonly seen: boolean;
}

export interface Auto {
  readonly mode: AutoMode;
  readonly seconds: number;
  readonly next_in: number | null;
}

export interface Build {
  readonly stage: string;
  readonly done: number;
  readonly of: number;
}

export interface Result {
  readonly version: number;
  readonly points: number;
  readonly verdict: string;
  readonly dimensions_m: readonly number[] | null;
  readonly dimensions_uncertainty_m: readonly number[] | null;
  readonly warnings: readonly string[];
  readonly views: readonly {
    readonly name: string;
    readonly used: boolean;
    readonly reason: string | null;
  }[];
  readonly removed: number;
  readonly can_undo: boolean;
}

export interface Publish {
  readonly phase: "uploading" | "processing" | "done" | "failed";
  readonly sent_bytes: number;
  readonly total_bytes: number;
  readonly address: string | null;
  readonly error: string | null;
}

export interface State {
  readonly step: StepName;
  readonly sensors: readonly SensorFound[];
  readonly libraries: readonly Library[];
  readonly sensor: SensorOpen | null;
  readonly board: Board | null;
  readonly views: readonly TakenView[];
  readonly sectors: readonly Sector[];
  readonly taking: { readonly view: string; readonly frames: number; readonly of: number } | null;
  readonly auto: Auto;
  readonly preview: { readonly version: number; readonly points: number } | null;
  readonly build: Build | null;
  readonly result: Result | null;
  readonly publish: Publish | null;
  /** The shop to propose for publishing. */
  readonly server: string | null;
  readonly folder: string | null;
  readonly free_bytes: number;
  readonly error: string | null;
}

export interface Hint {
  readonly level: Light;
  readonly code: string;
  readonly text: string;
}

/** "simulated", or "simulated:" and what it is to see. */
export function isSimulated(address: string | undefined): boolean {
  return address?.split(":")[0] === "simulated";
}

export type PixelPlace = readonly [number, number];

export interface PictureHeader {
  readonly index: number;
  readonly fps: number;
  readonly width: number;
  readonly height: number;
  readonly color_bytes: number;
  readonly depth_bytes: number;
  /** Corners in pixels of the colour picture. */
  readonly tags: readonly { readonly id: number; readonly corners: readonly PixelPlace[] }[];
  /** Outline of the place for the product; empty where the board is not placed. */
  readonly region: readonly PixelPlace[];
  readonly hints: readonly Hint[];
  readonly light: Light;
  readonly still_seconds: number;
  readonly valid_depth: number;
  readonly lost_packets: number;
  readonly distance_metres: number | null;
}

export interface Leaving {
  readonly files: readonly { readonly name: string; readonly bytes: number; readonly what: string }[];
  readonly stays: readonly string[];
}

export interface Listing {
  readonly server: string;
  readonly token: string;
  readonly title: string;
  readonly description: string;
  readonly price_minor: number | null;
  readonly currency: string | null;
  readonly category: string;
  readonly condition: string | null;
}
