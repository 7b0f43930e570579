// The views taken so far; each can be taken back.
import { formatCount } from "../../src/format";
import { button, h } from "../../src/ui/dom";
import type { App } from "../app";
import type { State, TakenView } from "../daemon/types";
import { clockOf, hourOf } from "../math/clock";
import { texts } from "../texts";

const t = texts.views;

export interface ViewList {
  readonly element: HTMLElement;
  update(state: State): void;
}

/** Names count from "000", people from 1. */
export function viewNumber({ name }: { readonly name: string }): number {
  return Number.parseInt(name, 10) + 1;
}

export function makeViewList(app: App): ViewList {
  const heading = h("h2", { tabindex: -1 }, t.listTitle);
  const items = h("ol", { class: "view-list" });
  let last: TakenView | undefined;
  const undo = button(t.undoLast, () => last && void remove(last));
  const element = h("section", { class: "panel" }, heading, items, undo);

  async function remove(view: TakenView): Promise<void> {
    const hadFocus = element.contains(document.activeElement);
    if (!(await app.run(() => app.daemon.removeView(view.name)))) return;
    app.say(t.removed(viewNumber(view)));
    // The button is gone: the list's heading is the nearest thing that stays.
    if (hadFocus && !element.contains(document.activeElement)) heading.focus();
  }

  return {
    element,
    update({ views, sectors }) {
      last = views.at(-1);
      element.hidden = views.length === 0;
      const clock = clockOf(sectors, views[0]?.azimuth ?? null);
      const focused = items.contains(document.activeElement) ? document.activeElement?.id : undefined;
      items.replaceChildren(
        ...views.map((view) => {
          const number = viewNumber(view);
          const facts = t.facts(hourOf(clock, sectors, view.azimuth), formatCount(view.points));
          return h(
            "li",
            {},
            h("span", {}, h("strong", {}, t.view(number)), h("span", { class: "hint" }, ` ${facts}`)),
            button(t.remove, () => void remove(view), {
              id: `remove-${view.name}`,
              "aria-label": t.removeNamed(number),
            }),
          );
        }),
      );
      if (focused) document.getElementById(focused)?.focus();
    },
  };
}
