// The form with a listing's details. Two people may have it open at once: the second to save is told and chooses.
import { ApiError, api } from "../api/client";
import type { Category, Condition, Product, ProductChange } from "../api/types";
import { formatPrice, named, parsePrice, priceInput } from "../format";
import { texts } from "../texts";
import { button, h } from "../ui/dom";
import { input, makeForm, type Notice, select, textarea } from "../ui/form";
import { messageOf } from "../ui/states";
import type { Edited } from "./edit";

const t = texts.edit;
const CURRENCIES = ["EUR", "USD", "GBP", "CHF", "PLN", "SEK", "DKK", "NOK", "CZK", "JPY", "CNY"];

export function detailsForm(edited: Edited, reload: () => void): HTMLElement {
  const { product } = edited;
  const fields = makeFields(product);
  const conflict = h("div", { class: "conflict", hidden: true });
  const { form } = makeForm([...fields.elements, conflict], texts.common.save, (notice) => send(notice));

  async function send(notice: Notice): Promise<void> {
    const edit = fields.read();
    try {
      edited.version = (await api.edit(product.id, edited.version, edit)).version;
      conflict.hidden = true;
      notice.good(t.saved);
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 412) throw error;
      showConflict(await api.product(product.id), edit, notice);
    }
  }

  function showConflict(theirs: Product, mine: ProductChange, notice: Notice): void {
    const keepMine = async () => {
      edited.version = theirs.version;
      try {
        await send(notice);
      } catch (error) {
        notice.bad(messageOf(error));
      }
    };
    const rows = differences(theirs, mine);
    const heading = h("h2", { tabindex: -1 }, t.conflictTitle);
    conflict.replaceChildren(
      heading,
      h("p", {}, t.conflict),
      rows.length > 0
        ? h("ul", {}, ...rows.map((row) => h("li", {}, row)))
        : h("p", {}, t.conflictNoDifference),
      h(
        "div",
        { class: "actions" },
        button(t.useTheirs, reload),
        button(t.keepMine, () => void keepMine()),
      ),
    );
    conflict.hidden = false;
    heading.focus();
    notice.bad(t.conflictTitle);
  }

  return form;
}

interface Fields {
  readonly elements: HTMLElement[];
  read(): ProductChange;
}

function makeFields(product: Product): Fields {
  const f = t.fields;
  const unset = { "": t.unset };
  const title = input(f.title, { name: "title", required: true, maxlength: 200, value: product.title });
  const description = textarea(
    f.description,
    { name: "description", rows: 6, maxlength: 10_000 },
    product.description,
  );
  const price = input(
    f.price,
    {
      name: "price",
      inputmode: "decimal",
      autocomplete: "off",
      value: priceInput(product.price_minor, product.currency),
    },
    t.priceHint,
  );
  const known = new Set(product.currency ? [...CURRENCIES, product.currency] : CURRENCIES);
  const currencies = Object.fromEntries([...known].map((code) => [code, code]));
  const currency = select(f.currency, currencies, product.currency ?? "EUR", { name: "currency" });
  const category = select(f.category, texts.categories, product.category, {
    name: "category",
  });
  const condition = select(f.condition, { ...unset, ...texts.conditions }, product.condition ?? "", {
    name: "condition",
  });
  const money = h("div", { class: "field-row" }, price.element, currency.element);
  const kinds = h("div", { class: "field-row" }, category.element, condition.element);
  return {
    elements: [title.element, description.element, money, kinds],
    read() {
      const name = title.control.value.trim();
      if (name === "") throw new ApiError(0, "title", t.titleBad);
      return {
        title: name,
        description: description.control.value,
        ...readPrice(price.control.value, currency.control.value),
        category: category.control.value as Category,
        condition: (condition.control.value || null) as Condition | null,
      };
    },
  };
}

function readPrice(text: string, currency: string): Pick<ProductChange, "price_minor" | "currency"> {
  if (text.trim() === "") return { price_minor: null, currency: null };
  const minor = parsePrice(text, currency);
  if (minor === null) throw new ApiError(0, "price", t.priceBad);
  return { price_minor: minor, currency };
}

function differences(theirs: Product, mine: ProductChange): string[] {
  const f = t.fields;
  const values: [string, string, string][] = [
    [f.title, theirs.title, mine.title ?? ""],
    [f.description, theirs.description, mine.description ?? ""],
    [
      f.price,
      formatPrice(theirs.price_minor, theirs.currency),
      formatPrice(mine.price_minor ?? null, mine.currency ?? null),
    ],
    [f.category, named(texts.categories, theirs.category), named(texts.categories, mine.category ?? null)],
    [f.condition, named(texts.conditions, theirs.condition), named(texts.conditions, mine.condition ?? null)],
  ];
  return values.filter(([, a, b]) => a !== b).map(([field, a, b]) => t.conflictRow(field, a, b));
}
