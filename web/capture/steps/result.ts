// The finished model: how big, how good, and what of it does not belong to the product.
import { formatCount, formatLength, formatUncertainty, named } from "../../src/format";
import { button, h } from "../../src/ui/dom";
import { viewerFrame } from "../../src/viewer/frame";
import type { Viewer } from "../../src/viewer/viewer";
import { type App, type MakeStep, whenChanged } from "../app";
import type { Result, State } from "../daemon/types";
import { makeCut } from "../parts/cut";
import { viewNumber } from "../parts/view-list";
import { texts } from "../texts";

const t = texts.result;

export const result: MakeStep = (app, first, signal) => {
  const cut = makeCut(app, signal);
  const facts = h("div", { class: "result-facts" });
  let viewer: Viewer | null = null;
  let version = first.result?.version ?? 0;
  const frame = viewerFrame({
    title: t.name,
    posterUrl: null,
    streamUrl: address(version),
    streamBytes: null,
    request: { headers: app.daemon.authorization, cache: "no-store" },
    signal,
    onStarted(made) {
      viewer = made;
      const stage = frame.querySelector<HTMLElement>(".viewer-stage");
      if (stage) cut.attach(made, stage);
      if (first.result?.version !== version) made.reload(address(version));
    },
  });
  const content = h(
    "div",
    {},
    h("p", { class: "lead" }, t.lead),
    h(
      "div",
      { class: "result-columns" },
      h("div", { class: "result-view" }, cut.element, frame),
      h("div", { class: "result-side" }, facts, actions(app)),
    ),
  );
  const showResult = whenChanged(
    (state: State) => state.result,
    (now) => {
      if (!now) return;
      facts.replaceChildren(...factParts(now));
      if (now.version === version) return;
      version = now.version;
      cut.reset();
      viewer?.reload(address(version));
    },
  );
  return {
    content,
    update(state) {
      showResult(state);
      cut.update(state);
    },
  };
};

function address(version: number): string {
  return `/api/model?version=${version}`;
}

function actions(app: App): HTMLElement {
  return h(
    "div",
    { class: "actions" },
    button(t.goOn, () => app.openListing(true), { class: "primary" }),
    button(t.more, () => void app.run(() => app.daemon.goBack("views"))),
  );
}

function factParts(now: Result): HTMLElement[] {
  const notes = [
    ...now.warnings,
    ...now.views
      .filter(({ used }) => !used)
      .map((view) => t.leftOut(viewNumber(view), view.reason ?? texts.common.noReason)),
  ];
  return [
    h(
      "section",
      { class: "panel" },
      h("h2", {}, t.size),
      sizeList(now) ?? h("p", {}, t.noSize),
      h("h2", {}, t.verdictTitle),
      h("p", { class: `verdict verdict-${now.verdict}` }, named(t.verdicts, now.verdict)),
      h("p", { class: "facts" }, pointsText(now)),
      notes.length > 0 && h("h3", {}, t.warnings),
      notes.length > 0 && h("ul", {}, ...notes.map((note) => h("li", {}, note))),
    ),
  ];
}

function pointsText({ points, removed }: Result): string {
  const all = t.points(formatCount(points));
  return removed > 0 ? `${all}, ${t.removed(formatCount(removed))}` : all;
}

function sizeList({ dimensions_m, dimensions_uncertainty_m }: Result): HTMLElement | null {
  if (!dimensions_m) return null;
  const rows = dimensions_m.slice(0, t.sides.length).flatMap((metres, i) => {
    const uncertainty = dimensions_uncertainty_m?.[i];
    const text = t.side(
      formatLength(metres, "cm"),
      uncertainty === undefined ? null : formatUncertainty([uncertainty]),
    );
    return [h("dt", {}, t.sides[i] ?? ""), h("dd", {}, text)];
  });
  return h("dl", { class: "fact-list sizes" }, ...rows);
}
