// A player: the scene, play and scrub controls, stages on the time line, camera buttons, forces. One rollout at a time.

import { PerspectiveCamera, Scene } from "three";
import { el } from "./dom.js";
import { fitView } from "./fit.js";
import { seconds, sentences } from "./format.js";
import { Orbit } from "./orbit.js";
import { RolloutScene } from "./scene.js";
import { timeline } from "./timeline.js";
import { unpackRollout } from "./unpack.js";

const FIELD = 28;
const ASPECT = 16 / 10; // as the style sheet has it
const TOLD_EVERY = 0.08; // s: while playing, clock and slider need not follow every picture, and each change of the page costs one
const SPEEDS = [0.25, 0.5, 1, 2, 4];
const NOTHING = new Scene();

export const KEYS = "Space plays and pauses, comma and full stop step a frame, Home and End jump, [ and ] change the trial, F shows or hides forces. " +
  "Drag or arrow keys turn, shift moves, + and − zoom, 0 resets.";

function outcomeBadge(outcome) {
  const good = outcome === "success";
  // The stage alone; what happened there is in the caption.
  const words = good ? "Success" : outcome ? `Failed: ${outcome.replace(/^failed:?\s*/i, "").split(":")[0].replaceAll("-", " ")}` : "";
  return words ? el("span", { class: `badge ${good ? "good" : "bad"}` }, words) : "";
}

/** A player of rollouts. `turn(step)` is asked for the next (+1) or the previous (−1) one, where there are several. */
export class Player {
  constructor(stage, turn = null) {
    this.turn = turn;
    this.stage = stage;
    [this.time, this.playing, this.speed, this.asked] = [0, false, 1, 0];
    this.shown = { arms: true, goal: true, contacts: true, forces: true };
    this.camera = new PerspectiveCamera(FIELD, 1, 0.01, 50);
    this.head = el("div", { class: "player-head" });
    this.canvas = el("canvas", { class: "view wide" });
    this.view = stage.add(this.canvas, () => this.draw());
    this.slider = el("input", { type: "range", min: 0, max: 0, step: "any", value: 0, "aria-label": "Time", oninput: () => this.seek(Number(this.slider.value)) });
    this.clock = el("span", { class: "clock" });
    this.play = el("button", { type: "button", class: "play", onclick: () => this.toggle() });
    this.stageLabel = el("div", { class: "stage-label" });
    this.ticks = el("div", { class: "ticks", "aria-hidden": "true" });
    this.list = el("ol", { class: "events", "aria-label": "Stages; each button jumps there" });
    this.readout = el("div", { class: "forces", "aria-live": "off" });
    this.words = el("p", { class: "what" });
    this.node = el("div", {}, this.head, el("div", { class: "player-row" }, this.frame(), this.list), this.words);
    this.toggle(false);
  }

  frame() {
    const camButton = (label, action) => el("button", { type: "button", onclick: () => { if (this.world) action(); } }, label);
    const fly = (azimuth, elevation) => this.orbit.fly(this.from(azimuth, elevation));
    const front = () => this.world.frame.front;
    const near = () => {
      const { work } = this.world.frame;
      this.orbit.fly({ azimuth: front() + 0.25, elevation: 0.24, distance: (1.5 * work.radius) / Math.sin((FIELD * Math.PI) / 360), target: work.middle.clone() });
    };
    const cameras = el("div", { class: "cameras", role: "group", "aria-label": "Camera" },
      camButton("Front", () => fly(front(), 0.18)), camButton("Side", () => fly(front() + Math.PI / 2, 0.18)),
      camButton("Top", () => fly(front(), Math.PI / 2)), camButton("Close", near), camButton("Reset", () => this.orbit.reset()));
    const speeds = el("select", { "aria-label": "Speed", onchange: () => { this.speed = Number(speeds.value); } },
      SPEEDS.map((value) => el("option", { value, selected: value === 1 }, `${value}×`)));
    const box = (label, name) => el("label", {}, el("input", { type: "checkbox", checked: true, "data-layer": name, onchange: (event) => {
      this.shown[name] = event.target.checked;
      this.showLayers();
    } }), ` ${label}`);
    const controls = el("div", { class: "controls" }, this.play, speeds, this.clock, el("span", { class: "spacer" }),
      box("Solid arms", "arms"), box("Goal", "goal"), box("Contacts", "contacts"), box("Forces", "forces"));
    const node = el("div", { class: "player" }, el("div", { class: "screen" }, this.canvas, this.stageLabel, cameras),
      el("div", { class: "timeline" }, this.slider, this.ticks), controls, this.readout);
    node.addEventListener("keydown", (event) => this.key(event));
    return node;
  }

  key(event) {
    const typed = event.target.matches("select, input[type=checkbox]");
    if (event.ctrlKey || event.metaKey || event.altKey || typed || !this.world) return;
    const step = this.world.motion.step;
    if (event.key === " " && !event.target.matches("button")) this.toggle();
    else if (event.key === ",") this.still(this.time - step);
    else if (event.key === ".") this.still(this.time + step);
    else if (event.key === "Home") this.still(0);
    else if (event.key === "End") this.still(this.world.motion.duration);
    else if (event.key === "[" && this.turn) this.turn(-1);
    else if (event.key === "]" && this.turn) this.turn(1);
    else if (event.key.toLowerCase() === "f") this.node.querySelector("[data-layer=forces]").click();
    else return;
    event.preventDefault();
  }

