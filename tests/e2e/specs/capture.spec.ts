// What the scanner's page does with what the program says, and with what a person does.
import type { Page } from "@playwright/test";
import { expect, heading, picturesPerSecond, test } from "../support/capture";
import * as states from "../support/capture-states";
import { Problem } from "../support/mock-daemon";

const AFTER_FIRST = {
  views: [states.view(0, 0.2)],
  sectors: states.sectors([11, 0, 1]),
  preview: { version: 1, points: 1000 },
};

const drawn = (page: Page, points: number) =>
  expect(page.locator(`.viewer[data-settled="true"][data-drawn="${points}"]`)).toBeVisible();

test("the key leaves the address, lasts for a reload, and opens nothing elsewhere", async ({
  page,
  scanner,
}) => {
  const daemon = await scanner(states.BEGIN);
  await expect(heading(page, "Choose your sensor")).toBeVisible();
  expect(page.url()).toBe(`${daemon.url}/`);
  await page.reload();
  await expect(heading(page, "Choose your sensor")).toBeVisible();
  const other = await page.context().newPage();
  await other.goto(daemon.url);
  await expect(other.getByRole("alert").filter({ hasText: "lacks its key" })).toBeVisible();
});

test("the way through by keyboard alone, with the focus on each step's heading", async ({
  page,
  scanner,
}) => {
  const daemon = await scanner(states.BEGIN);
  daemon.on("POST /api/sensor", () => states.BOARD);
  daemon.on("POST /api/board", () => states.NO_VIEWS);
  const tabTo = async (name: string) => {
    for (let i = 0; i < 40; i++) {
      await page.keyboard.press("Tab");
      const focused = page.locator(":focus");
      if ((await focused.getAttribute("aria-label")) === name || (await focused.textContent()) === name)
        return;
    }
    throw new Error(`Tab never comes to ${name}`);
  };
  await expect(heading(page, "Choose your sensor")).toBeVisible();
  await tabTo("Use this sensor: Simulated Kinect");
  await page.keyboard.press("Enter");
  await expect(heading(page, "Print or choose the board")).toBeFocused();
  expect(JSON.parse(String(daemon.ordersOf("POST /api/sensor")[0]?.body))).toEqual({ address: "simulated" });
  await tabTo("Use the A3 board");
  await page.keyboard.press("Enter");
  await expect(heading(page, "Take views")).toBeFocused();
  expect(JSON.parse(String(daemon.ordersOf("POST /api/board")[0]?.body))).toEqual({ paper: "a3" });
});

test("a sensor that cannot be used says why and what to do", async ({ page, scanner }) => {
  await scanner(states.BEGIN);
  const kinect = page.getByRole("listitem").filter({ hasText: "Xbox 360 Kinect" });
  await expect(kinect).toContainText("You may not use this USB device.");
  await expect(kinect).toContainText("sudo udevadm control --reload-rules");
  await expect(kinect.getByRole("button")).toHaveCount(0);
  await expect(page.getByText("sudo apt install libopenni2-0")).toBeVisible();
});

test("boards: a PDF with the key in its address, and a file of one's own", async ({ page, scanner }) => {
  const daemon = await scanner(states.BOARD);
  daemon.on("POST /api/board", () => states.NO_VIEWS);
  const pdf = page.getByRole("link", { name: "Download PDF of the A3 board" });
  await expect(pdf).toHaveAttribute("href", /^\/api\/boards\/a3\.pdf\?token=[0-9a-f]{64}$/);
  await page.getByText("I have another board").click();
  const file = page.getByLabel("Board description");
  await file.setInputFiles({
    name: "board.json",
    mimeType: "application/json",
    buffer: Buffer.from("nonsense"),
  });
  await page.getByRole("button", { name: "Use this file" }).click();
  await expect(page.getByRole("alert").filter({ hasText: "not a board description" })).toBeVisible();
  await file.setInputFiles({
    name: "board.json",
    mimeType: "application/json",
    buffer: Buffer.from('{"version":1}'),
  });
  await page.getByRole("button", { name: "Use this file" }).click();
  await expect(heading(page, "Take views")).toBeFocused();
  expect(JSON.parse(String(daemon.ordersOf("POST /api/board")[0]?.body))).toEqual({ file: { version: 1 } });
});

test("live pictures come fast, and a problem of the sensor is said", async ({ page, scanner }) => {
  const daemon = await scanner(states.NO_VIEWS);
  await expect.poll(() => picturesPerSecond(page), { timeout: 15_000 }).toBeGreaterThan(5);
  test
    .info()
    .annotations.push({ type: "pictures a second", description: String(await picturesPerSecond(page)) });
  daemon.isSilent = true;
  await expect(page.getByText("Waiting for pictures")).toBeVisible();
  daemon.set({ sensor: { ...openSensor(), trouble: "it was unplugged." } });
  await expect(page.getByRole("alert").filter({ hasText: "unplugged" })).toBeVisible();
});

