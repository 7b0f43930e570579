// Checks GLB files with the Khronos validator: node check.mjs FILE...
// Errors and warnings fail; they are printed one a line.
import { readFileSync } from "node:fs";
import { validateBytes } from "gltf-validator";

let failed = process.argv.length < 3;
for (const file of process.argv.slice(2)) {
  const { issues } = await validateBytes(new Uint8Array(readFileSync(file)));
  for (const { code, message, pointer } of issues.messages) {
    console.log(`${file}: ${code} ${pointer ?? ""}: ${message}`);
  }
  failed ||= issues.numErrors + issues.numWarnings > 0;
}
process.exit(failed ? 1 : 0);
