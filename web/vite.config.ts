import { defineConfig } from "vite";

const apiServer = process.env.PRODUCT_SERVER_URL ?? "http://127.0.0.1:8080";

export default defineConfig({
  build: {
    target: "es2022",
    // The Content-Security-Policy allows neither inline code nor data: addresses beyond pictures.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
  },
  server: { proxy: { "/api": apiServer } },
});
