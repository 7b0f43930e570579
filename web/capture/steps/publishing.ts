// The upload on its way.
import { formatBytes } from "../../src/format";
import { h } from "../../src/ui/dom";
import { type MakeStep, whenChanged } from "../app";
import type { State } from "../daemon/types";
import { texts } from "../texts";

const t = texts.publishing;

export const publishing: MakeStep = (app) => {
  const phase = h("p", { class: "stage-name" }, t.starting);
  const progress = h("progress", { "aria-label": t.progress });
  const sent = h("p", { class: "facts" });
  const showPhase = whenChanged(
    ({ publish }: State) => publish?.phase ?? null,
    (name) => {
      if (name === null) return;
      phase.textContent = t.phases[name] ?? name;
      app.say(phase.textContent);
    },
  );
  return {
    content: h("div", { class: "panel work" }, phase, progress, sent),
    update(state) {
      showPhase(state);
      const { publish } = state;
      const isCounted = publish?.phase === "uploading" && publish.total_bytes > 0;
      sent.textContent = isCounted
        ? t.sent(formatBytes(publish.sent_bytes), formatBytes(publish.total_bytes))
        : "";
      if (isCounted) progress.value = Math.min(1, publish.sent_bytes / publish.total_bytes);
      else progress.removeAttribute("value");
    },
  };
};
