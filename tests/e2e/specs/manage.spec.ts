// Sellers' and admins' pages: rights, editing, two edits at once, users, tokens, failures.
import { DETAILS, smallListing } from "../support/listings";
import { expect, type Listing, PASSWORDS, settled, test } from "../support/shop";

const ASC = Buffer.from("0 0 0 255 0 0\n10 0 0 0 255 0\n0 10 5 0 0 255\n");

test("markup in titles and descriptions is shown as text", async ({ page, shop }) => {
  const title = `<img src=x onerror="alert(1)"> <b>bold</b> & "quoted"`;
  const { id } = await shop.add({
    title,
    details: { description: "<script>alert(2)</script>" },
    model: { name: "model.asc", bytes: ASC },
    active: true,
  });
  await page.goto("/?q=bold");
  await expect(page.getByRole("heading", { level: 2, name: title })).toBeVisible();
  await page.goto(`/p/${id}`);
  await expect(page.getByRole("heading", { level: 1, name: title })).toBeVisible();
  await expect(page.getByText("<script>alert(2)</script>")).toBeVisible();
  await shop.logIn(page.context(), "admin");
  await page.goto("/manage?q=bold");
  await expect(page.getByRole("link", { name: title })).toBeVisible();
  await page.getByRole("link", { name: title }).click();
  await expect(page.getByLabel("Title")).toHaveValue(title);
  await expect(page.locator("main b, main img[src=x]")).toHaveCount(0);
});

test("the name leads to the details, which can be changed", async ({ page, shop }) => {
  const { id, title } = await shop.add({ title: "Chair with three legs" });
  await shop.logIn(page.context(), "seller");
  await page.goto("/manage?q=three");
  await page.getByRole("link", { name: title }).click();
  await page.getByLabel("Title").fill("Chair with four legs");
  await page.getByLabel("Description").fill("The fourth leg was found.");
  await page.getByLabel("Price").fill("abc");
  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByRole("alert")).toContainText("Write the price as a number");
  await page.getByLabel("Price").fill("7,5");
  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByText("Saved.", { exact: true })).toBeVisible();
  const saved = await (await shop.api("seller").get(`/api/products/${id}`)).json();
  expect(saved).toMatchObject({
    title: "Chair with four legs",
    description: "The fourth leg was found.",
    price_minor: 750,
    currency: "EUR",
  });
});

test("the second of two edits at once is told and chooses", async ({ page, shop, guard }) => {
  guard.expect(/status of 412/);
  const listing = await shop.add({ title: "Fought-over lamp", details: DETAILS });
  await shop.logIn(page.context(), "seller");
  await page.goto(`/manage/${listing.id}`);
  await page.getByLabel("Title").fill("My lamp");
  const theirs = await shop.api("admin").patch(`/api/products/${listing.id}`, {
    data: { title: "Their lamp" },
    headers: { "if-match": `"v${listing.version}"` },
  });
  expect(theirs.status()).toBe(200);
  await page.getByRole("button", { name: "Save" }).click();
  await expect(
    page.getByRole("heading", { name: "Someone else changed this listing meanwhile" }),
  ).toBeVisible();
  await expect(page.getByText("theirs “Their lamp”, yours “My lamp”")).toBeVisible();
  const titleNow = async () =>
    ((await (await shop.api("seller").get(`/api/products/${listing.id}`)).json()) as Listing).title;
  expect(await titleNow(), "nothing of theirs is lost").toBe("Their lamp");
  await page.getByRole("button", { name: "Save mine over theirs" }).click();
  await expect(page.getByText("Saved.", { exact: true })).toBeVisible();
  expect(await titleNow()).toBe("My lamp");
});

test("a file that is no model is refused in words and the draft is kept", async ({ page, shop, guard }) => {
  guard.expect(/status of 4\d\d/);
  await shop.logIn(page.context(), "seller");
  await page.goto("/manage/new");
  await page.getByLabel("Title").fill("Broken upload");
  const file = page.getByLabel("Model file");
  await file.setInputFiles({
    name: "model.asc",
    mimeType: "text/plain",
    buffer: Buffer.from("this is no model\n"),
  });
  await page.getByRole("button", { name: "Upload" }).click();
  await expect(page.getByRole("alert")).toContainText("The listing was kept as a draft");
  await file.setInputFiles({ name: "model.asc", mimeType: "text/plain", buffer: ASC });
  await page.getByRole("button", { name: "Upload" }).click();
  await expect(page.getByRole("heading", { level: 1, name: "Edit “Broken upload”" })).toBeVisible();
  const { items } = await (await shop.api("seller").get("/api/manage/products?q=Broken+upload")).json();
  expect(items, "one draft, not two").toHaveLength(1);
});

test("drafts can be deleted for good", async ({ page, shop, guard }) => {
  guard.expect(/^dialog: Delete “Unwanted vase”/);
  const { id } = await shop.add({ title: "Unwanted vase" });
  await shop.logIn(page.context(), "seller");
  await page.goto(`/manage/${id}`);
  // The guard dismisses the first question; the second one is accepted.
  await page.getByRole("button", { name: "Delete for good" }).click();
  await expect(page.getByRole("heading", { level: 1 })).toContainText("Unwanted vase");
  await page.evaluate(() => {
    window.confirm = () => true;
  });
  await page.getByRole("button", { name: "Delete for good" }).click();
  await expect(page.getByRole("heading", { level: 1, name: "My listings" })).toBeVisible();
  expect((await shop.api("seller").get(`/api/products/${id}`)).status()).toBe(404);
});

