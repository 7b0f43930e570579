// The traffic light in words, as the newest picture has it; said aloud only when it stays.
import { h } from "../../src/ui/dom";
import type { Hint, Light, PictureHeader } from "../daemon/types";
import { Speaker } from "../math/speaker";
import { texts } from "../texts";

const t = texts.live;
const SYMBOLS: Record<Light, string> = { green: "✓", yellow: "!", red: "✕" };
const WORST_FIRST: readonly Light[] = ["red", "yellow", "green"];
/** Numbers that change with every picture are not readable. */
const TEXT_MILLIS = 300;
const NO_PICTURE_MILLIS = 2500;

export interface LightBox {
  readonly element: HTMLElement;
  show(header: PictureHeader): void;
}

export function makeLight(signal: AbortSignal): LightBox {
  const symbol = h("span", { class: "light-symbol", "aria-hidden": "true" }, "…");
  const word = h("p", { class: "light-word" }, t.waiting);
  const hints = h("ul", { class: "light-hints" });
  // Its own voice: what the seller did and what came of it is said elsewhere, and neither may cut the other short.
  const voice = h("p", { class: "visually-hidden light-voice", role: "status" });
  const element = h("div", { class: "light" }, symbol, h("div", {}, word, hints), voice);
  const speaker = new Speaker();
  let shown = "";
  let shownAt = Number.NEGATIVE_INFINITY;
  let pictureAt = Number.NEGATIVE_INFINITY;

  const set = (light: Light | "", title: string, lines: readonly string[]) => {
    const key = [light, title, ...lines].join("\n");
    if (key === shown) return;
    shown = key;
    element.dataset.light = light;
    symbol.textContent = light === "" ? "…" : SYMBOLS[light];
    word.textContent = title;
    hints.replaceChildren(...lines.map((line) => h("li", {}, line)));
    hints.hidden = lines.length === 0;
  };

  const timer = window.setInterval(() => {
    if (performance.now() - pictureAt > NO_PICTURE_MILLIS) set("", t.waiting, []);
  }, NO_PICTURE_MILLIS / 2);
  signal.addEventListener("abort", () => clearInterval(timer), { once: true });

  return {
    element,
    show({ light, hints: all }) {
      const now = performance.now();
      pictureAt = now;
      const sorted = worstFirst(all);
      const aloud = speaker.next(sorted, now);
      if (aloud !== null) voice.textContent = aloud;
      if (now - shownAt < TEXT_MILLIS && element.dataset.light === light) return;
      shownAt = now;
      // The title says already that all is well.
      const lines = sorted.filter(({ code }) => code !== "ok").map(({ text }) => text);
      set(light, t.lights[light], lines.length > 0 ? lines : [t.fallback[light]]);
    },
  };
}

function worstFirst(hints: readonly Hint[]): Hint[] {
  return [...hints].sort((a, b) => WORST_FIRST.indexOf(a.level) - WORST_FIRST.indexOf(b.level));
}
