// Every step of the scanner's page: no axe-core violation and no sideways scrolling, on a desktop and at 360 pixels.
import type { Page } from "@playwright/test";
import type { State } from "../../../web/capture/daemon/types";
import { expect, expectClean, heading, test } from "../support/capture";
import * as states from "../support/capture-states";
import type { MockDaemon } from "../support/mock-daemon";

interface Visit {
  readonly name: string;
  readonly state: State;
  readonly title: string;
  /** Brings the page into the state to be checked. */
  ready?(page: Page, daemon: MockDaemon): Promise<unknown>;
}

const drawn = (page: Page) => expect(page.locator('.viewer[data-settled="true"]')).toBeVisible();
const lit = (page: Page) => expect(page.locator(".light[data-light=green]")).toBeVisible();

const VISITS: Visit[] = [
  { name: "sensors", state: states.BEGIN, title: "Choose your sensor" },
  {
    name: "board",
    state: { ...states.NO_VIEWS, step: "board" },
    title: "Print or choose the board",
    ready: (page) => page.getByText("I have another board").click(),
  },
  { name: "no views yet", state: states.NO_VIEWS, title: "Take views", ready: lit },
  {
    name: "four views",
    state: states.FOUR_VIEWS,
    title: "Take views",
    async ready(page) {
      await lit(page);
      await drawn(page);
    },
  },
  {
    name: "everything wrong",
    state: {
      ...states.FOUR_VIEWS,
      error: "The disk is nearly full: make room, then take the view again.",
      sensor: { ...(states.FOUR_VIEWS.sensor ?? never()), trouble: "it was unplugged." },
      board: { name: "A3", tags: 20, warnings: ["The print is 3 % too small."] },
      auto: { mode: "timer", seconds: 5, next_in: 2.2 },
      taking: { view: "004", frames: 4, of: 10 },
    },
    title: "Take views",
    async ready(page, daemon) {
      daemon.picture = {
        light: "red",
        hints: [
          { level: "red", code: "board_hidden", text: "Only 2 of the marks can be read." },
          { level: "yellow", code: "too_dark", text: "It is rather dark." },
        ],
      };
      await expect(page.locator(".light[data-light=red]")).toContainText("Only 2 of the marks");
    },
  },
  { name: "building", state: states.BUILDING, title: "Building" },
  { name: "result", state: states.RESULT, title: "Look at your 3D model", ready: drawn },
  {
    name: "result with a selection",
    state: states.RESULT,
    title: "Look at your 3D model",
    async ready(page) {
      await drawn(page);
      await page.getByRole("button", { name: "Box" }).click();
      await page.keyboard.press("Enter");
      await expect(page.locator(".cut-count")).toContainText("points selected");
    },
  },
  {
    name: "listing",
    state: states.RESULT,
    title: "Look at your 3D model",
    async ready(page) {
      await page.getByRole("button", { name: "Go on to publish" }).click();
      await expect(page.getByText("model.ply")).toBeVisible();
    },
  },
  { name: "publishing", state: states.PUBLISHING, title: "Sending" },
  { name: "published", state: states.PUBLISHED, title: "Your listing is on the server" },
  {
    name: "the question before the end",
    state: states.PUBLISHED,
    title: "Your listing is on the server",
    ready: (page) => page.getByRole("button", { name: "End the program" }).click(),
  },
];

function never(): never {
  throw new Error("the state has a sensor");
}

for (const width of [1280, 360]) {
  for (const { name, state, title, ready } of VISITS) {
    test(`${name} at ${width} px`, async ({ page, scanner }) => {
      await page.setViewportSize({ width, height: width === 360 ? 740 : 900 });
      const daemon = await scanner(state);
      await expect(heading(page, new RegExp(title))).toBeVisible();
      await ready?.(page, daemon);
      await expectClean(page);
    });
  }
}
