// What grippers do to the object: an arrow for each pad, and one for the whole hand.

import { ConeGeometry, CylinderGeometry, Group, Mesh, MeshBasicMaterial, Vector3 } from "three";
import { HAND_FORCE, PAD_FORCE } from "./palette.js";
import { FORCE_FRAMES } from "./unpack.js";

const METRES_PER_NEWTON = 0.004;
const LONGEST = 0.3; // m
const LEAST = 0.3; // N: weaker forces are left out
const WIDTH = 6;
const UP = new Vector3(0, 1, 0);
const shaft = new CylinderGeometry(0.0016, 0.0016, 1, 10).translate(0, 0.5, 0);
const TIP = 0.016; // m
const head = new ConeGeometry(0.0055, TIP, 16).translate(0, TIP / 2, 0);

/** An arrow for a force, which what hides it lets through faintly: its tip at the point where it presses, or its tail where it pulls. */
function arrow(color, tipAtPoint) {
  const group = new Group();
  const parts = [];
  for (const [opacity, depthTest] of [[1, true], [0.35, false]]) {
    const material = new MeshBasicMaterial({ color, transparent: true, opacity, depthTest });
    const [line, tip] = [new Mesh(shaft, material), new Mesh(head, material)];
    line.renderOrder = tip.renderOrder = 7;
    group.add(line, tip);
    parts.push([line, tip]);
  }
  group.userData.set = (point, force) => {
    const size = force.length();
    group.visible = size > LEAST;
    if (!group.visible) return;
    const length = Math.min(LONGEST, METRES_PER_NEWTON * size);
    const direction = force.clone().divideScalar(size);
    group.position.copy(point).addScaledVector(direction, tipAtPoint ? -(length + TIP) : 0);
    group.quaternion.setFromUnitVectors(UP, direction);
    for (const [line, tip] of parts) {
      line.scale.y = length;
      tip.position.y = length;
    }
  };
  return group;
}

/** The arrows of a rollout; nothing to see if it recorded no forces. */
export class Forces {
  constructor(rollout) {
    this.rollout = rollout;
    this.group = new Group();
    this.arms = Array.from({ length: rollout.arms }, () => ({ pads: [arrow(PAD_FORCE, true), arrow(PAD_FORCE, true)], hand: arrow(HAND_FORCE, false) }));
    for (const { pads, hand } of this.arms) this.group.add(...pads, hand);
  }

  vector(frame, pad, first) {
    const at = (Math.floor(frame / FORCE_FRAMES) * 2 * this.rollout.arms + pad) * WIDTH + first;
    return new Vector3(...this.rollout.forces.subarray(at, at + 3));
  }

  /** Size of each pad's force, of their sum and of its upward part (N), for every arm at a frame. */
  at(frame) {
    return this.arms.map((_, arm) => {
      const pads = [0, 1].map((pad) => this.vector(frame, 2 * arm + pad, 3));
      const sum = pads[0].clone().add(pads[1]);
      return { pads: pads.map((force) => force.length()), hand: sum.length(), up: sum.z };
    });
  }

  place(frame) {
    this.arms.forEach(({ pads, hand }, arm) => {
      const forces = [0, 1].map((pad) => this.vector(frame, 2 * arm + pad, 3));
      const points = [0, 1].map((pad) => this.vector(frame, 2 * arm + pad, 0));
      pads.forEach((each, pad) => each.userData.set(points[pad], forces[pad]));
      hand.userData.set(points[0].clone().add(points[1]).multiplyScalar(0.5), forces[0].clone().add(forces[1]));
    });
  }
}
