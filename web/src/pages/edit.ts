// A listing's details, its status, its model and picture.
import { ApiError, api } from "../api/client";
import type { Product, ProductModel, SessionUser, Status } from "../api/types";
import { named } from "../format";
import type { Page, PageContext } from "../page";
import { texts } from "../texts";
import { button, h } from "../ui/dom";
import { input, makeNotice, type Notice } from "../ui/form";
import { loaded, messageOf } from "../ui/states";
import { viewerFrame } from "../viewer/frame";
import type { Viewer } from "../viewer/viewer";
import { detailsForm } from "./edit-form";
import { message } from "./message";

const t = texts.edit;

export const edit: Page = (context) => {
  const content = loaded(context.signal, async () => {
    try {
      const product = await api.product(context.params.id ?? "", context.signal);
      context.setTitle(t.title(product.title));
      return editor(product, context);
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 404) throw error;
      return message(texts.errors.notFoundTitle, texts.errors.notFound).content;
    }
  });
  return { title: texts.siteName, content };
};

/** A listing being edited: every change made on the page, by its form or beside it, leads to the version the next one names. */
export interface Edited {
  readonly product: Product;
  version: number;
}

function editor(product: Product, context: PageContext): HTMLElement {
  const edited: Edited = { product, version: product.version };
  const reload = () => context.go(`/manage/${product.id}`);
  const notice = makeNotice();
  return h(
    "div",
    { class: "wrap" },
    h("p", { class: "crumb" }, h("a", { href: "/manage" }, `← ${t.back}`)),
    h("h1", {}, t.title(product.title)),
    notice.element,
    h(
      "div",
      { class: "edit-columns" },
      detailsForm(edited, reload),
      h(
        "div",
        { class: "edit-side" },
        statusBlock(product, context, notice, reload),
        modelBlock(edited, context, notice, reload),
      ),
    ),
  );
}

function statusBlock(
  product: Product,
  context: PageContext,
  notice: Notice,
  reload: () => void,
): HTMLElement {
  const change = (status: Status) =>
    attempt(notice, async () => {
      await api.setStatus(product.id, status);
      reload();
    });
  const remove = () => {
    if (!window.confirm(t.removeSure(product.title))) return;
    void attempt(notice, async () => {
      await api.remove(product.id);
      context.go("/manage");
    });
  };
  const actions = h(
    "div",
    { class: "actions" },
    h("a", { class: "button", href: `/p/${product.id}` }, t.view),
  );
  if (product.status === "active")
    actions.append(button(texts.manage.deactivate, () => void change("draft")));
  else if (mayActivate(product, context.user)) {
    actions.append(button(texts.manage.activate, () => void change("active"), { class: "primary" }));
  }
  if (product.status !== "archived") actions.append(button(t.archive, () => void change("archived")));
  if (product.status !== "active") actions.append(button(t.remove, remove, { class: "danger" }));
  return h(
    "section",
    { class: "panel" },
    h("h2", {}, t.statusTitle),
    h("p", {}, t.statusNow(named(texts.statuses, product.status))),
    actions,
  );
}

function mayActivate(product: Product, user: SessionUser | null): boolean {
  return user?.role === "admin" && product.model !== null;
}

function modelBlock(edited: Edited, context: PageContext, notice: Notice, reload: () => void): HTMLElement {
  const { product } = edited;
  const file = input(product.model ? t.replaceModel : texts.create.file, {
    type: "file",
    accept: ".asc,.ply,.glb",
  });
  file.control.addEventListener("change", () => {
    const chosen = file.control.files?.[0];
    if (!chosen) return;
    void attempt(notice, async () => {
      await api.upload(product.id, "model", chosen, chosen.name, (share) =>
        notice.good(
          share < 1 ? texts.create.sending(`${Math.floor(share * 100)} %`) : texts.create.preparing,
        ),
      );
      reload();
    });
  });
  const box = h("section", { class: "panel" }, h("h2", {}, t.modelTitle));
  if (product.model) box.append(modelView(edited, product.model, context.signal, notice));
  box.append(file.element);
  return box;
}

/** The 3D view with a button that makes its present picture the listing's. */
function modelView(edited: Edited, model: ProductModel, signal: AbortSignal, notice: Notice): HTMLElement {
  const { product } = edited;
  let viewer: Viewer | null = null;
  const take = () =>
    attempt(notice, async () => {
      const picture = await viewer?.picture();
      if (!picture) throw new ApiError(0, "no_picture", t.pictureFailed);
      edited.version = (await api.upload(product.id, "poster", picture, "poster.png")).version;
      notice.good(t.pictureSaved);
    });
  const frame = viewerFrame({
    title: product.title,
    posterUrl: product.poster_url,
    streamUrl: model.stream_url,
    streamBytes: model.stream_bytes,
    signal,
    onLoaded: (loadedViewer) => {
      viewer = loadedViewer;
    },
  });
  return h(
    "div",
    {},
    frame,
    button(t.usePicture, () => void take()),
  );
}

async function attempt(notice: Notice, action: () => Promise<void>): Promise<void> {
  try {
    await action();
  } catch (error) {
    notice.bad(messageOf(error));
  }
}
