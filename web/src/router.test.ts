import { expect, it } from "vitest";
import { matchPattern } from "./router";

it.each<[string, string, Record<string, string> | null]>([
  ["/", "/", {}],
  ["/login", "/login", {}],
  ["/login", "/login/", {}],
  ["/p/:id", "/p/0199", { id: "0199" }],
  ["/p/:id", "/p/a%2Fb", { id: "a/b" }],
  ["/p/:id", "/p/", null],
  ["/p/:id", "/p/%zz", null],
  ["/p/:id", "/p/1/2", null],
  ["/manage", "/manage/users", null],
  ["/", "/login", null],
])("%s against %s", (pattern, path, params) => {
  expect(matchPattern(pattern, path)).toEqual(params);
});
