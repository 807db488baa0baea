// Builds the page into the package: `npm run build`. The shaders of the engine are taken from there.
import { createHash } from "node:crypto";
import { mkdirSync, readdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "../src/vnca/viewer/page");
const engine = join(here, "../src/vnca/engine/wgsl");

// What the page is made of, by which a test tells whether the one in the package is older.
function digest() {
  const hash = createHash("sha256");
  const listed = [
    ...readdirSync(join(here, "src"), { recursive: true })
      .map((name) => join("src", name.toString()))
      .filter((name) => /\.(ts|wgsl|css|html)$/.test(name))
      .map((name) => [name.replaceAll("\\", "/"), join(here, name)]),
    ...readdirSync(engine)
      .filter((name) => name.endsWith(".wgsl"))
      .map((name) => [`engine/${name}`, join(engine, name)]),
  ].sort((a, b) => (a[0] < b[0] ? -1 : 1));
  for (const [name, path] of listed) {
    hash.update(name).update("\0").update(readFileSync(path)).update("\0");
  }
  return hash.digest("hex");
}

mkdirSync(out, { recursive: true });
const bundled = await build({
  entryPoints: [join(here, "src/main.ts")],
  outfile: join(out, "viewer.js"),
  bundle: true,
  write: false,
  minify: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  loader: { ".wgsl": "text" },
  banner: { js: `/* vnca, Apache-2.0; sources ${digest()} */` },
});
// The library that writes films tells in each of them where it is from; its name will do.
const script = bundled.outputFiles[0].text.replaceAll(/https:[/][/]github[.]com[/]\w+[/]/g, "");
writeFileSync(join(out, "viewer.js"), script);
for (const name of ["index.html", "viewer.css"]) {
  writeFileSync(join(out, name), readFileSync(join(here, "src", name)));
}
