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

TRIALS = int(sys.argv[1]) if len(sys.argv) > 1 else 6
POSITION, ROTATION = 0.02, np.radians(10.0)  # [thresholds] of configs/demo.toml
SPEED_DAMPING = 100.0  # 1/s, of joints beyond their speed limit, as ours

program = peer.cargo("vmao-sim", "example", "trial_targets")


class Arm:
    """One arm under operational space control (Khatib 1987), with NumPy alone."""

    def __init__(self, model, data, index, description):
        self.model, self.data, self.gains = model, data, description["gains"]
        joint = model.joint(f"arm{index}/joint1")
        finger = model.joint(f"arm{index}/finger1")
        self.q, self.v = slice(joint.qposadr[0], joint.qposadr[0] + 7), slice(joint.dofadr[0], joint.dofadr[0] + 7)
        self.finger = finger.qposadr[0]
        first = model.actuator(f"arm{index}/joint1").id
        self.ctrl, self.drive = slice(first, first + 7), first + 7
        self.limit = model.actuator_ctrlrange[self.ctrl, 1]
        self.force = model.actuator_ctrlrange[self.drive, 1]
        self.speed, self.spring = np.array(description["velocity"]), description["spring"]
        self.site = model.site(f"arm{index}/tool").id
        self.jacobian = np.zeros((6, model.nv))
        gains = self.gains
        self.stiffness = np.array([gains["position"]] * 3 + [gains["rotation"]] * 3)
        self.damping = 2 * gains["ratio"] * np.sqrt(self.stiffness)
        self.rotation, self.quaternion, self.turn = np.zeros(4), np.zeros(4), np.zeros(3)
        self.error = np.zeros(6)

    def pose_error(self, position, quaternion):
        """Linear, then angular, world frame; each no longer than the gains allow."""
        error = self.error
        error[:3] = position - self.data.site_xpos[self.site]
        mujoco.mju_mat2Quat(self.quaternion, self.data.site_xmat[self.site])
        mujoco.mju_negQuat(self.quaternion, self.quaternion)
        mujoco.mju_mulQuat(self.rotation, quaternion, self.quaternion)
        mujoco.mju_quat2Vel(self.turn, self.rotation, 1.0)
        error[3:] = self.turn
        for part, most in ((error[:3], self.gains["far"]), (error[3:], self.gains["turned"])):
            norm = np.sqrt(part @ part)
            if norm > most:
                part *= most / norm
        return error

    def task_inertia(self, inverse):
        """Damped near a singular pose only."""
        gains = self.gains
        distance = 0.0
        try:
            inertia = np.linalg.inv(inverse)
            distance = 1.0 / np.trace(inertia)
        except np.linalg.LinAlgError:
            inertia = None
        if inertia is not None and distance >= gains["onset"]:
            return inertia
        return np.linalg.inv(inverse + np.eye(6) * gains["damping"] * (1 - max(distance, 0.0) / gains["onset"]) ** 2)

    def command(self, full_mass, target):
        data, gains = self.data, self.gains
        mujoco.mj_jacSite(self.model, data, self.jacobian[:3], self.jacobian[3:], self.site)
        jacobian, mass = self.jacobian[:, self.v], full_mass[self.v, self.v]
        q, v = data.qpos[self.q], data.qvel[self.v]
        bias = data.qfrc_bias[self.v] - data.qfrc_passive[self.v]
        error = self.pose_error(target[:3], target[3:7])
        acceleration = self.stiffness * error + self.damping * (target[7:13] - jacobian @ v)
        inverse_mass_jt = np.linalg.solve(mass, jacobian.T)
        inertia = self.task_inertia(jacobian @ inverse_mass_jt)
        posture = mass @ (gains["posture"] * (target[13:20] - q) - 2 * np.sqrt(gains["posture"]) * v)
        # The task's forces, and the posture's torques less what they would do to the task.
        wanted = jacobian.T @ (inertia @ (acceleration - inverse_mass_jt.T @ posture)) + posture
        excess = v - np.clip(v, -self.speed, self.speed)
        if excess.any():
            wanted -= mass @ excess * SPEED_DAMPING
        room = self.limit - np.minimum(np.abs(bias), self.limit)
        scale = np.min(room / np.maximum(np.abs(wanted), room))
        data.ctrl[self.ctrl] = np.clip(wanted * scale + bias, -self.limit, self.limit)
        pull = -target[21] if target[20] == 1.0 else self.spring * (target[21] - data.qpos[self.finger])
        data.ctrl[self.drive] = min(max(pull, -self.force), self.force)


def replay(model, description, commands):
    """Drives the whole trial; the largest distances of the object's parts from their goal poses (m, rad)."""
    data = mujoco.MjData(model)
    data.qpos[:] = description["qpos"]
    mujoco.mj_forward(model, data)
    arms = [Arm(model, data, index, description) for index in range(commands.shape[1])]
    mass = np.zeros((model.nv, model.nv))
    for targets in commands:
        mujoco.mj_step1(model, data)
        mujoco.mj_fullM(model, mass, data.qM) if hasattr(data, "qM") else mujoco.mj_fullM(model, data, mass)
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
        answer = subprocess.run([program, order, str(TRIALS), folder], check=True, capture_output=True, text=True).stdout
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
