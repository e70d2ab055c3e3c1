// A rollout's poses over time, and where things are between two recorded frames.

import { Quaternion, Vector3 } from "three";

const STRIDE = 7; // x, y, z (m), then the quaternion w, x, y, z
const before = new Quaternion();
const after = new Quaternion();

/** Reads seven numbers into position and orientation; what is not finite leaves them as they were. */
export function readPose(values, at, position, quaternion) {
  for (let k = 0; k < STRIDE; k++) if (!Number.isFinite(values[at + k])) return false;
  position.set(values[at], values[at + 1], values[at + 2]);
  quaternion.set(values[at + 4], values[at + 5], values[at + 6], values[at + 3]).normalize();
  return true;
}

export class Motion {
  constructor(rollout) {
    this.bodies = rollout.bodies.length;
    this.poses = rollout.poses;
    this.frames = rollout.frames;
    this.step = rollout.frame_seconds > 0 ? rollout.frame_seconds : 1 / 30;
    this.duration = Math.max(0, this.frames - 1) * this.step;
    this.start = new Vector3();
    this.end = new Vector3();
  }

  /** The frame nearest to `time` (s). */
  frameAt(time) { return Math.max(0, Math.min(this.frames - 1, Math.round(time / this.step))); }

  /** Puts an object where the body is at `time` (s): straight in position, slerp in orientation. */
  place(body, time, object) {
    if (!this.frames) return;
    const exact = Math.min(this.frames - 1, Math.max(0, time / this.step));
    const first = Math.floor(exact);
    const second = Math.min(this.frames - 1, first + 1);
    const at = (frame) => STRIDE * (frame * this.bodies + body);
    if (!readPose(this.poses, at(first), this.start, before)) return;
    if (!readPose(this.poses, at(second), this.end, after)) {
      this.end.copy(this.start);
      after.copy(before);
    }
    object.position.lerpVectors(this.start, this.end, exact - first);
    object.quaternion.slerpQuaternions(before, after, exact - first);
  }
}
