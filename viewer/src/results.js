// Success by cell with Wilson intervals, failures by stage, and success over the threshold's scale.

import { el, figure, numberOf } from "./dom.js";
import { count, isNumber, methodName, objectName, orderName, percent, robotNames, stageName } from "./format.js";
import { lineChart } from "./chart.js";
import { methodColor, STAGES, SUCCESS } from "./palette.js";
import { stackedBar } from "./stacked.js";

const TICKS = [0, 0.25, 0.5, 0.75, 1];
const clamp = (value) => Math.min(1, Math.max(0, isNumber(value) ? value : 0));

/** The results section's content; nothing without cells. */
export function resultsSection(cells) {
  if (!cells.length) return [];
  const methods = [...new Set(cells.map((cell) => cell.method))];
  return [successFigure(cells, methods), failureFigure(cells, methods), goalsFigure(cells, methods), thresholdFigure(cells, methods)];
}

/** Goals that no choice of contacts can meet, apart from failures of the method. */
function goalsFigure(cells, methods) {
  const known = cells.filter((cell) => cell.goals);
  if (!known.length) return null;
  const table = el("table", { class: "goals" },
    el("thead", {}, el("tr", {}, ["Grasp order", "Method"].map((name) => el("th", { scope: "col" }, name)),
      ["within reach", "proven out of reach", "undecided", "drawn anew", "successes where not proven out of reach"].map((name) => el("th", { scope: "col", class: "number" }, name)))),
    groupedRows(known, 7, (cell, before) => {
      const { reachable, unreachable, unknown, redraws } = cell.goals;
      const open = cell.trials - unreachable;
      return el("tr", { class: before && before.order !== cell.order ? "break" : null }, cellNames(cell, before, methods),
        [reachable, unreachable, unknown, redraws].map((n) => el("td", { class: n ? "number" : "number zero" }, count(n))),
        el("td", { class: "number strong" }, open > 0 ? `${count(cell.successes)} of ${count(open)}` : "–"));
    }));
  return figure(numberOf("Table"), "Goals by what was known of them before anything moved: within reach, proven out of reach for every grasp looked at, or neither found. " +
    "Goals out of reach count as failures in the tables above; the last column leaves out those that are proven.", el("div", { class: "scroll" }, table));
}

const groupName = (cell) => `${objectName(cell.object)} · ${robotNames(cell.robots ?? [])}`;

/** Rows of a table with cells grouped by object and robots; a group's name is shown only when there are several. */
function groupedRows(cells, columns, row) {
  const groups = [...new Set(cells.map(groupName))];
  return groups.map((group) => el("tbody", {},
    groups.length > 1 && el("tr", { class: "group" }, el("th", { colspan: columns, scope: "rowgroup" }, group)),
    cells.filter((cell) => groupName(cell) === group).map((cell, index, all) => row(cell, all[index - 1]))));
}

/** The order's name where it changes, and the method with its colour. */
function cellNames(cell, before, methods) {
  const same = before && before.order === cell.order;
  return [
    el("th", { scope: "row", class: same ? "repeat" : "first" }, orderName(cell.order)),
    el("td", { class: "method" }, el("span", { class: "dot", style: { "--ink": methodColor(cell.method, methods) }, "aria-hidden": "true" }),
      methodName(cell.method)),
  ];
}

const interval = (bounds) => (bounds?.every(isNumber) ? `${percent(bounds[0])} – ${percent(bounds[1])}` : "–");

function intervalBar(cell, methods) {
  const [low, high] = (cell.wilson95 ?? [0, 1]).map(clamp);
  const at = (value) => `${100 * value}%`;
  return el("div", { class: "interval", style: { "--ink": methodColor(cell.method, methods) }, role: "img",
    "aria-label": `${percent(cell.rate)}, 95 % interval ${percent(low)} to ${percent(high)}` },
    TICKS.map((tick) => el("i", { class: "grid", style: { left: at(tick) } })),
    isNumber(cell.rate) && [el("i", { class: "fill", style: { width: at(clamp(cell.rate)) } }),
    el("i", { class: "whisker", style: { left: at(low), width: at(Math.max(0, high - low)) } }),
    el("i", { class: "mean", style: { left: at(clamp(cell.rate)) } })]);
}