function openSensor() {
  const { sensor } = states.NO_VIEWS;
  if (!sensor) throw new Error("the state has a sensor");
  return sensor;
}

test("views: by space bar and by button, with the ring in words, and taken back", async ({
  page,
  scanner,
}) => {
  const daemon = await scanner(states.NO_VIEWS);
  daemon.points = 1000;
  daemon.on("POST /api/views", (_, { state }) =>
    state.views.length === 0 ? AFTER_FIRST : { ...states.FOUR_VIEWS },
  );
  daemon.on("DELETE /api/views/003", () => AFTER_FIRST);
  await expect(page.getByText("No view yet.")).toBeVisible();
  await expect(page.getByRole("button", { name: "Build the 3D model" })).toBeDisabled();
  await heading(page, "Take views").click();
  await page.keyboard.press("Space");
  await expect(page.getByText("1 view. Still unseen: 8 to 4 o'clock.", { exact: true })).toBeVisible();
  await expect(page.locator("p.visually-hidden[role=status]").last()).toContainText("View 1 taken.");
  await drawn(page, 1000);

  daemon.points = 4000;
  await page.getByRole("button", { name: "Take view" }).click();
  await expect(page.getByRole("img", { name: "4 views. Still unseen: 9 to 1 o'clock." })).toBeVisible();
  await drawn(page, 4000);
  await expect(page.getByRole("button", { name: "Build the 3D model" })).toBeEnabled();
  expect(daemon.ordersOf("POST /api/views")).toHaveLength(2);

  daemon.points = 1000;
  await page.getByRole("button", { name: "Remove view 4" }).click();
  await expect(page.getByRole("button", { name: "Remove view 4" })).toHaveCount(0);
  await expect(page.getByRole("heading", { name: "Views", exact: true })).toBeFocused();
  await drawn(page, 1000);
});

test("a view that cannot be taken says why, as an alert", async ({ page, scanner, guard }) => {
  guard.expect(/status of 409/);
  const daemon = await scanner(states.NO_VIEWS);
  daemon.on("POST /api/views", () => new Problem(409, "The board is hidden: show more of its marks."));
  await page.getByRole("button", { name: "Take view" }).click();
  await expect(page.getByRole("alert").filter({ hasText: "show more of its marks" })).toBeVisible();
  daemon.on("POST /api/views", () => AFTER_FIRST);
  await page.getByRole("button", { name: "Take view" }).click();
  await expect(page.getByText("show more of its marks")).toHaveCount(0);
});

test("views by themselves, and walking with the simulated sensor", async ({ page, scanner }) => {
  const daemon = await scanner(states.FOUR_VIEWS);
  daemon.on("POST /api/auto", ({ body }) => ({ auto: { ...JSON.parse(String(body)), next_in: 2.4 } }));
  await page.getByLabel("Every few seconds").check();
  await expect(page.getByText("Next view in 3 s")).toBeVisible();
  await page.getByRole("spinbutton", { name: "Seconds" }).fill("7");
  await page.getByRole("spinbutton", { name: "Seconds" }).blur();
  await expect.poll(() => daemon.ordersOf("POST /api/auto").length).toBe(2);
  expect(JSON.parse(String(daemon.ordersOf("POST /api/auto")[1]?.body))).toEqual({
    mode: "timer",
    seconds: 7,
  });
  await page.getByRole("button", { name: "Go to the next unseen side" }).click();
  await expect.poll(() => daemon.ordersOf("POST /api/control").length).toBe(1);
  const { what, value } = JSON.parse(String(daemon.ordersOf("POST /api/control")[0]?.body));
  expect(what).toBe("station");
  expect(value, "the middle of what is unseen").toBeCloseTo((7.5 * Math.PI) / 6);
});

test("a step is one from where the program says that the sensor stands", async ({ page, scanner }) => {
  const { sensor } = states.FOUR_VIEWS;
  if (!sensor) throw new Error("a sensor is open");
  const daemon = await scanner({ ...states.FOUR_VIEWS, sensor: { ...sensor, station: 1 } });
  await page.getByRole("button", { name: "→" }).click();
  await expect.poll(() => daemon.ordersOf("POST /api/control").length).toBe(1);
  const { value } = JSON.parse(String(daemon.ordersOf("POST /api/control")[0]?.body));
  expect(value).toBeCloseTo(1 + Math.PI / 6);
});

