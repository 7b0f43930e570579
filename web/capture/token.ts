// The key to the program: it comes in the address's fragment, which no server sees, and is taken out of sight at once.

const KEY = "token";
const STORED = "allround.capture.token";
const SHAPE = /^[0-9a-f]{64}$/;

/** From the address, or from an earlier load of this page; null where there is none. */
export function readToken(): string | null {
  const given = new URLSearchParams(location.hash.slice(1)).get(KEY);
  if (given !== null) {
    history.replaceState(null, "", location.pathname + location.search);
    if (SHAPE.test(given)) sessionStorage.setItem(STORED, given);
  }
  return sessionStorage.getItem(STORED);
}
