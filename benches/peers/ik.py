"""Inverse kinematics beside optik-py, roboticstoolbox-python and frankik: the same reachable flange poses and seeds for all.

python3 benches/peers/ik.py [TARGETS]    (default 1000 a robot)

Ours is called from Rust and the peers from Python, as each is meant to be called; the peers' time contains that of their
Python call. Building of models and tables and imports are left out on all sides, and in each of 5 rounds every side
solves all targets once before the clock starts. Every answer is judged by MuJoCo's kinematics
of a chain written here from the robots' published tables: within 1 mm and 0.01 rad, inside the limits.
"""

import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import peer

peer.environment(
    "ik",
    ["optik-py==0.5.0", "roboticstoolbox-python==1.5.0", "frankik==1.0.1", "mujoco==3.17.0", "numpy==2.4.6", "scipy==1.17.1"],
)

import mujoco  # noqa: E402
import numpy as np  # noqa: E402

ROUNDS = 5
H = 0.5**0.5
# position and quaternion (w x y z) of each joint on the link before it, and its limits; last the flange
ROBOTS = {
    "panda": [
        ([0, 0, 0.333], [1, 0, 0, 0], (-2.8973, 2.8973)),
        ([0, 0, 0], [H, -H, 0, 0], (-1.7628, 1.7628)),
        ([0, -0.316, 0], [H, H, 0, 0], (-2.8973, 2.8973)),
        ([0.0825, 0, 0], [H, H, 0, 0], (-3.0718, -0.0698)),
        ([-0.0825, 0.384, 0], [H, -H, 0, 0], (-2.8973, 2.8973)),
        ([0, 0, 0], [H, H, 0, 0], (-0.0175, 3.7525)),
        ([0.088, 0, 0], [H, H, 0, 0], (-2.8973, 2.8973)),
        ([0, 0, 0.107], [1, 0, 0, 0], None),
    ],
    "sawyer": [
        ([0, 0, 0.08], [1, 0, 0, 0], (-3.0503, 3.0503)),
        ([0.081, 0.05, 0.237], [0.5, -0.5, 0.5, 0.5], (-3.8095, 2.2736)),
        ([0, -0.14, 0.1425], [H, H, 0, 0], (-3.0426, 3.0426)),
        ([0, -0.042, 0.26], [H, -H, 0, 0], (-3.0439, 3.0439)),
        ([0, -0.125, -0.1265], [H, H, 0, 0], (-2.9761, 2.9761)),
        ([0, 0.031, 0.275], [H, -H, 0, 0], (-2.9761, 2.9761)),
        ([0, -0.11, 0.1053], [0.0616248, 0.06163, -0.704416, 0.704416], (-4.7124, 4.7124)),
        ([0, 0, 0.0245], [H, 0, 0, H], None),
    ],
}


