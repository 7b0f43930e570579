// The server's API as functions. Every failure is an ApiError whose message can be shown to a person.
import { texts } from "../texts";
import type {
  GalleryPage,
  ManageItem,
  Paged,
  Product,
  ProductEdit,
  Role,
  Status,
  TokenItem,
  User,
  UserItem,
} from "./types";

export class ApiError extends Error {
  /** `status` 0: no answer came. `code` is the problem's machine-readable name. */
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
  ) {
    super(message);
  }
}

interface RequestOptions {
  readonly json?: unknown;
  readonly headers?: Record<string, string>;
  readonly signal?: AbortSignal;
}

async function request<T>(method: string, path: string, options: RequestOptions = {}): Promise<T> {
  const headers: Record<string, string> = { accept: "application/json", ...options.headers };
  const init: RequestInit = { method, headers, credentials: "same-origin" };
  if (options.signal) init.signal = options.signal;
  if (options.json !== undefined) {
    headers["content-type"] = "application/json";
    init.body = JSON.stringify(options.json);
  }
  let response: Response;
  try {
    response = await fetch(path, init);
  } catch (error) {
    if (options.signal?.aborted) throw error;
    throw new ApiError(0, "network", texts.errors.network);
  }
  const body = await response.text();
  if (!response.ok) throw problem(response.status, body);
  return parse<T>(body);
}

function parse<T>(body: string): T {
  if (body === "") return undefined as T;
  try {
    return JSON.parse(body) as T;
  } catch {
    throw new ApiError(0, "unreadable", texts.errors.unreadableAnswer);
  }
}

/** What an answer of application/problem+json says; plain words where it says nothing readable. */
export function problem(status: number, body: string): ApiError {
  try {
    const { detail, title, code } = JSON.parse(body) as Record<string, unknown>;
    const message = [detail, title].find((text) => typeof text === "string" && text !== "");
    return new ApiError(status, String(code ?? ""), String(message ?? texts.errors.unexpected));
  } catch {
    return new ApiError(status, "", texts.errors.unexpected);
  }
}

function withQuery(path: string, query: Record<string, string | number>): string {
  const filled = Object.entries(query).filter(([, value]) => value !== "");
  const search = new URLSearchParams(filled.map(([name, value]) => [name, String(value)]));
  return filled.length > 0 ? `${path}?${search}` : path;
}

const productPath = (id: string) => `/api/products/${encodeURIComponent(id)}`;

export interface GalleryQuery {
  readonly q: string;
  readonly category: string;
  readonly sort: string;
  readonly page: number;
  readonly per_page: number;
}

export interface ManageQuery {
  readonly q: string;
  readonly status: string;
  readonly page: number;
  readonly per_page: number;
}

export const api = {
  session: () => request<{ user: User | null }>("GET", "/api/session"),
  login: (name: string, password: string) =>
    request<{ user: User }>("POST", "/api/session", { json: { name, password } }),
  logout: () => request<void>("DELETE", "/api/session"),
  setup: (token: string, name: string, password: string) =>
    request<void>("POST", "/api/setup", { json: { token, name, password } }),
  changePassword: (current: string, next: string) =>
    request<void>("POST", "/api/account/password", { json: { current, new: next } }),

  users: (signal: AbortSignal) => request<{ items: UserItem[] }>("GET", "/api/users", { signal }),
  addUser: (name: string, password: string, role: Role) =>
    request<UserItem>("POST", "/api/users", { json: { name, password, role } }),
  changeUser: (id: string, change: { role?: Role; disabled?: boolean; password?: string }) =>
    request<UserItem>("PATCH", `/api/users/${encodeURIComponent(id)}`, { json: change }),

  tokens: (signal: AbortSignal) => request<{ items: TokenItem[] }>("GET", "/api/tokens", { signal }),
  addToken: (name: string, scopes: string[], days: number | null) =>
    request<{ token: string; item: TokenItem }>("POST", "/api/tokens", {
      json: days === null ? { name, scopes } : { name, scopes, expires_in_days: days },
    }),
  revokeToken: (id: string) => request<void>("DELETE", `/api/tokens/${encodeURIComponent(id)}`),

  gallery: (query: GalleryQuery, signal: AbortSignal) =>
    request<GalleryPage>("GET", withQuery("/api/products", { ...query }), { signal }),
  manage: (query: ManageQuery, signal: AbortSignal) =>
    request<Paged<ManageItem>>("GET", withQuery("/api/manage/products", { ...query }), { signal }),
  product: (id: string, signal?: AbortSignal) =>
    request<Product>("GET", productPath(id), signal ? { signal } : {}),
  create: (edit: ProductEdit & { title: string }) =>
    request<Product>("POST", "/api/products", { json: edit }),
  edit: (id: string, version: number, edit: ProductEdit) =>
    request<Product>("PATCH", productPath(id), { json: edit, headers: { "if-match": `"v${version}"` } }),
  setStatus: (id: string, status: Status) =>
    request<Product>("POST", `${productPath(id)}/status`, { json: { status } }),
  remove: (id: string) => request<void>("DELETE", productPath(id)),
  upload: (id: string, kind: "model" | "poster" | "report", file: Blob, name: string, progress?: Progress) =>
    upload(`${productPath(id)}/${kind}`, file, name, progress),
};

export type Progress = (share: number) => void;

/** XMLHttpRequest, for fetch tells nothing of how much of a body was sent. */
function upload(path: string, file: Blob, name: string, progress?: Progress): Promise<Product> {
  return new Promise((resolve, reject) => {
    const xhr = new XMLHttpRequest();
    xhr.open("PUT", path);
    xhr.setRequestHeader("content-type", contentType(name));
    xhr.setRequestHeader("x-filename", encodeURIComponent(name));
    xhr.upload.addEventListener("progress", ({ loaded, total }) =>
      progress?.(total > 0 ? loaded / total : 0),
    );
    xhr.addEventListener("error", () => reject(new ApiError(0, "network", texts.errors.network)));
    xhr.addEventListener("load", () => {
      if (xhr.status < 200 || xhr.status > 299) return reject(problem(xhr.status, xhr.responseText));
      try {
        resolve(parse<Product>(xhr.responseText));
      } catch (error) {
        reject(error);
      }
    });
    xhr.send(file);
  });
}

function contentType(name: string): string {
  const ending = name.slice(name.lastIndexOf(".") + 1).toLowerCase();
  const types: Record<string, string> = {
    asc: "text/plain",
    glb: "model/gltf-binary",
    json: "application/json",
    png: "image/png",
    jpg: "image/jpeg",
    jpeg: "image/jpeg",
  };
  return types[ending] ?? "application/octet-stream";
}
