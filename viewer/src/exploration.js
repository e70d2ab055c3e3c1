// How the label set grew: acceptance by round, totals, failures by stage.

import { el, figure, numberOf } from "./dom.js";
import { count, percent, stageName } from "./format.js";
import { lineChart } from "./chart.js";
import { STAGES, SUCCESS } from "./palette.js";
import { stackedBar } from "./stacked.js";

const ROUND = "#2c4a6e";
const RUNNING = "#b9792b";

/** The exploration section's content; nothing without a trial. */
export function explorationSection(summary) {
  if (!summary?.trials) return [];
  const { trials, successes, demonstrations, failures = {}, rounds = [] } = summary;
  const fact = (value, name) => el("div", {}, el("dd", {}, value), el("dt", {}, name));
  const parts = STAGES.map(([stage, color]) => [stageName(stage), failures[stage] ?? 0, color]);
  const left = el("div", { class: "panel" },
    el("dl", { class: "totals" }, fact(count(trials), "trials"), fact(count(successes), "successes kept"),
      fact(percent(successes / trials), "acceptance"), demonstrations ? fact(count(demonstrations), "demonstrated tuples") : null),
    el("h3", {}, "Outcome of the trials"),
    stackedBar([["success", successes, SUCCESS], ...parts], trials),
    el("table", { class: "compact" }, el("tbody", {}, [["success", successes, SUCCESS], ...parts].map(([name, n, color]) => el("tr", { class: n ? null : "zero" },
      el("th", { scope: "row" }, el("span", { class: "swatch", style: { "--ink": color }, "aria-hidden": "true" }), name),
      el("td", { class: "number" }, count(n)), el("td", { class: "number quiet" }, percent(n / trials)))))));
  const charts = rounds.length > 1 && el("div", { class: "panel" }, el("h3", {}, "Acceptance by round"), acceptance(rounds));
  return [figure(numberOf("Figure"), "Exploration from the demonstrated contact tuples: contacts near those that worked are tried in rounds, " +
    "and each round draws from the successes of the rounds before.", el("div", { class: "charts halves" }, left, charts))];
}

function acceptance(rounds) {
  let trials = 0;
  let successes = 0;
  const each = [];
  const all = [];
  rounds.forEach((round, index) => {
    trials += round.trials;
    successes += round.successes;
    each.push([index + 1, round.trials ? (100 * round.successes) / round.trials : null]);
    all.push([index + 1, trials ? (100 * successes) / trials : null]);
  });
  return lineChart({ name: "Acceptance by round", xLabel: "round", yLabel: "acceptance (%)", yRange: [0, 100], whole: true, height: 290, series: [
    { name: "this round", color: ROUND, points: each, dots: true },
    { name: "all rounds so far", color: RUNNING, dash: "7 4", points: all },
  ] });
}
