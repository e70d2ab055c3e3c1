// The three-dimensional scene of a rollout: bodies, light and shadow, the goal as a green ghost, asked contact points, forces.

import {
  AmbientLight, Box3, Color, DirectionalLight, Group, HemisphereLight, LessEqualDepth, Mesh, MeshBasicMaterial,
  MeshStandardMaterial, Object3D, PlaneGeometry, Scene, ShadowMaterial, SphereGeometry, Vector3,
} from "three";
import { Forces } from "./forces.js";
import { Motion, readPose } from "./motion.js";
import { FINGERS, GOAL } from "./palette.js";
import { bodyGeometry } from "./solids.js";

const BALL = 0.0065; // m

export class RolloutScene {
  constructor(rollout) {
    this.rollout = rollout;
    // Of a moving scene on a machine without a graphics card, shadows follow on every fourth picture.
    [this.coarse, this.drawn] = [false, 0];
    this.motion = new Motion(rollout);
    this.scene = new Scene();
    this.armMaterials = [];
    this.bodies = rollout.bodies.map((body) => this.body(body));
    this.ghost = this.makeGhost();
    this.place(0);
    this.frame = this.measure();
    this.light();
    this.ground();
    this.contacts = this.makeContacts();
    this.forces = new Forces(rollout);
    this.scene.add(this.forces.group);
    this.place(0);
  }

  /** Gives the graphics card back what the scene took. */
  dispose() {
    this.scene.traverse((node) => {
      node.geometry?.dispose();
      node.material?.dispose?.();
    });
    this.shadow?.map?.dispose();
  }

  /** A body is one mesh, each solid in its colour: every mesh costs a call to the graphics card, and there are hundreds of solids. */
  body({ solids, kind }) {
    const group = new Group();
    const material = new MeshStandardMaterial({ vertexColors: true, roughness: kind === "table" ? 0.95 : 0.5, metalness: 0.02 });
    if (kind === "arm") this.armMaterials.push(material);
    const mesh = new Mesh(bodyGeometry(solids), material);
    mesh.castShadow = kind !== "table";
    mesh.receiveShadow = true;
    group.add(mesh);
    this.scene.add(group);
    return group;
  }

  /** The parts at the goal. A depth-only pass first, so that overlapping solids show one even green. */
  makeGhost() {
    const ghost = new Group();
    const goal = this.rollout.goal.flat();
    const hidden = new MeshBasicMaterial({ colorWrite: false, transparent: true });
    const green = new MeshStandardMaterial({ color: GOAL, emissive: new Color(GOAL), emissiveIntensity: 0.12, transparent: true, opacity: 0.58, depthFunc: LessEqualDepth, roughness: 0.8 });
    const parts = this.rollout.bodies.filter(({ kind }) => kind === "part");
    parts.forEach(({ solids }, index) => {
      const group = new Group();
      if (!readPose(goal, 7 * index, group.position, group.quaternion)) return;
      const shape = bodyGeometry(solids);
      for (const [material, order] of [[hidden, 1], [green, 2]]) {
        const mesh = new Mesh(shape, material);
        mesh.renderOrder = order;
        group.add(mesh);
      }
      ghost.add(group);
    });
    this.scene.add(ghost);
    return ghost;
  }

  /** What the camera should see: where the parts go, and the arms' bases. */
  measure() {
    const box = new Box3();
    const points = [];
    const bases = new Map();
    const probe = new Object3D();
    this.rollout.bodies.forEach(({ kind, index }, i) => {
      this.motion.place(i, 0, probe);
      if (kind === "arm" && !bases.has(index)) bases.set(index, probe.position.clone());
      if (kind === "table") return;
      const steps = kind === "part" ? 24 : 6;
      for (let k = 0; k <= steps; k++) {
        this.motion.place(i, (this.motion.duration * k) / steps, probe);
        box.expandByPoint(probe.position);
        points.push([probe.position.clone(), kind === "part" ? 0.05 : 0.09]);
      }
    });
    this.ghost.children.forEach((part) => {
      box.expandByPoint(part.position);
      points.push([part.position.clone(), 0.05]);
    });
    const work = new Box3();
    this.rollout.bodies.forEach(({ kind }, i) => {
      if (kind !== "part") return;
      for (let k = 0; k <= 24; k++) {
        this.motion.place(i, (this.motion.duration * k) / 24, probe);
        work.expandByPoint(probe.position);
      }
    });
    this.ghost.children.forEach((part) => work.expandByPoint(part.position));
    if (box.isEmpty()) box.set(new Vector3(-0.5, -0.5, 0), new Vector3(0.5, 0.5, 0.5));
    if (!points.length) points.push([box.min.clone(), 0], [box.max.clone(), 0]);
    const size = box.getSize(new Vector3());
    if (work.isEmpty()) work.copy(box);
    const target = work.getCenter(new Vector3());
    target.z = 0.6 * target.z + 0.4 * (box.min.z + 0.5 * size.z);
    const near = { middle: work.getCenter(new Vector3()), radius: Math.max(0.14, 0.5 * work.getSize(new Vector3()).length()) };
    return { points, target, radius: Math.max(0.15, 0.5 * size.length()), front: frontAzimuth([...bases.values()], target), work: near };
  }

