// The API's data as the pages use it.
export type Role = "admin" | "seller";
export type Status = "draft" | "active" | "archived";
export type Sort = "newest" | "price_asc" | "price_desc";

export interface User {
  id: string;
  name: string;
  role: Role;
}

export interface UserItem extends User {
  disabled: boolean;
  created_at: string;
}

export interface ProductCard {
  id: string;
  title: string;
  price_minor: number | null;
  currency: string | null;
  category: string | null;
  condition: string | null;
  thumb_url: string | null;
  has_model: boolean;
  dimensions_m: number[] | null;
  verdict: string | null;
  created_at: string;
}

export interface ManageItem extends ProductCard {
  status: Status;
  owner: { id: string; name: string };
  version: number;
  updated_at: string;
}

export interface Model {
  kind: "points" | "mesh";
  points: number;
  triangles: number;
  stream_url: string;
  stream_bytes: number;
  original_url: string;
  original_name: string;
  original_bytes: number;
  sha256: string;
  bounds_m: { min: number[]; max: number[] };
}

export interface Scan {
  dimensions_m: number[] | null;
  dimensions_uncertainty_m: number[] | null;
  verdict: string | null;
  views_used: number | null;
  views_total: number | null;
  warnings: string[];
  software: string | null;
  report_url: string | null;
}

export interface Product extends ManageItem {
  description: string;
  poster_url: string | null;
  model: Model | null;
  scan: Scan | null;
}

export interface Paged<Item> {
  items: Item[];
  page: number;
  per_page: number;
  total: number;
}

export interface GalleryPage extends Paged<ProductCard> {
  categories: { name: string; count: number }[];
}

export interface ProductEdit {
  title?: string;
  description?: string;
  price_minor?: number | null;
  currency?: string | null;
  category?: string | null;
  condition?: string | null;
}

export interface TokenItem {
  id: string;
  name: string;
  prefix: string;
  scopes: string[];
  created_at: string;
  last_used_at: string | null;
  expires_at: string | null;
}
