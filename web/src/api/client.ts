// The server's API as functions. Every failure is an ApiError whose message can be shown to a person.
import { texts } from "../texts";
import type { components, paths } from "./schema";
import type {
  Gallery,
  ManagedList,
  NewProduct,
  Product,
  ProductChange,
  Role,
  Scope,
  SessionUser,
  Status,
  UploadKind,
  User,
} from "./types";

type Schemas = components["schemas"];

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

/** A path that the server's description names, with its open parts filled. */
function at(path: keyof paths, id = ""): string {
  return path.replace("{id}", encodeURIComponent(id));
}

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
  session: () => request<{ user: SessionUser | null }>("GET", at("/api/session")),
  login: (name: string, password: string) =>
    request<Schemas["Session"]>("POST", at("/api/session"), { json: { name, password } }),
  logout: () => request<void>("DELETE", at("/api/session")),
  setup: (token: string, name: string, password: string) =>
    request<Schemas["Session"]>("POST", at("/api/setup"), { json: { token, name, password } }),
  changePassword: (current: string, next: string) =>
    request<void>("POST", at("/api/account/password"), { json: { current, new: next } }),

  users: (signal: AbortSignal) => request<Schemas["UserList"]>("GET", at("/api/users"), { signal }),
  addUser: (name: string, password: string, role: Role) =>
    request<User>("POST", at("/api/users"), { json: { name, password, role } }),
  changeUser: (id: string, change: Schemas["UserChange"]) =>
    request<User>("PATCH", at("/api/users/{id}", id), { json: change }),

  tokens: (signal: AbortSignal) => request<Schemas["TokenList"]>("GET", at("/api/tokens"), { signal }),
  addToken: (name: string, scopes: Scope[], days: number | null) =>
    request<Schemas["TokenMade"]>("POST", at("/api/tokens"), {
      json: { name, scopes, expires_in_days: days },
    }),
  revokeToken: (id: string) => request<void>("DELETE", at("/api/tokens/{id}", id)),

  gallery: (query: GalleryQuery, signal: AbortSignal) =>
    request<Gallery>("GET", withQuery(at("/api/products"), { ...query }), { signal }),
  manage: (query: ManageQuery, signal: AbortSignal) =>
    request<ManagedList>("GET", withQuery(at("/api/manage/products"), { ...query }), { signal }),
  product: (id: string, signal?: AbortSignal) =>
    request<Product>("GET", at("/api/products/{id}", id), signal ? { signal } : {}),
  create: (product: NewProduct) => request<Product>("POST", at("/api/products"), { json: product }),
  edit: (id: string, version: number, change: ProductChange) =>
    request<Product>("PATCH", at("/api/products/{id}", id), {
      json: change,
      headers: { "if-match": `"v${version}"` },
    }),
  setStatus: (id: string, status: Status) =>
    request<Product>("POST", at("/api/products/{id}/status", id), { json: { status } }),
  remove: (id: string) => request<void>("DELETE", at("/api/products/{id}", id)),
  upload: (id: string, kind: UploadKind, file: Blob, name: string, progress?: Progress) =>
    upload(at(`/api/products/{id}/${kind}`, id), file, name, progress),
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
