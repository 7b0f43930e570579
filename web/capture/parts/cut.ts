// Marks points of the model with a box or a lasso drawn over its picture, and has them removed.
import { formatCount } from "../../src/format";
import { button, h } from "../../src/ui/dom";
import type { Viewer } from "../../src/viewer/viewer";
import type { App } from "../app";
import type { State } from "../daemon/types";
import { type Place, pointsInside, union } from "../math/select";
import { texts } from "../texts";
import { makeSurface, type Tool } from "./surface";

const t = texts.cut;

export interface Cut {
  readonly element: HTMLElement;
  /** Takes its place over the view once that can be drawn on. */
  attach(viewer: Viewer, stage: HTMLElement): void;
  /** The model is another one now: what was marked is gone. */
  reset(): void;
  update(state: State): void;
}

export function makeCut(app: App, signal: AbortSignal): Cut {
  let viewer: Viewer | null = null;
  let selected = new Uint32Array(0);
  let isBusy = false;
  let canUndo = false;
  const help = h("p", { class: "hint" }, t.helpTurn);
  const count = h("p", { class: "cut-count", role: "status" }, t.none);
  const front = h("input", { type: "checkbox" });
  const surface = makeSurface({ select, clear, say: app.say, remove: () => void remove() }, signal);
  const tools = (["turn", "box", "lasso"] as const).map((tool) =>
    button(t[tool], () => choose(tool), { "aria-pressed": String(tool === "turn") }),
  );
  const drop = button(t.remove, () => void remove(), { class: "danger" });
  const forget = button(t.clear, clear);
  const undo = button(t.undo, () => void takeBack());
  const element = h(
    "section",
    { class: "panel cut", "aria-label": t.title },
    h(
      "div",
      { class: "cut-row" },
      h("div", { class: "cut-tools", role: "group", "aria-label": t.tools }, ...tools),
      h("div", { class: "cut-actions" }, drop, forget, undo),
    ),
    help,
    h("div", { class: "cut-row" }, count, h("label", { class: "check" }, front, t.front)),
  );

  function choose(tool: Tool): void {
    for (const [i, name] of (["turn", "box", "lasso"] as const).entries()) {
      tools[i]?.setAttribute("aria-pressed", String(name === tool));
    }
    help.textContent = { turn: t.helpTurn, box: t.helpBox, lasso: t.helpLasso }[tool];
    surface.use(tool);
  }

  function select(outline: readonly Place[], isMore: boolean): void {
    const sight = viewer?.sight();
    if (!sight) return;
    const found = pointsInside(sight, surface.size(), outline, front.checked);
    show(isMore ? union(selected, found) : found);
  }

  function clear(): void {
    show(new Uint32Array(0));
  }

  function show(indices: Uint32Array<ArrayBuffer>): void {
    selected = indices;
    viewer?.mark(indices);
    count.textContent = indices.length === 0 ? t.none : t.selected(formatCount(indices.length));
    count.dataset.selected = String(indices.length);
    showButtons();
  }

  function showButtons(): void {
    drop.setAttribute("aria-disabled", String(selected.length === 0 || isBusy));
    forget.setAttribute("aria-disabled", String(selected.length === 0));
    undo.setAttribute("aria-disabled", String(!canUndo || isBusy));
  }

  async function remove(): Promise<void> {
    if (isBusy) return;
    if (selected.length === 0) return app.say(t.nothing);
    const going = selected;
    await once(() => app.run(() => app.daemon.removePoints(going)), t.gone);
  }

  async function takeBack(): Promise<void> {
    if (!isBusy && canUndo) await once(() => app.run(() => app.daemon.undoRemoval()), t.undone);
  }

  async function once(order: () => Promise<boolean>, good: string): Promise<void> {
    isBusy = true;
    showButtons();
    if (await order()) app.say(good);
    isBusy = false;
    showButtons();
  }

  element.addEventListener("keydown", onKey, { signal });
  function onKey(event: KeyboardEvent): void {
    if (event.key === "Delete") void remove();
    else if (event.key === "Escape") clear();
  }
  document.addEventListener(
    "keydown",
    (event) => {
      const isUndo = (event.ctrlKey || event.metaKey) && !event.shiftKey && event.key.toLowerCase() === "z";
      if (!isUndo || (event.target instanceof Element && event.target.closest("input, textarea"))) return;
      event.preventDefault();
      void takeBack();
    },
    { signal },
  );
  showButtons();

  return {
    element,
    attach(made, stage) {
      viewer = made;
      surface.attach(stage);
    },
    reset() {
      if (selected.length > 0) show(new Uint32Array(0));
    },
    update({ result }) {
      canUndo = result?.can_undo ?? false;
      showButtons();
    },
  };
}
