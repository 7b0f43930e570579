// The 3D view: one model, looked at from an orbit. Composition of camera mathematics, controls, loader and renderer;
// knows neither the API nor the page it stands in. Loaded lazily, for three.js is most of the site's code.
//
// `data-state` on the root says what is going on: loading, ready, failed, lost; `data-drawn` how many points (triangles of a
// mesh) the picture shows, `data-settled` whether the picture is final until something moves.
import { DrawBudget } from "../math/budget";
import { type ColourName, mainColours } from "../math/colours";
import { facing } from "../math/facing";
import * as orbits from "../math/orbit";
import { pickPoint, pickTriangle, sightLine } from "../math/pick";
import type { Vec3 } from "../math/vec3";
import { texts } from "../texts";
import { attachControls, type ControlActions } from "./controls";
import { loadStream, type StreamRequest } from "./load";
import { makePanel, type Panel } from "./panel";
import { Renderer } from "./renderer";
import { LANES, MARKED, type Model, type StreamDecoder, type StreamHeader } from "./stream";

export interface ViewerOptions {
  /** Box the view lives in; the viewer fills it and takes everything away again when the signal fires. */
  readonly root: HTMLElement;
  readonly canvas: HTMLCanvasElement;
  readonly context: WebGL2RenderingContext;
  readonly streamUrl: string;
  readonly streamBytes: number | null;
  readonly request?: StreamRequest;
  readonly signal: AbortSignal;
  /** Called once when there is something to see. */
  readonly onFirstPicture: () => void;
  /** Called when the whole model is there. */
  readonly onLoaded: (colours: ColourName[]) => void;
}

/** Where the model's points stand in the picture. */
export interface Sight {
  readonly orbit: orbits.Orbit;
  readonly bounds: orbits.Bounds;
  readonly positions: Uint16Array;
  readonly points: number;
}

const STILL_MILLIS = 180;
const SAY_AFTER_MILLIS = 700;
const GLIDE_MILLIS = 260;
/** A double-click takes the nearest point within this many pixels. */
const PICK_PX = 6;
const RESTORE_PATIENCE_MILLIS = 4000;

export class Viewer {
  readonly #options: ViewerOptions;
  readonly #panel: Panel;
  readonly #budget = new DrawBudget();
  #renderer: Renderer | null = null;
  #decoder: StreamDecoder | null = null;
  /** What the points are when no one marks them; kept from the first mark on. */
  #flags: Uint8Array | null = null;
  #home: orbits.Orbit | null = null;
  #orbit: orbits.Orbit | null = null;
  #streamUrl: string;
  #loading = new AbortController();
  #pointScale = 1;
  #frame = 0;
  #movedAt = Number.NEGATIVE_INFINITY;
  #lastMovingFrame: { at: number; drawn: number } | null = null;
  #stillTimer = 0;
  #sayTimer = 0;
  #restoreTimer = 0;
  #isLost = false;
  /** The person has turned or zoomed: a change of the window's shape keeps their view. */
  #isTouched = false;

