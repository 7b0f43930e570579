// Pointer, wheel and keys on the canvas, turned into what they mean. Knows no camera and no model.

export interface ControlActions {
  /** By a pointer that moved so many pixels, y down. */
  turn(dx: number, dy: number): void;
  pan(dx: number, dy: number): void;
  zoom(factor: number): void;
  /** At a place of the canvas, in pixels from its top left. */
  centre(x: number, y: number): void;
  reset(): void;
  fullScreen(): void;
}

const KEY_TURN_PX = 30;
const KEY_PAN_PX = 25;
export const KEY_ZOOM = 1.2;
const WHEEL_ZOOM_PER_PX = 0.0015;
/** Pinching on a touch pad arrives as a wheel with Ctrl, in much smaller steps. */
const PINCH_ZOOM_PER_PX = 0.01;
const LINE_PX = 33;
const DOUBLE_TAP_MILLIS = 320;
const TAP_PX = 12;

interface Place {
  x: number;
  y: number;
}

export function attachControls(canvas: HTMLElement, actions: ControlActions, signal: AbortSignal): void {
  const options = { signal };
  canvas.addEventListener("contextmenu", (event) => event.preventDefault(), options);
  canvas.addEventListener("keydown", (event) => onKey(event, actions), options);
  canvas.addEventListener("wheel", (event) => onWheel(event, actions), { signal, passive: false });
  canvas.addEventListener("dblclick", (event) => actions.centre(event.offsetX, event.offsetY), options);
  attachPointers(canvas, actions, options);
}

function attachPointers(
  canvas: HTMLElement,
  actions: ControlActions,
  options: { signal: AbortSignal },
): void {
  const down = new Map<number, Place>();
  let lastTap = { time: Number.NEGATIVE_INFINITY, x: 0, y: 0 };
  let start: Place = { x: 0, y: 0 };

  canvas.addEventListener(
    "pointerdown",
    (event) => {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, { x: event.clientX, y: event.clientY });
      start = { x: event.clientX, y: event.clientY };
    },
    options,
  );

  canvas.addEventListener(
    "pointermove",
    (event) => {
      const before = down.get(event.pointerId);
      if (!before) return;
      const now = { x: event.clientX, y: event.clientY };
      const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
      down.set(event.pointerId, now);
      const [dx, dy] = [now.x - before.x, now.y - before.y];
      if (other) {
        const spread = distance(now, other) / Math.max(1, distance(before, other));
        if (spread > 0) actions.zoom(spread);
        actions.pan(dx / 2, dy / 2);
      } else if (event.shiftKey || (event.buttons & 6) !== 0) {
        actions.pan(dx, dy);
      } else {
        actions.turn(dx, dy);
      }
    },
    options,
  );

  const up = (event: PointerEvent) => {
    const wasAlone = down.size === 1;
    if (!down.delete(event.pointerId) || event.type !== "pointerup") return;
    const here = { x: event.clientX, y: event.clientY };
    if (event.pointerType !== "touch" || !wasAlone || distance(here, start) > TAP_PX) return;
    const isSecond =
      event.timeStamp - lastTap.time < DOUBLE_TAP_MILLIS && distance(here, lastTap) < TAP_PX * 2;
    if (isSecond) actions.centre(event.offsetX, event.offsetY);
    lastTap = { time: isSecond ? Number.NEGATIVE_INFINITY : event.timeStamp, ...here };
  };
  for (const type of ["pointerup", "pointercancel"] as const) canvas.addEventListener(type, up, options);
}

function distance(a: Place, b: Place): number {
  return Math.hypot(a.x - b.x, a.y - b.y);
}

function onWheel(event: WheelEvent, actions: ControlActions): void {
  event.preventDefault();
  const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * LINE_PX;
  actions.zoom(Math.exp(-pixels * (event.ctrlKey ? PINCH_ZOOM_PER_PX : WHEEL_ZOOM_PER_PX)));
}

function onKey(event: KeyboardEvent, actions: ControlActions): void {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (arrow(event, actions) || letter(event.key, actions)) event.preventDefault();
}

function arrow(event: KeyboardEvent, actions: ControlActions): boolean {
  const directions: Record<string, readonly [number, number]> = {
    ArrowLeft: [-1, 0],
    ArrowRight: [1, 0],
    ArrowUp: [0, -1],
    ArrowDown: [0, 1],
  };
  const direction = directions[event.key];
  if (!direction) return false;
  const [x, y] = direction;
  if (event.shiftKey) actions.pan(x * KEY_PAN_PX, y * KEY_PAN_PX);
  else actions.turn(x * KEY_TURN_PX, y * KEY_TURN_PX);
  return true;
}

function letter(key: string, actions: ControlActions): boolean {
  switch (key) {
    case "+":
    case "=":
      actions.zoom(KEY_ZOOM);
      return true;
    case "-":
    case "_":
      actions.zoom(1 / KEY_ZOOM);
      return true;
    case "Home":
    case "r":
    case "R":
      actions.reset();
      return true;
    case "f":
    case "F":
      actions.fullScreen();
      return true;
    default:
      return false;
  }
}
