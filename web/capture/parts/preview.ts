// The cloud so far, growing with every view.
import { formatCount } from "../../src/format";
import { h } from "../../src/ui/dom";
import { viewerFrame } from "../../src/viewer/frame";
import type { Viewer } from "../../src/viewer/viewer";
import type { Daemon } from "../daemon/client";
import type { State } from "../daemon/types";
import { texts } from "../texts";

const t = texts.views;

export interface Preview {
  readonly element: HTMLElement;
  update(preview: State["preview"]): void;
}

export function makePreview(daemon: Daemon, signal: AbortSignal): Preview {
  const box = h("div", { class: "preview-box" });
  const count = h("p", { class: "facts" }, t.previewEmpty);
  const element = h("section", { class: "panel preview" }, h("h2", {}, t.previewTitle), box, count);
  let shown: { ending: AbortController; viewer: Viewer | null; version: number } | null = null;
  const end = () => {
    shown?.ending.abort();
    shown = null;
    box.replaceChildren();
  };
  signal.addEventListener("abort", end, { once: true });

  function begin(version: number): void {
    const mine = { ending: new AbortController(), viewer: null as Viewer | null, version };
    shown = mine;
    const frame = viewerFrame({
      title: t.previewName,
      posterUrl: null,
      streamUrl: address(version),
      streamBytes: null,
      request: { headers: daemon.authorization, cache: "no-store" },
      signal: mine.ending.signal,
      onStarted(viewer) {
        mine.viewer = viewer;
        // Another view may have been taken while the viewer's code was loading.
        if (mine.version !== version) viewer.reload(address(mine.version));
      },
    });
    box.replaceChildren(frame);
  }

  return {
    element,
    update(preview) {
      count.textContent = preview ? t.previewPoints(formatCount(preview.points)) : t.previewEmpty;
      if (!preview || preview.points === 0) return end();
      element.dataset.points = String(preview.points);
      if (!shown) return begin(preview.version);
      if (shown.version === preview.version) return;
      shown.version = preview.version;
      shown.viewer?.reload(address(preview.version));
    },
  };
}

function address(version: number): string {
  return `/api/preview?version=${version}`;
}
