// Wiring: the program's state chooses the step; leaving a step ends all that it started.
import "../src/style.css";
import "./style.css";
import { h } from "../src/ui/dom";
import { messageOf } from "../src/ui/states";
import type { App, MakeStep, Step } from "./app";
import { Daemon } from "./daemon/client";
import { Live } from "./daemon/live";
import type { State } from "./daemon/types";
import { makeLayout } from "./parts/layout";
import { confirmQuit } from "./parts/quit";
import { board } from "./steps/board";
import { building } from "./steps/building";
import { listing } from "./steps/listing";
import { published } from "./steps/published";
import { publishing } from "./steps/publishing";
import { result } from "./steps/result";
import { sensor } from "./steps/sensor";
import { views } from "./steps/views";
import { type ShownStep, texts } from "./texts";
import { readToken } from "./token";

const STEPS: Record<ShownStep, MakeStep> = {
  sensor,
  board,
  views,
  building,
  result,
  listing,
  publishing,
  published,
};

const layout = makeLayout(document.getElementById("app") ?? document.body, {
  open: (stage) => void open(stage),
  quit: () => void quit(),
});
const token = readToken();
const daemon = new Daemon(token ?? "");
let state: State | null = null;
let shown: { name: ShownStep; step: Step } | null = null;
let leaving = new AbortController();
let isListingOpen = false;
let wasLost = false;

const app: App = {
  daemon,
  async run(order) {
    try {
      await app.take(order);
      return true;
    } catch (error) {
      app.fail(messageOf(error));
      return false;
    }
  },
  async take(order) {
    layout.notice.clear();
    // What it changed comes over the live line: two lines could tell the same news in two orders.
    await order();
  },
  say: layout.say,
  fail(text) {
    layout.notice.bad(text);
    layout.showError(state?.error ?? null);
  },
  openListing(open) {
    isListingOpen = open;
    layout.notice.clear();
    if (state) show(state);
  },
};

function onState(next: State): void {
  state = next;
  show(next);
}

function show(now: State): void {
  const name = stepToShow(now);
  layout.showStages(name, now);
  layout.showError(now.error);
  layout.showFolder(now);
  if (shown?.name !== name) enter(name, now);
  shown?.step.update(now);
}

function stepToShow({ step }: State): ShownStep {
  return step === "result" && isListingOpen ? "listing" : step;
}

function enter(name: ShownStep, now: State): void {
  const isFirst = shown === null;
  leaving.abort();
  leaving = new AbortController();
  isListingOpen = name === "listing" || name === "publishing";
  const title = texts.titles[name];
  const heading = h("h1", { tabindex: -1 }, title);
  const step = STEPS[name](app, now, leaving.signal);
  shown = { name, step };
  layout.main.replaceChildren(h("div", { class: `wrap step-${name}` }, heading, step.content));
  document.title = `${title} · ${texts.siteName}`;
  if (isFirst) return;
  heading.focus({ preventScroll: true });
  window.scrollTo(0, 0);
}

async function open(stage: "sensor" | "board" | "views" | "result"): Promise<void> {
  if (state?.step === stage) app.openListing(false);
  else if (await app.run(() => daemon.goBack(stage))) isListingOpen = false;
}

async function quit(): Promise<void> {
  if (!(await confirmQuit(state?.folder ?? null))) return;
  // It breaks the line itself, which is no loss then.
  live?.end();
  await daemon.quit().catch((error: unknown) => console.info("The program ended without an answer:", error));
  leaving.abort();
  layout.showEnd();
  const heading = h("h1", { tabindex: -1 }, texts.quit.endedTitle);
  layout.main.replaceChildren(h("div", { class: "wrap narrow" }, heading, h("p", {}, texts.quit.ended)));
  document.title = texts.quit.endedTitle;
  heading.focus();
}

function connect(): Live {
  return new Live(daemon, {
    onState,
    onPicture: (picture) => shown?.step.onPicture?.(picture),
    onLost(refused) {
      wasLost = true;
      layout.showConnection(refused ? texts.connection.refused : texts.connection.lost);
    },
    onBack() {
      layout.showConnection(null);
      if (wasLost) layout.say(texts.connection.back);
      wasLost = false;
    },
  });
}

if (token === null) layout.showConnection(texts.connection.noToken);
else
  layout.main.replaceChildren(
    h("div", { class: "wrap" }, h("p", { role: "status" }, texts.connection.connecting)),
  );
const live = token === null ? null : connect();
