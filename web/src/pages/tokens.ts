// A person's tokens for scan-product and curl. A new one is shown once.
import { api } from "../api/client";
import type { TokenItem } from "../api/types";
import { formatDate } from "../format";
import type { Page } from "../page";
import { texts } from "../texts";
import { button, freshId, h } from "../ui/dom";
import { input, makeForm, makeNotice, type Notice, select } from "../ui/form";
import { loaded, messageOf } from "../ui/states";

const t = texts.tokens;

export const tokens: Page = ({ signal }) => {
  const notice = makeNotice();
  const list = h("div", {});
  const shown = h("div", {});
  const refresh = () => list.replaceChildren(loaded(signal, () => load(signal, notice)));
  refresh();
  const onAdded = (token: string) => {
    shown.replaceChildren(showOnce(token));
    refresh();
  };
  const content = h(
    "div",
    { class: "wrap" },
    h("h1", {}, t.title),
    h("p", { class: "lead" }, t.lead),
    notice.element,
    shown,
    list,
    h("section", { class: "panel form-panel" }, h("h2", {}, t.add), addForm(onAdded)),
  );
  return { title: t.title, content };
};

async function load(signal: AbortSignal, notice: Notice): Promise<Node> {
  const { items } = await api.tokens(signal);
  if (items.length === 0) return h("p", { class: "state" }, t.empty);
  const columns = [texts.common.name, t.starts, t.lastUsed, t.expires, t.revoke];
  return h(
    "table",
    { class: "people" },
    h("caption", { class: "visually-hidden" }, t.caption),
    h("thead", {}, h("tr", {}, ...columns.map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, ...items.map((item) => row(item, notice))),
  );
}

function row(item: TokenItem, notice: Notice): HTMLElement {
  const revoke = async () => {
    try {
      await api.revokeToken(item.id);
      element.remove();
      notice.good(t.revoked);
    } catch (error) {
      notice.bad(messageOf(error));
    }
  };
  const date = (time: string | null, otherwise: string) => (time === null ? otherwise : formatDate(time));
  const element = h(
    "tr",
    {},
    h("th", { scope: "row" }, item.name),
    h("td", { "data-label": t.starts }, h("code", {}, `${item.prefix}…`)),
    h("td", { "data-label": t.lastUsed }, date(item.last_used_at, t.never)),
    h("td", { "data-label": t.expires }, date(item.expires_at, t.never)),
    h(
      "td",
      { "data-label": t.revoke },
      button(t.revoke, () => void revoke(), { "aria-label": t.revokeNamed(item.name) }),
    ),
  );
  return element;
}

function addForm(onAdded: (token: string) => void): HTMLElement {
  const name = input(t.name, {
    name: "name",
    required: true,
    maxlength: 100,
    placeholder: t.namePlaceholder,
  });
  const days = select(t.days, t.daysOptions, "90", { name: "days" });
  const { form } = makeForm([name.element, days.element], t.add, async () => {
    const value = days.control.value;
    const added = await api.addToken(
      name.control.value.trim(),
      ["upload"],
      value === "" ? null : Number(value),
    );
    form.reset();
    onAdded(added.token);
  });
  return form;
}

function showOnce(token: string): HTMLElement {
  const id = freshId("token");
  const field = h("input", { id, class: "token", readonly: true, value: token, spellcheck: "false" });
  const said = h("p", { role: "status" });
  const copy = async () => {
    field.select();
    try {
      await navigator.clipboard.writeText(token);
      said.textContent = t.copied;
    } catch {
      said.textContent = t.copyFailed;
    }
  };
  return h(
    "section",
    { class: "panel once" },
    h("h2", {}, t.onceTitle),
    h("p", {}, t.once),
    h("label", { for: id }, t.token),
    h(
      "div",
      { class: "token-row" },
      field,
      button(t.copy, () => void copy(), { class: "primary" }),
    ),
    said,
  );
}
