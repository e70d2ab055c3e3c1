// Contact maps for several latent codes: a row of views with one shared camera, and the chosen one at large.

import { PerspectiveCamera } from "three";
import { unpackBytes, unpackFloats } from "./data.js";
import { el, figure, numberOf, svg } from "./dom.js";
import { isNumber, sentences } from "./format.js";
import { blend, cloudBase, cloudFrame, mapScene } from "./cloud.js";
import { Orbit } from "./orbit.js";
import { FINGERS } from "./palette.js";
import { KEYS as PLAYER_KEYS, Player } from "./player.js";
import { NO_WEBGL } from "./stage.js";

const FIELD = 30;
const GREY = [0.82, 0.82, 0.8];

/** The contact-map section's content, one scene at a time; nothing without maps. */
export function mapsSection(figures, stage) {
  const scenes = figures.filter((entry) => entry.maps?.length);
  if (!scenes.length) return [];
  const name = numberOf("Figure");
  const made = new Map();
  const place = el("div", {});
  // A scene's views are made when it is first chosen.
  const choose = (at) => {
    if (!made.has(at)) made.set(at, mapsFigure(scenes[at], name, stage));
    place.replaceChildren(made.get(at));
  };
  const select = el("select", { "aria-label": "Scene", onchange: () => choose(select.selectedIndex) }, scenes.map(({ title }, i) => el("option", {}, title || `Scene ${i + 1}`)));
  choose(0);
  return [scenes.length > 1 && el("div", { class: "controls chooser" }, el("label", {}, "Scene ", select)), place].filter(Boolean);
}

const caption = (entry) => `${sentences(entry.caption)}Contact maps of one scene for ${entry.maps.length} latent codes: finger 1 in green, ` +
  "finger 2 in blue, shaded by probability relative to each finger's maximum; a ball marks the point that is grasped. " +
  "Where the probability is low the object keeps a pale shade of its own colour; table and arms are paler still. All views share one camera.";

function mapsFigure(entry, name, stage) {
  const title = entry.title && el("h3", {}, entry.title);
  if (!stage) return figure(name, caption(entry), title, el("p", { class: "notice" }, NO_WEBGL));

  const points = unpackFloats(entry.points);
  const kinds = unpackBytes(entry.labels);
  const frame = cloudFrame(points, kinds);
  const base = cloudBase(points, unpackBytes(entry.colors), kinds);
  const maps = entry.maps.map((map) => ({ latent: map.latent ?? [], ...mapScene(base, frame, unpackFloats(map.finger1), unpackFloats(map.finger2), map.peaks) }));
  const distance = (1.04 * frame.radius) / Math.sin((FIELD * Math.PI) / 360);
  const orbit = new Orbit({ target: frame.middle, distance, azimuth: -Math.PI / 3, elevation: 0.82 });
  const views = [];
  orbit.onChange(() => views.forEach((view) => view.invalidate()));

  const view = (canvas, shown) => {
    const camera = new PerspectiveCamera(FIELD, 1, 0.01, 10);
    orbit.attach(canvas);
    views.push(stage.add(canvas, (height) => {
      const { scene, material } = shown();
      orbit.apply(camera);
      material.uniforms.height.value = height;
      material.uniformsNeedUpdate = true;
      return { scene, camera };
    }));
  };

  let chosen = 0;
  const codeName = (i) => `Code ${i + 1}`;
  const large = el("canvas", { class: "view", "aria-label": `Large contact map of the chosen code. ${KEYS}` });
  const facts = el("div", { class: "map-facts", "aria-live": "polite" });
  const panels = maps.map((map, i) => {
    const canvas = el("canvas", { class: "view", "aria-label": `Contact map of latent code ${i + 1}. ${KEYS} Enter shows it large.` });
    const button = el("button", { type: "button", class: "code", onclick: () => choose(i) }, el("span", {}, codeName(i)), latentBars(map.latent, 112, 22));
    let down = null;
    canvas.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4) choose(i);
    });
    canvas.addEventListener("keydown", (event) => { if (event.key === "Enter") choose(i); });
    view(canvas, () => map);
    return { node: el("div", { class: "map" }, canvas, button), button };
  });
  view(large, () => maps[chosen]);
  const player = entry.maps.some(({ executed }) => executed) ? new Player(stage, (step) => choose((chosen + step + maps.length) % maps.length)) : null;

  function choose(i) {
    chosen = i;
    panels.forEach(({ node, button }, k) => {
      node.classList.toggle("chosen", k === i);
      button.setAttribute("aria-pressed", String(k === i));
    });
    facts.replaceChildren(...mapFacts(maps[i], codeName(i)));
    views.at(-1).invalidate();
    if (player && entry.maps[i].executed) player.show(entry.maps[i].executed);
  }
  choose(0);

  const peaks = el("input", { type: "checkbox", checked: true, onchange: (event) => {
    for (const map of maps) map.balls.visible = event.target.checked;
    views.forEach((each) => each.invalidate());
  } });
  const aside = el("div", { class: "map-side" }, facts, blendLegend(),
    el("div", { class: "controls" }, el("label", {}, peaks, " Points that are grasped"),
      el("button", { type: "button", onclick: () => orbit.reset() }, "Reset view")),
    el("p", { class: "hint" }, "Drag to turn, shift-drag to move, scroll to zoom once focused, arrow keys to turn, + and − to zoom, 0 to reset."));
  return figure(name, caption(entry), title, el("div", { class: "five", style: { "--views": String(Math.min(5, maps.length)) } }, panels.map(({ node }) => node)),
    el("div", { class: "focus" }, el("div", { class: "large" }, large), aside),
    player && el("div", { class: "executed" }, player.node, el("p", { class: "hint keys" }, `Keys: ${PLAYER_KEYS}`)));
}

