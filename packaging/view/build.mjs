// Bundles src/main.js with three.js: node build.mjs [FOLDER], by default batch/eulerfsi/view. Needs `npm ci` here.
import { build } from "esbuild";
import { copyFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const folder = process.argv[2] ?? join(here, "../../batch/eulerfsi/view");
await build({
  absWorkingDir: here,
  entryPoints: ["src/main.js"],
  outfile: join(folder, "page.js"),
  bundle: true,
  minify: true,
  charset: "ascii",
  format: "iife",
  target: "es2022",
  legalComments: "eof",
});
await copyFile(join(here, "node_modules/three/LICENSE"), join(folder, "three-LICENSE.txt"));
