// A coloured point cloud with a contact map over it: finger 1 green, finger 2 blue, each relative to its own maximum.

import { BufferAttribute, BufferGeometry, Color, Group, Mesh, MeshBasicMaterial, Points, Scene, ShaderMaterial, SphereGeometry, Vector3, BackSide } from "three";
import { FINGERS } from "./palette.js";

const TABLE = 0;
const PART = 2;
// Share of the object's own colour that is left at full probability, and the curve that lifts the faint tail.
const FLOOR = 0.06;
const GAMMA = 0.75;

const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
const [GREEN, BLUE] = FINGERS.map(rgb);

/** The colour of a point: what the shader does, for the legend. Components in [0, 1]. */
export function blend(base, first, second) {
  const strength = (1 - FLOOR) * Math.max(first, second) ** GAMMA;
  const sum = Math.max(first + second, 1e-6);
  const grey = 0.3 * base[0] + 0.59 * base[1] + 0.11 * base[2];
  const calm = 0.8 * Math.min(1, 2.5 * strength);
  return base.map((value) => value + (grey - value) * calm).map((value, i) => value * (1 - strength) + strength * ((GREEN[i] * first + BLUE[i] * second) / sum));
}

const VERTEX = `
attribute vec3 tint; attribute float first; attribute float second; attribute float quiet;
uniform float height; uniform float size; uniform vec3 middle; uniform float reach;
varying vec3 shade; varying float fade;
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  float top = max(first, second);
  float strength = ${(1 - FLOOR).toFixed(3)} * pow(top, ${GAMMA.toFixed(3)});
  vec3 hue = (vec3(${GREEN.join(", ")}) * first + vec3(${BLUE.join(", ")}) * second) / max(first + second, 1e-6);
  // A tinted point first loses its own colour, so that green on yellow does not turn to mud.
  vec3 plain = mix(tint, vec3(dot(tint, vec3(0.3, 0.59, 0.11))), 0.8 * min(1.0, 2.5 * strength));
  shade = mix(plain, hue, strength);
  float scenery = step(0.005, quiet);
  fade = quiet * smoothstep(0.42, 0.85, distance(position, middle) / reach);
  gl_Position = projectionMatrix * seen;
  gl_PointSize = max(1.5, size * mix(1.0 + 0.25 * strength, 0.5, scenery) * height * projectionMatrix[1][1] * 0.5 / gl_Position.w);
}`;

const FRAGMENT = `
varying vec3 shade; varying float fade;
void main() {
  vec2 offset = gl_PointCoord * 2.0 - 1.0;
  float square = dot(offset, offset);
  if (square > 1.0 || fade > 0.97) discard;
  float light = 0.86 + 0.14 * sqrt(1.0 - square) - 0.10 * dot(offset, vec2(-0.5, 0.7));
  gl_FragColor = vec4(mix(shade * min(light, 1.04), vec3(0.965, 0.962, 0.953), fade), 1.0);
}`;

/** A cloud's centre, radius and point spacing (m), of its object points where there are any. */
export function cloudFrame(points, kinds) {
  let chosen = [];
  for (const wanted of [PART, null]) {
    chosen = [];
    for (let i = 0; i < kinds.length; i++) {
      const finite = Number.isFinite(points[3 * i] + points[3 * i + 1] + points[3 * i + 2]);
      if (finite && (wanted === null || kinds[i] === wanted)) chosen.push(i);
    }
    if (chosen.length > 8) break;
  }
  const middle = new Vector3();
  if (!chosen.length) return { middle, radius: 0.2, spacing: 0.01 };
  const axis = (k) => {
    const values = chosen.map((i) => points[3 * i + k]).sort((a, b) => a - b);
    return (values[Math.floor(0.004 * values.length)] + values[Math.floor(0.996 * values.length)]) / 2;
  };
  middle.set(axis(0), axis(1), axis(2));
  const distances = chosen.map((i) => Math.hypot(points[3 * i] - middle.x, points[3 * i + 1] - middle.y, points[3 * i + 2] - middle.z)).sort((a, b) => a - b);
  const radius = Math.max(0.02, distances[Math.floor(0.995 * distances.length)]);
  const nearest = chosen.filter((_, n) => n % Math.ceil(chosen.length / 60) === 0).map((i) => {
    let best = Infinity;
    for (const j of chosen) {
      if (j === i) continue;
      best = Math.min(best, (points[3 * i] - points[3 * j]) ** 2 + (points[3 * i + 1] - points[3 * j + 1]) ** 2 + (points[3 * i + 2] - points[3 * j + 2]) ** 2);
    }
    return Math.sqrt(best);
  }).sort((a, b) => a - b);
  const spacing = Math.min(0.05 * radius, Math.max(0.008 * radius, nearest[Math.floor(nearest.length / 2)] || 0.01 * radius));
  return { middle, radius, spacing };
}

