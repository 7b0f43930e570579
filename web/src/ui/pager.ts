// Links to the previous and next page of a list.
import { texts } from "../texts";
import { h } from "./dom";

export interface PageState {
  readonly page: number;
  readonly perPage: number;
  readonly total: number;
}

export function pager(
  { page, perPage, total }: PageState,
  address: (page: number) => string,
): HTMLElement | null {
  const pages = Math.max(1, Math.ceil(total / perPage));
  if (pages <= 1) return null;
  const link = (to: number, text: string, rel: string) =>
    to < 1 || to > pages
      ? h("span", { class: "button disabled" }, text)
      : h("a", { class: "button", href: address(to), rel }, text);
  return h(
    "nav",
    { class: "pager", "aria-label": texts.common.pages },
    link(page - 1, texts.common.previous, "prev"),
    h("span", {}, texts.common.pageOf(page, pages)),
    link(page + 1, texts.common.next, "next"),
  );
}
