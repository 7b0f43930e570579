// The ring of taken views as seen from above, and the same in words.
import { freshId, h } from "../../src/ui/dom";
import type { State } from "../daemon/types";
import { clockOf, hourRanges, middle } from "../math/clock";
import { texts } from "../texts";
import { viewNumber } from "./view-list";

const t = texts.views;
const SVG = "http://www.w3.org/2000/svg";
const [INNER, OUTER, DOTS, LABELS] = [52, 92, 72, 104];
/** Air between two sectors, radians. */
const AIR = 0.025;
const BOARD = { width: 56, height: 40 };

export interface Ring {
  readonly element: HTMLElement;
  update(state: State): void;
}

export function makeRing(): Ring {
  const textId = freshId("ring");
  const drawing = svg("svg", {
    viewBox: "-114 -114 228 228",
    class: "ring",
    role: "img",
    "aria-labelledby": textId,
  });
  const words = h("p", { id: textId, class: "ring-words" });
  const element = h(
    "section",
    { class: "panel ring-panel" },
    h("h2", {}, t.ringTitle),
    drawing,
    words,
    h("p", { class: "hint" }, t.ringFrom),
  );
  return {
    element,
    update(state) {
      drawing.replaceChildren(...parts(state));
      words.textContent = seenInWords(state);
    },
  };
}

export function seenInWords({ sectors, views }: Pick<State, "sectors" | "views">): string {
  const [first] = views;
  if (!first) return t.noneYet;
  const clock = clockOf(sectors, first.azimuth);
  const unseen = sectors.flatMap((sector, i) => (sector.seen ? [] : (clock.hours[i] ?? [])));
  const rest = unseen.length === 0 ? t.allSeen : t.unseen(hourRanges(unseen));
  return `${t.count(views.length)}. ${rest}`;
}

function parts({ sectors, views }: State): SVGElement[] {
  const clock = clockOf(sectors, views[0]?.azimuth ?? null);
  const angle = (onBoard: number) => onBoard + clock.turn;
  const board = svg("rect", {
    class: "ring-board",
    x: -BOARD.width / 2,
    y: -BOARD.height / 2,
    width: BOARD.width,
    height: BOARD.height,
    rx: 3,
    transform: `rotate(${(-clock.turn * 180) / Math.PI})`,
  });
  const product = svg("circle", { class: "ring-product", r: 11 });
  const wedges = sectors.map((sector) =>
    svg("path", {
      class: sector.seen ? "ring-seen" : "ring-unseen",
      d: wedge(angle(sector.from) + AIR, angle(sector.to) - AIR),
    }),
  );
  const hours = sectors.map((sector, i) =>
    label(String(clock.hours[i] ?? ""), angle(middle(sector)), LABELS, "ring-hour"),
  );
  const dots = views.flatMap((view) => {
    const [cx, cy] = place(angle(view.azimuth), DOTS);
    return [
      svg("circle", { class: "ring-view", cx, cy, r: 11 }),
      label(String(viewNumber(view)), angle(view.azimuth), DOTS, "ring-number"),
    ];
  });
  return [board, product, ...wedges, ...(views.length > 0 ? hours : []), ...dots];
}

/** The drawing's y goes down, the angles go up. */
function place(angle: number, radius: number): [number, number] {
  return [round(radius * Math.cos(angle)), round(-radius * Math.sin(angle))];
}

function wedge(from: number, to: number): string {
  const [a, b] = [place(from, OUTER), place(to, OUTER)];
  const [c, d] = [place(to, INNER), place(from, INNER)];
  return `M${a} A${OUTER},${OUTER} 0 0 0 ${b} L${c} A${INNER},${INNER} 0 0 1 ${d} Z`;
}

function label(text: string, angle: number, radius: number, className: string): SVGElement {
  const [x, y] = place(angle, radius);
  const element = svg("text", { class: className, x, y, dy: "0.35em" });
  element.textContent = text;
  return element;
}

function round(length: number): number {
  return Math.round(length * 100) / 100;
}

function svg(tag: string, attributes: Record<string, string | number>): SVGElement {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}
