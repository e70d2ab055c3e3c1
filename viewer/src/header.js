// The page's head: what this run was, in a title, a sentence and a line of facts.

import { el } from "./dom.js";
import { count, objectName, robotNames } from "./format.js";

/** Title, summary and the facts that name the run. */
export function header(data) {
  const { version, commit, seed } = data.provenance ?? {};
  const cells = data.cells ?? [];
  const distinct = (values) => [...new Set(values)].join(", ");
  const facts = [
    ["Object", distinct(cells.map((cell) => objectName(cell.object)))],
    ["Robots", distinct(cells.map((cell) => robotNames(cell.robots ?? [])))],
    ["Trials", cells.length ? count(cells.reduce((sum, cell) => sum + cell.trials, 0)) : ""],
    ["Seed", seed],
    ["Version", version],
    ["Commit", commit?.slice(0, 12)],
  ].filter(([, value]) => value);
  return el("header", {},
    el("p", { class: "kicker" }, "V-MAO · run report"),
    el("h1", {}, data.title || "Run report"),
    data.summary && el("p", { class: "lead" }, data.summary),
    facts.length > 0 && el("dl", { class: "facts" }, facts.map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value)))));
}

/** Links to the sections. */
export function contents(sections) {
  return el("nav", { "aria-label": "Sections" }, sections.map(([id, title]) => el("a", { href: `#${id}` }, title)));
}