class Judge:
    """MuJoCo's forward kinematics of a chain."""

    def __init__(self, rows):
        text = lambda values: " ".join(repr(float(v)) for v in values)
        body = ""
        for index, (position, quaternion, limits) in reversed(list(enumerate(rows))):
            hinge = f'<joint axis="0 0 1" limited="true" range="{text(limits)}"/>' if limits else ""
            mass = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
            body = f'<body name="b{index}" pos="{text(position)}" quat="{text(quaternion)}">{mass}{hinge}{body}</body>'
        xml = f'<mujoco><compiler angle="radian"/><worldbody>{body}</worldbody></mujoco>'
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        self.flange = self.model.nbody - 1
        self.low, self.high = self.model.jnt_range.T

    def pose(self, q):
        """Position, quaternion and 4 x 4 matrix of the flange."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        matrix = np.eye(4)
        matrix[:3, :3] = self.data.xmat[self.flange].reshape(3, 3)
        matrix[:3, 3] = self.data.xpos[self.flange]
        return self.data.xpos[self.flange].copy(), self.data.xquat[self.flange].copy(), matrix

    def accepts(self, q, target):
        """Whether some solution in `q`, one or a list, reaches the target inside the limits."""
        for q in np.atleast_2d(np.asarray(q, dtype=float)) if q is not None and len(q) else []:
            if not np.isfinite(q).all() or (q < self.low - 1e-9).any() or (q > self.high + 1e-9).any():
                continue
            position, quaternion, _ = self.pose(q)
            dot = min(abs(quaternion @ target[1]), 1.0)
            if np.linalg.norm(position - target[0]) < 1e-3 and 2 * np.arccos(dot) < 0.01:
                return True
        return False


def urdf(rows):
    """The chain as URDF, for optik."""
    from scipy.spatial.transform import Rotation

    text = "<robot name='arm'><link name='l0'/>"
    for index, (position, (w, x, y, z), limits) in enumerate(rows):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # at a quarter turn any one of the angle triples will do
            rpy = Rotation.from_quat([x, y, z, w]).as_euler("xyz")
        origin = "<origin xyz='{} {} {}' rpy='{:.17g} {:.17g} {:.17g}'/>".format(*position, *rpy)
        ends = f"<parent link='l{index}'/><child link='l{index + 1}'/>"
        bounds = f"<axis xyz='0 0 1'/><limit lower='{limits[0]}' upper='{limits[1]}' effort='1' velocity='1'/>" if limits else ""
        kind = "revolute" if limits else "fixed"
        text += f"<link name='l{index + 1}'/><joint name='j{index}' type='{kind}'>{origin}{ends}{bounds}</joint>"
    return text + "</robot>"


def optik(rows):
    """Its mode that stops at the first solution, with its own tolerance and starts."""
    import optik

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(urdf(rows))
        robot = optik.Robot.from_urdf_file(str(path), "l0", f"l{len(rows)}")
    robot.set_parallelism(1)
    config = optik.SolverConfig(solution_mode="speed", max_time=1.0)

    def solve(target, seed):
        answer = robot.ik(config, target[2].tolist(), seed.tolist())
        return None if answer is None else answer[0]

    return solve


def toolbox(rows, **damping):
    """The Levenberg-Marquardt solver in C on an elementary transform sequence, with its own starts and tolerance."""
    import roboticstoolbox as rtb

    sequence = rtb.ETS()
    for position, (w, x, y, z), limits in rows:
        matrix = np.eye(4)
        matrix[:3, 3] = position
        flat = np.zeros(9)
        mujoco.mju_quat2Mat(flat, np.array([w, x, y, z]) / np.linalg.norm([w, x, y, z]))
        matrix[:3, :3] = flat.reshape(3, 3)
        sequence *= rtb.ET.SE3(matrix)
        if limits:
            sequence *= rtb.ET.Rz(qlim=list(limits))

    def solve(target, seed):
        answer = sequence.ik_LM(target[2], q0=seed, slimit=200, **damping)
        return answer.q if answer.success else None

    return solve


def frankik(sizes):
    """Closed form at sampled last angles, all 332 degrees apart; more samples only where fewer found nothing.

    It answers with all solutions that it found; one that is right is enough.
    """
    import frankik

    def solve(target, seed):
        for size in sizes:
            found = frankik.ik_sample_q7(target[2], seed, False, size, 332.0, True)
            if found:
                return found
        return None

    return solve


class Ours:
    """The Rust library, in a process of its own that says what CPU time it took."""

    def __init__(self, program, robot):
        self.child = subprocess.Popen([program, robot], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def solve(self, targets, seeds):
        """Solutions, CPU time of all, wall time of the median."""
        lines = [str(len(targets))]
        for (position, quaternion, _), seed in zip(targets, seeds):
            lines.append(" ".join(repr(float(v)) for v in [*position, *quaternion, *seed]))
        self.child.stdin.write("\n".join(lines) + "\n")
        self.child.stdin.flush()
        answers = [[float(v) for v in self.child.stdout.readline().split()] for _ in targets]
        total, median = (float(v) for v in self.child.stdout.readline().split())
        return answers, total, median


def peer_solve(solve, targets, seeds):
    """Solutions, CPU time of all, CPU time of the median: once without the clock, together, one by one, as `Ours` does it."""
    work = lambda: [solve(target, seed) for target, seed in zip(targets, seeds)]
    work()
    total, answers = peer.cpu_seconds(work)
    single = []
    for target, seed in zip(targets, seeds):
        start = time.process_time()
        solve(target, seed)
        single.append(time.process_time() - start)
    return answers, total, peer.median(single)


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    program = peer.cargo("vmao-core", "example", "ik_solve")
    rows = []
    for robot, chain in ROBOTS.items():
        judge = Judge(chain)
        random = np.random.default_rng(0)
        targets = [judge.pose(q) for q in random.uniform(judge.low, judge.high, (count, 7))]
        seeds = random.uniform(judge.low, judge.high, (count, 7))
        ours = Ours(program, robot)
        sides = {"vmao": ours.solve}
        peers = {"optik-py 0.5.0, speed": optik(chain)}
        if robot == "panda":
            peers["roboticstoolbox-python 1.5.0, ik_LM"] = toolbox(chain)
            peers["roboticstoolbox-python 1.5.0, ik_LM, Sugihara"] = toolbox(chain, method="sugihara", k=1e-4)
            peers["frankik 1.0.1, 60 last angles"] = frankik([60])
            peers["frankik 1.0.1, 8, then 20, 60, 200"] = frankik([8, 20, 60, 200])
        for name, solve in peers.items():
            sides[name] = lambda t, s, solve=solve: peer_solve(solve, t, s)
        solved, means, medians = {}, {name: [] for name in sides}, {name: [] for name in sides}
        for round in range(ROUNDS + 1):
            for name, side in sides.items():
                answers, total, median = side(targets, seeds)
                if round > 0:  # the first round warms up
                    means[name].append(total / count)
                    medians[name].append(median)
                solved[name] = sum(judge.accepts(q, target) for q, target in zip(answers, targets))
        ours.child.stdin.close()
        ours.child.wait()
        for name in sides:
            mean, median = peer.median(means[name]), peer.median(medians[name])
            ratio = mean / peer.median(means["vmao"])
            cells = [f"{100 * solved[name] / count:.1f} %", f"{mean * 1e6:.1f}", f"{median * 1e6:.1f}", f"{ratio:.1f}"]
            rows.append([robot, name, *cells])
    peer.table(["robot", "solver", "solved", "mean, µs CPU", "median, µs", "mean, times ours"], rows)


main()
