// The shop: cards with search, category, order and paging, all of it in the address.
import { api, type GalleryQuery } from "../api/client";
import type { Gallery, ProductCard } from "../api/types";
import { formatPrice, formatSize, named } from "../format";
import type { Page, PageContext } from "../page";
import { texts } from "../texts";
import { h } from "../ui/dom";
import { input, select } from "../ui/form";
import { pager } from "../ui/pager";
import { empty, loaded } from "../ui/states";
import { thumb } from "../ui/thumb";

const t = texts.gallery;
const PER_PAGE = 24;

export const gallery: Page = (context) => {
  const query = readQuery(context.query);
  const content = h(
    "div",
    { class: "wrap" },
    h("h1", {}, t.title),
    h("p", { class: "lead" }, t.lead),
    searchForm(query, context),
    loaded(context.signal, async () => results(await api.gallery(query, context.signal), query)),
  );
  return { title: texts.nav.gallery, content };
};

function readQuery(query: URLSearchParams): GalleryQuery {
  const page = Math.max(1, Math.floor(Number(query.get("page")) || 1));
  const sort = query.get("sort") ?? "newest";
  return {
    q: query.get("q") ?? "",
    category: query.get("category") ?? "",
    sort: sort in t.sorts ? sort : "newest",
    page,
    per_page: PER_PAGE,
  };
}

function address({ q, category, sort, page }: GalleryQuery): string {
  const search = new URLSearchParams();
  if (q !== "") search.set("q", q);
  if (category !== "") search.set("category", category);
  if (sort !== "newest") search.set("sort", sort);
  if (page > 1) search.set("page", String(page));
  return search.size > 0 ? `/?${search}` : "/";
}

function searchForm(query: GalleryQuery, { go }: PageContext): HTMLElement {
  const q = input(t.searchLabel, {
    type: "search",
    name: "q",
    value: query.q,
    placeholder: t.searchPlaceholder,
  });
  const category = select(t.category, { "": texts.common.all, ...texts.categories }, query.category);
  const sort = select(t.sort, t.sorts, query.sort);
  const submit = h("button", { type: "submit", class: "primary" }, texts.common.search);
  const form = h(
    "form",
    { class: "search", role: "search" },
    q.element,
    category.element,
    sort.element,
    submit,
  );
  const send = () =>
    go(
      address({
        ...query,
        q: q.control.value.trim(),
        category: category.control.value,
        sort: sort.control.value,
        page: 1,
      }),
    );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    send();
  });
  return form;
}

function results(page: Gallery, query: GalleryQuery): Node {
  if (page.items.length === 0) return nothing(query);
  const list = h("ul", { class: "cards" }, ...page.items.map(card));
  const paging = { page: page.page, perPage: page.per_page, total: page.total };
  return h(
    "section",
    { "aria-label": texts.nav.gallery },
    h("p", { class: "count", role: "status" }, t.count(page.total)),
    list,
    pager(paging, (to) => address({ ...query, page: to })),
  );
}

function nothing(query: GalleryQuery): Node {
  const isFiltered = query.q !== "" || query.category !== "" || query.page > 1;
  if (!isFiltered) return empty(t.emptyShopTitle, t.emptyShop);
  return empty(t.emptyTitle, t.empty, h("a", { class: "button", href: "/" }, t.clear));
}

function card(product: ProductCard): HTMLElement {
  const facts = [
    product.condition === null ? null : named(texts.conditions, product.condition),
    formatSize(product.dimensions_m),
  ].filter((fact) => fact !== null);
  return h(
    "li",
    { class: "card" },
    h(
      "a",
      { href: `/p/${encodeURIComponent(product.id)}` },
      h(
        "div",
        { class: "card-picture" },
        thumb(product.thumb_url),
        product.has_model && h("span", { class: "badge" }, t.has3d),
      ),
      h("h2", {}, product.title),
      h("p", { class: "price" }, formatPrice(product.price_minor, product.currency)),
      facts.length > 0 && h("p", { class: "facts" }, facts.join(" · ")),
    ),
  );
}
