// Meshes for the solids that bodies are made of. Sizes in metres; cylinders and capsules lie along z.

import {
  BoxGeometry, BufferGeometry, CapsuleGeometry, CylinderGeometry, Float32BufferAttribute, SphereGeometry, Triangle, Vector3,
} from "three";
import { readPose } from "./motion.js";

/** The geometry of a solid in its own frame. */
export function solidGeometry(shape) {
  switch (shape.type) {
    case "sphere": return new SphereGeometry(shape.radius, 32, 20);
    case "capsule": return new CapsuleGeometry(shape.radius, 2 * shape.half_length, 12, 28).rotateX(Math.PI / 2);
    case "cylinder": return new CylinderGeometry(shape.radius, shape.radius, 2 * shape.half_length, 40).rotateX(Math.PI / 2);
    case "box": return new BoxGeometry(...shape.half_extents.map((half) => 2 * half));
    case "convex": return hullGeometry(shape);
    default: throw new Error(`unknown solid "${shape.type}"; known are sphere, capsule, cylinder, box, convex`);
  }
}

/** Flat faces: each triangle has corners, and so a normal, of its own. */
function hullGeometry({ vertices, faces }) {
  const corners = faces.flatMap((face) => face.flatMap((corner) => vertices[corner]));
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(corners, 3));
  geometry.computeVertexNormals();
  return geometry;
}

/** Distance (m) from a point to a hull: to the nearest of the faces that it is outside of. */
function distanceToHull({ vertices, faces }, point) {
  const [triangle, nearest] = [new Triangle(), new Vector3()];
  let [least, outside] = [Infinity, false];
  for (const face of faces) {
    triangle.set(...face.map((corner) => new Vector3(...vertices[corner])));
    if (triangle.getNormal(nearest).dot(point) <= triangle.a.dot(nearest)) continue;
    outside = true;
    least = Math.min(least, triangle.closestPointToPoint(point, nearest).distanceTo(point));
  }
  return outside ? least : 0;
}

/** Places an object at a solid's pose in its carrier's frame. */
export function placeSolid(object, pose) { readPose(pose, 0, object.position, object.quaternion); }

/** Distance (m) from a point in the solid's own frame to the solid; zero inside. */
export function distanceTo(shape, point) {
  const { x, y, z } = point;
  const flat = Math.hypot(x, y);
  switch (shape.type) {
    case "sphere": return Math.max(0, point.length() - shape.radius);
    case "capsule": return Math.max(0, Math.hypot(flat, Math.max(0, Math.abs(z) - shape.half_length)) - shape.radius);
    case "cylinder": return Math.hypot(Math.max(0, flat - shape.radius), Math.max(0, Math.abs(z) - shape.half_length));
    case "box": return new Vector3(...[x, y, z].map((value, k) => Math.max(0, Math.abs(value) - shape.half_extents[k]))).length();
    case "convex": return distanceToHull(shape, point);
    default: return Infinity;
  }
}
