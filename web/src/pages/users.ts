// Accounts, for admins: who there is, what they may do, and new ones.
import { api } from "../api/client";
import type { Role, User } from "../api/types";
import { formatDate } from "../format";
import type { Page } from "../page";
import { texts } from "../texts";
import { button, h } from "../ui/dom";
import { input, makeForm, makeNotice, type Notice, select } from "../ui/form";
import { loaded, messageOf } from "../ui/states";

const t = texts.users;

export const users: Page = ({ signal, user: me }) => {
  const notice = makeNotice();
  const list = h("div", {});
  const refresh = () => list.replaceChildren(loaded(signal, () => load(signal, me?.id ?? "", notice)));
  refresh();
  const content = h(
    "div",
    { class: "wrap" },
    h("h1", {}, t.title),
    notice.element,
    list,
    h("section", { class: "panel form-panel" }, h("h2", {}, t.add), addForm(refresh)),
  );
  return { title: t.title, content };
};

async function load(signal: AbortSignal, myId: string, notice: Notice): Promise<Node> {
  const { items } = await api.users(signal);
  const columns = [texts.common.name, t.role, t.state, texts.common.created];
  return h(
    "table",
    { class: "people" },
    h("caption", { class: "visually-hidden" }, t.caption),
    h("thead", {}, h("tr", {}, ...columns.map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, ...items.map((item) => row(item, item.id === myId, notice))),
  );
}

function row(item: User, isMe: boolean, notice: Notice): HTMLElement {
  const change = async (what: { role?: Role; disabled?: boolean }) => {
    try {
      const changed = await api.changeUser(item.id, what);
      notice.good(t.changed);
      element.replaceWith(row(changed, isMe, notice));
    } catch (error) {
      notice.bad(messageOf(error));
      element.replaceWith(row(item, isMe, notice));
    }
  };
  const role = h("select", { "aria-label": t.roleOf(item.name), disabled: isMe });
  for (const [name, text] of Object.entries(t.roles)) {
    role.append(h("option", { value: name, selected: name === item.role }, text));
  }
  role.addEventListener("change", () => void change({ role: role.value as Role }));
  const lock = button(item.disabled ? t.unlock : t.lock, () => void change({ disabled: !item.disabled }), {
    "aria-label": item.disabled ? t.unlockNamed(item.name) : t.lockNamed(item.name),
  });
  const state = h("span", { class: "state-text" }, item.disabled ? t.disabled : t.enabled);
  const element = h(
    "tr",
    {},
    h("th", { scope: "row" }, item.name),
    h("td", { "data-label": t.role }, role),
    h("td", { "data-label": t.state }, state, " ", isMe ? null : lock),
    h("td", { "data-label": texts.common.created }, formatDate(item.created_at)),
  );
  return element;
}

function addForm(onAdded: () => void): HTMLElement {
  const name = input(texts.common.name, {
    name: "name",
    required: true,
    maxlength: 200,
    autocomplete: "off",
  });
  const password = input(
    texts.common.password,
    { type: "password", name: "password", required: true, minlength: 10, autocomplete: "new-password" },
    t.passwordHint,
  );
  const role = select(t.role, t.roles, "seller", { name: "role" });
  const { form } = makeForm([name.element, password.element, role.element], t.add, async (notice) => {
    const added = await api.addUser(
      name.control.value.trim(),
      password.control.value,
      role.control.value as Role,
    );
    form.reset();
    notice.good(t.created(added.name));
    onAdded();
  });
  return form;
}
