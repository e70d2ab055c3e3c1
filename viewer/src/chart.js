// A line chart in SVG: axes with round ticks, direct labels, and values under the pointer or the arrow keys.

import { el, svg } from "./dom.js";
import { isNumber, reading } from "./format.js";

const FONT = 12;

/** About `wanted` round numbers that cover [low, high]. */
export function ticks(low, high, wanted = 5) {
  const span = high - low || Math.abs(high) || 1;
  const rough = span / wanted;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
  const out = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++) out.push(Number((k * step).toPrecision(12)));
  return out;
}

function extent(values) {
  const finite = values.filter(isNumber);
  return finite.length ? [Math.min(...finite), Math.max(...finite)] : null;
}

/**
 * A responsive chart of `series`: [{name, color, dash?, points: [[x, y], …]}]; gaps where y is null.
 * `mark` draws a vertical line at an x; `whole` keeps the horizontal ticks at whole numbers;
 * `log` makes the vertical axis logarithmic and leaves gaps at values that have no logarithm.
 */
export function lineChart(given) {
  const options = given.log ? { ...given, series: given.series.map((s) => ({ ...s, points: s.points.map(([x, y]) => [x, isNumber(y) && y > 0 ? y : null]) })) } : given;
  const holder = el("div", { class: "chart" });
  const readout = el("div", { class: "readout", hidden: true });
  const draw = () => {
    const width = Math.max(220, Math.round(holder.clientWidth || options.width || 640));
    holder.replaceChildren(chartOf({ ...options, width }, readout), readout);
  };
  let last = 0;
  new ResizeObserver(() => {
    if (Math.abs(holder.clientWidth - last) < 1) return;
    last = holder.clientWidth;
    draw();
  }).observe(holder);
  return el("div", {}, key(options.series), holder);
}

function key(series) {
  return el("ul", { class: "legend" }, series.map(({ name, color, dash }) => el("li", {},
    svg("svg", { width: 26, height: 10, "aria-hidden": "true" },
      svg("line", { x1: 1, x2: 25, y1: 5, y2: 5, stroke: color, "stroke-width": 2.5, "stroke-dasharray": dash || null })), name)));
}

/** Round powers of ten that cover [low, high], at most about six. */
function decades(low, high) {
  const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
  const step = Math.max(1, Math.ceil((last - first) / 5));
  const out = [];
  for (let power = first; power <= last; power += step) out.push(10 ** power);
  return out;
}

function frameOf({ series, width, height = 240, yRange, xRange, whole, log }) {
  const xs = xRange ?? extent(series.flatMap((s) => s.points.map(([x]) => x))) ?? [0, 1];
  let ys = yRange ?? extent(series.flatMap((s) => s.points.map(([, y]) => y))) ?? [0, 1];
  if (log) {
    ys = [10 ** Math.floor(Math.log10(ys[0] || 0.1)), 10 ** Math.ceil(Math.log10(ys[1]) + 1e-9)];
    if (ys[0] === ys[1]) ys[1] *= 10;
  } else if (!yRange) {
    // Losses are read against zero unless they stay far from it.
    const pad = 0.06 * (ys[1] - ys[0] || Math.abs(ys[1]) || 1);
    ys = [ys[0] >= 0 && ys[0] < 0.5 * ys[1] ? 0 : ys[0] - pad, ys[1] + pad];
  }
  const yTicks = log ? decades(...ys) : ticks(ys[0], ys[1], height < 200 ? 3 : 5);
  const scale = log ? Math.log10 : (value) => value;
  const longest = Math.max(...yTicks.map((t) => tickText(t).length), 1);
  const box = { left: 30 + 6.6 * longest, right: width - 14, top: 12, bottom: height - 42 };
  const spanX = xs[1] - xs[0] || 1;
  const spanY = scale(ys[1]) - scale(ys[0]) || 1;
  const xTicks = ticks(xs[0], xs[1], Math.max(2, Math.round((box.right - box.left) / 90))).filter((t) => !whole || Number.isInteger(t));
  return {
    width, height, box, xTicks, yTicks,
    x: (value) => box.left + ((value - xs[0]) / spanX) * (box.right - box.left),
    y: (value) => box.bottom - ((scale(value) - scale(ys[0])) / spanY) * (box.bottom - box.top),
  };
}

/** A tick's words: powers of ten short, the rest as read. */
const tickText = (value) => (value > 0 && value < 1e-2 && Number.isInteger(Math.round(1e6 * Math.log10(value)) / 1e6)
  ? `10${String(Math.round(Math.log10(value))).replace("-", "⁻").replace(/\d/g, (digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit])}` : reading(value));

/** Whether a later series lies on this one and would hide it. */
const covered = (series, at) => series.slice(at + 1).some((later) => later.points.length === series[at].points.length && !later.dash === !series[at].dash &&
  later.points.every(([x, y], i) => x === series[at].points[i][0] && y === series[at].points[i][1]));

