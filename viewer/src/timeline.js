// The stages of a trial as ticks under the slider and as a list beside the picture.

import { el } from "./dom.js";
import { seconds } from "./format.js";

/** Ticks, list and a function that marks the present stage and returns its words; `seek(time)` is called by the list. */
export function timeline(events, duration, seek) {
  const ordered = events.filter(({ time }) => Number.isFinite(time)).sort((a, b) => a.time - b.time);
  const ticks = ordered.map(({ time, label }) =>
    el("i", { title: `${seconds(time)} ${label}`, style: { left: `${duration ? Math.min(100, (100 * time) / duration) : 0}%` } }));
  const items = ordered.map(({ time, label }) => el("li", {}, el("button", { type: "button", onclick: () => seek(time) },
    el("span", { class: "when" }, time.toFixed(1)), el("span", {}, label))));
  let current = -1;
  // Arms that move in parallel begin stages at one time.
  const together = (i, now) => now >= 0 && i <= now && ordered[now].time - ordered[i].time < 1e-6;
  const mark = (time) => {
    const now = ordered.findLastIndex((event) => event.time <= time + 1e-6);
    if (now !== current) {
      items.forEach((item, i) => {
        item.classList.toggle("now", together(i, now));
        item.classList.toggle("past", i < now && !together(i, now));
      });
      current = now;
      const list = items[now]?.parentElement;
      if (list) list.scrollTop = items[now].offsetTop - list.offsetTop - list.clientHeight / 2 + items[now].offsetHeight;
    }
    return ordered.filter((_, i) => together(i, now)).map(({ label }) => label).join(" · ");
  };
  return { ticks, items, mark };
}
