// Rollouts as the page carries them: joints and poses in columns of second differences in variable-length integers, zlib, base64.

import { Quaternion, Vector3 } from "three";
import { unfold } from "./data.js";

const POSITION_STEP = 2e-4; // m
const ANGLE_STEP = 1e-3; // rad
const QUATERNION_STEP = 1 / 2048;
const POINT_STEP = 1e-3; // m
const FORCE_STEP = 0.1; // N
export const FORCE_FRAMES = 4;
const POSE = 7;
const PAD = 6;

/** Reads columns of `length` numbers, one after the other. */
class Columns {
  constructor(bytes) { [this.bytes, this.at] = [bytes, 0]; }

  /** Refuses numbers that nobody asked for: another layout than this one. */
  end() { if (this.at !== this.bytes.length) throw new Error("a packed motion has more numbers than it should"); }

  next(length, step) {
    const out = new Float64Array(length);
    let [last, slope] = [0, 0];
    for (let k = 0; k < length; k++) {
      let [value, scale, byte] = [0, 1, 0x80];
      while (byte >= 0x80) {
        if (this.at >= this.bytes.length) throw new Error("a packed motion ends too early");
        byte = this.bytes[this.at++];
        value += (byte & 0x7f) * scale; // products, because a shift would cut at 32 bits
        scale *= 128;
      }
      slope += value % 2 ? -(value + 1) / 2 : value / 2;
      last += slope;
      out[k] = last * step;
    }
    return out;
  }
}

/** For each frame a pose in the frame of what carries the body: calls `write(frame, position, quaternion)`. */
function eachPose({ pose, motion }, columns, frames, write) {
  const home = new Vector3(pose[0], pose[1], pose[2]);
  const turn = new Quaternion(pose[4], pose[5], pose[6], pose[3]);
  const [position, quaternion] = [new Vector3(), new Quaternion()];
  if (motion === "free") {
    const seven = Array.from({ length: POSE }, (_, column) => columns.next(frames, column < 3 ? POSITION_STEP : QUATERNION_STEP));
    const [x, y, z, w, i, j, k] = seven;
    for (let frame = 0; frame < frames; frame++) {
      write(frame, position.set(x[frame], y[frame], z[frame]), quaternion.set(i[frame], j[frame], k[frame], w[frame]).normalize());
    }
    return;
  }
  const { turns, slides } = motion;
  const values = turns || slides ? columns.next(frames, turns ? ANGLE_STEP : POSITION_STEP) : null;
  const axis = new Vector3(...(turns ?? slides ?? { axis: [0, 0, 1] }).axis);
  const anchor = new Vector3(...(turns?.anchor ?? [0, 0, 0]));
  for (let frame = 0; frame < frames; frame++) {
    position.set(0, 0, 0);
    quaternion.identity();
    if (turns) {
      quaternion.setFromAxisAngle(axis, values[frame]);
      position.copy(anchor).applyQuaternion(quaternion).negate().add(anchor);
    } else if (slides) position.copy(axis).multiplyScalar(values[frame]);
    write(frame, position.applyQuaternion(turn).add(home), quaternion.premultiply(turn));
  }
}

/** World poses of all bodies: out[(frame * bodies + body) * 7 + column]. */
function worldPoses(bodies, columns, frames) {
  const out = new Float32Array(frames * bodies.length * POSE);
  const place = (frame, body) => (frame * bodies.length + body) * POSE;
  const [origin, turn] = [new Vector3(), new Quaternion()];
  bodies.forEach(({ mount }, body) => {
    eachPose(mount, columns, frames, (frame, position, quaternion) => {
      if (mount.on !== null) {
        const at = place(frame, mount.on);
        turn.set(out[at + 4], out[at + 5], out[at + 6], out[at + 3]);
        position.applyQuaternion(turn).add(origin.fromArray(out, at));
        quaternion.premultiply(turn);
      }
      const { x, y, z, w } = quaternion;
      out.set([position.x, position.y, position.z, w, x, y, z], place(frame, body));
    });
  });
  columns.end();
  return out;
}

/** Points x, y, z (m) and forces x, y, z (N) of both pads of every arm: out[(force * pads + pad) * 6 + column]. */
function padForces(columns, count, pads) {
  const out = new Float32Array(count * pads * PAD);
  for (let pad = 0; pad < pads; pad++) {
    for (let column = 0; column < PAD; column++) {
      const values = columns.next(count, column < 3 ? POINT_STEP : FORCE_STEP);
      values.forEach((value, k) => { out[(k * pads + pad) * PAD + column] = value; });
    }
  }
  columns.end();
  return out;
}

/** A rollout ready to play: bodies, and poses and forces as flat lists, frame by frame; forces for every fourth frame. */
export async function unpackRollout(packed) {
  const { frames, arms } = packed;
  const [described, motion, forces] = await Promise.all([packed.bodies, packed.motion, packed.forces].map(unfold));
  const bodies = JSON.parse(new TextDecoder().decode(described));
  return {
    ...packed,
    bodies,
    poses: worldPoses(bodies, new Columns(motion), frames),
    forces: padForces(new Columns(forces), Math.ceil(frames / FORCE_FRAMES), 2 * arms),
  };
}
