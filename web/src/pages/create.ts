// A seller's new listing: a name and the files that scan-product wrote.
import { ApiError, api } from "../api/client";
import type { Product } from "../api/types";
import type { Page } from "../page";
import { texts } from "../texts";
import { h } from "../ui/dom";
import { input, makeForm, type Notice } from "../ui/form";
import { messageOf } from "../ui/states";

const t = texts.create;

export const create: Page = ({ go, signal }) => {
  const title = input(t.name, { name: "title", required: true, maxlength: 200 });
  const model = input(t.file, { type: "file", name: "model", accept: ".asc,.ply,.glb", required: true });
  const report = input(t.report, { type: "file", name: "report", accept: ".json,application/json" });
  const poster = input(t.poster, { type: "file", name: "poster", accept: "image/png,image/jpeg" });
  // A second attempt after a refused file goes into the same draft.
  let draft: Product | null = null;
  const fields = [title.element, model.element, poster.element, report.element];
  const { form } = makeForm(fields, t.submit, async (notice) => {
    const file = model.control.files?.[0];
    if (!file) throw new ApiError(0, "no_file", t.needsFile);
    draft ??= await api.create({ title: title.control.value.trim() });
    await sendModel(draft.id, file, notice);
    await sendOptional(draft.id, "poster", poster.control);
    await sendOptional(draft.id, "report", report.control);
    if (!signal.aborted) go(`/manage/${draft.id}`);
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

async function sendModel(id: string, file: File, notice: Notice): Promise<void> {
  try {
    await api.upload(id, "model", file, file.name, (share) => {
      notice.good(share < 1 ? t.sending(`${Math.floor(share * 100)} %`) : t.preparing);
    });
  } catch (error) {
    const status = error instanceof ApiError ? error.status : 0;
    throw new ApiError(status, "model_refused", `${messageOf(error)} ${t.kept}`);
  }
}

async function sendOptional(id: string, kind: "poster" | "report", control: HTMLInputElement): Promise<void> {
  const file = control.files?.[0];
  if (file) await api.upload(id, kind, file, file.name);
}
