// Builds the page: one section per kind of result; a kind without data leaves no trace.

import { pageData } from "./data.js";
import { el } from "./dom.js";
import { configurationSection } from "./configuration.js";
import { createStage } from "./stage.js";
import { explorationSection } from "./exploration.js";
import { header, contents } from "./header.js";
import { mapsSection } from "./maps.js";
import { resultsSection } from "./results.js";
import { rolloutsSection } from "./rollouts.js";
import { trainingSection } from "./training.js";

async function main() {
  const page = document.getElementById("page");
  const data = await pageData();
  const stage = createStage();
  const sections = [
    ["results", "Results", () => resultsSection(data.cells ?? [])],
    ["contact-maps", "Contact maps", () => mapsSection(data.contact_maps ?? [], stage)],
    ["rollouts", "Rollouts", () => rolloutsSection(data, stage)],
    ["training", "Training", () => trainingSection(data.training ?? [])],
    ["exploration", "Exploration", () => explorationSection(data.exploration)],
    ["configuration", "Configuration", () => configurationSection(data.provenance ?? {})],
  ];
  const made = [];
  for (const [id, title, build] of sections) {
    let body;
    try {
      body = build();
    } catch (error) {
      console.error(`${title}: ${error.stack ?? error}`);
      body = [el("p", { class: "notice" }, `This section could not be drawn: ${error.message}`)];
    }
    if (body?.length) made.push([id, title, body]);
  }
  page.replaceChildren(
    header(data),
    contents(made.map(([id, title]) => [id, title])),
    ...made.map(([id, title, body]) => el("section", { id, "aria-labelledby": `${id}-title` }, el("h2", { id: `${id}-title` }, title), body)),
  );
  stage?.start();
}

main().catch((error) => {
  console.error(error);
  document.getElementById("page").replaceChildren(el("p", { class: "notice" }, `This report could not be read: ${error.message}`));
});
