"""The method on other objects and numbers of arms: `cells.py FOLDER TRIALS [CELL]...` explores, trains and evaluates each cell, and prints a table.

A cell is one object with one kind of robot, an arm for each part, in sequential order on sizes that were never explored: `pliers-panda`, say. What is already
in FOLDER is not run again, and a cell that was stopped goes on where it was. VMAO names a program to use instead of a fresh build.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TWO_PARTS = ["pliers", "scissors", "stapler", "laptop", "lidded-box", "drawer"]
PARTS = {**{name: 2 for name in TWO_PARTS}, "sticks-4": 4, "sticks-5": 5, "sticks-6": 6}
METHODS = {"vmao": "V-MAO", "best-of-k": "best-of-K"}
STAGES = ["no-contact", "unreachable", "no-plan", "collision", "slip", "threshold", "timeout"]


def settings(name):
    thing, _, robot = name.rpartition("-")
    if thing not in PARTS or robot not in ("panda", "sawyer"):
        raise SystemExit(f"no cell {name}; cells are OBJECT-ROBOT, of {', '.join(PARTS)} and panda, sawyer")
    arms = PARTS[thing]
    changed = {
        "object.name": f'"{thing}"',
        "robots.names": json.dumps([robot] * arms),
        "scene.layout": '"opposed"' if arms == 2 else '"ring"',
        "evaluate.orders": '["sequential"]',
        "evaluate.methods": json.dumps(list(METHODS)),
    }
    if robot == "sawyer":
        changed["scene.base_distance"] = "0.66"  # as in configs/reproduce.toml
    if arms > 2 and robot == "panda":
        changed["grasp.closing_force"] = "35.0"  # N a pad, all that a Panda has: the first hand carries the whole star
    if arms > 4:
        changed["scene.base_distance"] = "0.65"  # m; nearer, six arms fold until their elbows and hands meet
        changed["explore.successes"] = "120"
        changed["explore.most_turn_deg"] = "180"  # one hand carries six sticks: where none may turn in it, seven of eight trials are lost
    if (thing, robot) == ("pliers", "sawyer"):
        changed["robots.sawyer_slot"] = "1"  # slot 2 stays 14 mm open, and three of the twelve sizes are thinner
    return [part for key, value in changed.items() for part in ("--set", f"{key}={value}")]


def run(program, folder, trials, name):
    """results.json of a cell, from its run in `folder`."""
    out = folder / name
    results = out / "results.json"
    if not results.exists():
        resume = ["--resume"] if (out / "run.json").exists() else []
        command = [program, "demo", "--json", "--out", out, "--set", f"evaluate.trials={trials}", *resume, *settings(name)]
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder / f"{name}.log", "a") as log:
            subprocess.run(command, check=True, stdout=log, stderr=log)
    return json.loads(results.read_text())


def row(name, results):
    thing, _, robot = name.rpartition("-")
    cells = {cell["method"]: cell for cell in results["cells"]}
    fields = [thing, f"{PARTS[thing]} × {robot}"]
    for method in METHODS:
        cell = cells[method]
        low, high = (100 * bound for bound in cell["wilson95"])
        fields.append(f"{cell['successes']}/{cell['trials']}: {100 * cell['rate']:.1f} [{low:.1f}, {high:.1f}]")
    lost = [f"{sum(cells[m]['failures'][stage] for m in METHODS)} {stage}" for stage in STAGES]
    fields.append(", ".join(text for text in lost if not text.startswith("0 ")) or "–")
    return "| " + " | ".join(fields) + " |"


def main():
    if len(sys.argv) < 3 or not sys.argv[2].isdigit():
        raise SystemExit(__doc__)
    folder, trials = Path(sys.argv[1]), int(sys.argv[2])
    names = sys.argv[3:] or [f"{thing}-{robot}" for thing in TWO_PARTS for robot in ("panda", "sawyer")] + ["sticks-4-panda", "sticks-6-panda"]
    for name in names:
        settings(name)
    program = os.environ.get("VMAO")
    if not program:
        subprocess.run(["cargo", "build", "--release", "--quiet", "-p", "vmao"], cwd=ROOT, check=True)
        program = ROOT / "target" / "release" / "vmao"
    print(f"| object | arms | {' | '.join(f'{title}, % [95 %]' for title in METHODS.values())} | failures of both |")
    print("|---|---|---|---|---|", flush=True)
    for name in names:
        print(row(name, run(program, folder, trials, name)), flush=True)


if __name__ == "__main__":
    main()
