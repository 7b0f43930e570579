import { ApiError, api } from "../api/client";
import type { Page } from "../page";
import { texts } from "../texts";
import { h } from "../ui/dom";
import { input, makeForm } from "../ui/form";

const t = texts.login;

export const login: Page = ({ query, enter }) => {
  const name = input(texts.common.name, {
    name: "name",
    autocomplete: "username",
    required: true,
    maxlength: 200,
  });
  const password = input(texts.common.password, {
    name: "password",
    type: "password",
    autocomplete: "current-password",
    required: true,
  });
  const { form } = makeForm([name.element, password.element], t.submit, async () => {
    try {
      await api.login(name.control.value, password.control.value);
    } catch (error) {
      throw error instanceof ApiError ? inOurWords(error) : error;
    }
    await enter(safeNext(query.get("next")));
  });
  const content = h(
    "div",
    { class: "wrap narrow" },
    h("h1", {}, t.title),
    h("p", { class: "lead" }, t.lead),
    form,
  );
  return { title: t.title, content };
};

function inOurWords(error: ApiError): ApiError {
  const known: Record<number, string> = { 401: t.wrong, 429: t.tooMany };
  return new ApiError(error.status, error.code, known[error.status] ?? error.message);
}

/** Only a path of this site: a link must not lead people elsewhere after they log in. */
function safeNext(next: string | null): string {
  return next && /^\/(?![/\\])/.test(next) ? next : "/manage";
}
