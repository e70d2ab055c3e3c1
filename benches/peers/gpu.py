"""A training step on a GPU against PyTorch's on the same GPU, same network, weights, batch and latent noise: `gpu.py [ROUNDS] [CONFIG.toml]...`

Where there is no GPU one line says so, and nothing is built or measured. Network and peer are those of network.py, on the CUDA device, the peer in both
layouts, and with products in full and in reduced precision (TF32, which our side's library picks for itself). Neighbours are found before; a step counts the batch's way to the device, forward,
backward, Adam and the loss's way back. Wall time: a GPU's work is no CPU time.
"""

import json
import os
import shutil
import subprocess
import sys
import time

import peer

ABSENT = "no GPU on this machine (nvidia-smi lists none): nothing was measured"
if __name__ == "__main__":
    tool = shutil.which("nvidia-smi")
    if tool is None or "GPU 0" not in subprocess.run([tool, "-L"], capture_output=True, text=True).stdout:
        print(ABSENT)
        sys.exit(0)
    peer.environment("network", ["torch==2.13.0", "numpy==2.4.6", "safetensors==0.8.0"])

import network
import torch

STEPS, WARM = 20, 5


def on_device(batch):
    """The batch with all its arrays on the GPU."""
    there = lambda x: x.to("cuda", non_blocking=True)
    edges = lambda layers: [(there(sources), there(offsets), k) for sources, offsets, k in layers]
    arrays = [there(x) for x in (batch.features, batch.posterior_features, batch.map_means, batch.targets)]
    return network.Batch(batch.clouds, *arrays, edges(batch.down), edges(batch.up), batch.sizes, [there(owners) for owners in batch.owners])


def theirs(folder, layout, precision):
    """One turn of the peer, in this process; prints what our example prints."""
    torch.set_float32_matmul_precision(precision)
    kind, ready = (network.Channels, network.channels_batch) if layout == "conv" else (network.Network, lambda batch: batch)
    config, file, batch = network.load(folder, network.CLOUDS)
    batch, weights = ready(batch), network.start(file, "cuda")
    model, optimiser = kind("vmao", config, weights), torch.optim.Adam(weights.values(), network.LEARNING_RATE)
    losses, times = [], []
    for _ in range(WARM + STEPS):
        torch.cuda.synchronize()
        start = time.perf_counter()
        losses.append(network.descend(model, optimiser, on_device(batch), file["noise"].to("cuda"), config))
        torch.cuda.synchronize()
        times.append(time.perf_counter() - start)
    print(json.dumps({"losses": losses, "times": times[WARM:]}))


def ours(program, folder):
    answer = network.run([program, folder, network.CLOUDS, os.cpu_count(), WARM + STEPS, "step", "cuda"])
    return answer | {"times": [wall for _, wall in answer["times"][WARM:]]}


def compare(name, config, rounds, program):
    folder = network.FOLDER / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "network.json").write_text(json.dumps(config))
    subprocess.run([str(c) for c in [program, folder, network.CLOUDS, os.cpu_count(), 1, "export"]], check=True)
    sides = {"vmao": lambda: ours(program, folder)}
    for layout in ["rows", "conv"]:
        for precision in ["highest", "high"]:
            command = [sys.executable, __file__, "--side", folder, layout, precision]
            sides[f"PyTorch, {layout}, {precision}"] = lambda command=command: network.run(command)
    turns = {side: [] for side in sides}
    for _ in range(rounds):
        for side, turn in sides.items():
            turns[side].append(turn())
    first = {side: turn[0]["losses"][0] for side, turn in turns.items()}
    worst = max(abs(loss - first["vmao"]) / first["vmao"] for loss in first.values())
    assert worst < 1e-2, f"the sides start from different losses: {first}"
    assert all(turn[0]["losses"][-1] < turn[0]["losses"][0] for turn in turns.values()), "a side does not learn"
    wall = {side: min(t for turn in turn for t in turn["times"]) for side, turn in turns.items()}
    print(f"\n{name}: {config['points']} points, {network.CLOUDS} clouds a step; losses of the first step differ by {worst:.1e}\n")
    peer.table(["side", "wall ms", "wall / ours"], [[side, f"{t * 1e3:.2f}", f"{t / wall['vmao']:.2f}"] for side, t in wall.items()])


def build():
    command = ["cargo", "build", "--release", "--quiet", "-p", "vmao-net", "--features", "cuda", "--example", "network_step"]
    subprocess.run(command, cwd=peer.ROOT, check=True)
    return peer.ROOT / "target" / "release" / "examples" / "network_step"


if __name__ == "__main__":
    if "--side" in sys.argv:
        folder, layout, precision = sys.argv[2:]
        theirs(peer.ROOT / folder, layout, precision)
    else:
        rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
        built = build()
        print(f"Wall time, least of {rounds} turns of {STEPS} steps; {torch.cuda.get_device_name()}, torch {torch.__version__}.")
        compare("demo", network.layered([]), rounds, built)
        for path in sys.argv[2:]:
            compare(os.path.basename(path).removesuffix(".toml"), network.layered([path]), rounds, built)