function successFigure(cells, methods) {
  const axis = el("div", { class: "interval axis", "aria-hidden": "true" },
    TICKS.map((tick) => el("span", { style: { left: `${100 * tick}%` } }, `${100 * tick}`)));
  const table = el("table", { class: "success" },
    el("thead", {}, el("tr", {},
      el("th", { scope: "col" }, "Grasp order"), el("th", { scope: "col" }, "Method"),
      el("th", { scope: "col", class: "number" }, "Trials"), el("th", { scope: "col", class: "number" }, "Successes"),
      el("th", { scope: "col", class: "number" }, "Rate"),
      el("th", { scope: "col", class: "plot" }, el("span", { class: "sr" }, "Rate and interval, drawn, in percent"), axis),
      el("th", { scope: "col", class: "number" }, "95 % interval"))),
    groupedRows(cells, 7, (cell, before) => el("tr", { class: before && before.order !== cell.order ? "break" : null },
      cellNames(cell, before, methods),
      el("td", { class: "number" }, count(cell.trials)), el("td", { class: "number" }, count(cell.successes)),
      el("td", { class: "number strong" }, percent(cell.rate)),
      el("td", { class: "plot" }, intervalBar(cell, methods)),
      el("td", { class: "number quiet" }, interval(cell.wilson95)))));
  return figure(numberOf("Table"), "Share of trials that met the goal, by grasp order and method. Line: Wilson score interval at 95 %. " +
    "Methods within one order are tried on the same scenes and goals.", el("div", { class: "scroll" }, table));
}

function failureFigure(cells, methods) {
  const failures = (cell) => cell.failures ?? {};
  const segments = (cell) => [["success", cell.successes, SUCCESS], ...STAGES.map(([stage, color]) => [stageName(stage), failures(cell)[stage] ?? 0, color])];
  const table = el("table", { class: "failures" },
    el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Grasp order"), el("th", { scope: "col" }, "Method"),
      el("th", { scope: "col", class: "plot" }, el("span", { class: "swatch", style: { "--ink": SUCCESS }, "aria-hidden": "true" }), "success and failures, share of trials"),
      STAGES.map(([stage, color]) => el("th", { scope: "col", class: "number stage" }, el("span", { class: "swatch", style: { "--ink": color }, "aria-hidden": "true" }), stageName(stage))),
      el("th", { scope: "col", class: "number" }, "all failed"))),
    groupedRows(cells, 4 + STAGES.length, (cell, before) => el("tr", { class: before && before.order !== cell.order ? "break" : null },
      cellNames(cell, before, methods),
      el("td", { class: "plot" }, stackedBar(segments(cell), cell.trials)),
      STAGES.map(([stage]) => {
        const n = failures(cell)[stage] ?? 0;
        return el("td", { class: n ? "number" : "number zero" }, count(n));
      }),
      el("td", { class: "number strong" }, count(Math.max(0, cell.trials - cell.successes))))));
  return figure(numberOf("Table"), "Failed trials by the first stage that failed. A bar stands for all trials of its row; its pale part is the successes.",
    el("div", { class: "scroll" }, table));
}

function thresholdFigure(cells, methods) {
  const curves = cells.filter((cell) => cell.threshold_curve?.length > 1);
  if (!curves.length) return null;
  const orders = [...new Set(curves.map((cell) => cell.order))];
  const several = new Set(curves.map(groupName)).size > 1;
  const dashes = ["", "7 4", "2 3"];
  const series = curves.map((cell) => ({
    name: `${several ? `${groupName(cell)}, ` : ""}${orderName(cell.order)} · ${methodName(cell.method)}`,
    color: methodColor(cell.method, methods),
    dash: dashes[orders.indexOf(cell.order) % dashes.length],
    points: cell.threshold_curve.map(({ scale, rate }) => [scale, isNumber(rate) ? 100 * rate : null]),
  }));
  return figure(numberOf("Figure"), "Success rate if all thresholds (position, angle, joint) are scaled by the factor on the horizontal axis. " +
    "The factor 1 is the table above; no single threshold decides the comparison.",
    lineChart({ series, xLabel: "threshold scale factor", yLabel: "success rate (%)", yRange: [0, 100], height: 300, mark: 1, name: "Success against threshold" }));
}
