#!/usr/bin/env python3
"""Cameras: frames per CPU second and depths, against MuJoCo 3.17.0's renderer on software GL and its mj_multiRay.

Two Pandas and an object, four cameras of 320 x 240. Ours: vmao-sim's example `camera_rate`; a frame is the depth, colour, label and
normal of each pixel and the cloud of coloured points. GL: one pass without shadows, reflections or multisampling, colours and depths
read back. mj_multiRay: one call for all pixels of a frame. Depths are checked once before the clock starts; GL then draws round solids
with as many facets as it can.
"""

import json
import os
import subprocess
import tempfile
from pathlib import Path

import peer

peer.environment("cameras", ["mujoco==3.17.0", "numpy==2.4.6", "PyOpenGL==3.1.10"])
os.environ.setdefault("MUJOCO_GL", "egl")
os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"

import mujoco  # noqa: E402
import numpy as np  # noqa: E402
from OpenGL import GL  # noqa: E402

ROUNDS = 5
FRAMES = 10  # of each camera in a round, for every side
OURS = 100  # ours, so that the clock has something to count
OBJECT = "pliers"
FAR = 6.0  # m: GL's far plane, what it draws where nothing is
EDGE = 0.003  # 1/m: a bend of inverse depth over three pixels that makes an edge

program = peer.cargo("vmao-sim", "example", "camera_rate")


def ours(folder, frames):
    answer = subprocess.run([program, OBJECT, str(frames), folder], check=True, capture_output=True, text=True).stdout
    return json.loads(answer)


def loaded(folder, still, slices):
    """The scene that our side wrote, in the same state, with our cameras; MuJoCo's look along -z, x to the right."""
    cameras = ""
    field = float(np.degrees(2 * np.arctan(still["half_tangent"])))
    for camera in still["cameras"]:
        x, y, _ = np.array(camera["axes"])
        place = " ".join(map(repr, camera["position"]))
        axes = " ".join(repr(float(value)) for value in [*-x, *y])
        cameras += f'<camera pos="{place}" xyaxes="{axes}" fovy="{field!r}"/>\n'
    text = (Path(folder) / "scene.xml").read_text()
    assert text.count("</worldbody>") == 1
    model = mujoco.MjModel.from_xml_string(text.replace("</worldbody>", cameras + "</worldbody>"))
    model.vis.quality.offsamples = 0
    model.vis.quality.numslices = model.vis.quality.numstacks = slices
    model.vis.global_.offwidth, model.vis.global_.offheight = still["width"], still["height"]
    # The clipping planes as tight as the scene allows: depths are coded between them.
    model.vis.map.znear, model.vis.map.zfar = 0.3 / model.stat.extent, FAR / model.stat.extent
    data = mujoco.MjData(model)
    data.qpos[:] = still["qpos"]
    mujoco.mj_forward(model, data)
    return model, data


class Renderer:
    """One pass on software GL: colours and depths (m) of a camera."""

    def __init__(self, model, data, still):
        self.model, self.data = model, data
        self.scene = mujoco.MjvScene(model, maxgeom=1000)
        self.camera, self.option = mujoco.MjvCamera(), mujoco.MjvOption()
        self.camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self.context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.context)
        self.context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self.rectangle = mujoco.MjrRect(0, 0, still["width"], still["height"])
        self.colors = np.empty((still["height"], still["width"], 3), dtype=np.uint8)
        self.depths = np.empty((still["height"], still["width"]), dtype=np.float32)
        flags = mujoco.mjtRndFlag
        for flag in [flags.mjRND_SHADOW, flags.mjRND_REFLECTION, flags.mjRND_SKYBOX, flags.mjRND_HAZE, flags.mjRND_FOG]:
            self.scene.flags[flag] = 0

    def frame(self, camera):
        self.camera.fixedcamid = camera
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self.model, self.data, self.option, None, self.camera, everything, self.scene)
        mujoco.mjr_render(self.rectangle, self.scene, self.context)
        mujoco.mjr_readPixels(self.colors, self.depths, self.rectangle, self.context)
        # Undo the reversed perspective: the far plane is coded as 0, the near plane as 1.
        extent, planes = self.model.stat.extent, self.model.vis.map
        near, far = float(np.float32(planes.znear * extent)), float(np.float32(planes.zfar * extent))
        coded = self.depths.astype(np.float64)
        depths = near * far / (near + coded * (far - near))
        return np.where(depths < 0.999 * far, depths, 0.0)


