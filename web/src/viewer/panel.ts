// The viewer's buttons, its progress line and what it says aloud.
import { texts } from "../texts";
import { button, freshId, h } from "../ui/dom";
import { type ControlActions, KEY_ZOOM } from "./controls";

const t = texts.viewer;
const BUTTON_TURN_PX = 60;

export interface Panel {
  readonly element: HTMLElement;
  readonly helpId: string;
  showProgress(share: number | null): void;
  showMessage(text: string | null, retry?: () => void): void;
  say(text: string): void;
  onPointScale(listener: (scale: number) => void): void;
  hidePointSize(): void;
  /** Explains the stripes of surface that nobody measured. */
  showInvented(isThere: boolean): void;
}

export function makePanel(actions: ControlActions): Panel {
  const helpId = freshId("viewer-help");
  const progress = h("progress", { max: 1, value: 0, "aria-label": t.loading });
  const message = h("div", { class: "viewer-message", hidden: true });
  const live = h("p", { class: "visually-hidden", role: "status" });
  const sizeId = freshId("point-size");
  const size = h("input", { id: sizeId, type: "range", min: -2, max: 2, step: 0.25, value: 0 });
  const sizeField = h("div", { class: "viewer-size" }, h("label", { for: sizeId }, t.pointSize), size);
  const tools = h("div", { class: "viewer-tools", role: "group", "aria-label": t.tools });
  tools.append(
    icon("↺", t.turnLeft, () => actions.turn(-BUTTON_TURN_PX, 0)),
    icon("↻", t.turnRight, () => actions.turn(BUTTON_TURN_PX, 0)),
    icon("+", t.zoomIn, () => actions.zoom(KEY_ZOOM)),
    icon("−", t.zoomOut, () => actions.zoom(1 / KEY_ZOOM)),
    button(t.reset, actions.reset, { class: "quiet" }),
    button(t.fullScreen, actions.fullScreen, { class: "quiet" }),
    sizeField,
  );
  const help = h("p", { class: "viewer-help", id: helpId }, t.help);
  const invented = h("p", { class: "viewer-invented", hidden: true }, t.invented);
  const keys = h("details", { class: "viewer-keys" }, h("summary", {}, t.keysTitle), h("p", {}, t.keys));
  const element = h("div", { class: "viewer-panel" }, progress, message, tools, invented, help, keys, live);

  return {
    element,
    helpId,
    showProgress(share) {
      progress.hidden = share === null;
      if (share !== null) progress.value = share;
    },
    showMessage(text, retry) {
      message.replaceChildren();
      message.hidden = text === null;
      if (text === null) return;
      message.append(h("p", { role: "alert" }, text));
      if (retry) message.append(button(texts.common.retry, retry));
    },
    say(text) {
      live.textContent = text;
    },
    onPointScale(listener) {
      size.addEventListener("input", () => listener(2 ** Number(size.value)));
    },
    showInvented(isThere) {
      invented.hidden = !isThere;
    },
    hidePointSize() {
      sizeField.hidden = true;
    },
  };
}

function icon(symbol: string, label: string, onClick: () => void): HTMLButtonElement {
  const element = button("", onClick, { class: "quiet icon", "aria-label": label, title: label });
  element.append(h("span", { "aria-hidden": "true" }, symbol));
  return element;
}
