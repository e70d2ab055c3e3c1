"""A sweep over sizes and constants of the network, one at a time about the shipped ones: `sweep.py FOLDER OBJECT EPOCHS TRIALS SEEDS [VARIANT]...`

Explores OBJECT once into FOLDER (seed 1, 200 successes), trains V-MAO on it for each variant and each seed below SEEDS with a quarter of the examples
held out (the same ones for all variants), and lets the networks grasp in TRIALS parallel trials on held-out instances. What FOLDER already holds is not run again. Prints a table;
VMAO names a program to use instead of a fresh build.
"""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import peer

SCENES = {
    "pliers": [],
    "laptop": ['robots.names=["sawyer","sawyer"]'],
    "three-sticks": ['robots.names=["panda","panda","panda"]'],
}


def widths(factor):
    down = [(192, 0.015, [16, 32]), (64, 0.03, [32, 64]), (16, 0.06, [64, 64]), (1, 10.0, [64, 96])]
    up = [(1, [64], [64]), (4, [64], [64]), (4, [48], [32]), (3, [32], [32])]
    scaled = lambda channels: [round(factor * c) for c in channels]
    return [abstraction([(n, r, scaled(c)) for n, r, c in down]), up_conv([(k, scaled(c), scaled(s)) for k, c, s in up])]


def abstraction(levels):
    rows = [f"{{num_centroids={n}, radius={r}, num_neighbours=16, channels={c}}}" for n, r, c in levels]
    return f"network.abstraction=[{', '.join(rows)}]"


def up_conv(layers):
    return f"network.up_conv=[{', '.join(f'{{num_neighbours={k}, channels={c}, refine={s}}}' for k, c, s in layers)}]"


VARIANTS = {
    "as shipped": [],
    "1024 points": ["network.points=1024", "cameras.points=1024"],
    "384 centroids": [abstraction([(384, 0.015, [16, 32]), (96, 0.03, [32, 64]), (24, 0.06, [64, 64]), (1, 10.0, [64, 96])])],
    "radii times 0.7": [abstraction([(192, 0.0105, [16, 32]), (64, 0.021, [32, 64]), (16, 0.042, [64, 64]), (1, 10.0, [64, 96])])],
    "radii times 1.4": [abstraction([(192, 0.021, [16, 32]), (64, 0.042, [32, 64]), (16, 0.084, [64, 64]), (1, 10.0, [64, 96])])],
    "widths halved": widths(0.5),
    "widths doubled": widths(2),
    "Z 8": ["network.latent_size=8"],
    "beta 0.1": ["network.beta=0.1"],
    "no free bits": ["network.free_bits=0"],
    "label 4 mm": ["network.label_sigma=0.004"],
    "label 9 mm": ["network.label_sigma=0.009"],
    "no colour change": ["train.augmentation.color_gain=0.0"],
    "all turns": ["train.augmentation.rotation=3.14159"],
}


def run(log, *command):
    """The program's JSON answer and its CPU seconds; both are kept in `log`."""
    if not log.exists():
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([str(c) for c in command], check=True, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        log.write_text(json.dumps({"answer": json.loads(done.stdout), "seconds": seconds}))
    kept = json.loads(log.read_text())
    return kept["answer"], kept["seconds"]


def settings(values):
    return [part for value in values for part in ("--set", value)]


def main():
    folder, name, epochs, trials, seeds, *chosen = sys.argv[1:]
    folder = Path(folder) / name
    folder.mkdir(parents=True, exist_ok=True)
    program = os.environ.get("VMAO") or peer.cargo("vmao", "bin", "vmao")
    scene = [f'object.name="{name}"', *SCENES[name]]
    data = folder / "data"
    run(folder / "data.json", program, "explore", "--json", "--workers", 1, "--seed", 1, "--successes", 200, "--max-trials", 500, *settings(scene), "--out", data)
    rows = []
    for variant, seed in [(variant, seed) for variant in chosen or VARIANTS for seed in range(int(seeds))]:
        own = settings([*scene, f"train.epochs={epochs}", "train.validation_fraction=0.25", 'evaluate.methods=["vmao"]', *VARIANTS[variant]])
        place = folder / f"{variant.replace(' ', '-')}-{seed}"
        log = lambda what: folder / f"{place.name}.{what}.json"
        command = lambda name, *rest: (program, name, "--json", "--workers", 1, "--seed", seed, *rest, *own, "--out")
        trained, seconds = run(log("train"), *command("train", "--data", data, "--model", "vmao"), place)
        tried = command("evaluate", "--checkpoint", place, "--order", "parallel", "--trials", trials)
        results, _ = run(log("evaluate"), *tried, folder / f"{place.name}.results")
        cell = results["cells"][0]
        terms = list(trained["validation"].values())
        entropy = " ".join(f"{t['reconstruction']:.2f}" for t in terms)
        divergence = " ".join(f"{t['kl']:.2f}" for t in terms)
        contact = sum(cell["failures"][stage] for stage in ["no-contact", "unreachable"])
        rows.append([variant, seed, entropy, divergence, f"{cell['successes']} of {cell['trials']}", contact, f"{seconds:.0f}"])
        print(rows[-1], file=sys.stderr, flush=True)
    print(f"\n{name}, {epochs} epochs\n")
    peer.table(["variant", "seed", "cross-entropy", "KL", "succeeded", "no grasp found", "training CPU s"], rows)


if __name__ == "__main__":
    main()
