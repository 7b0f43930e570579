// The table of listings: all of them for admins, a seller's own for sellers. One click shows a listing to the public or
// hides it; its name leads to its details.
import { api, type ManageQuery } from "../api/client";
import type { ManagedCard, ManagedList, SessionUser } from "../api/types";
import { formatDate, formatPrice, named } from "../format";
import type { Page, PageContext } from "../page";
import { texts } from "../texts";
import { button, h } from "../ui/dom";
import { input, makeNotice, type Notice, select } from "../ui/form";
import { pager } from "../ui/pager";
import { empty, loaded, messageOf } from "../ui/states";
import { thumb } from "../ui/thumb";

const t = texts.manage;
const PER_PAGE = 25;

export const manage: Page = (context) => {
  const { user } = context;
  const title = user?.role === "admin" ? t.titleAll : t.titleOwn;
  const query = readQuery(context.query);
  const notice = makeNotice();
  const content = h(
    "div",
    { class: "wrap" },
    h(
      "div",
      { class: "title-row" },
      h("h1", {}, title),
      h("a", { class: "button primary", href: "/manage/new" }, t.add),
    ),
    searchForm(query, context),
    notice.element,
    loaded(context.signal, async () => results(await api.manage(query, context.signal), query, user, notice)),
  );
  return { title, content };
};

function readQuery(query: URLSearchParams): ManageQuery {
  const status = query.get("status") ?? "";
  return {
    q: query.get("q") ?? "",
    status: status in texts.statuses ? status : "",
    page: Math.max(1, Math.floor(Number(query.get("page")) || 1)),
    per_page: PER_PAGE,
  };
}

function address({ q, status, page }: ManageQuery): string {
  const search = new URLSearchParams();
  if (q !== "") search.set("q", q);
  if (status !== "") search.set("status", status);
  if (page > 1) search.set("page", String(page));
  return search.size > 0 ? `/manage?${search}` : "/manage";
}

function searchForm(query: ManageQuery, { go }: PageContext): HTMLElement {
  const q = input(t.searchLabel, { type: "search", name: "q", value: query.q });
  const status = select(t.status, { "": texts.common.all, ...texts.statuses }, query.status);
  const submit = h("button", { type: "submit" }, texts.common.search);
  const form = h("form", { class: "search", role: "search" }, q.element, status.element, submit);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    go(address({ ...query, q: q.control.value.trim(), status: status.control.value, page: 1 }));
  });
  return form;
}

function results(page: ManagedList, query: ManageQuery, user: SessionUser | null, notice: Notice): Node {
  if (page.items.length === 0) {
    const isFiltered = query.q !== "" || query.status !== "" || query.page > 1;
    return empty(t.emptyTitle, isFiltered ? t.emptyFiltered : t.empty);
  }
  const columns = [t.picture, t.listing, t.status, t.price, t.owner, t.changed, t.action];
  const table = h(
    "table",
    { class: "listings" },
    h("caption", { class: "visually-hidden" }, t.tableCaption),
    h("thead", {}, h("tr", {}, ...columns.map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, ...page.items.map((item) => row(item, user, notice))),
  );
  const paging = { page: page.page, perPage: page.per_page, total: page.total };
  return h(
    "div",
    {},
    table,
    pager(paging, (to) => address({ ...query, page: to })),
  );
}

function row(item: ManagedCard, user: SessionUser | null, notice: Notice): HTMLElement {
  const cell = (label: string, ...children: (Node | string)[]) =>
    h("td", { "data-label": label }, ...children);
  const element = h(
    "tr",
    {},
    h("td", { class: "cell-thumb" }, thumb(item.thumb_url)),
    h("th", { scope: "row" }, h("a", { href: `/manage/${item.id}` }, item.title)),
    cell(t.status, h("span", { class: `chip chip-${item.status}` }, named(texts.statuses, item.status))),
    cell(t.price, formatPrice(item.price_minor, item.currency)),
    cell(t.owner, item.owner.name),
    cell(t.changed, formatDate(item.updated_at)),
    cell(
      t.action,
      publicSwitch(item, user, notice, (changed) => element.replaceWith(row(changed, user, notice))),
    ),
  );
  return element;
}

/** The one click that shows a listing to everybody, or hides it again. */
function publicSwitch(
  item: ManagedCard,
  user: SessionUser | null,
  notice: Notice,
  onChanged: (item: ManagedCard) => void,
): Node {
  const isActive = item.status === "active";
  if (!isActive && !item.has_model) return h("span", { class: "hint" }, t.noModelYet);
  if (!isActive && user?.role !== "admin") {
    return h("span", { class: "hint" }, item.status === "draft" ? t.waiting : texts.common.none);
  }
  const label = isActive ? t.deactivateNamed(item.title) : t.activateNamed(item.title);
  const toggle = button(
    isActive ? t.deactivate : t.activate,
    async () => {
      toggle.disabled = true;
      try {
        const changed = await api.setStatus(item.id, isActive ? "draft" : "active");
        notice.good(isActive ? t.deactivated(item.title) : t.activated(item.title));
        onChanged({
          ...item,
          status: changed.status,
          version: changed.version,
          updated_at: changed.updated_at,
        });
      } catch (error) {
        notice.bad(messageOf(error));
        toggle.disabled = false;
      }
    },
    { class: isActive ? "" : "primary", "aria-label": label },
  );
  return toggle;
}
