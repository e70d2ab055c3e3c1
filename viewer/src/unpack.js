// Rollouts as the page carries them: zlib in base64, columns of second differences in variable-length integers.

import { unpackBytes } from "./data.js";

const POSITION_STEP = 1e-4; // m
const QUATERNION_STEP = 1 / 16384;
const FORCE_STEP = 0.01; // N
const POSE = 7;
const PAD = 6;

/** base64 of zlib → bytes, with what the browser has for it. */
async function unfold(text) {
  const stream = new Blob([unpackBytes(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Columns of `frames` numbers each, `width` columns a thing, written row by row: out[(frame * things + thing) * width + column]. */
function columns(bytes, frames, things, width, stepOf) {
  const out = new Float32Array(frames * things * width);
  let at = 0;
  for (let thing = 0; thing < things; thing++) {
    for (let column = 0; column < width; column++) {
      const step = stepOf(column);
      let [last, slope] = [0, 0];
      for (let frame = 0; frame < frames; frame++) {
        let [value, scale, byte] = [0, 1, 0x80];
        while (byte >= 0x80) {
          if (at >= bytes.length) throw new Error("a packed motion ends too early");
          byte = bytes[at++];
          value += (byte & 0x7f) * scale; // products, because a shift would cut at 32 bits
          scale *= 128;
        }
        slope += value % 2 ? -(value + 1) / 2 : value / 2;
        last += slope;
        out[(frame * things + thing) * width + column] = last * step;
      }
    }
  }
  return out;
}

/** A rollout ready to play: bodies, and poses and forces as flat lists, frame by frame. */
export async function unpackRollout(packed) {
  const { frames, body_count: count, arms } = packed;
  const [bodies, motion, forces] = await Promise.all([packed.bodies, packed.motion, packed.forces].map(unfold));
  return {
    ...packed,
    bodies: JSON.parse(new TextDecoder().decode(bodies)),
    poses: columns(motion, frames, count, POSE, (column) => (column < 3 ? POSITION_STEP : QUATERNION_STEP)),
    // Point x, y, z (m) and force x, y, z (N) of both pads of every arm.
    forces: columns(forces, frames, 2 * arms, PAD, (column) => (column < 3 ? POSITION_STEP : FORCE_STEP)),
  };
}
