// Asks before the program ends.
import { button, freshId, h } from "../../src/ui/dom";
import { texts } from "../texts";

const t = texts.quit;

export function confirmQuit(folder: string | null): Promise<boolean> {
  const titleId = freshId("quit");
  let sure = false;
  const dialog = h("dialog", { class: "dialog", "aria-labelledby": titleId });
  const yes = button(
    t.yes,
    () => {
      sure = true;
      dialog.close();
    },
    { class: "danger" },
  );
  dialog.append(
    h("h2", { id: titleId }, t.title),
    h("p", {}, folder === null ? t.textPlain : t.text(folder)),
    h(
      "div",
      { class: "actions" },
      button(t.no, () => dialog.close(), { class: "primary", autofocus: true }),
      yes,
    ),
  );
  document.body.append(dialog);
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(sure);
    });
    dialog.showModal();
  });
}
