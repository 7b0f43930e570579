// The API's data under the names the pages use; all of it comes from the server's own description (schema.ts, generated).
import type { components } from "./schema";

type Schemas = components["schemas"];

export type Category = Schemas["Category"];
export type Condition = Schemas["Condition"];
export type Role = Schemas["Role"];
export type Scope = Schemas["Scope"];
export type Status = Schemas["Status"];
export type SessionUser = Schemas["SessionUser"];
export type User = Schemas["User"];
export type ProductCard = Schemas["ProductCard"];
export type ManagedCard = Schemas["ManagedCard"];
export type ManagedList = Schemas["ManagedList"];
export type Gallery = Schemas["Gallery"];
export type Product = Schemas["Product"];
export type ProductModel = Schemas["ProductModel"];
export type ProductScan = Schemas["ProductScan"];
export type NewProduct = Schemas["NewProduct"];
export type ProductChange = Schemas["ProductChange"];
export type TokenItem = Schemas["TokenItem"];
export type UploadKind = Schemas["UploadKind"];
