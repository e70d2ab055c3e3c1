// Bundles src/main.js into the one script that the report inlines.
import { build } from "esbuild";
import { readFileSync } from "node:fs";

const target = new URL("../crates/vmao/src/report/viewer.js", import.meta.url).pathname;
const licence = readFileSync(new URL("node_modules/three/LICENSE", import.meta.url), "utf8").trim();

await build({
  entryPoints: [new URL("src/main.js", import.meta.url).pathname],
  outfile: target,
  bundle: true,
  minify: true,
  format: "iife",
  target: ["es2022"],
  charset: "ascii",
  legalComments: "none",
  banner: { js: `/* Built from viewer/ by viewer/build.sh; do not edit. Contains three.js:\n\n${licence}\n*/` },
});