  constructor(options: ViewerOptions) {
    this.#options = options;
    this.#streamUrl = options.streamUrl;
    const actions: ControlActions = {
      turn: (dx, dy) => this.#turn(dx, dy),
      pan: (dx, dy) => this.#move((orbit) => orbits.pan(orbit, dx, dy, options.canvas.clientHeight)),
      zoom: (factor) => this.#zoom(factor),
      centre: (x, y) => this.#centre(x, y),
      reset: () => this.#reset(),
      fullScreen: () => this.#fullScreen(),
    };
    this.#panel = makePanel(actions);
    this.#panel.onPointScale((scale) => {
      this.#pointScale = scale;
      this.#invalidate();
    });
    options.root.append(this.#panel.element);
    options.canvas.setAttribute("aria-describedby", this.#panel.helpId);
    attachControls(options.canvas, actions, options.signal);
    this.#watchContext();
    this.#watchSize();
    options.signal.addEventListener("abort", () => this.#dispose(), { once: true });
    void this.#load();
  }

  /** The picture as it is now, for use as a listing's picture. */
  async picture(): Promise<Blob | null> {
    if (!this.#renderer || !this.#orbit || this.#isLost) return null;
    const { kind, count } = this.#available();
    this.#renderer.render(this.#orbit, kind, count, this.#pointScale);
    return new Promise((resolve) => this.#options.canvas.toBlob(resolve, "image/png"));
  }

  /** Fetches the model anew, from another address where one is given; the person's view of it stays. */
  reload(streamUrl?: string): void {
    if (streamUrl !== undefined) this.#streamUrl = streamUrl;
    void this.#load();
  }

  /** What is seen now; null until the whole model is there. */
  sight(): Sight | null {
    const { header, model, complete } = this.#decoder ?? {};
    if (!header || !model || !complete || !this.#orbit) return null;
    return { orbit: this.#orbit, bounds: header, positions: model.positions, points: header.points };
  }

  /** Shows these points, and no others, as marked. */
  mark(indices: Iterable<number>): void {
    const { model, header } = this.#decoder ?? {};
    if (!model || !header) return;
    const flags = this.#flags ?? new Uint8Array(header.points).map((_, i) => flagAt(model, i));
    this.#flags = flags;
    flags.forEach((flag, i) => {
      model.colors[i * LANES + LANES - 1] = flag;
    });
    for (const i of indices) model.colors[i * LANES + LANES - 1] = MARKED;
    this.#renderer?.refreshColors();
    this.#invalidate();
  }

  async #load(): Promise<void> {
    const { streamBytes, signal, request } = this.#options;
    // Only the last of several calls counts.
    this.#loading.abort();
    const mine = new AbortController();
    this.#loading = mine;
    const ended = AbortSignal.any([signal, mine.signal]);
    this.#setState("loading");
    this.#panel.showMessage(null);
    this.#panel.showProgress(0);
    try {
      const onProgress = (decoder: StreamDecoder) => this.#onProgress(decoder);
      await loadStream({
        url: this.#streamUrl,
        expectedBytes: streamBytes,
        signal: ended,
        onProgress,
        ...(request ? { request } : {}),
      });
      this.#onLoaded();
    } catch (error) {
      if (ended.aborted) return;
      console.info("The 3D model could not be loaded:", error);
      this.#setState("failed");
      this.#panel.showProgress(null);
      this.#panel.showMessage(texts.viewer.failed, () => void this.#load());
    }
  }

  #onProgress(decoder: StreamDecoder): void {
    const { header, model } = decoder;
    if (!header || !model) return;
    if (this.#decoder !== decoder) this.#begin(decoder, header, model);
    const total = header.points + header.triangles;
    this.#panel.showProgress((decoder.pointsReady + decoder.trianglesReady) / total);
    this.#renderer?.addPoints(decoder.pointsReady);
    this.#invalidate();
  }

  #begin(decoder: StreamDecoder, header: StreamHeader, model: Model): void {
    const { canvas, context } = this.#options;
    this.#decoder = decoder;
    this.#flags = null;
    if (this.#renderer) this.#renderer.useModel(header, model);
    else this.#renderer = new Renderer(canvas, context, header, model);
    if (header.kind === "mesh") this.#panel.hidePointSize();
    this.#resize();
  }

  #onLoaded(): void {
    const { header, model } = this.#decoder ?? {};
    if (!header || !model) return;
    this.#renderer?.addPoints(header.points);
    this.#panel.showProgress(null);
    this.#panel.showInvented((this.#decoder?.inventedPoints ?? 0) > 0);
    this.#setState("ready");
    this.#invalidate();
    this.#saySoon();
    this.#options.onLoaded(mainColours(model.colors, LANES, header.points));
  }

  /** What can be drawn of what has arrived: any number of points, and a mesh as soon as it is whole. */
  #available(): { kind: StreamHeader["kind"]; count: number } {
    const { header, complete, trianglesReady, pointsReady } = this.#decoder ?? {};
    if (header?.kind === "mesh" && complete) return { kind: "mesh", count: trianglesReady ?? 0 };
    return { kind: "points", count: pointsReady ?? 0 };
  }

  // --- drawing on demand ---

  #invalidate(): void {
    this.#options.root.dataset.settled = "false";
    if (this.#frame !== 0 || this.#options.signal.aborted) return;
    this.#frame = requestAnimationFrame((now) => this.#draw(now));
  }

  #draw(now: number): void {
    this.#frame = 0;
    const { kind, count } = this.#available();
    if (!this.#renderer || !this.#orbit || this.#isLost || count === 0) return;
    const moving = now - this.#movedAt < STILL_MILLIS;
    const drawn = kind === "mesh" ? count : this.#budget.points(count, moving);
    this.#learn(now, moving);
    this.#renderer.render(this.#orbit, kind, drawn, this.#pointScale);
    this.#lastMovingFrame = moving ? { at: now, drawn } : null;
    this.#afterDraw(drawn, moving);
  }

  #learn(now: number, moving: boolean): void {
    const last = this.#lastMovingFrame;
    // A pause between two movements is no slow frame.
    if (moving && last && now - last.at < STILL_MILLIS * 4) this.#budget.learn(last.drawn, now - last.at);
  }

  #afterDraw(drawn: number, moving: boolean): void {
    const { root, onFirstPicture } = this.#options;
    if (root.dataset.drawn === undefined) onFirstPicture();
    root.dataset.drawn = String(drawn);
    clearTimeout(this.#stillTimer);
    if (moving) this.#stillTimer = window.setTimeout(() => this.#invalidate(), STILL_MILLIS);
    else root.dataset.settled = String(root.dataset.state === "ready");
  }

  // --- moving the view ---

  #move(change: (orbit: orbits.Orbit) => orbits.Orbit): void {
    if (!this.#orbit) return;
    this.#orbit = change(this.#orbit);
    this.#isTouched = true;
    this.#movedAt = performance.now();
    this.#invalidate();
    this.#saySoon();
  }

  #turn(dx: number, dy: number): void {
    this.#move((orbit) => orbits.turn(orbit, -dx * orbits.TURN_PER_PIXEL, dy * orbits.TURN_PER_PIXEL));
  }

  #zoom(factor: number): void {
    const bounds = this.#decoder?.header;
    if (bounds) this.#move((orbit) => orbits.zoom(orbit, factor, orbits.radius(bounds)));
  }

  #reset(): void {
    if (!this.#home) return;
    this.#glideTo(this.#home);
    this.#isTouched = false;
  }

  #centre(x: number, y: number): void {
    const found = this.#pick(x, y);
    if (found && this.#orbit) this.#glideTo({ ...this.#orbit, target: found });
  }

  #pick(x: number, y: number): Vec3 | null {
    const { header, model, complete, pointsReady } = this.#decoder ?? {};
    if (!header || !model || !this.#orbit || pointsReady === undefined) return null;
    const { clientWidth: width, clientHeight: height } = this.#options.canvas;
    const ray = sightLine(this.#orbit, width / height, (2 * x) / width - 1, 1 - (2 * y) / height);
    if (header.kind === "mesh" && complete)
      return pickTriangle(ray, header, model.positions, LANES, model.indices);
    const slope = (PICK_PX * 2 * Math.tan(orbits.FIELD_OF_VIEW / 2)) / height;
    return pickPoint(ray, header, model.positions, LANES, pointsReady, slope);
  }

  #glideTo(goal: orbits.Orbit): void {
    const start = this.#orbit;
    if (!start || matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.#move(() => goal);
      return;
    }
    const began = performance.now();
    let mine = start;
    const step = () => {
      // Somebody took hold of the view meanwhile: theirs counts.
      if (this.#orbit !== mine || this.#options.signal.aborted) return;
      const t = Math.min(1, (performance.now() - began) / GLIDE_MILLIS);
      const wasTouched = this.#isTouched;
      this.#move(() => (t < 1 ? orbits.between(start, goal, t * t * (3 - 2 * t)) : goal));
      this.#isTouched = wasTouched;
      mine = this.#orbit;
      if (t < 1) requestAnimationFrame(step);
    };
    step();
  }

  #fullScreen(): void {
    const { root } = this.#options;
    const change = document.fullscreenElement ? document.exitFullscreen() : root.requestFullscreen();
    change.catch(() => this.#panel.say(texts.viewer.noFullScreen));
  }

  #saySoon(): void {
    clearTimeout(this.#sayTimer);
    this.#sayTimer = window.setTimeout(() => {
      if (!this.#orbit || !this.#home) return;
      const zoom = Math.round((this.#home.distance / this.#orbit.distance) * 100);
      this.#panel.say(texts.viewer.seenFrom(facing(this.#orbit), zoom));
    }, SAY_AFTER_MILLIS);
  }

  // --- the browser's side ---

  #watchSize(): void {
    const observer = new ResizeObserver(() => this.#resize());
    observer.observe(this.#options.canvas);
    this.#options.signal.addEventListener("abort", () => observer.disconnect(), { once: true });
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.#options.canvas;
    const bounds = this.#decoder?.header;
    if (!this.#renderer || !bounds || width === 0 || height === 0) return;
    this.#renderer.resize(width, height);
    this.#home = orbits.fit(bounds, width / height);
    if (!this.#orbit || !this.#isTouched) this.#orbit = this.#home;
    this.#invalidate();
  }

  #watchContext(): void {
    const { canvas, signal } = this.#options;
    canvas.addEventListener("webglcontextlost", (event) => this.#onLost(event), { signal });
    canvas.addEventListener("webglcontextrestored", () => this.#onRestored(), { signal });
  }

  #onLost(event: Event): void {
    // Without this the browser never gives the context back.
    event.preventDefault();
    this.#isLost = true;
    this.#setState("lost");
    this.#panel.showMessage(texts.viewer.lost);
    this.#restoreTimer = window.setTimeout(
      () => this.#panel.showMessage(texts.viewer.lostForGood, () => location.reload()),
      RESTORE_PATIENCE_MILLIS,
    );
  }

  #onRestored(): void {
    clearTimeout(this.#restoreTimer);
    this.#isLost = false;
    this.#setState(this.#decoder?.complete ? "ready" : "loading");
    this.#panel.showMessage(null);
    this.#invalidate();
  }

  #setState(state: "loading" | "ready" | "failed" | "lost"): void {
    this.#options.root.dataset.state = state;
  }

  #dispose(): void {
    cancelAnimationFrame(this.#frame);
    for (const timer of [this.#stillTimer, this.#sayTimer, this.#restoreTimer]) clearTimeout(timer);
    if (this.#renderer) this.#renderer.dispose();
    else this.#options.context.getExtension("WEBGL_lose_context")?.loseContext();
    this.#renderer = null;
    this.#decoder = null;
    this.#panel.element.remove();
  }
}

function flagAt(model: Model, point: number): number {
  return model.colors[point * LANES + LANES - 1] ?? 0;
}
