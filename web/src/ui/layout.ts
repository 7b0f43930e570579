// Header, navigation and the place for the page.
import type { SessionUser } from "../api/types";
import { texts } from "../texts";
import { button, h } from "./dom";

const t = texts.nav;

export interface Layout {
  readonly main: HTMLElement;
  showUser(user: SessionUser | null, path: string): void;
  announce(text: string): void;
}

export function makeLayout(root: HTMLElement, onLogout: () => void): Layout {
  const links = h("ul", { class: "nav-links" });
  const main = h("main", { id: "content", tabindex: -1 });
  const live = h("p", { class: "visually-hidden", role: "status" });
  root.replaceChildren(
    h("a", { class: "skip", href: "#content" }, texts.skipToContent),
    h(
      "header",
      { class: "site-header" },
      h(
        "div",
        { class: "wrap" },
        h(
          "a",
          { class: "brand", href: "/" },
          h("img", { src: "/icon.svg", alt: "", width: 28, height: 28 }),
          texts.siteName,
        ),
        h("nav", { "aria-label": t.main }, links),
      ),
    ),
    main,
    h("footer", { class: "site-footer" }, h("div", { class: "wrap" }, h("p", {}, texts.slogan))),
    live,
  );
  return {
    main,
    showUser(user, path) {
      const items = destinations(user).map(([href, text]) =>
        h("li", {}, h("a", { href, "aria-current": href === path ? "page" : undefined }, text)),
      );
      if (user)
        items.push(
          h("li", {}, button(t.logout, onLogout, { class: "link", title: t.loggedInAs(user.name) })),
        );
      links.replaceChildren(...items);
    },
    announce(text) {
      live.textContent = text;
    },
  };
}

function destinations(user: SessionUser | null): [string, string][] {
  if (!user) {
    return [
      ["/", t.gallery],
      ["/login", t.login],
    ];
  }
  const isAdmin = user.role === "admin";
  return [
    ["/", t.gallery],
    ["/manage", isAdmin ? t.manageAll : t.manageOwn],
    ...(isAdmin ? [["/manage/users", t.users] as [string, string]] : []),
    ["/manage/tokens", t.tokens],
    ["/manage/account", t.account],
  ];
}
