// Numbers as people read them. Metres and minor units come in, text goes out.
import { texts } from "./texts";

export const LOCALE = "en-GB";
export type LengthUnit = "cm" | "in";

const METRES_PER = { cm: 0.01, in: 0.0254 } as const;
const UNIT_TEXT = { cm: "cm", in: "in" } as const;

/** Decimals of a currency by Intl; 2 for a code it does not know. */
export function currencyDigits(currency: string): number {
  try {
    const format = new Intl.NumberFormat(LOCALE, { style: "currency", currency });
    return format.resolvedOptions().maximumFractionDigits ?? 2;
  } catch {
    return 2;
  }
}

export function formatPrice(minor: number | null, currency: string | null): string {
  if (minor === null || currency === null) return texts.common.noPrice;
  const amount = minor / 10 ** currencyDigits(currency);
  try {
    return new Intl.NumberFormat(LOCALE, { style: "currency", currency }).format(amount);
  } catch {
    return `${amount.toFixed(2)} ${currency}`;
  }
}

/** For the edit form: "25.00". */
export function priceInput(minor: number | null, currency: string | null): string {
  if (minor === null || currency === null) return "";
  const digits = currencyDigits(currency);
  return (minor / 10 ** digits).toFixed(digits);
}

/** "25", "25.5" or "25,50" in minor units; null where it is no price. */
export function parsePrice(text: string, currency: string): number | null {
  const match = /^(\d{1,9})(?:[.,](\d+))?$/.exec(text.trim());
  if (!match) return null;
  const digits = currencyDigits(currency);
  const fraction = match[2] ?? "";
  if (fraction.length > digits) return null;
  return Number((match[1] ?? "") + fraction.padEnd(digits, "0"));
}

export function formatLength(metres: number, unit: LengthUnit): string {
  return new Intl.NumberFormat(LOCALE, { minimumFractionDigits: 1, maximumFractionDigits: 1 }).format(
    metres / METRES_PER[unit],
  );
}

/** "19.1 × 9.5 × 6.7 cm"; null where there are no three lengths. */
export function formatSize(metres: readonly number[] | null, unit: LengthUnit = "cm"): string | null {
  const [length, width, height] = metres ?? [];
  if (length === undefined || width === undefined || height === undefined) return null;
  const [l, w, h] = [length, width, height].map((side) => formatLength(side, unit));
  return `${texts.product.sizeOf(l ?? "", w ?? "", h ?? "")} ${UNIT_TEXT[unit]}`;
}

/** "± 1.2 mm": the largest of the sides' uncertainties, never rounded down to nothing. */
export function formatUncertainty(metres: readonly number[] | null): string | null {
  if (!metres || metres.length === 0) return null;
  const millimetres = Math.max(...metres) * 1000;
  if (!Number.isFinite(millimetres) || millimetres <= 0) return null;
  return `± ${Math.max(0.1, Math.ceil(millimetres * 10) / 10).toFixed(1)} mm`;
}

export function formatBytes(bytes: number): string {
  if (bytes < 1000) return `${bytes} B`;
  if (bytes < 1_000_000) return `${Math.round(bytes / 1000)} kB`;
  if (bytes < 1_000_000_000) return `${(bytes / 1_000_000).toFixed(1)} MB`;
  return `${(bytes / 1_000_000_000).toFixed(1)} GB`;
}

export function formatCount(count: number): string {
  return new Intl.NumberFormat(LOCALE).format(count);
}

export function formatDate(rfc3339: string): string {
  const date = new Date(rfc3339);
  if (Number.isNaN(date.getTime())) return texts.common.none;
  return new Intl.DateTimeFormat(LOCALE, { dateStyle: "medium" }).format(date);
}

/** The text of a known name, or the name itself where a newer server knows more. */
export function named(table: Record<string, string>, name: string | null): string {
  return name === null ? texts.common.none : (table[name] ?? name);
}
