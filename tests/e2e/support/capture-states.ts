// States of a scan as the program would tell them, one for every step of the page.
import type { State, TakenView } from "../../../web/capture/daemon/types";

const SECTOR = Math.PI / 6;

export const SIMULATED = {
  address: "simulated",
  backend: "simulated",
  model: "Simulated Kinect",
  serial: "",
  usable: true,
  problem: null,
  advice: null,
  abilities: ["station"],
};

const OPEN = {
  address: "simulated",
  model: "Simulated Kinect",
  serial: "",
  calibrated: false,
  running: true,
  trouble: null,
  station: 0,
};

const REFUSED = {
  address: "freenect:A00363",
  backend: "freenect",
  model: "Xbox 360 Kinect (model 1414)",
  serial: "A00363814823039A",
  usable: false,
  problem: "You may not use this USB device.",
  advice:
    "Copy the rule and plug the sensor in again:\nsudo cp deploy/udev/51-kinect.rules /etc/udev/rules.d/\nsudo udevadm control --reload-rules",
  abilities: [],
};

export function sectors(seen: readonly number[]): State["sectors"] {
  return Array.from({ length: 12 }, (_, i) => ({
    from: i * SECTOR,
    to: (i + 1) * SECTOR,
    seen: seen.includes(i),
  }));
}

export function view(number: number, azimuth: number): TakenView {
  return {
    name: String(number).padStart(3, "0"),
    azimuth,
    elevation: 0.6,
    distance: 0.8,
    tags: 14,
    frames: 10,
    points: 48_211,
    seconds: 0.7,
  };
}

export const BEGIN: State = {
  step: "sensor",
  sensors: [SIMULATED, REFUSED],
  libraries: [
    { name: "libfreenect", found: true, path: "/usr/lib/libfreenect.so.0.5", version: "0.5.3", advice: null },
    { name: "OpenNI2", found: false, path: null, version: null, advice: "sudo apt install libopenni2-0" },
  ],
  sensor: null,
  board: null,
  views: [],
  sectors: sectors([]),
  taking: null,
  auto: { mode: "manual", seconds: 3, next_in: null },
  preview: null,
  build: null,
  result: null,
  publish: null,
  server: null,
  folder: null,
  free_bytes: 52_000_000_000,
  error: null,
};

export const BOARD: State = { ...BEGIN, step: "board", sensor: OPEN };

export const NO_VIEWS: State = {
  ...BOARD,
  step: "views",
  board: { name: "A3 aruco_4x4_50", tags: 20, warnings: [] },
  folder: "/home/seller/scans/2026-11-22-1",
};

export const FOUR_VIEWS: State = {
  ...NO_VIEWS,
  views: [view(0, 0.2), view(1, 1.3), view(2, 2.3), view(3, 5.5)],
  sectors: sectors([0, 1, 2, 3, 4, 10, 11]),
  preview: { version: 4, points: 4000 },
};

export const BUILDING: State = {
  ...FOUR_VIEWS,
  step: "building",
  build: { stage: "align", done: 3, of: 9 },
};

export const RESULT: State = {
  ...FOUR_VIEWS,
  step: "result",
  result: {
    version: 1,
    points: 4000,
    verdict: "acceptable",
    dimensions_m: [0.16, 0.1, 0.17],
    dimensions_uncertainty_m: [0.0011, 0.0009, 0.0014],
    warnings: ["Between 1 and 5 o'clock nothing was seen."],
    views: [
      { name: "000", used: true, reason: null },
      { name: "001", used: true, reason: null },
      { name: "002", used: false, reason: "the board was knocked." },
      { name: "003", used: true, reason: null },
    ],
    removed: 0,
    can_undo: false,
  },
};

export const PUBLISHING: State = {
  ...RESULT,
  step: "publishing",
  publish: { phase: "uploading", sent_bytes: 400_000, total_bytes: 1_282_590, address: null, error: null },
};

export const PUBLISHED: State = {
  ...RESULT,
  step: "published",
  publish: {
    phase: "done",
    sent_bytes: 1_282_590,
    total_bytes: 1_282_590,
    address: "https://shop.example/p/7f3a",
    error: null,
  },
};
