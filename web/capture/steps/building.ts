// The build: how far it is, and a way to stop it.
import { button, h } from "../../src/ui/dom";
import { type MakeStep, whenChanged } from "../app";
import type { State } from "../daemon/types";
import { texts } from "../texts";

const t = texts.building;

export const building: MakeStep = (app) => {
  const stage = h("p", { class: "stage-name" }, t.starting);
  const progress = h("progress", { "aria-label": t.progress });
  const count = h("p", { class: "facts" });
  const content = h(
    "div",
    { class: "panel work" },
    h("p", { class: "lead" }, t.lead),
    stage,
    progress,
    count,
    button(t.cancel, () => void app.run(() => app.daemon.cancelBuild())),
  );
  const showStage = whenChanged(
    ({ build }: State) => build?.stage ?? null,
    (name) => {
      if (name === null) return;
      stage.textContent = t.stages[name] ?? name;
      app.say(stage.textContent);
    },
  );
  return {
    content,
    update(state) {
      showStage(state);
      const { build } = state;
      count.textContent = build && build.of > 0 ? t.step(build.done, build.of) : "";
      if (build && build.of > 0) progress.value = Math.min(1, build.done / build.of);
      else progress.removeAttribute("value");
    },
  };
};
