import { describe, expect, it } from "vitest";
import type { Draft } from "../draft";
import { toListing } from "./listing";

const DRAFT: Draft = {
  title: " Mug ",
  description: "Blue.",
  price: "12,50",
  currency: "EUR",
  category: "home",
  condition: "good",
  server: "https://shop.example/manage",
  token: " arp_x ",
};

describe("the listing sent", () => {
  it("is what the form says", () => {
    expect(toListing(DRAFT)).toEqual({
      server: "https://shop.example",
      token: "arp_x",
      title: "Mug",
      description: "Blue.",
      price_minor: 1250,
      currency: "EUR",
      category: "home",
      condition: "good",
    });
  });

  it("may lack price and condition", () => {
    const sent = toListing({ ...DRAFT, price: " ", condition: "" });
    expect(sent).toMatchObject({ price_minor: null, currency: null, condition: null });
  });

  it.each([
    ["no title", { title: "  " }, /title/i],
    ["a price in words", { price: "cheap" }, /price/i],
    ["no address", { server: "shop" }, /address/i],
    ["an address that is no shop's", { server: "javascript:alert(1)" }, /address/i],
  ])("is refused with %s", (_, change, says) => {
    expect(() => toListing({ ...DRAFT, ...change })).toThrow(says);
  });
});
