#!/usr/bin/env python3
"""Exploration on one worker and on two: how many times the trials a second, in turns, the best of several runs.

Wants two idle cores: the share of a core that other work took from each run is printed beside it.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time

import peer

ROUNDS = int(sys.argv[1]) if len(sys.argv) > 1 else 5
TRIALS = 32  # two rounds of Algorithm 1

program = peer.cargo("vmao", "bin", "vmao")


def explore(workers):
    """Wall time and CPU time of a run, and the digest of what it found."""
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "explore", "--seed", "0", "--workers", str(workers), "--successes", "1000", "--max-trials", str(TRIALS)]
        command += ["--set", "trial.order=parallel", "--out", os.path.join(folder, "set")]
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return wall, cpu, json.loads(answer)["digest"]


rounds = [(explore(1), explore(2)) for _ in range(ROUNDS)]
digests = {run[2] for pair in rounds for run in pair}
assert len(digests) == 1, f"workers change the data set: {digests}"
rows = []
for index, (one, two) in enumerate(rounds):
    rows.append([index + 1, f"{one[0]:.2f}", f"{one[1] / one[0]:.2f}", f"{two[0]:.2f}", f"{two[1] / two[0]:.2f}", f"{one[0] / two[0]:.2f}"])
peer.table(["round", "1 worker, s", "cores used", "2 workers, s", "cores used", "times as fast"], rows)
best = [min(pair[workers][0] for pair in rounds) for workers in (0, 1)]
print(f"best of {ROUNDS}: {best[0]:.2f} s and {best[1]:.2f} s, {best[0] / best[1]:.2f} times as fast; {TRIALS} trials, load {os.getloadavg()[0]:.1f}")
