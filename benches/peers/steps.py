#!/usr/bin/env python3
"""What a physics step costs under other solver settings: trials of ours replayed, with arms free and with something held.

Arguments: object, robot (panda or sawyer), order, how many trials, then the settings, each `option=value` or several with commas between;
an option is an attribute of MuJoCo's <option>, or `condim` of all geoms. Every setting replays the same targets; the shipped one comes first.
"""

import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import peer

peer.environment("trial", ["mujoco==3.17.0", "numpy==2.4.6"])

import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import numpy_osc  # noqa: E402

OBJECT, ROBOT, ORDER, TRIALS = sys.argv[1:5]
SETTINGS = ["", *sys.argv[5:]]
GRIPPED = 0.56  # s after a gripper was told to close: it holds, or the trial has ended

program = peer.cargo("vmao-sim", "example", "trial_targets")


def changed(scene, settings):
    """The scene with other options."""
    for setting in filter(None, settings.split(",")):
        key, value = setting.split("=")
        scene, found = re.subn(rf'(?<= {key}=")[^"]*', value, scene, count=0 if key == "condim" else 1)
        if not found:
            scene = scene.replace("<option ", f'<option {key}="{value}" ', 1)
    return mujoco.MjModel.from_xml_string(scene)


def touched_part(model, data, arm):
    """The part between the pads of this arm, if any."""
    for contact in data.contact:
        names = [model.geom(int(geom)).name for geom in contact.geom]
        if any(name.startswith(f"arm{arm}/pad") for name in names):
            parts = [name.split("/")[1] for name in names if name.startswith("object/")]
            if parts:
                return parts[0]
    return None


def part_in_hand(data, arm, part):
    """Rotation matrix of a part as the hand sees it."""
    hand = data.site_xmat[arm.site].reshape(3, 3)
    return hand.T @ data.body(f"object/{part}").xmat.reshape(3, 3)


def replay(model, description, commands):
    """CPU seconds and steps with nothing and with something held, contacts, and how far parts turned in the pads (degrees)."""
    data = mujoco.MjData(model)
    arms = numpy_osc.arms(model, data, description, commands.shape[1])
    mass = np.zeros((model.nv, model.nv))
    seconds, steps, contacts = [0.0, 0.0], [0, 0], 0
    closed, held = [0] * len(arms), {}
    for targets in commands:
        started = time.thread_time()
        mujoco.mj_step1(model, data)
        spent = time.thread_time() - started
        numpy_osc.mass_matrix(model, data, mass)
        for arm, target in zip(arms, targets):
            arm.command(mass, target)
        started = time.thread_time()
        mujoco.mj_step2(model, data)
        gripping = int(any(target[20] == 1.0 for target in targets))
        seconds[gripping] += spent + time.thread_time() - started
        steps[gripping] += 1
        contacts += data.ncon if gripping else 0
        for index, target in enumerate(targets):
            closed[index] = closed[index] + 1 if target[20] == 1.0 else 0
            if closed[index] == round(GRIPPED / model.opt.timestep):
                part = touched_part(model, data, index)
                if part is not None:
                    held[index] = (part, part_in_hand(data, arms[index], part))
    turned = [
        np.degrees(np.arccos(np.clip((np.trace(before.T @ part_in_hand(data, arms[index], part)) - 1) / 2, -1.0, 1.0)))
        for index, (part, before) in held.items()
    ]
    return seconds, steps, contacts, turned


with tempfile.TemporaryDirectory() as folder:
    command = [program, OBJECT, ROBOT, ORDER, TRIALS, folder]
    answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    scene = (Path(folder) / "scene.xml").read_text()
    models = [changed(scene, settings) for settings in SETTINGS]
    sums = [[np.zeros(2), np.zeros(2), 0, []] for _ in models]
    for description in filter(lambda description: description["success"], map(json.loads, answer.splitlines())):
        commands = np.fromfile(Path(folder) / f"{description['index']}.bin").reshape(description["steps"], -1, 22)
        for model, total in zip(models, sums):
            seconds, steps, contacts, turned = replay(model, description, commands)
            total[0] += seconds
            total[1] += steps
            total[2] += contacts
            total[3] += turned

rows = []
for settings, (seconds, steps, contacts, turned) in zip(SETTINGS, sums):
    free, held = seconds / np.maximum(steps, 1) * 1e6
    rows.append([
        settings or "as shipped", f"{seconds.sum() / steps.sum() * 1e6:.1f}", f"{free:.1f}", f"{held:.1f}", f"{contacts / steps[1]:.1f}",
        f"{np.mean(turned):.2f}°" if turned else "–", f"{np.max(turned):.2f}°" if turned else "–", len(turned),
    ])
peer.table(["setting", "µs a step", "free", "gripping", "contacts, gripping", "turned in the pads, mean", "most", "holds"], rows)