  from(azimuth, elevation) {
    return { azimuth, elevation, ...fitView(this.world.frame.points, { azimuth, elevation, field: (FIELD * Math.PI) / 180, aspect: ASPECT }) };
  }

  draw() {
    if (!this.world) return { scene: NOTHING, camera: this.camera };
    this.orbit.apply(this.camera);
    this.world.place(this.time);
    return { scene: this.world.scene, camera: this.camera };
  }

  /** Shows a rollout figure of the page's data, from its start. */
  async show({ title, caption, rollout }) {
    const asked = ++this.asked;
    this.toggle(false);
    this.head.replaceChildren(el("h3", {}, title || "Rollout"), outcomeBadge(rollout.outcome));
    const why = rollout.outcome === "success" ? "" : rollout.outcome.split(": ").slice(1).join(": ");
    this.words.textContent = sentences(caption || why);
    let unpacked;
    try {
      unpacked = await unpackRollout(rollout);
    } catch (error) {
      this.words.textContent = `This motion could not be read: ${error.message}`;
      return;
    }
    if (asked !== this.asked) return; // another one was asked for in the meantime
    const azimuth = this.orbit && this.world ? this.orbit.azimuth - this.world.frame.front : 0.42;
    const elevation = this.orbit?.elevation ?? 0.5;
    this.world?.dispose();
    this.world = new RolloutScene(unpacked);
    const { front } = this.world.frame;
    if (this.orbit) this.orbit.restart(this.from(front + 0.42, 0.5), this.from(front + azimuth, elevation));
    else {
      this.orbit = new Orbit(this.from(front + azimuth, elevation));
      this.orbit.attach(this.canvas);
      this.orbit.onChange(() => this.view.invalidate());
    }
    const { duration } = this.world.motion;
    this.canvas.setAttribute("aria-label", `${title || "Rollout"}. ${KEYS}`);
    this.slider.max = duration;
    this.line = timeline(unpacked.events ?? [], duration, (at) => this.seek(at));
    this.ticks.replaceChildren(...this.line.ticks);
    this.list.replaceChildren(...this.line.items);
    this.node.querySelector("[data-layer=forces]").disabled = !unpacked.arms;
    this.showLayers();
    this.seek(0);
    this.canvas.dataset.loaded = String(asked);
  }

  showLayers() {
    if (!this.world) return;
    this.world.setArms(this.shown.arms);
    this.world.ghost.visible = this.shown.goal;
    this.world.contactsOn = this.shown.contacts;
    this.world.forces.group.visible = this.shown.forces;
    this.seek(this.time);
  }

  seek(to) {
    const duration = this.world?.motion.duration ?? 0;
    this.time = Math.min(duration, Math.max(0, to));
    this.view.invalidate();
    const now = performance.now() / 1000;
    if (this.playing && now - (this.told ?? 0) < TOLD_EVERY) return;
    this.told = now;
    this.slider.value = String(this.time);
    this.slider.style.setProperty("--done", `${duration ? (100 * this.time) / duration : 0}%`);
    this.slider.setAttribute("aria-valuetext", seconds(this.time));
    this.clock.textContent = `${this.time.toFixed(2)} / ${duration.toFixed(2)}\u2009s`;
    this.stageLabel.textContent = this.line?.mark(this.time) ?? "";
    this.stageLabel.hidden = !this.stageLabel.textContent;
    if (this.world) this.readout.textContent = this.forceWords();
  }

  forceWords() {
    if (!this.world.rollout.arms) return "This motion was recorded without forces.";
    const newtons = (value) => value.toFixed(1);
    return this.world.forces.at(this.world.motion.frameAt(this.time)).map(({ pads, hand, up }, arm) =>
      `Arm ${arm}: pads press ${pads.map(newtons).join(" and ")}\u2009N, together ${newtons(hand)}\u2009N on the object, ${newtons(up).replace("-", "−")}\u2009N of it up.`).join("  ");
  }

  /** Pauses at a time. */
  still(at) {
    this.toggle(false);
    this.seek(at);
  }

  toggle(on = !this.playing) {
    const duration = this.world?.motion.duration ?? 0;
    this.playing = on && duration > 0;
    this.play.textContent = this.playing ? "Pause" : "Play";
    this.play.dataset.state = this.playing ? "playing" : "paused";
    if (this.world) this.world.coarse = this.playing && this.stage.coarse;
    if (!this.playing) {
      if (!this.world) return;
      this.world.shadow.needsUpdate = true;
      this.seek(this.time);
      return;
    }
    if (this.time >= duration) this.time = 0;
    this.view.animate((elapsed) => {
      if (!this.playing) return false;
      this.seek(this.time + elapsed * this.speed);
      if (this.time >= duration) this.still(duration);
      return this.playing;
    });
  }
}
