// The scanner's own page: built apart from the shop's, for `scan-product` carries the one and `product-server` the other.
import { defineConfig } from "vite";

export default defineConfig({
  root: "capture",
  publicDir: "../public",
  build: {
    outDir: "../dist-capture",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
  },
});
