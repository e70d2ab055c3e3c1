#!/usr/bin/env python3
"""Whole trials: trials per CPU second against the same scene and targets driven from Python with mujoco 3.17.0 and a NumPy OSC.

Ours: vmao-sim's example `trial_targets`, one whole trial: looking, choosing grasps, planning, control and physics. The peer gets the
scene that ours wrote and, tick by tick, each gripper's target pose, twist, posture and drive as ours computed them; it steps the physics
and computes the torques. It does not look, choose, solve inverse kinematics, plan, evaluate Eq. (1) and (2), or watch for collisions and
lost parts, so its rate is an upper bound of what a trial in Python reaches. Both sides' final errors from the goal are checked.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import peer

peer.environment("trial", ["mujoco==3.17.0", "numpy==2.4.6"])

import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import numpy_osc  # noqa: E402

TRIALS = int(sys.argv[1]) if len(sys.argv) > 1 else 6
POSITION, ROTATION = 0.02, np.radians(10.0)  # [thresholds] of configs/demo.toml

program = peer.cargo("vmao-sim", "example", "trial_targets")


def replay(model, description, commands):
    """Drives the whole trial; the largest distances of the object's parts from their goal poses (m, rad)."""
    data = mujoco.MjData(model)
    arms = numpy_osc.arms(model, data, description, commands.shape[1])
    mass = np.zeros((model.nv, model.nv))
    for targets in commands:
        mujoco.mj_step1(model, data)
        numpy_osc.mass_matrix(model, data, mass)
        for arm, target in zip(arms, targets):
            arm.command(mass, target)
        mujoco.mj_step2(model, data)
    errors = [0.0, 0.0]
    for part, goal in description["goal"].items():
        body = data.body(f"object/{part}")
        errors[0] = max(errors[0], float(np.linalg.norm(body.xpos - goal[:3])))
        errors[1] = max(errors[1], 2 * float(np.arccos(min(1.0, abs(body.xquat @ goal[3:])))))
    return errors


def compare(order):
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "pliers", "panda", order, str(TRIALS), folder]
        answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        descriptions = [json.loads(line) for line in answer.splitlines()]
        model = mujoco.MjModel.from_xml_path(str(Path(folder) / "scene.xml"))
        seconds, agree, worst = [[], []], 0, [[0.0, 0.0], [0.0, 0.0]]
        counted = [description for description in descriptions if description["success"]]
        for description in counted:
            commands = np.fromfile(Path(folder) / f"{description['index']}.bin").reshape(description["steps"], -1, 22)
            spent, errors = peer.cpu_seconds(lambda: replay(model, description, commands))
            agree += errors[0] < POSITION and errors[1] < ROTATION
            seconds[0].append(description["seconds"])
            seconds[1].append(spent)
            for side, found in enumerate((description["errors"], errors)):
                worst[side] = [max(a, b) for a, b in zip(worst[side], found[:2])]
        steps = sum(description["steps"] for description in counted)
    rows = []
    for side, name in enumerate(["vmao, whole trials", "mujoco 3.17.0 and NumPy, control and physics only"]):
        total = sum(seconds[side])
        reached = len(counted) if side == 0 else agree
        rows.append([
            order, name, f"{reached} of {len(counted)}", f"{worst[side][0] * 1e3:.2f} mm, {np.degrees(worst[side][1]):.2f}°",
            f"{len(counted) / total:.2f}", f"{steps / total:.0f}", f"{total / sum(seconds[0]):.1f}",
        ])
    return rows


header = ["order", "side", "at the goal", "largest final error", "trials per CPU second", "steps per CPU second", "CPU time / ours"]
peer.table(header, compare("sequential") + compare("parallel"))
