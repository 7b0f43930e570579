// The main colours of a model in the words a buyer would use.

const NAMES = [
  "black",
  "grey",
  "white",
  "red",
  "orange",
  "brown",
  "yellow",
  "green",
  "turquoise",
  "blue",
  "purple",
  "pink",
] as const;
export type ColourName = (typeof NAMES)[number];

const MAX_NAMED = 3;
/** Less than this share of the surface is a detail, not a main colour. */
const MIN_SHARE = 0.12;
const MAX_SAMPLES = 20_000;

/** Names of up to three main colours, most frequent first; `colors` has `lanes` bytes a point, sRGB first. */
export function mainColours(colors: Uint8Array, lanes: number, points: number): ColourName[] {
  const counts = new Map<ColourName, number>();
  const stride = Math.max(1, Math.floor(points / MAX_SAMPLES));
  let total = 0;
  for (let i = 0; i < points; i += stride, total++) {
    const at = i * lanes;
    const name = colourName(colors[at] ?? 0, colors[at + 1] ?? 0, colors[at + 2] ?? 0);
    counts.set(name, (counts.get(name) ?? 0) + 1);
  }
  return [...counts]
    .filter(([, count]) => count >= total * MIN_SHARE)
    .sort(([a, countA], [b, countB]) => countB - countA || NAMES.indexOf(a) - NAMES.indexOf(b))
    .slice(0, MAX_NAMED)
    .map(([name]) => name);
}

/** Name of one sRGB colour, by lightness and hue. */
export function colourName(red: number, green: number, blue: number): ColourName {
  const high = Math.max(red, green, blue);
  const low = Math.min(red, green, blue);
  const lightness = (high + low) / 510;
  const chroma = high - low;
  if (high < 45) return "black";
  if (chroma < 28 || chroma < high * 0.16)
    return lightness > 0.78 ? "white" : lightness < 0.2 ? "black" : "grey";
  return hueName(hueDegrees(red, green, blue, high, chroma), lightness);
}

function hueDegrees(red: number, green: number, blue: number, high: number, chroma: number): number {
  const sixth =
    high === red
      ? (green - blue) / chroma
      : high === green
        ? 2 + (blue - red) / chroma
        : 4 + (red - green) / chroma;
  return (sixth * 60 + 360) % 360;
}

function hueName(hue: number, lightness: number): ColourName {
  if (hue < 14 || hue >= 345) return lightness > 0.72 ? "pink" : "red";
  if (hue < 43) return lightness < 0.42 ? "brown" : "orange";
  if (hue < 70) return lightness < 0.25 ? "brown" : "yellow";
  if (hue < 165) return "green";
  if (hue < 195) return "turquoise";
  if (hue < 255) return "blue";
  return hue < 295 ? "purple" : "pink";
}
