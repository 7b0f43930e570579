// The listings that several tests look at, made once for each running shop.
import { makeCloud, writeAsc, writePly } from "./cloud";
import type { Listing, Shop } from "./shop";

export const SMALL = 100_000;
export const LARGE = 1_000_000;

export const REPORT = {
  version: 1,
  views: [
    { name: "000", used: true, reason: null },
    { name: "001", used: true, reason: null },
    { name: "002", used: false, reason: "The board was knocked." },
  ],
  points: SMALL,
  dimensions_m: [0.16, 0.1, 0.17],
  dimensions_uncertainty_m: [0.0011, 0.0009, 0.0014],
  warnings: ["View 002 was left out: the board was knocked."],
  verdict: "acceptable",
  timings_ms: {},
  software: "0.1.0",
};

export const DETAILS = {
  description: "Made for a test.\nNever used.",
  price_minor: 2500,
  currency: "EUR",
  category: "toys",
  condition: "like_new",
};

const made = new WeakMap<Shop, Map<string, Promise<Listing>>>();

function once(shop: Shop, name: string, make: () => Promise<Listing>): Promise<Listing> {
  const ofShop = made.get(shop) ?? new Map<string, Promise<Listing>>();
  made.set(shop, ofShop);
  const listing = ofShop.get(name) ?? make();
  ofShop.set(name, listing);
  return listing;
}

export const cloud = {
  small: lazy(() => makeCloud(SMALL)),
  large: lazy(() => makeCloud(LARGE)),
};

function lazy<T>(make: () => T): () => T {
  let value: T | undefined;
  return () => {
    value ??= make();
    return value;
  };
}

/** An active product of 100 000 points with everything a listing can have. */
export function smallListing(shop: Shop): Promise<Listing> {
  return once(shop, "small", () =>
    shop.add({
      title: "Tower with a ball",
      model: { name: "model.asc", bytes: writeAsc(cloud.small()) },
      report: REPORT,
      details: DETAILS,
      active: true,
    }),
  );
}

export function largeListing(shop: Shop): Promise<Listing> {
  return once(shop, "large", () =>
    shop.add({
      title: "Tower of a million points",
      model: { name: "model.ply", bytes: writePly(cloud.large()) },
      active: true,
    }),
  );
}
