// Form fields with labels, hints and messages, and a form that is sent once at a time.
import { type Attributes, append, type Child, freshId, h } from "./dom";
import { messageOf } from "./states";

export interface Field<Control extends HTMLElement> {
  readonly element: HTMLElement;
  readonly control: Control;
}

export function input(label: string, attributes: Attributes, hint?: string): Field<HTMLInputElement> {
  const id = freshId("field");
  const control = h("input", { id, ...attributes, "aria-describedby": hint ? `${id}-hint` : undefined });
  return { element: wrap(id, label, control, hint), control };
}

export function textarea(label: string, attributes: Attributes, value: string): Field<HTMLTextAreaElement> {
  const id = freshId("field");
  const control = h("textarea", { id, ...attributes });
  control.value = value;
  return { element: wrap(id, label, control), control };
}

export function select(
  label: string,
  options: Record<string, string>,
  value: string,
  attributes: Attributes = {},
): Field<HTMLSelectElement> {
  const id = freshId("field");
  const control = h("select", { id, ...attributes });
  for (const [name, text] of Object.entries(options)) {
    const option = h("option", { value: name }, text);
    option.selected = name === value;
    control.append(option);
  }
  return { element: wrap(id, label, control), control };
}

function wrap(id: string, label: string, control: HTMLElement, hint?: string): HTMLElement {
  return h(
    "div",
    { class: "field" },
    h("label", { for: id }, label),
    control,
    hint ? h("p", { class: "hint", id: `${id}-hint` }, hint) : null,
  );
}

export interface FormParts {
  readonly form: HTMLFormElement;
  /** Shows how it went: good news is said politely, failures at once. */
  readonly notice: Notice;
}

export interface Notice {
  readonly element: HTMLElement;
  good(text: string): void;
  bad(text: string): void;
  clear(): void;
}

export function makeNotice(): Notice {
  const element = h("p", { class: "notice", role: "status" });
  const show = (kind: string, text: string) => {
    element.className = `notice ${kind}`;
    element.setAttribute("role", kind === "bad" ? "alert" : "status");
    element.textContent = text;
  };
  return {
    element,
    good: (text) => show("good", text),
    bad: (text) => show("bad", text),
    clear: () => show("", ""),
  };
}

/** A form whose `send` runs once at a time; what it throws is shown. */
export function makeForm(
  children: readonly Child[],
  submitText: string,
  send: (notice: Notice) => Promise<void>,
): FormParts {
  const notice = makeNotice();
  const submit = h("button", { type: "submit", class: "primary" }, submitText);
  const form = h("form", { novalidate: true });
  append(form, [...children, h("div", { class: "form-end" }, submit), notice.element]);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (submit.disabled) return;
    const invalid = form.querySelector<HTMLInputElement>(":invalid:not(fieldset)");
    if (invalid) {
      invalid.focus();
      notice.bad(`${labelOf(invalid)}: ${invalid.validationMessage}`);
      return;
    }
    submit.disabled = true;
    notice.clear();
    try {
      await send(notice);
    } catch (error) {
      notice.bad(messageOf(error));
    } finally {
      submit.disabled = false;
    }
  });
  return { form, notice };
}

function labelOf(control: HTMLInputElement): string {
  return control.labels?.[0]?.textContent ?? control.name;
}
