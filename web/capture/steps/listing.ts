// Last look before anything leaves this computer: what goes, what stays, and the words of the listing.
import { ApiError } from "../../src/api/client";
import { formatBytes, parsePrice } from "../../src/format";
import { texts as shop } from "../../src/texts";
import { button, h } from "../../src/ui/dom";
import { input, makeForm, select, textarea } from "../../src/ui/form";
import { loaded } from "../../src/ui/states";
import { type App, type MakeStep, whenChanged } from "../app";
import type { Leaving, Listing, State } from "../daemon/types";
import { type Draft, keepDraft, readDraft } from "../draft";
import { texts } from "../texts";

const t = texts.listing;
const CURRENCIES = ["EUR", "USD", "GBP", "CHF", "PLN", "SEK", "DKK", "NOK", "CZK", "JPY", "CNY"];

export const listing: MakeStep = (app, { server }, signal) => {
  const failed = h("p", { class: "notice bad", role: "alert" });
  const back = button(t.back, () => app.openListing(false));
  const content = h(
    "div",
    {},
    h("p", { class: "lead" }, t.lead),
    failed,
    h(
      "div",
      { class: "listing-columns" },
      h(
        "section",
        { class: "panel leaving" },
        h("h2", {}, t.leavingTitle),
        h("p", {}, t.leavingLead),
        loaded(signal, async () => leavingList(await app.daemon.leaving())),
      ),
      h("section", { class: "panel" }, h("h2", {}, t.formTitle), listingForm(app, server, signal)),
    ),
    back,
  );
  const showFailure = whenChanged(
    ({ publish }: State) => (publish?.phase === "failed" ? (publish.error ?? "") : null),
    (error) => {
      failed.textContent = error === null ? "" : t.failed(error);
    },
  );
  return { content, update: showFailure };
};

function leavingList({ files, stays }: Leaving): HTMLElement {
  const total = files.reduce((sum, { bytes }) => sum + bytes, 0);
  return h(
    "div",
    {},
    h(
      "ul",
      { class: "files" },
      ...files.map(({ name, bytes, what }) =>
        h("li", {}, h("strong", {}, name), ` (${formatBytes(bytes)}): ${what}`),
      ),
    ),
    h("p", { class: "facts" }, t.total(formatBytes(total))),
    stays.length > 0 && h("h3", {}, t.staysTitle),
    stays.length > 0 && h("ul", {}, ...stays.map((what) => h("li", {}, what))),
  );
}

function listingForm(app: App, server: string | null, signal: AbortSignal): HTMLFormElement {
  const draft = readDraft();
  const fields = makeFields({ ...draft, server: draft.server || (server ?? "") });
  const { form } = makeForm(fields.elements, t.submit, async () => {
    const wanted = toListing(fields.read());
    await app.take(() => app.daemon.publish(wanted));
  });
  form.addEventListener("input", () => keepDraft(fields.read()), { signal });
  return form;
}

function makeFields(draft: Draft) {
  const f = shop.edit.fields;
  const title = input(f.title, { name: "title", required: true, maxlength: 200, value: draft.title });
  const description = textarea(
    t.description,
    { name: "description", rows: 5, maxlength: 10_000 },
    draft.description,
  );
  const price = input(
    f.price,
    { name: "price", inputmode: "decimal", autocomplete: "off", value: draft.price },
    shop.edit.priceHint,
  );
  const codes = Object.fromEntries(CURRENCIES.map((code) => [code, code]));
  const currency = select(f.currency, codes, draft.currency, { name: "currency" });
  const category = select(f.category, shop.categories, draft.category, { name: "category" });
  const conditions = { "": shop.edit.unset, ...shop.conditions };
  const condition = select(f.condition, conditions, draft.condition, { name: "condition" });
  const server = input(
    t.server,
    { name: "server", type: "url", required: true, autocomplete: "off", value: draft.server },
    t.serverHint,
  );
  const token = input(
    t.token,
    { name: "token", type: "password", required: true, autocomplete: "off", value: draft.token },
    t.tokenHint,
  );
  return {
    elements: [
      title.element,
      description.element,
      h("div", { class: "field-row" }, price.element, currency.element),
      h("div", { class: "field-row" }, category.element, condition.element),
      h("h2", {}, t.serverTitle),
      server.element,
      token.element,
    ],
    read: (): Draft => ({
      title: title.control.value,
      description: description.control.value,
      price: price.control.value,
      currency: currency.control.value,
      category: category.control.value,
      condition: condition.control.value,
      server: server.control.value,
      token: token.control.value,
    }),
  };
}

/** Throws an `ApiError` that says which field cannot be sent so. */
export function toListing(draft: Draft): Listing {
  const title = draft.title.trim();
  if (title === "") throw new ApiError(0, "title", shop.edit.titleBad);
  return {
    server: toServer(draft.server),
    token: draft.token.trim(),
    title,
    description: draft.description,
    ...toPrice(draft),
    category: draft.category,
    condition: draft.condition === "" ? null : draft.condition,
  };
}

function toServer(text: string): string {
  try {
    const { protocol, origin } = new URL(text.trim());
    if (protocol === "https:" || protocol === "http:") return origin;
  } catch {
    // Said below.
  }
  throw new ApiError(0, "server", t.badServer);
}

function toPrice({ price, currency }: Draft): Pick<Listing, "price_minor" | "currency"> {
  if (price.trim() === "") return { price_minor: null, currency: null };
  const minor = parsePrice(price, currency);
  if (minor === null) throw new ApiError(0, "price", shop.edit.priceBad);
  return { price_minor: minor, currency };
}
