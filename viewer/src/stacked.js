// A stacked bar: parts of a whole, each with a tooltip.

import { el } from "./dom.js";
import { percent } from "./format.js";

/** A bar of [name, count, colour] segments whose full length is `total`. */
export function stackedBar(segments, total) {
  const shown = segments.filter(([, n]) => n > 0);
  const words = shown.map(([name, n]) => `${name} ${n}`).join(", ");
  return el("div", { class: "stacked", role: "img", "aria-label": `${words || "nothing"} of ${total}` },
    shown.map(([name, n, color]) => el("i", { title: `${name}: ${n} of ${total} (${percent(n / total)})`,
      style: { "flex-grow": String(n), background: color } })));
}
