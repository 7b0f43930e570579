// The board: print one of ours, or name another.
import { ApiError } from "../../src/api/client";
import { button, h } from "../../src/ui/dom";
import { input, makeForm } from "../../src/ui/form";
import { type App, type MakeStep, whenChanged } from "../app";
import { isSimulated, type Paper, type State } from "../daemon/types";
import { texts } from "../texts";

const t = texts.board;
const PAPERS: readonly Paper[] = ["a4", "a3", "a2"];

export const board: MakeStep = (app) => {
  const simulated = h("p", { class: "notice info", hidden: true }, t.simulated);
  const current = h("div", {});
  const content = h(
    "div",
    {},
    h("p", { class: "lead" }, t.lead),
    current,
    simulated,
    h("ol", { class: "howto" }, ...t.steps.map((step) => h("li", {}, step))),
    h("ul", { class: "papers" }, ...PAPERS.map((paper) => paperItem(app, paper))),
    h("details", { class: "panel other-board" }, h("summary", {}, t.other), fileForm(app)),
  );
  const showCurrent = whenChanged(
    (state: State) => state.board,
    (now) => {
      current.replaceChildren();
      if (!now) return;
      current.append(
        h(
          "div",
          { class: "panel current-board" },
          h("p", {}, t.current(now.name, now.tags)),
          ...now.warnings.map((warning) => h("p", { class: "problem" }, warning)),
          button(t.goOn, () => void app.run(() => app.daemon.goBack("views"))),
        ),
      );
    },
  );
  return {
    content,
    update(state) {
      simulated.hidden = !isSimulated(state.sensor?.address);
      showCurrent(state);
    },
  };
};

function paperItem(app: App, paper: Paper): HTMLElement {
  const { name, fits } = t.papers[paper];
  return h(
    "li",
    { class: "panel paper" },
    h("div", { class: `sheet sheet-${paper}`, "aria-hidden": "true" }, h("span", {})),
    h("h2", {}, name),
    h("p", { class: "hint" }, fits),
    h(
      "a",
      {
        class: "button",
        href: app.daemon.withToken(`/api/boards/${paper}.pdf`),
        download: `board-${paper}.pdf`,
        "aria-label": t.download(name),
      },
      t.downloadShort,
    ),
    button(t.use(name), () => void app.run(() => app.daemon.boardOfPaper(paper)), { class: "primary" }),
  );
}

function fileForm(app: App): HTMLElement {
  const file = input(t.file, { type: "file", accept: ".json,application/json" }, t.fileHint);
  const { form } = makeForm([file.element], t.useFile, async () => {
    const chosen = file.control.files?.[0];
    if (!chosen) throw new ApiError(0, "no_file", t.needsFile);
    const described = parse(await chosen.text());
    await app.take(() => app.daemon.boardOfFile(described));
  });
  return form;
}

function parse(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    throw new ApiError(0, "bad_file", t.badFile);
  }
}
