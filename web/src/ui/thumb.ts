// A listing's small picture, or a place holder of the same shape.
import { texts } from "../texts";
import { h } from "./dom";

/** Beside the title the picture says nothing more to those who hear the page: its alt stays empty. */
export function thumb(url: string | null): HTMLElement {
  if (url === null) return h("div", { class: "thumb placeholder" }, h("span", {}, texts.common.noPicture));
  return h("img", {
    class: "thumb",
    src: url,
    alt: "",
    loading: "lazy",
    decoding: "async",
    width: 400,
    height: 300,
  });
}
