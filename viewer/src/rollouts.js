// Playable rollouts: the scene, play and scrub controls, stages on the time line, camera buttons.

import { PerspectiveCamera } from "three";
import { el, figure, numberOf } from "./dom.js";
import { fitView } from "./fit.js";
import { seconds, sentences } from "./format.js";
import { Orbit } from "./orbit.js";
import { RolloutScene } from "./scene.js";
import { NO_WEBGL } from "./stage.js";

const FIELD = 28;
const ASPECT = 16 / 10; // as the style sheet has it
const SPEEDS = [0.25, 0.5, 1, 2, 4];

/** The rollout section's content; nothing without frames. */
export function rolloutsSection(rollouts, stage) {
  return rollouts.filter(({ rollout }) => rollout?.bodies?.length && rollout.poses).map((entry) => player(entry, numberOf("Figure"), stage));
}

function outcomeBadge(outcome) {
  const good = outcome === "success";
  // The stage alone; what happened there is in the caption.
  const words = good ? "Success" : outcome ? `Failed: ${outcome.replace(/^failed:?\s*/i, "").split(":")[0].replaceAll("-", " ")}` : "";
  return words && el("span", { class: `badge ${good ? "good" : "bad"}` }, words);
}

function player({ title, caption, rollout }, name, stage) {
  const head = el("div", { class: "player-head" }, el("h3", {}, title || "Rollout"), outcomeBadge(rollout.outcome));
  const words = `${sentences(caption)}The goal is the green ghost; small balls are the asked contact points, finger 1 green and finger 2 blue.`;
  if (!stage) return figure(name, words, head, el("p", { class: "notice" }, NO_WEBGL));

  const world = new RolloutScene(rollout);
  const { duration } = world.motion;
  const camera = new PerspectiveCamera(FIELD, 1, 0.01, 50);
  const { points, front, work } = world.frame;
  const from = (azimuth, elevation) => ({ azimuth, elevation, ...fitView(points, { azimuth, elevation, field: (FIELD * Math.PI) / 180, aspect: ASPECT }) });
  const orbit = new Orbit(from(front + 0.42, 0.5));
  const canvas = el("canvas", { class: "view wide", "aria-label": `${title || "Rollout"}. Space plays and pauses. Arrow keys turn, plus and minus zoom, 0 resets.` });
  orbit.attach(canvas);
  const view = stage.add(canvas, () => {
    orbit.apply(camera);
    world.place(time);
    return { scene: world.scene, camera };
  });
  orbit.onChange(() => view.invalidate());

  let time = 0;
  let playing = false;
  let speed = 1;
  const play = el("button", { type: "button", class: "play", onclick: () => toggle() });
  const slider = el("input", { type: "range", min: 0, max: duration, step: "any", value: 0, "aria-label": "Time", oninput: () => seek(Number(slider.value)) });
  const clock = el("span", { class: "clock" });
  const stageLabel = el("div", { class: "stage-label", "aria-live": "off" });
  const events = timeline(rollout.events ?? [], duration, (at) => seek(at));

  function show() {
    slider.value = String(time);
    slider.style.setProperty("--done", `${duration ? (100 * time) / duration : 0}%`);
    slider.setAttribute("aria-valuetext", seconds(time));
    clock.textContent = `${time.toFixed(2)} / ${duration.toFixed(2)}\u2009s`;
    stageLabel.textContent = events.mark(time);
    stageLabel.hidden = !stageLabel.textContent;
  }
  function seek(to) {
    time = Math.min(duration, Math.max(0, to));
    show();
    view.invalidate();
  }
  function toggle(on = !playing) {
    playing = on && duration > 0;
    play.textContent = playing ? "Pause" : "Play";
    play.dataset.state = playing ? "playing" : "paused";
    if (!playing) return;
    if (time >= duration) time = 0;
    view.animate((elapsed) => {
      if (!playing) return false;
      time = Math.min(duration, time + elapsed * speed);
      show();
      if (time >= duration) toggle(false);
      return playing;
    });
  }

  const fly = (azimuth, elevation) => orbit.fly(from(azimuth, elevation));
  const near = () => orbit.fly({ azimuth: front + 0.25, elevation: 0.24, distance: (1.5 * work.radius) / Math.sin((FIELD * Math.PI) / 360), target: work.middle.clone() });
  const camButton = (label, action) => el("button", { type: "button", onclick: action }, label);
  const cameras = el("div", { class: "cameras", role: "group", "aria-label": "Camera" },
    camButton("Front", () => fly(front, 0.18)), camButton("Side", () => fly(front + Math.PI / 2, 0.18)),
    camButton("Top", () => fly(front, Math.PI / 2)), camButton("Close", near), camButton("Reset", () => orbit.reset()));
  const speeds = el("select", { "aria-label": "Speed", onchange: () => { speed = Number(speeds.value); } },
    SPEEDS.map((value) => el("option", { value, selected: value === 1 }, `${value}×`)));
  const box = (label, change) => el("label", {}, el("input", { type: "checkbox", checked: true, onchange: (event) => { change(event.target.checked); view.invalidate(); } }), ` ${label}`);
  const controls = el("div", { class: "controls" }, play, speeds, clock, el("span", { class: "spacer" }),
    box("Solid arms", (on) => world.setArms(on)), box("Goal", (on) => { world.ghost.visible = on; }), box("Contacts", (on) => { world.contactsOn = on; }));

  const node = el("div", { class: "player" },
    el("div", { class: "screen" }, canvas, stageLabel, cameras),
    el("div", { class: "timeline" }, slider, events.ticks), controls);
  node.addEventListener("keydown", (event) => {
    if (event.key !== " " || event.target.matches("button, select, input[type=checkbox]")) return;
    event.preventDefault();
    toggle();
  });
  toggle(false);
  show();
  return figure(name, words, head, el("div", { class: events.list ? "player-row" : "" }, node, events.list));
}

/** The stages as ticks under the slider and as a list beside the picture. */
function timeline(events, duration, seek) {
  const ordered = events.filter(({ time }) => Number.isFinite(time)).sort((a, b) => a.time - b.time);
  const ticks = el("div", { class: "ticks", "aria-hidden": "true" }, ordered.map(({ time, label }) =>
    el("i", { title: `${seconds(time)} ${label}`, style: { left: `${duration ? Math.min(100, (100 * time) / duration) : 0}%` } })));
  const items = ordered.map(({ time, label }) => el("li", {}, el("button", { type: "button", onclick: () => seek(time) },
    el("span", { class: "when" }, time.toFixed(1)), el("span", {}, label))));
  const list = ordered.length ? el("ol", { class: "events", "aria-label": "Stages; each button jumps there" }, items) : null;
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
      if (list && items[now]) list.scrollTop = items[now].offsetTop - list.offsetTop - list.clientHeight / 2 + items[now].offsetHeight;
    }
    return ordered.filter((_, i) => together(i, now)).map(({ label }) => label).join(" · ");
  };
  return { ticks, list, mark };
}
