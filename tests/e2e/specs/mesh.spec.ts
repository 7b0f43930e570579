// A model with faces: uploaded as .glb through the form, shown as a surface whose outline is the thing's.
import { writeGlb } from "../support/cloud";
import { cloud } from "../support/listings";
import { check, DEGREES_PER_PX, drag } from "../support/outline";
import { expect, test } from "../support/shop";
import { FIRST_VIEW } from "../support/silhouette";

test("a .glb with faces goes through the form and turns as a surface", async ({ page, shop }) => {
  const { bytes, triangles } = writeGlb(24);
  await shop.logIn(page.context(), "seller");
  await page.goto("/manage/new");
  await page.getByLabel("Title").fill("Tower with faces");
  const file = { name: "model.glb", mimeType: "model/gltf-binary", buffer: bytes };
  await page.getByLabel("Model file").setInputFiles(file);
  await page.getByRole("button", { name: "Upload" }).click();
  await expect(page.getByRole("heading", { level: 1, name: "Edit “Tower with faces”" })).toBeVisible();

  await check(page, cloud.small(), FIRST_VIEW, triangles);
  await expect(page.getByLabel("Point size")).toBeHidden();
  await drag(page, 90, 40);
  const turned = { azimuth: 30 - 90 * DEGREES_PER_PX, elevation: 22 + 40 * DEGREES_PER_PX, zoom: 1 };
  await check(page, cloud.small(), turned, triangles);
});
