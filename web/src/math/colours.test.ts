import { expect, it } from "vitest";
import { type ColourName, colourName, mainColours } from "./colours";

it.each<[ColourName, number, number, number]>([
  ["black", 20, 20, 24],
  ["white", 240, 240, 235],
  ["grey", 128, 130, 127],
  ["red", 200, 30, 30],
  ["orange", 240, 140, 20],
  ["brown", 110, 70, 40],
  ["yellow", 240, 210, 30],
  ["green", 40, 140, 60],
  ["turquoise", 30, 180, 190],
  ["blue", 30, 60, 180],
  ["purple", 120, 40, 170],
  ["pink", 230, 80, 180],
])("calls it %s", (name, red, green, blue) => {
  expect(colourName(red, green, blue)).toBe(name);
});

it("names the main colours, most frequent first, and leaves details out", () => {
  const blue = [30, 60, 180, 255];
  const yellow = [240, 210, 30, 255];
  const red = [200, 30, 30, 255];
  const points = [...Array(60).fill(yellow), ...Array(35).fill(blue), ...Array(5).fill(red)].flat();
  expect(mainColours(Uint8Array.from(points), 4, 100)).toEqual(["yellow", "blue"]);
  expect(mainColours(new Uint8Array(0), 4, 0)).toEqual([]);
});