function relative(values, length) {
  const out = new Float32Array(length);
  let peak = -1;
  for (let i = 0; i < Math.min(length, values.length); i++) {
    if (Number.isFinite(values[i]) && values[i] > 0) out[i] = values[i];
    if (out[i] > (peak < 0 ? 0 : out[peak])) peak = i;
  }
  const most = peak < 0 ? 1 : out[peak];
  for (let i = 0; i < length; i++) out[i] /= most;
  return [out, peak < 0 ? 0 : most];
}

function ball(color, radius, position) {
  const group = new Group();
  const shape = new SphereGeometry(1, 24, 16);
  const core = new Mesh(shape, new MeshBasicMaterial({ color: new Color(color) }));
  const rim = new Mesh(shape, new MeshBasicMaterial({ color: 0xffffff, side: BackSide }));
  core.scale.setScalar(radius);
  rim.scale.setScalar(radius * 1.35);
  group.add(core, rim);
  // The mark shows, fainter, through the points that surround it.
  for (const [ink, scale, opacity, order] of [[0xffffff, 1.3, 0.55, 5], [color, 1, 0.8, 6]]) {
    const through = new Mesh(shape, new MeshBasicMaterial({ color: new Color(ink), transparent: true, opacity, depthTest: false, depthWrite: false }));
    through.scale.setScalar(scale * radius);
    through.renderOrder = order;
    group.add(through);
  }
  group.position.copy(position);
  return group;
}

/**
 * The base attributes that all maps of a figure share: positions, colours in [0, 1] quietened so that
 * the map reads over them, and which points may fade out.
 */
export function cloudBase(points, colors, kinds) {
  const n = kinds.length;
  const positions = new Float32Array(3 * n);
  const tints = new Float32Array(3 * n);
  const quiet = new Float32Array(n);
  for (let i = 0; i < n; i++) {
    const table = kinds[i] === TABLE;
    quiet[i] = table ? 1 : kinds[i] === PART ? 0 : 0.99;
    for (let k = 0; k < 3; k++) {
      const value = points[3 * i + k];
      positions[3 * i + k] = Number.isFinite(value) ? value : 0;
      const base = (colors[3 * i + k] ?? 170) / 255;
      const light = (0.3 * (colors[3 * i] ?? 170) + 0.59 * (colors[3 * i + 1] ?? 170) + 0.11 * (colors[3 * i + 2] ?? 170)) / 255;
      // Part colours may be the fingers' own green and blue, so only a trace of them stays.
      tints[3 * i + k] = kinds[i] === PART ? 0.26 * base + 0.74 * (0.66 + 0.2 * light) : table ? 0.55 * base + 0.45 * 0.9 : 0.3 * light + 0.7 * 0.88;
    }
  }
  return { count: n, positions: new BufferAttribute(positions, 3), tints: new BufferAttribute(tints, 3), quiet: new BufferAttribute(quiet, 1) };
}

/** A scene with the cloud, one contact map over it and a ball at each finger's chosen point. */
export function mapScene(base, frame, first, second, chosen) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", base.positions);
  geometry.setAttribute("tint", base.tints);
  geometry.setAttribute("quiet", base.quiet);
  const peaks = [];
  for (const [name, values] of [["first", first], ["second", second]]) {
    const [scaled, most] = relative(values, base.count);
    geometry.setAttribute(name, new BufferAttribute(scaled, 1));
    peaks.push({ most, point: most > 0 ? new Vector3().fromBufferAttribute(base.positions, chosen[peaks.length]) : null });
  }
  const material = new ShaderMaterial({
    vertexShader: VERTEX, fragmentShader: FRAGMENT,
    uniforms: { height: { value: 1 }, size: { value: 2.3 * frame.spacing }, middle: { value: frame.middle }, reach: { value: 2.6 * frame.radius } },
  });
  const cloud = new Points(geometry, material);
  cloud.frustumCulled = false;
  const scene = new Scene();
  scene.add(cloud);
  const balls = new Group();
  peaks.forEach(({ point }, finger) => { if (point) balls.add(ball(FINGERS[finger], Math.max(0.034 * frame.radius, 1.45 * frame.spacing), point)); });
  scene.add(balls);
  return { scene, material, peaks, balls };
}
