import { api } from "../api/client";
import type { Page } from "../page";
import { texts } from "../texts";
import { h } from "../ui/dom";
import { input, makeForm } from "../ui/form";

const t = texts.account;

export const account: Page = () => {
  const password = { type: "password", required: true };
  const current = input(t.current, { ...password, autocomplete: "current-password" });
  const next = input(t.next, { ...password, autocomplete: "new-password", minlength: 10 }, t.hint);
  const { form } = makeForm([current.element, next.element], t.submit, async (notice) => {
    await api.changePassword(current.control.value, next.control.value);
    form.reset();
    notice.good(t.changed);
  });
  const content = h(
    "div",
    { class: "wrap narrow" },
    h("h1", {}, t.title),
    h("h2", {}, t.passwordTitle),
    form,
  );
  return { title: t.title, content };
};