class Rays:
    """mj_multiRay, one call a frame."""

    def __init__(self, model, data, still):
        self.model, self.data, self.still = model, data, still
        width, height = still["width"], still["height"]
        columns = (2 * (np.arange(width) + 0.5) / width - 1) * still["half_tangent"] * width / height
        rows = (1 - 2 * (np.arange(height) + 0.5) / height) * still["half_tangent"]
        local = np.stack([*np.broadcast_arrays(columns[None, :], rows[:, None]), np.ones((height, width))], axis=-1)
        self.scale = np.linalg.norm(local, axis=-1)
        self.rays = [(local @ np.array(camera["axes"])) / self.scale[..., None] for camera in still["cameras"]]
        self.geoms, self.distances = np.empty(width * height, dtype=np.int32), np.empty(width * height)

    def frame(self, camera):
        position, rays = np.array(self.still["cameras"][camera]["position"]), self.rays[camera].reshape(-1)
        mujoco.mj_multiRay(
            self.model, self.data, position, rays, None, 1, -1, self.geoms, self.distances, None, len(self.distances), 10.0
        )
        return np.where(self.geoms < 0, 0.0, self.distances).reshape(self.scale.shape) / self.scale


    def single(self, camera, row, column):
        """The same ray by mj_ray, which tries every solid: its depth."""
        position, geom = np.array(self.still["cameras"][camera]["position"]), np.empty(1, dtype=np.int32)
        ray = self.rays[camera][row, column]
        distance = mujoco.mj_ray(self.model, self.data, position, ray, None, 1, -1, geom, None)
        return distance / self.scale[row, column] if geom[0] >= 0 else 0.0


def edges(depths):
    """Pixels where depth has a step: where it bends by more than EDGE from one neighbour to the other, or ends."""
    found = np.zeros(depths.shape, dtype=bool)
    inverse = np.where(depths > 0, 1 / np.maximum(depths, 1e-3), 0.0)  # linear on every plane
    for axis in (0, 1):
        bend = np.abs(np.diff(inverse, n=2, axis=axis)) > EDGE
        for shift in range(3):
            place = [slice(None)] * 2
            place[axis] = slice(shift, depths.shape[axis] - 2 + shift)
            found[tuple(place)] |= bend
    return found


def compare(name, depths, peers):
    """Disagreement of depths, edges counted apart: there a pixel's ray may just meet or just miss."""
    on_edge = np.array([edges(frame) for frame in depths])
    both, either = (depths > 0) & (peers > 0), (depths > 0) | (peers > 0)
    off = np.abs(depths - peers)
    inside = both & ~on_edge
    one = int((either & ~both & ~on_edge).sum())
    wrong = lambda where: int((off[where & either] > 1e-4).sum())  # noqa: E731
    typical = np.sqrt(np.mean(off[inside] ** 2))
    return [name, inside.sum(), f"{off[inside].max():.1e}", f"{typical:.1e}", wrong(inside), one, on_edge.sum(), wrong(on_edge)]


def rate(side, cameras):
    seconds, _ = peer.cpu_seconds(lambda: [side.frame(camera) for _ in range(FRAMES) for camera in range(cameras)])
    return FRAMES * cameras / seconds


with tempfile.TemporaryDirectory() as folder:
    still = ours(folder, 1)
    cameras = len(still["cameras"])
    context = mujoco.GLContext(still["width"], still["height"])
    context.make_current()
    shape = (cameras, still["height"], still["width"])
    depths = np.fromfile(Path(folder) / "depths.bin").reshape(shape)

    fine = Renderer(*loaded(folder, still, 256), still)
    # Our columns run from right to left, GL's rows from the bottom up.
    gl = np.array([fine.frame(camera)[::-1, ::-1] for camera in range(cameras)])
    model, data = loaded(folder, still, 28)
    rays = Rays(model, data, still)
    cast = np.array([rays.frame(camera) for camera in range(cameras)])
    header = ["peer", "pixels compared", "largest difference (m)", "RMS (m)", "over 1e-4 m", "seen by one", "at edges", "of these over 1e-4 m"]
    print(f"GL: {GL.glGetString(GL.GL_RENDERER).decode()}; {still['width']} x {still['height']}, {cameras} cameras, {model.ngeom} geoms")
    # mj_multiRay leaves out solids by bounds of its own; what it misses is asked of mj_ray, which does not.
    doubtful = np.argwhere(np.abs(depths - cast) > 1e-6)
    single = cast.copy()
    for camera, row, column in doubtful:
        single[camera, row, column] = rays.single(camera, row, column)
    rows = [("software GL", gl), ("mj_multiRay", cast), ("mj_multiRay, mj_ray where it differs", single)]
    peer.table(header, [compare(name, depths, theirs) for name, theirs in rows])

    renderer = Renderer(model, data, still)
    for side in (renderer, rays):
        side.frame(0)
    rounds = []
    for _ in range(ROUNDS):
        answer = ours(folder, OURS)
        mine = OURS * cameras / answer["seconds"]
        rounds.append((mine, rate(renderer, cameras), rate(rays, cameras)))
    context.free()

names = ["vmao", "MuJoCo 3.17.0, software GL", "mj_multiRay 3.17.0"]
rates = [peer.median(side) for side in zip(*rounds)]
rows = []
for index, name in enumerate(names):
    ratios = sorted(sides[0] / sides[index] for sides in rounds)
    rows.append([name, f"{rates[index]:.0f}", f"{rates[0] / rates[index]:.1f}", f"{ratios[0]:.1f} to {ratios[-1]:.1f}"])
print()
peer.table(["side", "frames per CPU second", "ours, times this", "rounds"], rows)
