import { expect, it } from "vitest";
import { DrawBudget } from "./budget";

/** Frames of a device that draws so many points a millisecond. */
function settle(budget: DrawBudget, available: number, pointsPerMilli: number): number {
  let drawn = 0;
  for (let frame = 0; frame < 60; frame++) {
    drawn = budget.points(available, true);
    budget.learn(drawn, Math.max(16, drawn / pointsPerMilli));
  }
  return drawn;
}

it("draws everything when still, whatever was learnt", () => {
  const budget = new DrawBudget();
  settle(budget, 1_000_000, 1000);
  expect(budget.points(1_000_000, false)).toBe(1_000_000);
});

it("comes down to what a slow device draws smoothly", () => {
  const drawn = settle(new DrawBudget(), 1_000_000, 2000);
  expect(drawn / 2000).toBeLessThan(50);
  expect(drawn).toBeGreaterThan(20_000);
});

it("leaves a fast device alone", () => {
  expect(settle(new DrawBudget(), 1_000_000, 200_000)).toBe(1_000_000);
});

it("keeps a recognisable picture on the slowest device", () => {
  expect(settle(new DrawBudget(), 1_000_000, 1)).toBe(25_000);
  expect(settle(new DrawBudget(), 900, 1)).toBe(900);
});
