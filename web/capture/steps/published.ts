// Done: where the listing is, and what next.
import { button, h } from "../../src/ui/dom";
import { type App, type MakeStep, whenChanged } from "../app";
import type { State } from "../daemon/types";
import { forgetProduct } from "../draft";
import { texts } from "../texts";

const t = texts.published;

export const published: MakeStep = (app) => {
  const address = h("p", { class: "address" });
  const content = h(
    "div",
    { class: "panel work" },
    h("p", { class: "lead" }, t.lead),
    h("h2", {}, t.address),
    address,
    h(
      "div",
      { class: "actions" },
      button(t.another, () => void another(app), { class: "primary" }),
    ),
    h("p", { class: "hint" }, t.anotherHint),
  );
  const showAddress = whenChanged(
    ({ publish }: State) => publish?.address ?? null,
    (url) => address.replaceChildren(url === null ? "" : isWeb(url) ? link(url) : url),
  );
  return { content, update: showAddress };
};

async function another(app: App): Promise<void> {
  if (await app.run(() => app.daemon.newProduct())) forgetProduct();
}

function link(url: string): HTMLElement {
  return h("a", { href: url, target: "_blank", rel: "noreferrer noopener" }, url);
}

function isWeb(url: string): boolean {
  return /^https?:\/\//.test(url);
}