const KEYS = "Arrow keys turn, plus and minus zoom, 0 resets.";

/** A latent code as small bars about zero; tall bars are clipped at ±3 standard deviations. */
function latentBars(latent, width, height) {
  if (!latent.length) return null;
  const step = width / latent.length;
  const middle = height / 2;
  return svg("svg", { class: "latent", width, height, viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" },
    svg("line", { x1: 0, x2: width, y1: middle, y2: middle }),
    latent.map((value, i) => {
      const size = (Math.min(3, Math.abs(isNumber(value) ? value : 0)) / 3) * (middle - 1);
      return svg("rect", { x: i * step + step * 0.12, width: Math.max(0.8, step * 0.76), y: value >= 0 ? middle - size : middle, height: Math.max(size, 0.3) });
    }));
}

function mapFacts({ latent, peaks }, title) {
  const [one, two] = peaks;
  const span = one.point && two.point ? `${(1000 * one.point.distanceTo(two.point)).toFixed(0)}\u2009mm` : "–";
  const top = (peak) => (peak.most ? peak.most.toPrecision(2) : "–");
  return [
    el("h4", {}, title),
    latent.length > 0 && el("div", { class: "latent-large" }, latentBars(latent, 240, 56),
      el("span", { class: "quiet" }, `latent code, ${latent.length} number${latent.length === 1 ? "" : "s"}, ±3`)),
    el("dl", { class: "pairs" },
      el("dt", {}, "Distance between the points"), el("dd", {}, span),
      el("dt", {}, el("span", { class: "dot", style: { "--ink": FINGERS[0] } }), "Highest probability, finger 1"), el("dd", {}, top(one)),
      el("dt", {}, el("span", { class: "dot", style: { "--ink": FINGERS[1] } }), "Highest probability, finger 2"), el("dd", {}, top(two))),
  ].filter(Boolean);
}

/** A square of all blends: finger 1 to the right, finger 2 upwards. */
function blendLegend() {
  const side = 72;
  const canvas = el("canvas", { width: side, height: side, role: "img", "aria-label": "Colour key: green for finger 1, blue for finger 2, mixed for both" });
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  for (let y = 0; y < side; y++) {
    for (let x = 0; x < side; x++) {
      const color = blend(GREY, x / (side - 1), 1 - y / (side - 1));
      const at = 4 * (y * side + x);
      color.forEach((value, k) => { image.data[at + k] = Math.round(255 * value); });
      image.data[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return el("div", { class: "blend" }, canvas, el("div", {},
    el("div", {}, el("b", { style: { color: FINGERS[0] } }, "→ finger 1")), el("div", {}, el("b", { style: { color: FINGERS[1] } }, "↑ finger 2")),
    el("div", { class: "quiet" }, "probability, from none to the maximum")));
}
