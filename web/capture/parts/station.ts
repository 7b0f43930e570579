// Walks the simulated sensor round the product, as a person would walk with a real one.
import { button, h } from "../../src/ui/dom";
import type { App } from "../app";
import type { State } from "../daemon/types";
import { clockOf, hourOf, widestGap, wrapTurn } from "../math/clock";
import { texts } from "../texts";

const t = texts.views;
const STEP = Math.PI / 6;

export interface Station {
  readonly element: HTMLElement;
  update(state: State): void;
}

export function makeStation(app: App): Station {
  let state: State | null = null;
  const walk = async (to: number) => {
    const goal = wrapTurn(to);
    if (!(await app.run(() => app.daemon.standAt(goal)))) return;
    if (!state) return;
    const clock = clockOf(state.sectors, state.views[0]?.azimuth ?? null);
    app.say(t.walked(state.views.length > 0 ? hourOf(clock, state.sectors, goal) : null));
  };
  const here = () => state?.sensor?.station ?? 0;
  const element = h(
    "div",
    { class: "station", role: "group", "aria-label": t.stationTitle },
    h("p", {}, t.stationTitle),
    h(
      "div",
      { class: "actions" },
      // Facing the product, a step to the right goes counter-clockwise seen from above.
      button(`← ${t.left}`, () => void walk(here() - STEP)),
      button(`${t.right} →`, () => void walk(here() + STEP)),
      button(t.nextGap, () => void walk(widestGap(state?.sectors ?? []) ?? here() + STEP)),
    ),
  );
  return {
    element,
    update(now) {
      state = now;
      const open = now.sensors.find(({ address }) => address === now.sensor?.address);
      element.hidden = !open?.abilities.includes("station");
    },
  };
}
