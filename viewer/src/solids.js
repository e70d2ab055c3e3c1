// Meshes for the solids that bodies are made of. Sizes in metres; cylinders and capsules lie along z.

import { BoxGeometry, BufferGeometry, CapsuleGeometry, Color, CylinderGeometry, Float32BufferAttribute, Matrix4, Quaternion, SphereGeometry, Vector3 } from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import { readPose } from "./motion.js";

/** The geometry of a solid in its own frame. As few corners as look round: without a graphics card they are what drawing costs. */
function solidGeometry(shape) {
  switch (shape.type) {
    case "sphere": return new SphereGeometry(shape.radius, 20, 12);
    case "capsule": return new CapsuleGeometry(shape.radius, 2 * shape.half_length, 6, 20).rotateX(Math.PI / 2);
    case "cylinder": return new CylinderGeometry(shape.radius, shape.radius, 2 * shape.half_length, 28).rotateX(Math.PI / 2);
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

/** One geometry of all solids of a body, in the body's frame, each corner with its solid's colour. */
export function bodyGeometry(solids) {
  const [position, quaternion, ones] = [new Vector3(), new Quaternion(), new Vector3(1, 1, 1)];
  const placed = solids.map(({ shape, pose, color }) => {
    const geometry = solidGeometry(shape);
    geometry.deleteAttribute("uv");
    if (readPose(pose, 0, position, quaternion)) geometry.applyMatrix4(new Matrix4().compose(position, quaternion, ones));
    const { r, g, b } = new Color().setRGB(...color, "srgb");
    const count = geometry.getAttribute("position").count;
    if (!geometry.index) geometry.setIndex(Array.from({ length: count }, (_, corner) => corner));
    return geometry.setAttribute("color", new Float32BufferAttribute(Array.from({ length: count }, () => [r, g, b]).flat(), 3));
  });
  return placed.length ? mergeGeometries(placed) : new BufferGeometry();
}
