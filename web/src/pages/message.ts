// A page that only says something.
import type { PageContent } from "../page";
import { texts } from "../texts";
import { h } from "../ui/dom";

export function message(title: string, text: string): PageContent {
  const content = h(
    "div",
    { class: "wrap narrow" },
    h("h1", {}, title),
    h("p", {}, text),
    h("p", {}, h("a", { class: "button", href: "/" }, texts.product.back)),
  );
  return { title, content };
}