  light() {
    const { target, radius } = this.frame;
    const key = new DirectionalLight(0xfff8ee, 2.3);
    key.position.copy(target).add(new Vector3(0.5, -0.9, 2.0).multiplyScalar(radius * 1.6));
    key.target.position.copy(target);
    key.castShadow = true;
    key.shadow.mapSize.set(2048, 2048);
    key.shadow.radius = 3;
    key.shadow.intensity = 0.48;
    key.shadow.autoUpdate = false;
    // Without a first map the shadow sampler has nothing to read and the scene is not drawn at all.
    key.shadow.needsUpdate = true;
    this.shadow = key.shadow;
    key.shadow.bias = -0.0008;
    key.shadow.normalBias = 0.004;
    Object.assign(key.shadow.camera, { left: -1.3 * radius, right: 1.3 * radius, top: 1.3 * radius, bottom: -1.3 * radius, near: 0.1 * radius, far: 6 * radius });
    const fill = new DirectionalLight(0xdfe9ff, 0.6);
    fill.position.copy(target).add(new Vector3(-1, 0.8, 0.7));
    fill.target.position.copy(target);
    this.scene.add(key, key.target, fill, fill.target, new HemisphereLight(0xffffff, 0xd9d4ca, 1.7), new AmbientLight(0xffffff, 0.35));
  }

  /** The table top at z = 0 where no body is the table: only the shadows on it, so that it hides nothing from below. */
  ground() {
    if (this.rollout.bodies.some(({ kind }) => kind === "table")) return;
    const { target, radius } = this.frame;
    const top = new Mesh(new PlaneGeometry(6 * radius, 6 * radius), new ShadowMaterial({ color: 0x2b2a26, opacity: 0.5 }));
    top.position.set(target.x, target.y, 0);
    top.receiveShadow = true;
    this.scene.add(top);
  }

  /** Balls where fingers were asked to touch; each rides on the body it lies on. Shown from the stage before the grasp on. */
  makeContacts() {
    const shape = new SphereGeometry(BALL, 14, 9);
    const out = [];
    for (const { time, part, fingers } of this.rollout.contacts) {
      this.place(time);
      const shown = this.rollout.events.filter((event) => event.time < time - 1e-6).at(-1)?.time ?? 0;
      const carrier = this.bodies[this.rollout.bodies.findIndex(({ kind, index }) => kind === "part" && index === part)] ?? this.scene;
      carrier.updateWorldMatrix(true, false);
      fingers.forEach((position, finger) => {
        if (!position.every(Number.isFinite)) return;
        const ball = new Group();
        // A faint second ball shows through the fingers that close over the point.
        ball.add(new Mesh(shape, new MeshStandardMaterial({ color: FINGERS[finger], emissive: new Color(FINGERS[finger]), emissiveIntensity: 0.35, roughness: 0.4 })));
        const through = new Mesh(shape, new MeshBasicMaterial({ color: FINGERS[finger], transparent: true, opacity: 0.35, depthTest: false }));
        through.renderOrder = 5;
        ball.add(through);
        carrier.add(ball);
        ball.position.copy(carrier.worldToLocal(new Vector3(...position)));
        out.push({ ball, shown });
      });
    }
    return out;
  }

  /** Solid arms, or arms like glass that do not hide the parts. */
  setArms(solid) {
    for (const material of this.armMaterials) {
      Object.assign(material, { transparent: !solid, opacity: solid ? 1 : 0.16, depthWrite: solid });
      material.needsUpdate = true;
    }
  }

  /** Moves everything to `time` (s). */
  place(time) {
    if (this.shadow && time !== this.time && !(this.coarse && ++this.drawn % 4)) this.shadow.needsUpdate = true;
    this.time = time;
    this.bodies.forEach((group, i) => this.motion.place(i, time, group));
    this.forces?.place(this.motion.frameAt(time));
    for (const { ball, shown } of this.contacts ?? []) ball.visible = this.contactsOn !== false && time >= shown - 1e-9;
  }
}

/** The horizontal direction to look from so that the arms stand side by side. */
function frontAzimuth(bases, target) {
  let far = null;
  for (const a of bases) {
    for (const b of bases) {
      const gap = Math.hypot(a.x - b.x, a.y - b.y);
      if (gap > (far?.gap ?? 0.05)) far = { gap, angle: Math.atan2(b.y - a.y, b.x - a.x) };
    }
  }
  const front = far ? far.angle - Math.PI / 2 : 0;
  // The work stands between the reader and the arms, not behind them.
  const behind = bases.reduce((sum, base) => sum + (target.x - base.x) * Math.cos(front) + (target.y - base.y) * Math.sin(front), 0);
  return behind < -0.2 * bases.length ? front + Math.PI : front;
}
