// What a page is: a function from its address to its content.
import type { SessionUser } from "./api/types";

export interface PageContext {
  /** The parts of the path that the route leaves open. */
  readonly params: Readonly<Record<string, string>>;
  readonly query: URLSearchParams;
  readonly user: SessionUser | null;
  /** Fires when the page is left: everything it started must end. */
  readonly signal: AbortSignal;
  go(path: string): void;
  /** For pages whose title comes with their data. */
  setTitle(title: string): void;
  /** Asks the server again who is logged in, then goes there. */
  enter(path: string): Promise<void>;
}

export interface PageContent {
  readonly title: string;
  readonly content: Node;
}

export type Page = (context: PageContext) => PageContent;
export type Access = "all" | "user" | "admin";

export interface Route {
  /** For example "/p/:id". */
  readonly pattern: string;
  readonly access: Access;
  readonly page: Page;
}
