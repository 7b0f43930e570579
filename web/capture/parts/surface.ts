// The sheet over the 3D view on which a box or a lasso is drawn, by pointer or, for the box, by keys.
import { h } from "../../src/ui/dom";
import { boxOutline, type Place, type Size } from "../math/select";
import { texts } from "../texts";

const t = texts.cut;

export type Tool = "turn" | "box" | "lasso";

export interface SurfaceEvents {
  /** An outline is complete; `isMore` where it adds to what is selected. */
  select(outline: readonly Place[], isMore: boolean): void;
  clear(): void;
  remove(): void;
  say(text: string): void;
}

export interface Surface {
  use(tool: Tool): void;
  attach(stage: HTMLElement): void;
  size(): Size;
}

const LINE = "#b0115f";
const FILL = "rgb(176 17 95 / 12%)";
const EDGE = "rgb(255 255 255 / 85%)";
/** Two places of a lasso nearer than this are one. */
const LASSO_STEP_PX = 3;
const LEAST_DRAG_PX = 4;
const KEY_STEP = 0.02;
const LEAST_BOX = 0.04;
const SAY_AFTER_MILLIS = 600;

/** Shares of the surface. */
interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

export function makeSurface(events: SurfaceEvents, signal: AbortSignal): Surface {
  const canvas = h("canvas", {
    class: "cut-surface",
    tabindex: 0,
    role: "application",
    "aria-roledescription": t.surfaceRole,
    hidden: true,
  });
  let tool: Tool = "turn";
  let outline: Place[] = [];
  let start: Place | null = null;
  let box: Box = { x: 0.35, y: 0.35, width: 0.3, height: 0.3 };
  let sayTimer = 0;
  const size = (): Size => ({ width: canvas.clientWidth, height: canvas.clientHeight });

  function boxPlaces(): Place[] {
    const { width, height } = size();
    const at = (x: number, y: number): Place => ({ x: x * width, y: y * height });
    return boxOutline(at(box.x, box.y), at(box.x + box.width, box.y + box.height));
  }

  function draw(): void {
    const { width, height } = size();
    const ratio = window.devicePixelRatio;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    if (!pen) return;
    pen.scale(ratio, ratio);
    const isByKeys = tool === "box" && start === null && document.activeElement === canvas;
    const places = isByKeys ? boxPlaces() : outline;
    if (places.length < 2) return;
    pen.beginPath();
    for (const { x, y } of places) pen.lineTo(x, y);
    pen.closePath();
    pen.fillStyle = FILL;
    pen.fill();
    pen.strokeStyle = EDGE;
    pen.lineWidth = 4;
    pen.stroke();
    pen.strokeStyle = LINE;
    pen.lineWidth = 2;
    pen.setLineDash([6, 4]);
    pen.stroke();
  }

  function here(event: PointerEvent): Place {
    const edge = canvas.getBoundingClientRect();
    return { x: event.clientX - edge.left, y: event.clientY - edge.top };
  }

  function extend(place: Place): void {
    if (!start) return;
    if (tool === "box") outline = boxOutline(start, place);
    else {
      const last = outline.at(-1);
      if (last && Math.hypot(place.x - last.x, place.y - last.y) < LASSO_STEP_PX) return;
      outline.push(place);
    }
    draw();
  }

  function finish(event: PointerEvent): void {
    if (!start) return;
    const drawn = outline;
    const isDrag = drawn.some(({ x, y }) => start && Math.hypot(x - start.x, y - start.y) > LEAST_DRAG_PX);
    start = null;
    outline = [];
    draw();
    if (event.type !== "pointerup") return;
    if (isDrag) events.select(drawn, event.shiftKey);
    else if (!event.shiftKey) events.clear();
  }

  const options = { signal };
  canvas.addEventListener(
    "pointerdown",
    (event) => {
      if (event.button !== 0 || start) return;
      canvas.setPointerCapture(event.pointerId);
      start = here(event);
      outline = [start];
    },
    options,
  );
  canvas.addEventListener("pointermove", (event) => extend(here(event)), options);
  for (const type of ["pointerup", "pointercancel"] as const) canvas.addEventListener(type, finish, options);
  canvas.addEventListener("keydown", onKey, options);
  for (const type of ["focus", "blur"] as const) canvas.addEventListener(type, draw, options);
  const observer = new ResizeObserver(draw);
  observer.observe(canvas);
  signal.addEventListener("abort", () => observer.disconnect(), { once: true });

  function onKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Delete" || event.key === "Backspace") events.remove();
    else if (event.key === "Escape") events.clear();
    else if (tool !== "box") return;
    else if (event.key === "Enter") events.select(boxPlaces(), event.shiftKey);
    else if (!moveBox(event)) return;
    event.preventDefault();
  }

  function moveBox({ key, shiftKey }: KeyboardEvent): boolean {
    const steps: Record<string, readonly [number, number]> = {
      ArrowLeft: [-KEY_STEP, 0],
      ArrowRight: [KEY_STEP, 0],
      ArrowUp: [0, -KEY_STEP],
      ArrowDown: [0, KEY_STEP],
    };
    const step = steps[key];
    if (!step) return false;
    box = shiftKey ? resized(box, step) : moved(box, step);
    draw();
    clearTimeout(sayTimer);
    sayTimer = window.setTimeout(() => {
      const percent = (share: number) => Math.round(share * 100);
      events.say(t.boxAt(percent(box.x), percent(box.y), percent(box.width), percent(box.height)));
    }, SAY_AFTER_MILLIS);
    return true;
  }

  return {
    size,
    use(chosen) {
      tool = chosen;
      outline = [];
      start = null;
      canvas.hidden = tool === "turn";
      canvas.dataset.tool = tool;
      if (tool !== "turn") {
        canvas.setAttribute("aria-label", t.surface(t[tool]));
        canvas.focus({ preventScroll: true });
      }
      draw();
    },
    attach(stage) {
      stage.append(canvas);
    },
  };
}

function moved(box: Box, [dx, dy]: readonly [number, number]): Box {
  return {
    ...box,
    x: clamp(box.x + dx, 0, 1 - box.width),
    y: clamp(box.y + dy, 0, 1 - box.height),
  };
}

function resized(box: Box, [dx, dy]: readonly [number, number]): Box {
  return {
    ...box,
    width: clamp(box.width + dx, LEAST_BOX, 1 - box.x),
    height: clamp(box.height + dy, LEAST_BOX, 1 - box.y),
  };
}

function clamp(value: number, low: number, high: number): number {
  return Math.min(high, Math.max(low, value));
}
