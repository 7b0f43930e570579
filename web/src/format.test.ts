import { expect, it } from "vitest";
import * as format from "./format";

it("writes prices of every kind of currency", () => {
  expect(format.formatPrice(2500, "EUR")).toBe("€25.00");
  expect(format.formatPrice(2500, "JPY")).toMatch(/2,500$/);
  expect(format.formatPrice(null, null)).toBe("Price on request");
  expect(format.formatPrice(100, "not a currency")).toBe("1.00 not a currency");
});

it.each([
  ["25", "EUR", 2500],
  ["25.5", "EUR", 2550],
  [" 25,50 ", "EUR", 2550],
  ["0.05", "EUR", 5],
  ["700", "JPY", 700],
  ["25.505", "EUR", null],
  ["7.5", "JPY", null],
  ["-3", "EUR", null],
  ["1e9", "EUR", null],
  ["", "EUR", null],
])("reads the price %j %s as %s", (text, currency, minor) => {
  expect(format.parsePrice(text, currency)).toBe(minor);
});

it("reads back the prices it writes", () => {
  for (const minor of [0, 1, 99, 100, 12_345_678]) {
    expect(format.parsePrice(format.priceInput(minor, "EUR"), "EUR")).toBe(minor);
  }
});

it("writes sizes in centimetres and inches", () => {
  expect(format.formatSize([0.1911, 0.095, 0.0667])).toBe("19.1 × 9.5 × 6.7 cm");
  expect(format.formatSize([0.254, 0.0254, 0.127], "in")).toBe("10.0 × 1.0 × 5.0 in");
  expect(format.formatSize(null)).toBeNull();
  expect(format.formatSize([1, 2])).toBeNull();
});

it("never claims more certainty than there is", () => {
  expect(format.formatUncertainty([0.00121, 0.0004, 0.0009])).toBe("± 1.3 mm");
  expect(format.formatUncertainty([0.000_001])).toBe("± 0.1 mm");
  expect(format.formatUncertainty(null)).toBeNull();
});

it("writes bytes, dates and unknown names", () => {
  expect(format.formatBytes(999)).toBe("999 B");
  expect(format.formatBytes(1_234_567)).toBe("1.2 MB");
  expect(format.formatDate("2026-03-04T10:00:00Z")).toBe("4 Mar 2026");
  expect(format.formatDate("yesterday")).toBe("—");
  expect(format.named({ a: "A" }, "b")).toBe("b");
});
