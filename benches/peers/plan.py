"""Planning against roboplan (RRT-Connect, then its path shortcutter) on our problem sets: `plan.py [COUNT] [SET]...`

Both sides get the same problems, solids (capsules, boxes and cylinders alike), joint limits and ignored pairs, plan in
turns in one run, and shorten their paths; ours keeps 5 mm of distance, theirs needs none. All paths are judged by
MuJoCo's collision detection at 0.01 rad of the most turned joint. CPU time is that of planning and shortcutting alone,
without the building of models; of ours it includes the preparation of the collision check. A set is FAMILY:ROBOT,ROBOT...
"""

import itertools
import json
import os
import subprocess
import sys

import peer

if __name__ == "__main__":
    peer.environment("plan", ["roboplan==0.7.0", "mujoco==3.3.7", "numpy==2.4.6"])

import mujoco
import numpy as np
from roboplan.core import (
    Box,
    JointConfiguration,
    PathShortcutter,
    PathShortcuttingOptions,
    Scene,
    loadMjcfModel,
)
from roboplan.rrt import RRT, RRTOptions

SETS = ["shelf:panda,panda", "crossed:panda,panda", "shelf:panda", "crossed:panda", "crossed:panda,panda,panda"]
STEP = 0.01  # rad, of every joint: what the judge looks at
# rad, Euclidean, for planning and shortcutting: roboplan's own default, and one that finds most of what the judge finds
PEER_STEPS = [0.05, 0.02]
PEER_SECONDS = 20.0  # most time for one of the peer's plans; its default is no limit but 1000 nodes
PEER_NODES = 100_000


def attributes(pose):
    position, quaternion = (" ".join(map(repr, pose[key])) for key in ("position", "quaternion"))
    return f'pos="{position}" quat="{quaternion}"'


def geom(solid, name):
    shape = solid["shape"]
    kind = shape["type"]
    sizes = shape["half_extents"] if kind == "box" else [shape[key] for key in ("radius", "half_length") if key in shape]
    return f'<geom name="{name}" type="{kind}" size="{" ".join(map(repr, sizes))}" {attributes(solid["pose"])}/>'


def body_name(arm, link):
    return f"arm{arm}_body{link}"


def arm_body(arm, base, model):
    """One arm as nested bodies: base, links, and hand and fingers as bodies fixed to the last link."""
    count = len(model["joints"])
    text, here = "", lambda link: "".join(
        geom(solid, f"{body_name(arm, link)}_{index}") for index, solid in enumerate(model["solids"]) if solid["link"] == link
    )
    for link in range(count + 1):
        pose = base if link == 0 else model["joints"][link - 1]["pose"]
        text += f'<body name="{body_name(arm, link)}" {attributes(pose)}><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        if link > 0:
            low, high = model["joints"][link - 1]["range"]
            text += f'<joint name="arm{arm}_joint{link}" type="hinge" axis="0 0 1" range="{low!r} {high!r}" limited="true"/>'
        text += here(link)
    for link in (count + 1, count + 2):
        text += f'<body name="{body_name(arm, link)}">{here(link)}</body>'
    return text + "</body>" * (count + 1)


def ignored(problem):
    for arm, model in enumerate(problem["models"]):
        for first, second in model["ignored"]:
            yield body_name(arm, first), body_name(arm, second)


def mjcf(problem, obstacles):
    arms = zip(problem["request"]["arms"], problem["models"])
    # roboplan's reader takes the first body of the world only, so that all arms stand on one
    bodies = "".join(arm_body(index, arm["base"], model) for index, (arm, model) in enumerate(arms))
    boxes = [{"shape": {"type": "box", "half_extents": o["half_extents"]}, "pose": o["pose"]} for o in problem["request"]["obstacles"]]
    around = "".join(geom(box, f"obstacle{index}") for index, box in enumerate(boxes)) if obstacles else ""
    pairs = "".join(f'<exclude body1="{first}" body2="{second}"/>' for first, second in ignored(problem))
    return (
        f'<mujoco model="problem"><compiler angle="radian"/><worldbody>{around}<body name="arms">{bodies}</body></worldbody>'
        f"<contact>{pairs}</contact></mujoco>"
    )


class Judge:
    """MuJoCo's own collision detection on the problem's solids."""

    def __init__(self, problem):
        self.model = mujoco.MjModel.from_xml_string(mjcf(problem, True))
        self.data = mujoco.MjData(self.model)

    def depth(self, q):
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)
        return min((contact.dist for contact in self.data.contact), default=0.0)

    def deepest(self, path):
        """The deepest overlap anywhere on the path (m, 0 if none)."""
        deepest = self.depth(path[0])
        for start, end in zip(path, path[1:]):
            count = max(1, int(np.ceil(np.abs(end - start).max() / STEP)))
            deepest = min([deepest] + [self.depth(start + (end - start) * i / count) for i in range(1, count + 1)])
        return -deepest


