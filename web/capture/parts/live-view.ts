// What the sensor sees now: the newest pair of pictures, with the board's marks and the product's place drawn over the colours.
// A picture that comes while another is being decoded takes the place of the one before it.
//
// `data-fps` on the root is how many pictures a second were drawn over the last two seconds.
import { h } from "../../src/ui/dom";
import type { Picture } from "../daemon/picture";
import type { PictureHeader, PixelPlace } from "../daemon/types";
import { Rate } from "../math/rate";
import { texts } from "../texts";

const t = texts.live;
const TAG_LINE = "#ffb000";
const REGION_LINE = "#ffffff";
const DARK_EDGE = "rgb(0 0 0 / 65%)";
const FACTS_MILLIS = 1000;

export interface LiveView {
  readonly color: HTMLElement;
  readonly depth: HTMLElement;
  readonly facts: HTMLElement;
  show(picture: Picture): void;
}

export function makeLiveView(signal: AbortSignal, onShown: (header: PictureHeader) => void): LiveView {
  const colorCanvas = h("canvas", {
    class: "live-picture",
    role: "img",
    "aria-label": t.color,
    width: 640,
    height: 480,
  });
  const depthCanvas = h("canvas", {
    class: "live-picture",
    role: "img",
    "aria-label": t.depth,
    width: 640,
    height: 480,
  });
  const color = h("figure", { class: "live-color" }, colorCanvas);
  const depth = h(
    "figure",
    { class: "live-depth" },
    depthCanvas,
    h("figcaption", { class: "hint" }, h("strong", {}, t.depthTitle), ` ${t.depthHint}`),
  );
  const facts = h("p", { class: "facts" });
  const rate = new Rate();
  let waiting: Picture | null = null;
  let isBusy = false;
  let newest: PictureHeader | null = null;

  async function work(): Promise<void> {
    isBusy = true;
    while (waiting && !signal.aborted) {
      const picture: Picture = waiting;
      waiting = null;
      await draw(picture).catch((error: unknown) =>
        console.info("A live picture could not be drawn:", error),
      );
    }
    isBusy = false;
  }

  async function draw({ header, color: colors, depth: depths }: Picture): Promise<void> {
    const [colorPicture, depthPicture] = await Promise.all([
      createImageBitmap(new Blob([colors])),
      depths ? createImageBitmap(new Blob([depths])) : null,
    ]);
    if (!signal.aborted) {
      paint(colorCanvas, colorPicture, (pen) => drawOverlay(pen, header));
      if (depthPicture) paint(depthCanvas, depthPicture);
      rate.note(performance.now());
      newest = header;
      onShown(header);
    }
    colorPicture.close();
    depthPicture?.close();
  }

  const timer = window.setInterval(() => {
    const perSecond = rate.perSecond(performance.now());
    color.dataset.fps = perSecond.toFixed(1);
    facts.textContent = newest ? factsOf(newest, perSecond) : "";
  }, FACTS_MILLIS);
  signal.addEventListener("abort", () => clearInterval(timer), { once: true });

  return {
    color,
    depth,
    facts,
    show(picture) {
      waiting = picture;
      if (!isBusy) void work();
    },
  };
}

function factsOf(header: PictureHeader, perSecond: number): string {
  const metres = header.distance_metres;
  return t.facts(
    Math.round(perSecond),
    Math.round(header.valid_depth * 100),
    metres !== null && metres > 0 ? metres.toFixed(2) : null,
    header.lost_packets,
  );
}

function paint(
  canvas: HTMLCanvasElement,
  picture: ImageBitmap,
  over?: (pen: CanvasRenderingContext2D) => void,
): void {
  if (canvas.width !== picture.width) canvas.width = picture.width;
  if (canvas.height !== picture.height) canvas.height = picture.height;
  // Drawn in main memory: for two small pictures the way through the graphics card's is longer, and without a card much longer.
  const pen = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
  if (!pen) return;
  pen.drawImage(picture, 0, 0);
  over?.(pen);
}

function drawOverlay(pen: CanvasRenderingContext2D, { region, tags, width }: PictureHeader): void {
  pen.save();
  pen.lineJoin = "round";
  // The header's pixels are those of the whole picture, whatever size came.
  const scale = width > 0 ? pen.canvas.width / width : 1;
  pen.scale(scale, scale);
  if (region.length > 2) {
    pen.setLineDash([10, 7]);
    strokeTwice(pen, region, REGION_LINE, 2.5);
    pen.setLineDash([]);
  }
  for (const { corners } of tags) strokeTwice(pen, corners, TAG_LINE, 2);
  pen.restore();
}

/** A dark edge makes the line stand out on any picture. */
function strokeTwice(
  pen: CanvasRenderingContext2D,
  corners: readonly PixelPlace[],
  color: string,
  width: number,
): void {
  pen.beginPath();
  for (const [i, [u, v]] of corners.entries()) {
    // Pixel (0, 0) is the middle of the first pixel.
    if (i === 0) pen.moveTo(u + 0.5, v + 0.5);
    else pen.lineTo(u + 0.5, v + 0.5);
  }
  pen.closePath();
  pen.strokeStyle = DARK_EDGE;
  pen.lineWidth = width + 2;
  pen.stroke();
  pen.strokeStyle = color;
  pen.lineWidth = width;
  pen.stroke();
}
