// What the seller has written so far, so that neither a failed upload nor a reload loses it. Kept no longer than this tab.

export interface Draft {
  readonly title: string;
  readonly description: string;
  readonly price: string;
  readonly currency: string;
  readonly category: string;
  readonly condition: string;
  readonly server: string;
  readonly token: string;
}

const STORED = "allround.capture.listing";
const EMPTY: Draft = {
  title: "",
  description: "",
  price: "",
  currency: "EUR",
  category: "other",
  condition: "",
  server: "",
  token: "",
};

export function readDraft(): Draft {
  try {
    const stored = JSON.parse(sessionStorage.getItem(STORED) ?? "{}") as Record<string, unknown>;
    const texts = Object.entries(stored).filter(([, value]) => typeof value === "string");
    return { ...EMPTY, ...Object.fromEntries(texts) };
  } catch {
    return EMPTY;
  }
}

export function keepDraft(draft: Draft): void {
  sessionStorage.setItem(STORED, JSON.stringify(draft));
}

/** The next product is another one, but the shop is the same. */
export function forgetProduct(): void {
  const { server, token, currency } = readDraft();
  keepDraft({ ...EMPTY, server, token, currency });
}
