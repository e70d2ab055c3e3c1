// Meshes for the solids that bodies are made of. Sizes in metres; cylinders and capsules lie along z.

import { BoxGeometry, BufferGeometry, CapsuleGeometry, CylinderGeometry, Float32BufferAttribute, SphereGeometry } from "three";
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

/** Places an object at a solid's pose in its carrier's frame. */
export function placeSolid(object, pose) { readPose(pose, 0, object.position, object.quaternion); }