test("hints are said when they stay, and not while they flicker", async ({ page, scanner }) => {
  const daemon = await scanner(states.NO_VIEWS);
  const said: string[] = [];
  await page.exposeFunction("noteSaid", (text: string) => said.push(text));
  await page.evaluate(() => {
    const line = document.querySelector(".light-voice");
    const note = (window as unknown as { noteSaid(text: string): void }).noteSaid;
    if (line?.textContent) note(line.textContent);
    if (line) new MutationObserver(() => note(line.textContent ?? "")).observe(line, { childList: true });
  });
  await expect.poll(() => said).toEqual(["Good: a view can be taken."]);
  daemon.picture = {
    light: "red",
    hints: [{ level: "red", code: "too_near", text: "Move the sensor back." }],
  };
  await expect(page.locator(".light")).toContainText("Move the sensor back.");
  daemon.picture = {};
  await expect(page.locator(".light")).toContainText("Ready");
  daemon.picture = {
    light: "yellow",
    hints: [{ level: "yellow", code: "too_dark", text: "It is rather dark." }],
  };
  await expect.poll(() => said).toEqual(["Good: a view can be taken.", "It is rather dark."]);
});

test("a lost program is said, and found again", async ({ page, scanner, guard }) => {
  guard.expect(/ERR_CONNECTION|WebSocket connection/);
  const daemon = await scanner(states.FOUR_VIEWS);
  await expect(heading(page, "Take views")).toBeVisible();
  await daemon.stop();
  const alert = page.getByRole("alert").filter({ hasText: "connection to the scanner program is lost" });
  await expect(alert).toBeVisible();
  await page.getByRole("button", { name: "Take view" }).click();
  await expect(page.getByRole("alert").filter({ hasText: "did not answer" })).toBeVisible();
  await daemon.start();
  await expect(alert).toHaveCount(0);
  daemon.set({ step: "building", build: { stage: "fuse", done: 1, of: 2 } });
  await expect(heading(page, "Building")).toBeFocused();
  await expect(page.getByRole("main")).toContainText("Making one surface of all views");
});

test("a build is stopped", async ({ page, scanner }) => {
  const daemon = await scanner(states.BUILDING);
  daemon.on("POST /api/build/cancel", () => states.FOUR_VIEWS);
  await expect(page.getByRole("main")).toContainText("Fitting the views together");
  await page.getByRole("button", { name: "Stop building" }).click();
  await expect(heading(page, "Take views")).toBeFocused();
});

function builtResult() {
  const { result } = states.RESULT;
  if (!result) throw new Error("the state has a result");
  return result;
}

test.describe("removing points", () => {
  const removed = { ...builtResult(), version: 2, points: 3000, removed: 1000, can_undo: true };
  const indicesOf = (body: Buffer) =>
    Array.from({ length: body.length / 4 }, (_, i) => body.readUInt32LE(i * 4));

  test("by a lasso, with undo", async ({ page, scanner }) => {
    const daemon = await scanner(states.RESULT);
    daemon.on("POST /api/model/remove", (_, self) => {
      self.points = 3000;
      return { ...states.RESULT, result: removed };
    });
    daemon.on("POST /api/model/undo", (_, self) => {
      self.points = 4000;
      return {
        ...states.RESULT,
        result: { ...removed, version: 3, points: 4000, removed: 0, can_undo: false },
      };
    });
    await drawn(page, 4000);
    await page.getByRole("button", { name: "Lasso" }).click();
    const box = await page.locator(".cut-surface").boundingBox();
    if (!box) throw new Error("no surface");
    // Round the tower at the left.
    const at = (x: number, y: number) => [box.x + x * box.width, box.y + y * box.height] as const;
    await page.mouse.move(...at(0.2, 0.1));
    await page.mouse.down();
    for (const place of [at(0.45, 0.1), at(0.45, 0.5), at(0.2, 0.55), at(0.18, 0.2)]) {
      await page.mouse.move(...place, { steps: 4 });
    }
    await page.mouse.up();
    await expect(page.locator(".cut-count")).toContainText("points selected");
    const selected = Number(await page.locator(".cut-count").getAttribute("data-selected"));
    expect(selected).toBeGreaterThan(300);
    await page.keyboard.press("Delete");
    await drawn(page, 3000);
    await expect(page.getByText("1,000 points removed by hand")).toBeVisible();
    await expect(page.locator(".cut-count")).toHaveText("Nothing is selected.");
    const sent = indicesOf(daemon.ordersOf("POST /api/model/remove")[0]?.body ?? Buffer.alloc(0));
    expect(sent).toHaveLength(selected);
    expect(Math.max(...sent)).toBeLessThan(4000);
    expect(new Set(sent).size).toBe(selected);
    await page.keyboard.press("Control+z");
    await drawn(page, 4000);
    await expect(page.getByText("removed by hand")).toHaveCount(0);
  });

  test("by a box, with keys alone", async ({ page, scanner }) => {
    const daemon = await scanner(states.RESULT);
    daemon.on("POST /api/model/remove", () => ({ ...states.RESULT, result: removed }));
    await drawn(page, 4000);
    await page.getByRole("button", { name: "Box" }).focus();
    await page.keyboard.press("Enter");
    await expect(page.locator(".cut-surface")).toBeFocused();
    await page.keyboard.press("Enter");
    const count = page.locator(".cut-count");
    await expect(count).toContainText("points selected");
    const first = Number(await count.getAttribute("data-selected"));
    for (let i = 0; i < 6; i++) await page.keyboard.press("Shift+ArrowRight");
    for (let i = 0; i < 4; i++) await page.keyboard.press("ArrowUp");
    await expect(page.getByText(/^Box at 34 % from the left|^Box at 35 % from the left/)).toBeAttached();
    await page.keyboard.press("Enter");
    await expect.poll(async () => Number(await count.getAttribute("data-selected"))).not.toBe(first);
    await page.keyboard.press("Escape");
    await expect(count).toHaveText("Nothing is selected.");
    await page.keyboard.press("Enter");
    await page.keyboard.press("Delete");
    await expect.poll(() => daemon.ordersOf("POST /api/model/remove").length).toBe(1);
  });
});

