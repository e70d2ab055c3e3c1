#!/usr/bin/env python3
"""Control rollouts of two Pandas: physics steps per CPU second, against robosuite 1.5.2 TwoArmLift with mujoco 3.3.7.

Both sides run operational space control of two Panda arms at 500 Hz physics, random goals at 20 Hz, an object on the table.
Ours: vmao-sim's example `osc_rollout` (its process, scene compilation included). Theirs: `env.step`, after construction.
"""

import json
import logging
import os
import resource
import subprocess

import peer

peer.environment("osc", ["robosuite==1.5.2", "mujoco==3.3.7", "numpy==1.26.4"])
os.environ["MUJOCO_GL"] = "disabled"
logging.disable(logging.WARNING)

import numpy as np  # noqa: E402
import robosuite  # noqa: E402
from robosuite.controllers import load_composite_controller_config  # noqa: E402

ROUNDS = 5
COMMANDS = 200  # 10 s of simulated time a round for the peer
SECONDS = 100  # simulated by us in a round: ten times as much, so that compiling the scene weighs little
OBJECT = "pliers"
SUBSTEPS = 25

program = peer.cargo("vmao-sim", "example", "osc_rollout")
environment = robosuite.make(
    "TwoArmLift",
    robots=["Panda", "Panda"],
    controller_configs=load_composite_controller_config(controller="BASIC"),
    has_renderer=False,
    has_offscreen_renderer=False,
    use_camera_obs=False,
    control_freq=20,
    horizon=10**9,
    seed=0,
)
assert abs(environment.model_timestep * SUBSTEPS * 20 - 1.0) < 1e-9, "the peer does not take 25 steps of 2 ms a command"


def hands():
    data = environment.sim.data
    return np.array([data.site_xpos[robot.eef_site_id["right"]] for robot in environment.robots])


def theirs():
    """Random actions x 0.3, as in the sheet of facts."""
    random = np.random.default_rng(0)
    environment.reset()
    low, high = environment.action_spec
    contacts, path, last = 0, np.zeros(2), hands()

    def work():
        nonlocal contacts, path, last
        for _ in range(COMMANDS):
            environment.step(random.uniform(low, high) * 0.3)
            contacts += environment.sim.data.ncon
            path, last = path + np.linalg.norm(hands() - last, axis=1), hands()

    seconds, _ = peer.cpu_seconds(work)
    assert np.isfinite(environment.sim.data.qpos).all() and (path > 0.1).all(), f"the peer's hands went {path} m"
    return COMMANDS * SUBSTEPS / seconds, contacts / COMMANDS, path / COMMANDS / 0.05


def ours(seed):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = subprocess.run([program, str(SECONDS), OBJECT, str(seed)], check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    rollout = json.loads(answer)
    assert rollout["steps"] == SECONDS * 500, rollout
    # Goals jump at 20 Hz, so that a hand is always a little behind; an arm that did not follow would be 10 cm off.
    assert rollout["position_error"] < 0.03 and rollout["rotation_error"] < 0.3, rollout
    return rollout["steps"] / seconds, rollout["contacts"], np.array(rollout["hand_paths"]) / SECONDS, rollout["outside"]


theirs()  # warm-up: first calls compile numba kernels
rounds = [(ours(seed), theirs()) for seed in range(ROUNDS)]
mine, peers = zip(*rounds)
columns = ["steps per CPU second", "contacts", "hand speed (m/s)", "outside mj_step"]
rate = [peer.median([side[0] for side in sides]) for sides in (mine, peers)]
load = [np.mean([side[1] for side in sides]) for sides in (mine, peers)]
speed = [np.mean([side[2] for side in sides]) for sides in (mine, peers)]
outside = peer.median([side[3] for side in mine])
peer.table(
    ["side", *columns],
    [
        ["vmao", f"{rate[0]:.0f}", f"{load[0]:.1f}", f"{speed[0]:.3f}", f"{outside:.1%}"],
        ["robosuite 1.5.2, mujoco 3.3.7", f"{rate[1]:.0f}", f"{load[1]:.1f}", f"{speed[1]:.3f}", "not measured"],
    ],
)
ratios = sorted(a[0] / b[0] for a, b in rounds)
print(f"ratio of the medians {rate[0] / rate[1]:.1f}; rounds {ratios[0]:.1f} to {ratios[-1]:.1f}")
