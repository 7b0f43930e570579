// The very first start: the one-time link makes the admin and works no second time.

import { Server } from "../support/server";
import { expect, test } from "../support/shop";

test("the one-time link makes the first admin", async ({ browser, guard }) => {
  guard.expect(/status of 403/);
  const server = await Server.start();
  const context = await browser.newContext({ baseURL: server.url });
  const page = await context.newPage();
  guard.watch(page, server.url);
  const link = await server.setupPath();
  await page.goto(link);
  await page.getByLabel("Name").fill("founder");
  await page.getByLabel("Password").fill("short");
  await page.getByRole("button", { name: "Create and log in" }).click();
  await expect(page.getByRole("alert")).toBeVisible();
  await page.getByLabel("Password").fill("a long enough password");
  await page.getByRole("button", { name: "Create and log in" }).click();
  await expect(page.getByRole("heading", { level: 1, name: "All listings" })).toBeVisible();
  await page.goto(link);
  await page.getByLabel("Name").fill("intruder");
  await page.getByLabel("Password").fill("another long password");
  await page.getByRole("button", { name: "Create and log in" }).click();
  await expect(page.getByRole("alert")).toContainText("used already");
  await context.close();
  await server.stop();
});
