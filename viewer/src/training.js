// Loss curves, one row of charts per model.

import { el, figure, numberOf } from "./dom.js";
import { isNumber, methodName } from "./format.js";
import { lineChart } from "./chart.js";

const TRAIN = "#2c4a6e";
const VALIDATION = "#c2632f";
const KL = "#5b4f8f";
const BETA = "#8d97a5";

const column = (epochs, field) => epochs.map((epoch, index) => [index + 1, epoch[field]]);
const varies = (points) => points.some(([, y]) => isNumber(y) && y !== 0);

/** The training section's content; nothing without epochs. */
export function trainingSection(models) {
  const trained = models.filter((model) => model.epochs?.length);
  if (!trained.length) return [];
  const losses = trained.flatMap(({ epochs }) => epochs.flatMap((epoch) => [epoch.train_reconstruction, epoch.validation_reconstruction])).filter(isNumber);
  const least = Math.min(...losses);
  const span = Math.max(...losses) - least;
  // One scale for all models, so that their losses compare by eye; KL charts follow.
  const range = losses.length && span > 0 ? [Math.max(0, least - 0.08 * span), least + 1.06 * span] : undefined;
  const panels = trained.map((model) => modelCharts(model, range));
  const charts = [0, 1].flatMap((k) => panels.map((each) => each[k])).filter(Boolean);
  return [figure(numberOf("Figure"), "Loss over training epochs, all reconstruction losses on one scale, the KL divergence on a logarithmic one. The validation scenes are never trained on. " +
    "A model without a latent code has no KL divergence. Point at a curve, or focus it and use the arrow keys, to read values.",
    el("div", { class: "charts pairs" }, charts))];
}

function modelCharts({ model, epochs }, yRange) {
  const panel = (title, chart) => el("div", { class: "panel" }, el("h3", {}, methodName(model), el("span", {}, ` ${title}`)), chart);
  const reconstruction = panel("reconstruction", lineChart({
    name: `${methodName(model)} reconstruction loss`, xLabel: "epoch", yLabel: "reconstruction loss", whole: true, height: 240, yRange,
    series: [
      { name: "training", color: TRAIN, points: column(epochs, "train_reconstruction") },
      { name: "validation", color: VALIDATION, points: column(epochs, "validation_reconstruction") },
    ].filter(({ points }) => points.some(([, y]) => isNumber(y))),
  }));
  const kl = column(epochs, "kl");
  if (!varies(kl)) return [reconstruction];
  const beta = column(epochs, "beta");
  const weighted = epochs.map(({ kl: value, beta: weight }, i) => [i + 1, isNumber(value) && isNumber(weight) ? value * weight : null]);
  const series = [{ name: "KL", color: KL, points: kl }];
  if (varies(beta) && beta.some(([, y]) => y !== 1)) series.push({ name: "weighted by β", color: BETA, dash: "5 4", points: weighted });
  return [reconstruction, panel("KL divergence", lineChart({
    name: `${methodName(model)} KL divergence`, xLabel: "epoch", yLabel: "KL divergence (nats)", whole: true, height: 240, log: true, series,
  }))];
}
