// A listing as a buyer sees it: the 3D view and, in words, all that it shows.
import { ApiError, api } from "../api/client";
import type { Product, ProductModel, ProductScan } from "../api/types";
import * as format from "../format";
import type { ColourName } from "../math/colours";
import type { Page } from "../page";
import { texts } from "../texts";
import { h } from "../ui/dom";
import { loaded } from "../ui/states";
import { thumb } from "../ui/thumb";
import { viewerFrame } from "../viewer/frame";
import { message } from "./message";

const t = texts.product;

export const product: Page = ({ params, signal, setTitle }) => {
  const content = loaded(signal, async () => {
    try {
      const found = await api.product(params.id ?? "", signal);
      setTitle(found.title);
      return listing(found, signal);
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 404) throw error;
      return message(texts.errors.notFoundTitle, texts.errors.notFound).content;
    }
  });
  return { title: texts.siteName, content };
};

function listing(product: Product, signal: AbortSignal): HTMLElement {
  const colours = h("dd", {}, texts.common.none);
  const view = product.model
    ? viewerFrame({
        title: product.title,
        posterUrl: product.poster_url,
        streamUrl: product.model.stream_url,
        streamBytes: product.model.stream_bytes,
        signal,
        onLoaded: (_, names) => showColours(colours, names),
      })
    : h("div", { class: "viewer" }, thumb(product.poster_url), h("p", {}, t.noModel));
  return h(
    "article",
    { class: "wrap product" },
    h("p", { class: "crumb" }, h("a", { href: "/" }, `← ${t.back}`)),
    product.status !== "active" &&
      h(
        "p",
        { class: "notice info" },
        t.notPublic(format.named(texts.statuses, product.status)),
        " ",
        h("a", { href: `/manage/${product.id}` }, t.edit),
      ),
    h(
      "div",
      { class: "product-columns" },
      view,
      h(
        "div",
        { class: "product-facts" },
        h("h1", {}, product.title),
        h("p", { class: "price" }, format.formatPrice(product.price_minor, product.currency)),
        sizeBlock(product),
        factList(product, colours),
        scanBlock(product.scan),
      ),
      h(
        "section",
        { class: "product-text" },
        h("h2", {}, t.description),
        h("p", { class: "description" }, product.description || t.noDescription),
        modelBlock(product.model, product.scan),
      ),
    ),
  );
}

function showColours(cell: HTMLElement, names: ColourName[]): void {
  if (names.length > 0) cell.textContent = texts.colours(names);
}

function sizeBlock({ dimensions_m, scan }: Product): HTMLElement | null {
  const metres = scan?.dimensions_m ?? dimensions_m;
  const inUnit = (unit: format.LengthUnit) => format.formatSize(metres, unit);
  if (inUnit("cm") === null) return null;
  const size = h("p", { class: "size", role: "status" }, inUnit("cm") ?? "");
  const uncertainty = format.formatUncertainty(scan?.dimensions_uncertainty_m ?? null);
  return h(
    "section",
    { class: "size-block" },
    h("h2", {}, t.size),
    size,
    h(
      "p",
      { class: "hint" },
      [t.sizeNames, uncertainty ? t.uncertainty(uncertainty) : null].filter(Boolean).join(", "),
    ),
    unitSwitch((unit) => {
      size.textContent = inUnit(unit) ?? "";
    }),
  );
}

function unitSwitch(onChange: (unit: format.LengthUnit) => void): HTMLElement {
  const choice = (unit: format.LengthUnit, text: string) => {
    const radio = h("input", { type: "radio", name: "unit", value: unit, checked: unit === "cm" });
    radio.addEventListener("change", () => onChange(unit));
    return h("label", {}, radio, text);
  };
  return h(
    "fieldset",
    { class: "units" },
    h("legend", { class: "visually-hidden" }, t.units),
    choice("cm", t.centimetres),
    choice("in", t.inches),
  );
}

function factList(product: Product, colours: HTMLElement): HTMLElement {
  const fact = (name: string, value: string) => [h("dt", {}, name), h("dd", {}, value)];
  return h(
    "dl",
    { class: "fact-list" },
    ...fact(t.condition, format.named(texts.conditions, product.condition)),
    ...fact(t.category, format.named(texts.categories, product.category)),
    ...(product.model ? [h("dt", {}, t.colours), colours] : []),
    ...fact(t.seller, product.owner.name),
    ...fact(t.listed, format.formatDate(product.created_at)),
  );
}

function scanBlock(scan: ProductScan | null): HTMLElement {
  const box = h("section", { class: "scan-block" }, h("h2", {}, t.scanTitle));
  if (!scan) {
    box.append(h("p", {}, t.noScan));
    return box;
  }
  if (scan.verdict) {
    box.append(h("p", { class: `verdict verdict-${scan.verdict}` }, format.named(t.verdicts, scan.verdict)));
  }
  if (scan.views_total > 0) box.append(h("p", {}, t.views(scan.views_used, scan.views_total)));
  if (scan.warnings.length > 0) {
    box.append(h("h3", {}, t.warnings), h("ul", {}, ...scan.warnings.map((warning) => h("li", {}, warning))));
  }
  return box;
}

function modelBlock(model: ProductModel | null, scan: ProductScan | null): HTMLElement | null {
  if (!model) return null;
  const size =
    model.kind === "mesh"
      ? t.modelMesh(format.formatCount(model.triangles))
      : t.modelPoints(format.formatCount(model.points));
  const name = model.original_name;
  return h(
    "ul",
    { class: "downloads" },
    h(
      "li",
      {},
      h(
        "a",
        { href: model.original_url, download: name },
        t.download(name, format.formatBytes(model.original_bytes)),
      ),
      ` — ${size}`,
    ),
    scan?.report_url
      ? h("li", {}, h("a", { href: scan.report_url, download: "report.json" }, t.report))
      : null,
  );
}