test("an admin adds, changes and locks users; a seller cannot", async ({ page, shop }) => {
  await shop.logIn(page.context(), "admin");
  await page.goto("/manage/users");
  await page.getByLabel("Name").fill("carla");
  await page.getByLabel("Password").fill("a long password");
  await page.getByRole("button", { name: "Add a user" }).click();
  await expect(page.getByText("User “carla” was created.")).toBeVisible();
  await page.getByLabel("Role of carla").selectOption("Admin");
  await expect(page.getByText("Changed.", { exact: true })).toBeVisible();
  await page.getByRole("button", { name: "Lock carla", exact: true }).click();
  await expect(page.getByRole("row", { name: "carla" })).toContainText("Locked");
  await shop.logIn(page.context(), "seller");
  await page.goto("/manage/users");
  await expect(page.getByText("Only an admin can open this page.")).toBeVisible();
});

test("a token is shown once, works, and stops working when revoked", async ({ page, shop }) => {
  await shop.logIn(page.context(), "seller");
  await page.goto("/manage/tokens");
  await page.getByLabel("What is it for?").fill("Test bench");
  await page.getByRole("button", { name: "Create a token" }).click();
  const token = await page.getByLabel("New token").inputValue();
  const upload = () =>
    fetch(`${shop.url}/api/models?title=By+token&filename=model.asc`, {
      method: "POST",
      headers: { authorization: `Bearer ${token}`, "content-type": "text/plain" },
      body: ASC,
    });
  expect((await upload()).status).toBe(201);
  await page.reload();
  await expect(page.getByText("Test bench")).toBeVisible();
  await expect(page.getByText(token)).toHaveCount(0);
  await page.getByRole("button", { name: "Revoke Test bench" }).click();
  await expect(page.getByText("The token no longer works.")).toBeVisible();
  expect((await upload()).status).toBe(401);
});

test("a wrong password is told; a page behind the login comes after it", async ({ page, guard }) => {
  guard.expect(/status of 401/);
  await page.goto("/manage/tokens");
  await page.getByLabel("Name").fill("seller");
  await page.getByLabel("Password").fill("not the password");
  await page.getByRole("button", { name: "Log in" }).click();
  await expect(page.getByRole("alert")).toHaveText("Name or password is wrong.");
  await page.getByLabel("Password").fill(PASSWORDS.seller);
  await page.getByRole("button", { name: "Log in" }).click();
  await expect(page.getByRole("heading", { level: 1, name: "Upload tokens" })).toBeVisible();
});

test("a session that ended asks for the login", async ({ page, shop, guard }) => {
  // 401 for what is asked for next; 404 for a draft's thumbnail that was still on its way when the session ended.
  guard.expect(/status of 40[14]/);
  await shop.logIn(page.context(), "seller");
  await page.goto("/manage");
  await expect(page.getByRole("heading", { level: 1, name: "My listings" })).toBeVisible();
  await page.context().clearCookies();
  await page.getByRole("link", { name: "Upload tokens" }).click();
  await expect(page.getByRole("alert").getByRole("link", { name: "Log in" })).toBeVisible();
});

test("a failure is told and can be tried again", async ({ page, shop, guard }) => {
  guard.expect(/Failed to load resource/);
  await smallListing(shop);
  await page.route("**/api/products?*", (route) => route.abort());
  await page.goto("/");
  await expect(page.getByText("The server cannot be reached.")).toBeVisible();
  await page.unroute("**/api/products?*");
  await page.getByRole("button", { name: "Try again" }).click();
  await expect(page.locator(".card").first()).toBeVisible();
});

test("the keyboard alone leads from the shop to a listing's 3D view", async ({ page, shop }) => {
  const { title } = await smallListing(shop);
  await page.goto("/");
  await expect(page.getByRole("link", { name: title })).toBeVisible();
  await page.keyboard.press("Tab");
  await expect(page.getByRole("link", { name: "Skip to content" })).toBeFocused();
  await page.keyboard.press("Enter");
  await tabTo(page, () =>
    page.getByRole("link", { name: title }).evaluate((e) => e === document.activeElement),
  );
  await page.keyboard.press("Enter");
  await settled(page);
  await expect(page.locator("main")).toBeFocused();
  await tabTo(page, () => page.evaluate(() => document.activeElement?.tagName === "CANVAS"));
  await page.keyboard.press("ArrowLeft");
  await expect(page.locator(".viewer-panel [role=status]")).toContainText("Seen from the");
  await tabTo(page, () => page.evaluate(() => document.activeElement?.textContent === "Reset view"));
});

async function tabTo(page: import("@playwright/test").Page, arrived: () => Promise<boolean>): Promise<void> {
  for (let presses = 0; presses < 60; presses++) {
    if (await arrived()) return;
    await page.keyboard.press("Tab");
  }
  throw new Error("the Tab key never got there");
}
