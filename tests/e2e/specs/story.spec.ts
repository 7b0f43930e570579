// The whole way: a seller uploads through the form, an admin activates with one click, a buyer turns the thing round.
import { makeCloud, writeAsc } from "../support/cloud";
import { expect, PASSWORDS, settled, test } from "../support/shop";
import { canvasMask, canvasPicture, difference, share } from "../support/silhouette";

const TITLE = "Blue tower with a green ball";

test("seller uploads, admin activates, buyer turns it round", async ({ browser, page, shop, guard }) => {
  await test.step("the seller logs in and uploads", async () => {
    await page.goto("/manage/new");
    await page.getByLabel("Name").fill("seller");
    await page.getByLabel("Password").fill(PASSWORDS.seller);
    await page.getByRole("button", { name: "Log in" }).click();
    await expect(page.getByRole("heading", { level: 1, name: "Add a listing" })).toBeVisible();
    await page.getByLabel("Title").fill(TITLE);
    await page.getByLabel("Model file").setInputFiles({
      name: "model.asc",
      mimeType: "text/plain",
      buffer: writeAsc(makeCloud(30_000)),
    });
    await page.getByRole("button", { name: "Upload" }).click();
    await expect(page.getByRole("heading", { level: 1, name: `Edit “${TITLE}”` })).toBeVisible();
  });

  await test.step("the seller chooses the picture and completes the details", async () => {
    await settled(page, 30_000);
    await page.getByRole("button", { name: "Use this view as the picture" }).click();
    await expect(page.getByText("The picture is saved.")).toBeVisible();
    await page.getByLabel("Price").fill("12.50");
    await page.getByLabel("Category").selectOption("Toys");
    await page.getByLabel("Condition").selectOption("Good");
    await page.getByRole("button", { name: "Save" }).click();
    await expect(page.getByText("Saved.", { exact: true })).toBeVisible();
    await expect(page.getByRole("button", { name: "Activate" })).toHaveCount(0);
    await page.goto("/manage");
    await expect(page.getByRole("row", { name: TITLE })).toContainText("waiting for an admin");
  });

  await test.step("the public does not see it yet", async () => {
    const visitor = await (await browser.newContext({ baseURL: shop.url })).newPage();
    await visitor.goto("/?q=blue+tower");
    await expect(visitor.getByRole("heading", { name: "Nothing found" })).toBeVisible();
    await visitor.context().close();
  });

  await test.step("the admin activates it with one click", async () => {
    await page.getByRole("button", { name: "Log out" }).click();
    await expect(page.getByRole("link", { name: "Log in" })).toBeVisible();
    await shop.logIn(page.context(), "admin");
    await page.goto("/manage?status=draft");
    await page.getByRole("button", { name: `Activate ${TITLE}` }).click();
    await expect(page.getByText(`“${TITLE}” is now public.`)).toBeVisible();
    await expect(page.getByRole("row", { name: TITLE })).toContainText("Active");
  });

  await test.step("a buyer finds it and turns it round", async () => {
    const context = await browser.newContext({ baseURL: shop.url });
    const buyer = await context.newPage();
    guard.watch(buyer, shop.url);
    await buyer.goto("/");
    await buyer.getByLabel("Search listings").fill("blue tower");
    await buyer.getByRole("button", { name: "Search" }).click();
    await buyer.getByRole("link", { name: TITLE }).click();
    await expect(buyer.getByRole("heading", { level: 1, name: TITLE })).toBeVisible();
    await expect(buyer.getByText("€12.50")).toBeVisible();
    const canvas = await settled(buyer, 30_000);
    const first = await canvasPicture(canvas);
    expect(share(canvasMask(first)), "the picture is not empty").toBeGreaterThan(0.05);
    await buyer.mouse.move(400, 350);
    await buyer.mouse.down();
    await buyer.mouse.move(520, 360, { steps: 6 });
    await buyer.mouse.up();
    await settled(buyer, 30_000);
    const turned = await canvasPicture(canvas);
    expect(difference(first, turned), "a drag changes the picture").toBeGreaterThan(0.03);
    await buyer.mouse.wheel(0, -300);
    await settled(buyer, 30_000);
    const zoomed = canvasMask(await canvasPicture(canvas));
    expect(share(zoomed), "the wheel zooms in").toBeGreaterThan(share(canvasMask(turned)) * 1.3);
    await context.close();
  });

  await test.step("deactivated, it is gone for the public", async () => {
    await page.getByRole("button", { name: `Deactivate ${TITLE}` }).click();
    await expect(page.getByText(`“${TITLE}” is now hidden from the public.`)).toBeVisible();
    const visitor = await (await browser.newContext({ baseURL: shop.url })).newPage();
    await visitor.goto("/?q=blue+tower");
    await expect(visitor.getByRole("heading", { name: "Nothing found" })).toBeVisible();
    await visitor.context().close();
  });
});
