// Where a camera must stand so that given points fill its picture.

import { Vector3 } from "three";

/**
 * The target (m) and distance (m) at which `points` ([Vector3, radius] pairs, m) fill `share` of a picture with the vertical field `field` (rad)
 * and width over height `aspect`, seen from `azimuth` and `elevation` (rad). World z is up.
 */
export function fitView(points, { azimuth, elevation, field, aspect, share = 0.9 }) {
  const back = new Vector3(Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation));
  const right = new Vector3(-Math.sin(azimuth), Math.cos(azimuth), 0);
  const up = new Vector3().crossVectors(back, right);
  const target = points.reduce((sum, [point]) => sum.add(point), new Vector3()).multiplyScalar(1 / points.length);
  const [high, wide] = [Math.tan(field / 2) * share, Math.tan(field / 2) * aspect * share];
  let distance = 1;
  const offset = new Vector3();
  // Perspective makes near points larger, so centring and distance are found in turns.
  for (let turn = 0; turn < 8; turn++) {
    let need = 0;
    for (const [point, radius] of points) {
      offset.subVectors(point, target);
      const near = offset.dot(back);
      need = Math.max(need, near + (Math.abs(offset.dot(right)) + radius) / wide, near + (Math.abs(offset.dot(up)) + radius) / high);
    }
    distance = need;
    const span = [Infinity, -Infinity, Infinity, -Infinity];
    for (const [point, radius] of points) {
      offset.subVectors(point, target);
      const depth = Math.max(0.05 * distance, distance - offset.dot(back));
      const [x, y] = [offset.dot(right), offset.dot(up)];
      span[0] = Math.min(span[0], (x - radius) / depth);
      span[1] = Math.max(span[1], (x + radius) / depth);
      span[2] = Math.min(span[2], (y - radius) / depth);
      span[3] = Math.max(span[3], (y + radius) / depth);
    }
    if (turn === 7) break;
    target.addScaledVector(right, 0.5 * (span[0] + span[1]) * distance).addScaledVector(up, 0.5 * (span[2] + span[3]) * distance);
  }
  return { target, distance };
}
