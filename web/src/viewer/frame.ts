// Where the 3D view stands in a page: the poster first, as a plain picture; the viewer's code only after that, and only where
// the browser can draw in 3D. Everything goes when the signal fires.
import type { ColourName } from "../math/colours";
import { texts } from "../texts";
import { h } from "../ui/dom";
import type { StreamRequest } from "./load";
import type { Viewer } from "./viewer";

export interface FrameOptions {
  readonly title: string;
  readonly posterUrl: string | null;
  readonly streamUrl: string;
  readonly streamBytes: number | null;
  readonly request?: StreamRequest;
  readonly signal: AbortSignal;
  readonly onStarted?: (viewer: Viewer) => void;
  readonly onLoaded?: (viewer: Viewer, colours: ColourName[]) => void;
}

const POSTER_PATIENCE_MILLIS = 3000;

export function viewerFrame(options: FrameOptions): HTMLElement {
  const root = h("section", { class: "viewer", "aria-label": texts.viewer.label(options.title) });
  root.dataset.state = "poster";
  const stage = h("div", { class: "viewer-stage" });
  const poster = options.posterUrl === null ? null : makePoster(options.posterUrl, options.title);
  if (poster) stage.append(poster);
  root.append(stage);
  void start(root, stage, poster, options);
  return root;
}

function makePoster(url: string, title: string): HTMLImageElement {
  return h("img", {
    class: "viewer-poster",
    src: url,
    alt: texts.product.posterAlt(title),
    fetchpriority: "high",
    decoding: "async",
  });
}

async function start(
  root: HTMLElement,
  stage: HTMLElement,
  poster: HTMLImageElement | null,
  options: FrameOptions,
): Promise<void> {
  const { signal } = options;
  const canvas = h("canvas", {
    class: "viewer-canvas",
    tabindex: 0,
    role: "application",
    "aria-roledescription": texts.viewer.role,
    "aria-label": texts.viewer.label(options.title),
  });
  if (poster) await pictureShown(poster);
  if (signal.aborted) return;
  const context = canvas.getContext("webgl2", { antialias: true, alpha: false });
  if (!context) {
    root.dataset.state = "unsupported";
    root.append(h("p", { class: "viewer-message", role: "status" }, texts.viewer.unsupported));
    return;
  }
  signal.addEventListener("abort", () => canvas.remove(), { once: true });
  stage.append(canvas);
  try {
    const { Viewer } = await import("./viewer");
    if (signal.aborted) return releaseContext(context);
    const viewer: Viewer = new Viewer({
      root,
      canvas,
      context,
      streamUrl: options.streamUrl,
      streamBytes: options.streamBytes,
      ...(options.request ? { request: options.request } : {}),
      signal,
      onFirstPicture: () => stage.classList.add("has-picture"),
      onLoaded: (colours) => options.onLoaded?.(viewer, colours),
    });
    options.onStarted?.(viewer);
  } catch (error) {
    if (signal.aborted) return;
    console.info("The 3D view could not be started:", error);
    releaseContext(context);
    canvas.remove();
    root.dataset.state = "failed";
    root.append(h("p", { class: "viewer-message", role: "alert" }, texts.viewer.notStarted));
  }
}

function releaseContext(context: WebGL2RenderingContext): void {
  context.getExtension("WEBGL_lose_context")?.loseContext();
}

/** Resolves when the picture is there or will not come soon: the viewer's code must not take the line from it. */
function pictureShown(picture: HTMLImageElement): Promise<void> {
  if (picture.complete) return Promise.resolve();
  return new Promise((resolve) => {
    const done = () => resolve();
    picture.addEventListener("load", done, { once: true });
    picture.addEventListener("error", done, { once: true });
    setTimeout(done, POSTER_PATIENCE_MILLIS);
  });
}