function path(points, frame) {
  let text = "";
  let pen = false;
  for (const [x, y] of points) {
    if (!isNumber(y) || !isNumber(x)) { pen = false; continue; }
    text += `${pen ? "L" : "M"}${frame.x(x).toFixed(1)} ${frame.y(y).toFixed(1)}`;
    pen = true;
  }
  return text;
}

function axes(frame, { xLabel, yLabel }) {
  const { box } = frame;
  const middle = (box.top + box.bottom) / 2;
  return [
    frame.yTicks.map((t) => svg("g", { class: "tick" },
      svg("line", { x1: box.left, x2: box.right, y1: frame.y(t), y2: frame.y(t) }),
      svg("text", { x: box.left - 8, y: frame.y(t) + 4, "text-anchor": "end" }, tickText(t)))),
    frame.xTicks.map((t) => svg("g", { class: "tick" },
      svg("line", { x1: frame.x(t), x2: frame.x(t), y1: box.bottom, y2: box.bottom + 5, class: "axis" }),
      svg("text", { x: frame.x(t), y: box.bottom + 19, "text-anchor": "middle" }, reading(t)))),
    svg("line", { class: "axis", x1: box.left, x2: box.right, y1: box.bottom, y2: box.bottom }),
    svg("text", { class: "label", x: (box.left + box.right) / 2, y: frame.height - 5, "text-anchor": "middle" }, xLabel),
    svg("text", { class: "label", transform: `translate(${FONT} ${middle}) rotate(-90)`, "text-anchor": "middle" }, yLabel),
  ];
}

function chartOf(options, readout) {
  const { series, mark, name } = options;
  const frame = frameOf(options);
  const { box } = frame;
  const cursor = svg("g", { class: "cursor", visibility: "hidden" });
  const root = svg("svg", { width: frame.width, height: frame.height, viewBox: `0 0 ${frame.width} ${frame.height}`,
    role: "img", tabindex: 0, "aria-label": `${name ?? options.yLabel}: ${series.map(summary).join("; ")}. Arrow keys read values.` },
    axes(frame, options),
    isNumber(mark) && svg("line", { class: "mark", x1: frame.x(mark), x2: frame.x(mark), y1: box.top, y2: box.bottom }),
    series.map((s, i) => svg("path", { d: path(s.points, frame), fill: "none", stroke: s.color, "stroke-width": covered(series, i) ? 6 : 2, "stroke-linejoin": "round",
      "stroke-dasharray": s.dash || null })),
    series.filter((s) => s.dots || s.points.length === 1).map((s) => s.points.filter(([, y]) => isNumber(y)).map(([x, y]) =>
      svg("circle", { cx: frame.x(x), cy: frame.y(y), r: 3, fill: s.color }))),
    cursor);
  attachCursor(root, cursor, readout, frame, options);
  return root;
}

function summary({ name, points }) {
  const finite = points.filter(([, y]) => isNumber(y));
  return finite.length ? `${name} from ${reading(finite[0][1])} to ${reading(finite.at(-1)[1])}` : `${name} without values`;
}

function attachCursor(root, cursor, readout, frame, { series, xLabel }) {
  const xs = [...new Set(series.flatMap((s) => s.points.map(([x]) => x)))].filter(isNumber).sort((a, b) => a - b);
  let at = -1;
  const hide = () => { cursor.setAttribute("visibility", "hidden"); readout.hidden = true; };
  const show = (index) => {
    at = Math.max(0, Math.min(xs.length - 1, index));
    const x = xs[at];
    const found = series.map((s) => [s, s.points.find(([px]) => px === x)?.[1]]).filter(([, y]) => isNumber(y));
    cursor.replaceChildren(
      svg("line", { x1: frame.x(x), x2: frame.x(x), y1: frame.box.top, y2: frame.box.bottom }),
      ...found.map(([s, y]) => svg("circle", { cx: frame.x(x), cy: frame.y(y), r: 4, fill: s.color })));
    cursor.setAttribute("visibility", "visible");
    readout.replaceChildren(el("div", { class: "quiet" }, `${xLabel} ${reading(x)}`),
      ...found.map(([s, y]) => el("div", {}, el("span", { class: "dot", style: { "--ink": s.color } }), `${s.name} `, el("b", {}, reading(y)))));
    readout.hidden = false;
    const left = frame.x(x) > frame.width / 2;
    readout.style.left = left ? "auto" : `${frame.x(x) + 12}px`;
    readout.style.right = left ? `${frame.width - frame.x(x) + 12}px` : "auto";
  };
  root.addEventListener("pointermove", (event) => {
    if (!xs.length) return;
    const x = event.clientX - root.getBoundingClientRect().left;
    show(xs.reduce((best, value, i) => Math.abs(frame.x(value) - x) < Math.abs(frame.x(xs[best]) - x) ? i : best, 0));
  });
  root.addEventListener("pointerleave", hide);
  root.addEventListener("blur", hide);
  root.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step || !xs.length) return;
    event.preventDefault();
    show(at < 0 ? (step > 0 ? 0 : xs.length - 1) : at + step);
  });
}
