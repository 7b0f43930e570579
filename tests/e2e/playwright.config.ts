// Browser tests against the real server binary, in the machine's own Chromium.
//   PRODUCT_SERVER  path of the binary (default: target/release/product-server of this repository)
//   CHROMIUM        path of the browser (default: /usr/bin/chromium)
import { defineConfig } from "@playwright/test";

/** Software drawing, and none of the browser's own traffic. */
export const BROWSER_ARGS = [
  "--no-sandbox",
  "--no-first-run",
  "--disable-quic",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
];

export const BROWSER = process.env.CHROMIUM ?? "/usr/bin/chromium";

export default defineConfig({
  testDir: "specs",
  outputDir: "test-results",
  fullyParallel: false,
  workers: 1,
  retries: 0,
  forbidOnly: process.env.CI !== undefined,
  timeout: 90_000,
  expect: { timeout: 20_000 },
  reporter: [["list"]],
  use: {
    viewport: { width: 1280, height: 900 },
    deviceScaleFactor: 1,
    locale: "en-GB",
    launchOptions: { executablePath: BROWSER, args: BROWSER_ARGS },
  },
});
