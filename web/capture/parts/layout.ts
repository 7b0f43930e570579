// Header with the steps, the place for a step, and what must be said whatever the step.
import { formatBytes } from "../../src/format";
import { button, h } from "../../src/ui/dom";
import { makeNotice, type Notice } from "../../src/ui/form";
import type { BackStep } from "../daemon/client";
import type { State } from "../daemon/types";
import { type ShownStep, texts } from "../texts";

const STAGES: readonly BackStep[] = ["sensor", "board", "views", "result"];
const STAGE_OF: Record<ShownStep, BackStep | "publish"> = {
  sensor: "sensor",
  board: "board",
  views: "views",
  building: "result",
  result: "result",
  listing: "publish",
  publishing: "publish",
  published: "publish",
};

export interface Layout {
  readonly main: HTMLElement;
  readonly notice: Notice;
  showStages(shown: ShownStep, state: State): void;
  showConnection(text: string | null): void;
  showError(text: string | null): void;
  showFolder(state: State): void;
  say(text: string): void;
  /** Leaves the text alone. */
  showEnd(): void;
}

export interface LayoutActions {
  open(stage: BackStep): void;
  quit(): void;
}

export function makeLayout(root: HTMLElement, actions: LayoutActions): Layout {
  const stages = h("ol", { class: "stages" });
  const main = h("main", { id: "content", tabindex: -1 });
  const live = h("p", { class: "visually-hidden", role: "status" });
  const connection = alertLine();
  const error = alertLine();
  const notice = makeNotice();
  const folder = h("p", { class: "folder" });
  const quit = button(texts.quit.open, actions.quit, { class: "quiet" });
  const nav = h("nav", { "aria-label": texts.stages.label }, stages);
  root.replaceChildren(
    h("a", { class: "skip", href: "#content" }, texts.skipToContent),
    h(
      "header",
      { class: "site-header" },
      h(
        "div",
        { class: "wrap" },
        h(
          "span",
          { class: "brand" },
          h("img", { src: "/icon.svg", alt: "", width: 28, height: 28 }),
          texts.brand,
        ),
        nav,
        quit,
      ),
    ),
    h("div", { class: "wrap alerts" }, connection, error, notice.element),
    main,
    h("footer", { class: "site-footer" }, h("div", { class: "wrap" }, h("p", {}, texts.footer), folder)),
    live,
  );
  let shownStages = "";
  return {
    main,
    notice,
    showStages(shown, state) {
      const items = stageItems(shown, state);
      const key = JSON.stringify(items);
      if (key === shownStages) return;
      shownStages = key;
      stages.replaceChildren(...items.map((item, place) => stageElement(item, place, actions)));
    },
    showConnection: (text) => setText(connection, text),
    showError(text) {
      // Why the last order was refused stands there already.
      setText(error, text === notice.element.textContent ? null : text);
    },
    showFolder(state) {
      setText(
        folder,
        state.folder === null ? null : texts.folder(state.folder, formatBytes(state.free_bytes)),
      );
    },
    say(text) {
      live.textContent = text;
    },
    showEnd() {
      nav.remove();
      quit.remove();
      setText(connection, null);
      setText(error, null);
      notice.clear();
    },
  };
}

function alertLine(): HTMLElement {
  return h("p", { class: "notice bad", role: "alert" });
}

function setText(element: HTMLElement, text: string | null): void {
  if (element.textContent !== (text ?? "")) element.textContent = text ?? "";
}

interface StageItem {
  readonly stage: BackStep | "publish";
  readonly isCurrent: boolean;
  readonly isDone: boolean;
  readonly canOpen: boolean;
}

function stageItems(shown: ShownStep, state: State): StageItem[] {
  const current = STAGE_OF[shown];
  const order = [...STAGES, "publish"] as const;
  const isBusy = shown === "building" || shown === "publishing";
  const isThere: Record<BackStep | "publish", boolean> = {
    sensor: true,
    board: state.sensor !== null,
    views: state.sensor !== null && state.board !== null,
    result: state.result !== null,
    publish: false,
  };
  return order.map((stage, i) => ({
    stage,
    isCurrent: stage === current,
    isDone: i < order.indexOf(current),
    canOpen: stage !== current && !isBusy && isThere[stage],
  }));
}

function stageElement(
  { stage, isCurrent, isDone, canOpen }: StageItem,
  place: number,
  actions: LayoutActions,
) {
  const name = stage === "publish" ? texts.stages.publish : texts.stages.names[stage];
  const mark = h("span", { class: "stage-mark", "aria-hidden": "true" }, isDone ? "✓" : String(place + 1));
  const text = h("span", { class: "stage-name" }, name);
  if (isDone) text.append(h("span", { class: "visually-hidden" }, ` (${texts.stages.done})`));
  const inner =
    canOpen && stage !== "publish" ? button("", () => actions.open(stage), { class: "link" }) : h("span", {});
  inner.append(mark, text);
  const attributes = {
    class: isDone ? "stage-done" : "stage",
    "aria-current": isCurrent ? "step" : undefined,
  };
  return h("li", attributes, inner);
}