class Peer:
    """roboplan on one problem."""

    def __init__(self, problem, index, step):
        file = peer.ROOT / "target" / "peers" / "plan" / f"problem-{os.getpid()}.xml"
        file.write_text(mjcf(problem, False))
        self.scene = Scene("problem", loadMjcfModel(file))
        file.unlink()
        self.scene.setCollisions(list(ignored(problem)), False)
        for number, obstacle in enumerate(problem["request"]["obstacles"]):
            tform = np.eye(4)
            mujoco.mju_quat2Mat(flat := np.zeros(9), np.array(obstacle["pose"]["quaternion"]))
            tform[:3, :3], tform[:3, 3] = flat.reshape(3, 3), obstacle["pose"]["position"]
            box = Box(*(2 * half for half in obstacle["half_extents"]))
            self.scene.addBoxGeometry(f"obstacle{number}", "universe", box, tform, np.ones(4))
        # boards and walls of a shelf touch each other
        obstacles = [f"obstacle{number}" for number in range(len(problem["request"]["obstacles"]))]
        self.scene.setCollisions(list(itertools.combinations(obstacles, 2)), False)
        self.names = self.scene.getJointNames()
        self.scene.addGroup("arms", self.names)
        self.rrt = RRT(
            self.scene,
            RRTOptions(
                group_name="arms",
                max_nodes=PEER_NODES,
                rrt_connect=True,
                collision_check_step_size=step,
                max_planning_time=PEER_SECONDS,
            ),
        )
        self.rrt.setRngSeed(index)
        self.shortcutter = PathShortcutter(self.scene, PathShortcuttingOptions(group_name="arms", max_step_size=step, seed=index))
        self.request = problem["request"]

    def plan(self):
        ends = [np.array(sum((arm[key] for arm in self.request["arms"]), [])) for key in ("start", "goal")]
        self.scene.setJointPositions(ends[0])
        try:
            path = self.rrt.plan(*(JointConfiguration(self.names, end) for end in ends))
        except RuntimeError:
            return None
        return np.array(self.shortcutter.shortcut(path).positions)


def length(path):
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def compare(which, count):
    family, robots = which.split(":")
    ours = subprocess.Popen(
        [peer.cargo("vmao-core", "example", "plan_problems"), family, robots, "-", "--solve"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )
    names = ["vmao", *(f"roboplan, step {step}" for step in PEER_STEPS)]
    results = {name: [] for name in names}
    for index in range(count):
        ours.stdin.write(f"{index}\n")
        ours.stdin.flush()
        problem = json.loads(ours.stdout.readline())
        judge = Judge(problem)
        answers = [(problem["cpu_seconds"], problem["path"])]
        answers += [peer.cpu_seconds(Peer(problem, index, step).plan) for step in PEER_STEPS]
        for name, (cpu, path) in zip(names, answers):
            path = None if path is None else np.array(path)
            results[name].append((cpu, path is not None and length(path), path is not None and judge.deepest(path)))
    ours.stdin.close()
    ours.wait()
    solved = {name: [i for i in range(count) if side[i][1] is not False] for name, side in results.items()}
    all_solved = sorted(set.intersection(*(set(indices) for indices in solved.values())))
    rows, figures = [], {}
    for name, side in results.items():
        times, lengths = [1e3 * cpu for cpu, _, _ in side], [side[i][1] for i in all_solved]
        depths = [side[i][2] for i in solved[name]]
        figures[name] = [peer.median(times), np.mean(times), peer.median(lengths), np.mean(lengths)]
        valid = f"{sum(depth <= 0 for depth in depths)}/{len(depths)}"
        deepest = f"{1e3 * max(0.0, *depths):.1f}"
        shown = [f"{figure:.{digits}f}" for figure, digits in zip(figures[name], [2, 2, 3, 3])]
        ratios = [f"{other / own:.{digits}f}" for other, own, digits in zip(figures[name], figures["vmao"], [1, 1, 2, 2])]
        rows.append([which, name, f"{len(depths)}/{count}", valid, deepest, *shown, *ratios])
    return rows


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    header = ["set", "side", "solved", "valid", "deepest mm", "CPU ms median", "mean", "length rad median", "mean"]
    header += [f"{figure} / ours" for figure in ("CPU median", "CPU mean", "length median", "length mean")]
    peer.table(header, [row for which in sys.argv[2:] or SETS for row in compare(which, count)])


if __name__ == "__main__":
    main()
