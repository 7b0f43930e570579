// The heart of the scan: see what the sensor sees, take views from all sides, watch the product grow.
import { button, h } from "../../src/ui/dom";
import { type MakeStep, whenChanged } from "../app";
import type { State } from "../daemon/types";
import { makeLight } from "../parts/light";
import { makeLiveView } from "../parts/live-view";
import { makePreview } from "../parts/preview";
import { makeRing, seenInWords } from "../parts/ring";
import { makeStation } from "../parts/station";
import { makeTaking } from "../parts/taking";
import { makeViewList, viewNumber } from "../parts/view-list";
import { texts } from "../texts";

const t = texts.views;
const LEAST_VIEWS = 3;

export const views: MakeStep = (app, first, signal) => {
  const light = makeLight(signal);
  const live = makeLiveView(signal, light.show);
  const taking = makeTaking(app, signal);
  const station = makeStation(app);
  const ring = makeRing();
  const preview = makePreview(app.daemon, signal);
  const list = makeViewList(app);
  const trouble = h("p", { class: "notice bad", role: "alert" });
  const boardWarnings = h("div", {});
  const buildHint = h("p", { class: "hint" });
  const build = button(t.build, () => void app.run(() => app.daemon.build()), { class: "primary" });
  const content = h(
    "div",
    {},
    h("p", { class: "lead" }, t.lead),
    trouble,
    boardWarnings,
    h(
      "div",
      { class: "scan-columns" },
      h(
        "div",
        { class: "scan-live" },
        light.element,
        live.color,
        taking.element,
        station.element,
        live.facts,
      ),
      h("div", { class: "scan-ring" }, ring.element, live.depth),
      h("div", { class: "scan-model" }, preview.element),
      h("div", { class: "scan-list" }, list.element),
      h("section", { class: "panel scan-build" }, buildHint, build),
    ),
  );

  let known = new Set(first.views.map(({ name }) => name));
  const showViews = whenChanged(
    ({ views: all, sectors }: State) => [all, sectors] as const,
    ([all, sectors], state) => {
      ring.update(state);
      list.update(state);
      const fresh = all.find(({ name }) => !known.has(name));
      if (fresh) app.say(t.taken(viewNumber(fresh), seenInWords(state)));
      known = new Set(all.map(({ name }) => name));
      const unseen = sectors.filter(({ seen }) => !seen).length;
      const tooFew = all.length < LEAST_VIEWS;
      buildHint.textContent = tooFew ? t.buildFirst : unseen > 0 ? t.buildSome(unseen) : t.buildAll;
      build.disabled = tooFew;
    },
  );
  const showWarnings = whenChanged(
    ({ board }: State) => board?.warnings ?? [],
    (warnings) =>
      boardWarnings.replaceChildren(...warnings.map((text) => h("p", { class: "notice info" }, text))),
  );
  const showTrouble = whenChanged(
    ({ sensor }: State) => sensor?.trouble ?? null,
    (text) => {
      trouble.textContent = text === null ? "" : texts.live.trouble(text);
    },
  );
  return {
    content,
    update(state) {
      showTrouble(state);
      showWarnings(state);
      showViews(state);
      taking.update(state);
      station.update(state);
      preview.update(state.preview);
    },
    onPicture: live.show,
  };
};
