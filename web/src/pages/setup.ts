// The one-time page behind the link that the server prints at its first start.
import { ApiError, api } from "../api/client";
import type { Page } from "../page";
import { texts } from "../texts";
import { h } from "../ui/dom";
import { input, makeForm } from "../ui/form";
import { failure } from "../ui/states";

const t = texts.setup;

export const setup: Page = ({ query, enter }) => {
  const token = query.get("token");
  const name = input(texts.common.name, {
    name: "name",
    autocomplete: "username",
    required: true,
    maxlength: 200,
  });
  const password = input(texts.common.password, {
    name: "password",
    type: "password",
    autocomplete: "new-password",
    required: true,
    minlength: 10,
  });
  const { form } = makeForm([name.element, password.element], t.submit, async () => {
    await api.setup(token ?? "", name.control.value, password.control.value);
    await enter("/manage");
  });
  const body = token ? form : failure(new ApiError(0, "no_token", t.noToken));
  const content = h(
    "div",
    { class: "wrap narrow" },
    h("h1", {}, t.title),
    h("p", { class: "lead" }, t.lead),
    body,
  );
  return { title: t.title, content };
};
