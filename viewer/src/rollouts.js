// The trials that can be played: one player, a list to choose from, and the failure classes with an example of each.

import { el, figure, legend, numberOf } from "./dom.js";
import { count, methodName, orderName, stageName } from "./format.js";
import { FINGERS, GOAL, HAND_FORCE, PAD_FORCE, STAGES } from "./palette.js";
import { KEYS, Player } from "./player.js";
import { NO_WEBGL } from "./stage.js";

const CAPTION = "The goal is the green ghost; small balls are the asked contact points, finger 1 green and finger 2 blue. Orange arrows are the forces of " +
  "the pads on the object, purple ones what both pads of a hand exert together; 10\u2009N are 4\u2009cm. ";

/** The rollout section's content; nothing without motions. */
export function rolloutsSection({ rollouts, rollouts_note: note, failure_classes: classes }, stage) {
  const all = (rollouts ?? []).filter(({ rollout }) => rollout?.bodies && rollout.frames);
  const explained = (show) => (classes?.length ? [failureClasses(classes, rollouts, show)] : []);
  if (!all.length) return explained(null);
  const name = numberOf("Figure");
  if (!stage) return [figure(name, CAPTION, el("p", { class: "notice" }, NO_WEBGL)), ...explained(null)];
  const chooser = new Chooser(all, (entry) => player.show(entry));
  const player = new Player(stage, (step) => chooser.turn(step));
  const body = figure(name, CAPTION, note && el("p", { class: "quiet" }, note), all.length > 1 && chooser.node, player.node,
    legend([["contact of finger 1", FINGERS[0]], ["contact of finger 2", FINGERS[1]], ["goal", GOAL], ["force of a pad", PAD_FORCE], ["force of a hand", HAND_FORCE]]),
    el("p", { class: "hint keys" }, `Keys: ${KEYS}`));
  chooser.choose(0);
  const show = async (entry) => {
    body.scrollIntoView({ block: "start" });
    player.canvas.focus({ preventScroll: true });
    await chooser.chooseEntry(entry);
    player.toggle(true);
  };
  return [body, ...explained(show)];
}

/** Two lists: which kind of trials, and which of them. */
class Chooser {
  constructor(all, show) {
    [this.all, this.show] = [all, show];
    const outcomes = [...new Set(all.map(({ trial }) => (trial ? trial.failed ?? "success" : "")))].filter(Boolean);
    const named = (value) => (value === "success" ? "successes" : `failed: ${stageName(value)}`);
    this.kinds = el("select", { "aria-label": "Which trials", onchange: () => { this.list(); this.choose(0); } },
      el("option", { value: "" }, `all (${all.length})`),
      outcomes.map((value) => el("option", { value }, `${named(value)} (${all.filter((entry) => this.kind(entry) === value).length})`)));
    this.trials = el("select", { "aria-label": "Trial", class: "trials", onchange: () => this.choose(this.trials.selectedIndex) });
    const step = (label, by) => el("button", { type: "button", "aria-label": label, onclick: () => this.turn(by) }, by < 0 ? "‹ Previous" : "Next ›");
    this.node = el("div", { class: "controls chooser" }, el("label", {}, "Show ", this.kinds), el("label", {}, "Trial ", this.trials),
      step("Previous trial", -1), step("Next trial", 1));
    this.list();
  }

  kind({ trial }) { return trial ? trial.failed ?? "success" : ""; }

  list() {
    const wanted = this.kinds.value;
    this.listed = this.all.filter((entry) => !wanted || this.kind(entry) === wanted);
    const words = ({ trial, title }) => (trial ? `${trial.index} · ${orderName(trial.order)} · ${methodName(trial.method)} · ${trial.failed ? `failed: ${stageName(trial.failed)}` : "success"}` : title);
    this.trials.replaceChildren(...this.listed.map((entry) => el("option", {}, words(entry))));
  }

  choose(at) {
    if (!this.listed[at]) return null;
    this.trials.selectedIndex = at;
    return this.show(this.listed[at]);
  }

  chooseEntry(entry) {
    this.kinds.value = "";
    this.list();
    return this.choose(this.listed.indexOf(entry));
  }

  /** The next or the previous of the list, round its ends. */
  turn(step) { this.choose((this.trials.selectedIndex + step + this.listed.length) % this.listed.length); }
}

function failureClasses(classes, rollouts, show) {
  const colors = new Map(STAGES);
  const card = ({ stage, count: n, meaning, remedy, example }) => {
    const entry = rollouts?.[example];
    return el("div", { class: "failure" },
      el("h4", {}, el("span", { class: "swatch", style: { "--ink": colors.get(stage) }, "aria-hidden": "true" }), `${stageName(stage)} `,
        el("span", { class: "quiet" }, `${count(n)} trial${n === 1 ? "" : "s"}`)),
      el("p", {}, meaning), el("p", {}, el("b", {}, "What would help. "), remedy),
      entry && show && el("button", { type: "button", class: "example", onclick: () => show(entry) }, `Play an example: trial ${entry.trial.index}`));
  };
  return el("div", { class: "failure-classes" }, el("h3", {}, "Why trials failed"), classes.map(card));
}
