// The scanner's page before a program that only speaks as one, brought into whatever state a test asks for.
import AxeBuilder from "@axe-core/playwright";
import { test as base, expect, type Page } from "@playwright/test";
import type { State } from "../../../web/capture/daemon/types";
import { MockDaemon } from "./mock-daemon";
import { Guard } from "./shop";

export { expect };

interface Fixtures {
  guard: Guard;
  /** Starts the program in a state and opens its page. */
  scanner: (state: State) => Promise<MockDaemon>;
}

export const test = base.extend<Fixtures>({
  guard: [
    // biome-ignore lint/correctness/noEmptyPattern: Playwright reads the parameter's shape.
    async ({}, use) => {
      const guard = new Guard();
      await use(guard);
      expect(guard.wrong, "console errors, dialogs and requests to other origins").toEqual([]);
    },
    { auto: true },
  ],
  scanner: async ({ page, guard }, use) => {
    const started: MockDaemon[] = [];
    await use(async (state) => {
      const daemon = await new MockDaemon(state).start();
      started.push(daemon);
      guard.watch(page, daemon.url);
      await page.goto(daemon.address);
      return daemon;
    });
    // The page first, for it would note that its program is gone.
    await page.close();
    for (const daemon of started) await daemon.stop();
  },
});

export function heading(page: Page, name: string | RegExp) {
  return page.getByRole("heading", { level: 1, name });
}

/** No axe-core violation, and nothing sticks out sideways. */
export async function expectClean(page: Page): Promise<void> {
  const { violations } = await new AxeBuilder({ page }).analyze();
  expect(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" | ")}`)).toEqual(
    [],
  );
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
  expect(overflow, "pixels that stick out sideways").toBeLessThanOrEqual(0);
}

/** Pictures a second, as the page itself counts what it has drawn. */
export async function picturesPerSecond(page: Page): Promise<number> {
  return Number(await page.locator(".live-color").getAttribute("data-fps"));
}