test("publishing: the form is kept where it fails, and the token goes nowhere else", async ({
  page,
  scanner,
}) => {
  const daemon = await scanner(states.RESULT);
  daemon.on("POST /api/publish", () => states.PUBLISHING);
  await page.getByRole("button", { name: "Go on to publish" }).click();
  await expect(heading(page, "Publish your listing")).toBeFocused();
  await expect(page.getByText("the recording, which has pictures of your room")).toBeVisible();
  await page.getByRole("button", { name: "Publish", exact: true }).click();
  await expect(page.getByRole("alert").filter({ hasText: "Title" })).toBeVisible();
  await page.getByLabel("Title").fill("Camera");
  await page.getByLabel("Price").fill("12.50");
  await page.getByLabel("Address of the shop").fill("https://shop.example");
  const token = page.getByLabel("Upload token");
  await expect(token).toHaveAttribute("type", "password");
  await token.fill("arp_secret");
  await page.getByRole("button", { name: "Publish", exact: true }).click();
  await expect(heading(page, "Sending your listing")).toBeFocused();
  await expect(page.getByText("400 kB of 1.3 MB")).toBeVisible();
  expect(JSON.parse(String(daemon.ordersOf("POST /api/publish")[0]?.body))).toMatchObject({
    title: "Camera",
    price_minor: 1250,
    currency: "EUR",
    condition: null,
    server: "https://shop.example",
  });
  daemon.set({
    step: "result",
    publish: {
      phase: "failed",
      sent_bytes: 0,
      total_bytes: 0,
      address: null,
      error: "the shop refuses the token.",
    },
  });
  await expect(page.getByRole("alert").filter({ hasText: "refuses the token" })).toBeVisible();
  await expect(page.getByLabel("Title")).toHaveValue("Camera");
  expect(await page.evaluate(() => JSON.stringify(localStorage) + document.cookie)).not.toContain(
    "arp_secret",
  );
  daemon.set(states.PUBLISHED);
  await expect(page.getByRole("link", { name: "https://shop.example/p/7f3a" })).toBeVisible();
});

test("back to an earlier step, another product, and the end", async ({ page, scanner, guard }) => {
  guard.expect(/ERR_CONNECTION|WebSocket connection/);
  const daemon = await scanner(states.PUBLISHED);
  daemon.on("POST /api/step", ({ body }, { state }) => ({ ...state, step: JSON.parse(String(body)).step }));
  daemon.on("POST /api/new", () => states.NO_VIEWS);
  await page.getByRole("navigation", { name: "Steps" }).getByRole("button", { name: "Board" }).click();
  await expect(heading(page, "Print or choose the board")).toBeFocused();
  daemon.set({ step: "published" });
  await page.getByRole("button", { name: "Scan another product" }).click();
  await expect(heading(page, "Take views")).toBeFocused();
  await page.getByRole("button", { name: "End the program" }).click();
  const dialog = page.getByRole("dialog", { name: "End the scanner program?" });
  await dialog.getByRole("button", { name: "Go on scanning" }).click();
  expect(daemon.ordersOf("POST /api/quit")).toHaveLength(0);
  await page.getByRole("button", { name: "End the program" }).click();
  await dialog.getByRole("button", { name: "End it" }).click();
  await expect(heading(page, "The scanner program has ended")).toBeFocused();
  expect(daemon.ordersOf("POST /api/quit")).toHaveLength(1);
});
