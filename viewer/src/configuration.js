// What it takes to make this page again: command, configuration, version, digest.

import { el } from "./dom.js";

function copyButton(text) {
  const button = el("button", { type: "button", class: "copy" }, "Copy");
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch {
      button.textContent = "Select and copy by hand";
    }
    setTimeout(() => { button.textContent = "Copy"; }, 1600);
  });
  return button;
}

/** Comments and section heads of TOML in their own shades. */
function tomlLines(text) {
  return text.split("\n").map((line) => {
    const kind = /^\s*#/.test(line) ? "comment" : /^\s*\[/.test(line) ? "head" : null;
    if (kind) return el("span", { class: kind }, `${line}\n`);
    const equals = line.indexOf("=");
    if (equals < 0) return `${line}\n`;
    return [el("span", { class: "key" }, line.slice(0, equals)), `${line.slice(equals)}\n`];
  });
}

/** The configuration section's content. */
export function configurationSection({ command, config, version, commit, seed, digest }) {
  const rows = [["Version", version], ["Commit", commit], ["Seed", seed], ["Data set digest (SHA-256)", digest]].filter(([, value]) => value);
  return [
    command && el("div", { class: "command" }, el("pre", {}, el("code", {}, command)), copyButton(command)),
    rows.length > 0 && el("table", { class: "compact provenance" }, el("tbody", {}, rows.map(([name, value]) =>
      el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, el("code", {}, value)))))),
    config && el("details", {}, el("summary", {}, `Configuration, fully resolved (${config.split("\n").length} lines of TOML)`),
      el("div", { class: "command" }, el("pre", { class: "toml", tabindex: 0 }, el("code", {}, tomlLines(config))), copyButton(config))),
  ].filter(Boolean);
}
