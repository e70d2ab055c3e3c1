"""Farthest-point sampling against fpsample's exact variants, nearest neighbours and ball queries against kiddo: `neighbours.py [ROUNDS]`

Points lie on the surfaces of boxes on a plane, as a scene's do. One thread each, CPU time, sides in turns; a k-d tree is built for each cloud and
counts, as ours counts what it prepares. kiddo is compiled for this very processor, ours is not. Answers must agree but for ties: the same samples in
the same order from the same first one, the same nearest, and the first 16 points of the ball.
"""

import json
import os
import subprocess
import sys

import peer

if __name__ == "__main__":
    peer.environment("neighbours", ["fpsample==1.0.2", "numpy==2.4.6"])

import fpsample
import numpy as np

REPEATS, RADIUS, NEAREST, BALL = 20, 0.02, 8, 16
SIZES = [(2048, 2048), (2048, 192), (4096, 1024), (16384, 4096)]
EXACT = {
    "fps_sampling": fpsample.fps_sampling,
    "bucket_fps_kdtree_sampling": fpsample.bucket_fps_kdtree_sampling,
    **{f"bucket_fps_kdline_sampling h={h}": lambda p, n, start_idx, h=h: fpsample.bucket_fps_kdline_sampling(p, n, h, start_idx=start_idx) for h in (3, 5, 7, 9)},
}


def scene(count, seed):
    random = np.random.default_rng(seed)
    points = random.uniform(-1, 1, (count, 3))
    face = random.integers(0, 3, count)
    points[np.arange(count), face] = np.sign(points[np.arange(count), face])
    box = random.integers(0, 3, count)
    half = np.array([[0.1, 0.01, 0.01], [0.01, 0.08, 0.015], [0.25, 0.25, 1e-4]])[box]
    shift = np.array([[0.0, 0.0, 0.01], [0.03, 0.02, 0.015], [0.0, 0.0, 0.0]])[box]
    return (points * half + shift).astype(np.float32)


def share_farthest(points, order):
    """Share of the steps of `order` that take a point as far from all before it as any is: near ties make several orders right."""
    distance, right = np.full(len(points), np.inf), 1
    for before, after in zip(order, order[1:]):
        distance = np.minimum(distance, ((points - points[before]).astype(np.float64) ** 2).sum(axis=1))
        right += distance[after] >= distance.max() * (1 - 1e-5)
    return right / len(order)


def run(program, request):
    done = subprocess.run([program, str(REPEATS)], input=request, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def kiddo():
    folder = peer.ROOT / "benches" / "peers" / "kiddo"
    target = peer.ROOT / "target" / "peers" / "kiddo"
    flags = os.environ | {"RUSTFLAGS": "-C target-cpu=native", "CARGO_TARGET_DIR": str(target)}
    subprocess.run(["cargo", "build", "--release", "--quiet", "--locked"], cwd=folder, env=flags, check=True)
    return target / "release" / "kiddo-peer"


def compare(count, samples, rounds, ours, theirs):
    times, shares = {}, {}

    def note(task, side, seconds, same):
        times.setdefault(task, {}).setdefault(side, []).append(seconds)
        shares.setdefault(task, []).append(same)

    for seed in range(rounds):
        points = scene(count, seed)
        queries = points[np.random.default_rng(seed).permutation(count)[: max(count // 2, 1024)]]
        request = json.dumps({"points": points.tolist(), "queries": queries.tolist(), "radius": RADIUS, "nearest": NEAREST, "samples": samples})
        mine, peers = run(ours, request), run(theirs, request)
        order = np.array(mine["farthest"]["rows"])
        note("farthest points", "vmao", mine["farthest"]["seconds"], share_farthest(points, order))
        for name, sample in EXACT.items():
            work = lambda: [sample(points, samples, start_idx=int(order[0])) for _ in range(REPEATS)][-1]
            seconds, found = peer.cpu_seconds(work)
            note("farthest points", f"fpsample {name}", seconds / REPEATS, share_farthest(points, found))
        near = np.array(mine["nearest"]["rows"]).reshape(len(queries), -1)
        note("8 nearest", "vmao", mine["nearest"]["seconds"], 1.0)
        note("8 nearest", "kiddo", peers["nearest"]["seconds"], np.mean(near == np.array(peers["nearest"]["rows"])))
        balls = np.array(mine["ball"]["rows"]).reshape(len(queries), -1)
        first = [(row[:BALL] + row[:1] * BALL)[:BALL] for row in peers["ball"]["rows"]]
        note("first 16 within 2 cm", "vmao", mine["ball"]["seconds"], 1.0)
        note("first 16 within 2 cm", "kiddo", peers["ball"]["seconds"], np.mean(balls == np.array(first)))
    rows = []
    for task, sides in times.items():
        assert min(shares[task]) > 0.99, f"{task}: only {min(shares[task])} of the answers are the same"
        middle = {side: peer.median(values) for side, values in sides.items()}
        for side, value in middle.items():
            of = f"{samples} of {count}" if task == "farthest points" else f"{len(queries)} in {count}"
            rows.append([task, of, side, f"{value * 1e3:.2f}", f"{value / middle['vmao']:.2f}", f"{min(shares[task]):.2%}"])
    return rows


rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
programs = peer.cargo("vmao-net", "example", "neighbours"), kiddo()
rows = [row for count, samples in SIZES for row in compare(count, samples, rounds, *programs)]
peer.table(["search", "size", "side", "CPU ms", "CPU / ours", "least agreement"], rows)
