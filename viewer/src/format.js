// Numbers and names as a reader wants them.

/** Whether a value read from the data is a usable number (NaN and infinities arrive as null). */
export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

/** 0.8351 → "83.5 %"; whole when a digit would say nothing. */
export function percent(value, digits = 1) {
  return isNumber(value) ? `${(100 * value).toFixed(digits)}\u2009%` : "–";
}

/** 12345 → "12 345". */
export function count(value) {
  return isNumber(value) ? String(value).replace(/\B(?=(\d{3})+(?!\d))/g, "\u2009") : "–";
}

/** A value for a readout: four significant digits at most. */
export function reading(value) {
  if (!isNumber(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2).replace("-", "−");
  return String(Number(value.toPrecision(4))).replace("-", "−");
}

/** Words from the data as whole sentences with a space after them: a capital first, a full stop last. */
export function sentences(text) {
  const words = (text ?? "").trim().replace(/(^|[.!?]\s+)(\p{Ll})/gu, (_, before, letter) => before + letter.toUpperCase());
  return words && `${words}${/[.!?…]$/.test(words) ? "" : "."} `;
}

/** Seconds with two digits. */
export const seconds = (value) => `${value.toFixed(2)}\u2009s`;

const METHODS = { vmao: "V-MAO", "best-of-k": "V-MAO best-of-K", top1: "Top-1", uniform: "Uniform", demonstrations: "Demonstrations" };
const ORDERS = { parallel: "Parallel", "sequential-parallel": "Sequential-parallel", sequential: "Sequential" };
const ROBOTS = { panda: "Panda", sawyer: "Sawyer" };

const sentence = (name) => name.charAt(0).toUpperCase() + name.slice(1).replaceAll("-", " ");

export const methodName = (name) => METHODS[name] ?? name;
export const orderName = (name) => ORDERS[name] ?? sentence(name);
export const objectName = (name) => sentence(name);

/** ["panda", "panda"] → "2 × Panda". */
export function robotNames(robots) {
  const counts = new Map();
  for (const robot of robots) counts.set(robot, (counts.get(robot) ?? 0) + 1);
  return [...counts].map(([robot, n]) => `${n}\u2009×\u2009${ROBOTS[robot] ?? robot}`).join(" + ");
}

/** "no-contact" → "no contact". */
export const stageName = (stage) => stage.replaceAll("-", " ");
