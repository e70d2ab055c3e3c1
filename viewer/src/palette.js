// The report's colours, in one place. The two fingers, the methods and the failure stages each have their own family.

export const FINGERS = ["#17924a", "#2563d9"];
export const GOAL = "#2f9e5b";
export const PAD_FORCE = "#d9730d";
export const HAND_FORCE = "#7b2d8b";

const METHOD_COLORS = { vmao: "#2c4a6e", "best-of-k": "#5b8a72", top1: "#b9792b" };
const SPARE = ["#6b5b95", "#5a7d5a", "#8c4a4a", "#4d7f86"];

/** A method's colour; unknown methods take the spare ones in turn. */
export function methodColor(method, methods = []) {
  const strangers = methods.filter((name) => !(name in METHOD_COLORS));
  return METHOD_COLORS[method] ?? SPARE[Math.max(0, strangers.indexOf(method)) % SPARE.length];
}

/** Failure stages in the order of the program, each with its colour. */
export const STAGES = [
  ["no-contact", "#8a94a6"],
  ["unreachable", "#9a86b8"],
  ["no-plan", "#6c9cc4"],
  ["collision", "#bf5b52"],
  ["slip", "#dfa04a"],
  ["threshold", "#5f9f8f"],
  ["timeout", "#a08c6a"],
];
export const SUCCESS = "#dfe6ee";
