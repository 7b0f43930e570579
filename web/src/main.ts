// Wiring: the address chooses the page; leaving a page ends all that it started.
import "./style.css";
import { api } from "./api/client";
import type { SessionUser } from "./api/types";
import type { Access, PageContent, PageContext, Route } from "./page";
import { account } from "./pages/account";
import { create } from "./pages/create";
import { edit } from "./pages/edit";
import { gallery } from "./pages/gallery";
import { login } from "./pages/login";
import { manage } from "./pages/manage";
import { message } from "./pages/message";
import { product } from "./pages/product";
import { setup } from "./pages/setup";
import { tokens } from "./pages/tokens";
import { users } from "./pages/users";
import { innerLink, matchRoute } from "./router";
import { texts } from "./texts";
import { makeLayout } from "./ui/layout";

const ROUTES: readonly Route[] = [
  { pattern: "/", access: "all", page: gallery },
  { pattern: "/p/:id", access: "all", page: product },
  { pattern: "/login", access: "all", page: login },
  { pattern: "/setup", access: "all", page: setup },
  { pattern: "/manage", access: "user", page: manage },
  { pattern: "/manage/new", access: "user", page: create },
  { pattern: "/manage/users", access: "admin", page: users },
  { pattern: "/manage/tokens", access: "user", page: tokens },
  { pattern: "/manage/account", access: "user", page: account },
  { pattern: "/manage/:id", access: "user", page: edit },
];

const root = document.getElementById("app") ?? document.body;
const layout = makeLayout(root, () => void logout());
let user: SessionUser | null = null;
let leaving = new AbortController();
let isFirstPage = true;

function showPage(): void {
  leaving.abort();
  leaving = new AbortController();
  const { pathname, search } = location;
  const { title, content } = contentFor(pathname, new URLSearchParams(search));
  layout.showUser(user, pathname);
  layout.main.replaceChildren(content);
  setTitle(title);
  if (!isFirstPage) layout.main.focus({ preventScroll: true });
  isFirstPage = false;
}

function setTitle(title: string): void {
  const isPlain = title === texts.siteName;
  document.title = isPlain ? title : `${title} · ${texts.siteName}`;
  // The first page is read from its top by itself; a plain title says that the real one is on its way.
  if (!isFirstPage && !isPlain) layout.announce(title);
}

function contentFor(path: string, query: URLSearchParams): PageContent {
  const match = matchRoute(ROUTES, path);
  if (!match) return message(texts.errors.notFoundTitle, texts.errors.notFound);
  const context: PageContext = {
    params: match.params,
    query,
    user,
    signal: leaving.signal,
    go,
    setTitle,
    enter,
  };
  if (mayOpen(match.route.access)) return match.route.page(context);
  if (user) return message(texts.errors.notFoundTitle, texts.errors.adminOnly);
  return login({ ...context, query: new URLSearchParams({ next: path }) });
}

function mayOpen(access: Access): boolean {
  return access === "all" || (access === "user" ? user !== null : user?.role === "admin");
}

function go(path: string): void {
  history.pushState(null, "", path);
  showPage();
  window.scrollTo(0, 0);
}

async function enter(path: string): Promise<void> {
  user = (await api.session()).user;
  go(path);
}

async function logout(): Promise<void> {
  await api.logout().catch(() => undefined);
  await enter("/").catch(() => location.assign("/"));
}

document.addEventListener("click", (event) => {
  const path = innerLink(event);
  if (path === null) return;
  event.preventDefault();
  go(path);
});
window.addEventListener("popstate", showPage);

async function start(): Promise<void> {
  // Who is logged in decides the navigation; buyers' pages need not wait for it.
  const session = api.session().then(
    (answer) => answer.user,
    () => null,
  );
  const isPublic = matchRoute(ROUTES, location.pathname)?.route.access === "all";
  if (isPublic) showPage();
  user = await session;
  if (!isPublic) showPage();
  else layout.showUser(user, location.pathname);
}

void start();
