// Loading, failure and emptiness look and sound the same everywhere.
import { ApiError } from "../api/client";
import { texts } from "../texts";
import { append, button, type Child, h } from "./dom";

/** A box that shows `load`'s content when it comes, and a message with a retry button where it fails. */
export function loaded(signal: AbortSignal, load: () => Promise<Node>): HTMLElement {
  const box = h("div", { class: "loaded", "aria-busy": true });
  const attempt = async () => {
    box.setAttribute("aria-busy", "true");
    box.replaceChildren(loading());
    try {
      box.replaceChildren(await load());
    } catch (error) {
      if (signal.aborted) return;
      box.replaceChildren(failure(error, () => void attempt()));
    }
    box.removeAttribute("aria-busy");
  };
  void attempt();
  return box;
}

function loading(): HTMLElement {
  return h("p", { class: "state loading", role: "status" }, texts.common.loading);
}

export function failure(error: unknown, retry?: () => void): HTMLElement {
  return h(
    "div",
    { class: "state failure", role: "alert" },
    h("p", {}, messageOf(error)),
    isLoggedOut(error) ? loginLink() : retry && button(texts.common.retry, retry),
  );
}

/** The session ended while the page was open. */
function isLoggedOut(error: unknown): boolean {
  return error instanceof ApiError && error.status === 401;
}

function loginLink(): HTMLElement {
  const next = encodeURIComponent(location.pathname + location.search);
  return h("a", { class: "button", href: `/login?next=${next}` }, texts.nav.login);
}

export function empty(title: string, text: string, ...actions: Child[]): HTMLElement {
  const box = h("div", { class: "state empty" }, h("h2", {}, title), h("p", {}, text));
  append(box, actions);
  return box;
}

export function messageOf(error: unknown): string {
  if (error instanceof ApiError) return error.message;
  console.error(error);
  return texts.errors.unexpected;
}
