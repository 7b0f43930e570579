// How a view is taken: by button, by space bar, by a timer, or by itself when nothing moves.
import { button, freshId, h } from "../../src/ui/dom";
import { input } from "../../src/ui/form";
import { type App, whenChanged } from "../app";
import type { AutoMode, State } from "../daemon/types";
import { texts } from "../texts";

const t = texts.views;
const MODES: readonly AutoMode[] = ["manual", "still", "timer"];
/** Where the space bar has a meaning of its own. */
const OWN_SPACE = "button, a, input, select, textarea, summary, dialog, [role=application]";

export interface Taking {
  readonly element: HTMLElement;
  update(state: State): void;
}

export function makeTaking(app: App, signal: AbortSignal): Taking {
  let isTaking = false;
  const take = () => {
    if (!isTaking) void app.run(() => app.daemon.takeView());
  };
  const label = h("span", {}, t.take);
  const hint = h("span", { class: "take-hint" }, t.takeHint);
  const shoot = button("", take, { class: "primary take" });
  shoot.append(label, hint);
  const progress = h("progress", { max: 1, value: 0, "aria-label": t.takingLabel, hidden: true });
  const next = h("p", { class: "facts next-in" });
  const auto = makeAuto(app);
  document.addEventListener(
    "keydown",
    (event) => {
      const isMeant = event.code === "Space" && !event.ctrlKey && !event.altKey && !event.metaKey;
      if (!isMeant || !(event.target instanceof Element) || event.target.closest(OWN_SPACE)) return;
      event.preventDefault();
      if (!event.repeat) take();
    },
    { signal },
  );
  return {
    element: h("div", { class: "taking" }, shoot, progress, next, auto.element),
    update(state) {
      const { taking, auto: mode } = state;
      if (taking && !isTaking) app.say(t.begun);
      isTaking = taking !== null;
      // Not `disabled`, which would take the focus away in the middle of the work.
      shoot.setAttribute("aria-disabled", String(isTaking));
      label.textContent = taking ? t.taking(taking.frames, taking.of) : t.take;
      hint.hidden = isTaking;
      progress.hidden = !isTaking;
      if (taking) progress.value = taking.of > 0 ? taking.frames / taking.of : 0;
      next.textContent = mode.next_in === null ? "" : t.nextIn(Math.ceil(mode.next_in));
      auto.update(state);
    },
  };
}

function makeAuto(app: App): Taking {
  const name = freshId("auto");
  const seconds = input(t.seconds, { type: "number", min: 1, max: 60, step: 1, value: 3 });
  const radios = MODES.map((mode) => {
    const radio = h("input", { type: "radio", name, value: mode });
    radio.addEventListener("change", send);
    return radio;
  });
  seconds.control.addEventListener("change", send);

  function send(): void {
    const mode = MODES.find((_, i) => radios[i]?.checked) ?? "manual";
    const wanted = Math.min(60, Math.max(1, Number(seconds.control.value) || 3));
    void app.run(() => app.daemon.auto(mode, wanted));
  }

  const show = whenChanged(
    (state: State) => [state.auto.mode, state.auto.seconds] as const,
    ([mode, wanted]) => {
      for (const radio of radios) radio.checked = radio.value === mode;
      seconds.element.hidden = mode === "manual";
      if (document.activeElement !== seconds.control) seconds.control.value = String(wanted);
    },
  );
  const labels = MODES.map((mode, i) => h("label", {}, radios[i], t.modes[mode]));
  return {
    element: h(
      "fieldset",
      { class: "auto" },
      h("legend", {}, t.autoTitle),
      h("div", { class: "auto-modes" }, ...labels),
      seconds.element,
    ),
    update: show,
  };
}
