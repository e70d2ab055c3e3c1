"""Training steps and sampled maps against PyTorch, same network, weights, batch and latent noise: `network.py [ROUNDS] [CONFIG.toml]...`

The network is that of [network] in configs/demo.toml, under each CONFIG laid over it. The peer is crates/vmao-net/goldens/pytorch_network.py
in float32 in two layouts: rows × channels (`Linear`) and clouds × channels × points (`Conv2d` 1x1); ratios are to the faster one. Both
sides use 2 threads and take turns, a process for each turn, so that the peak memory is that of the task. Neighbours are given to both, but where a row says
"search": there each side finds them itself, the peer in the batched way usual for PointNet++. Losses and maps of both sides must agree.
"""

import json
import os
import subprocess
import sys
import time
import tomllib

import peer

if __name__ == "__main__":
    peer.environment("network", ["torch==2.13.0", "numpy==2.4.6", "safetensors==0.8.0"])

sys.path.insert(0, str(peer.ROOT / "crates" / "vmao-net" / "goldens"))
import torch
from pytorch_network import Batch, Network
from safetensors.torch import load_file
from torch.nn import functional

CLOUDS, THREADS, STEPS, LEARNING_RATE, LATENT = 8, 2, 4, 1e-3, 0.5
FOLDER = peer.ROOT / "target" / "peers" / "network-data"


class Channels(Network):
    """The layout of PointNet++'s own code: clouds × channels × points, or × centres × neighbours, and convolutions with 1x1 kernels."""

    def norm_linear(self, name, x):
        weight = self.weights[f"{name}.weight"].T
        if x.dim() == 3:
            z = functional.conv1d(x, weight[:, :, None])
        else:
            z = functional.conv2d(x, weight[:, :, None, None])
        return torch.relu(self.normalised(name, z))

    def grouped(self, name, depth, x, edges):
        sources, offsets, _ = edges
        clouds, centres, k = sources.shape
        flat = sources.view(clouds, 1, -1).expand(-1, x.shape[1], -1)
        y = torch.cat([offsets, x.gather(2, flat).view(clouds, -1, centres, k)], 1)
        for j in range(depth):
            y = self.norm_linear(f"{name}.{j}", y)
        return y.max(3).values

    def spread(self, z, owners):
        return z[:, :, None].expand(-1, -1, len(owners) // len(z))

    def pooled(self, x, clouds):
        return x.amax(2)

    def head(self, x, modulators, sizes):
        return super().head(x.transpose(1, 2).flatten(0, 1), modulators, sizes)


def channels_batch(rows):
    """The batch in the layout of `Channels`; sources become numbers within a cloud."""
    split = lambda x: x.unflatten(0, (rows.clouds, -1)).transpose(1, 2).contiguous()

    def edges(e, table):
        sources, offsets, k = e
        local = sources.view(rows.clouds, -1, k) - torch.arange(rows.clouds)[:, None, None] * (table // rows.clouds)
        return local, offsets.view(rows.clouds, -1, k, 3).permute(0, 3, 1, 2).contiguous(), k

    tables = [len(owners) for owners in rows.owners]
    down = [edges(e, tables[i]) for i, e in enumerate(rows.down)]
    up = [edges(e, tables[i + 1]) for i, e in enumerate(rows.up)]
    features, posterior = split(rows.features), split(rows.posterior_features)
    return Batch(rows.clouds, features, posterior, rows.map_means, rows.targets, down, up, rows.sizes, rows.owners)


def load(folder, clouds):
    """The first `clouds` clouds of the exported batch, and everything else of the file."""
    config = json.loads((folder / "network.json").read_text())
    file = load_file(folder / "batch.safetensors")
    points = len(file["features"]) // CLOUDS
    counts = [points] + [level["num_centroids"] for level in config["abstraction"]]
    neighbours = [level["num_neighbours"] for level in config["abstraction"]]
    nearest = [layer["num_neighbours"] for layer in reversed(config["up_conv"])]

    def edges(flow, i, k):
        sources, offsets = file[f"{flow}.{i}.sources"].long(), file[f"{flow}.{i}.offsets"]
        kept = len(sources) // CLOUDS * clouds
        return sources[:kept].clone(), offsets[:kept].clone(), k

    batch = Batch(
        clouds,
        *(file[name][: len(file[name]) // CLOUDS * clouds].clone() for name in ["features", "posterior_features", "map_means", "targets"]),
        [edges("down", i, k) for i, k in enumerate(neighbours)],
        [edges("up", i, k) for i, k in enumerate(nearest)],
        [points] * clouds,
        [torch.arange(clouds).repeat_interleave(count) for count in counts],
    )
    return config, file, batch


def take(points, index):
    """points[b, index[b]]: clouds × any shape × 3."""
    flat = index.flatten(1)[:, :, None].expand(-1, -1, 3)
    return points.gather(1, flat).unflatten(1, index.shape[1:])


def find_neighbours(points, config):
    """Farthest-point order and all neighbours of clouds × points × 3, batched, as PointNet++ in PyTorch usually does it."""
    exact = "donot_use_mm_for_euclid_dist"
    clouds, count, _ = points.shape
    distances = torch.cdist(points, points, compute_mode=exact)
    spacing = distances.topk(9, largest=False).values.mean(2)
    weights = spacing.clamp(min=5e-4) ** (-2 * config["density_power"])
    last = (weights * (points - points.mean(1, keepdim=True)).square().sum(2)).argmax(1)
    gap, order, each = torch.full((clouds, count), torch.inf), torch.empty(clouds, count, dtype=torch.long), torch.arange(clouds)
    for i in range(count):
        order[:, i] = last
        gap[each, last] = -torch.inf
        gap = torch.minimum(gap, weights * (points - points[each, last][:, None]).square().sum(2))
        last = gap.argmax(1)
    near = distances <= config["abstraction"][0]["radius"]
    outward = points - (near.float() @ points) / near.sum(2, keepdim=True)
    fine, found = take(points, order), {"order": order, "outward": outward}
    for i, (level, up) in enumerate(zip(config["abstraction"], reversed(config["up_conv"]))):
        coarse, k = fine[:, : level["num_centroids"]], level["num_neighbours"]
        outside = torch.cdist(coarse, fine, compute_mode=exact) > level["radius"]
        index = torch.arange(fine.shape[1]).expand_as(outside).masked_fill(outside, fine.shape[1])
        ball = index.topk(k, largest=False, sorted=True).values
        found[f"down.{i}"] = torch.where(ball == fine.shape[1], ball[:, :, :1], ball)
        found[f"up.{i}"] = torch.cdist(fine, coarse, compute_mode=exact).topk(up["num_neighbours"], largest=False).indices
        fine = coarse
    return found


def same_neighbours(found, file, config, points):
    """Share of the peer's neighbours that are ours; rounding moves points over the edges of balls."""
    counts = [points] + [level["num_centroids"] for level in config["abstraction"]]
    shares = [(found["order"].flatten() == file["order"]).float().mean().item()]
    for i in range(len(counts) - 1):
        for flow, table in [("down", counts[i]), ("up", counts[i + 1])]:
            base = torch.arange(CLOUDS)[:, None, None] * table
            shares.append(((found[f"{flow}.{i}"] + base).flatten() == file[f"{flow}.{i}.sources"]).float().mean().item())
    return min(shares)


def start(file, device="cpu"):
    """The weights that a training of ours starts from."""
    weights = {name[len("weight.") :]: value for name, value in file.items() if name.startswith("weight.")}
    vectors = {name for name, value in weights.items() if len(value) == 1 and name.endswith(("bias", "norm.weight"))}
    leaf = lambda name, value: (value.flatten() if name in vectors else value).clone().to(device).requires_grad_()
    return {name: leaf(name, value) for name, value in weights.items()}


def descend(model, optimiser, batch, noise, config):
    """One training step; the loss before it, with the whole divergence."""
    optimiser.zero_grad(set_to_none=True)
    cross_entropy, kl, charged, _ = model.terms(batch, noise)
    (cross_entropy + config["beta"] * charged).backward()
    optimiser.step()
    return (cross_entropy + config["beta"] * kl).item()


def theirs(folder, layout, task):
    """One turn of the peer, in this process; prints what our example prints."""
    torch.set_num_threads(THREADS)
    before = memory("VmHWM")
    network, ready = (Channels, channels_batch) if layout == "conv" else (Network, lambda batch: batch)
    config, file, batch = load(folder, 1 if task == "map" else CLOUDS)
    batch = ready(batch)
    answer = {"start_kib": before}
    if task == "map":
        weights = {name: value for name, value in load_file(folder / "warmed.safetensors").items()}
        model, z = network("vmao", config, weights), torch.full((1, config["latent_size"]), LATENT)
        points = file["points"][None, : batch.sizes[0]]
        with torch.inference_mode():
            encode = lambda: model.encode("scene", batch.features, batch.down)
            code = lambda: torch.softmax(model.decode(batch, scene, z)[0], 0)
            scene = encode()
            ours = torch.tensor(json.loads((folder / "map.json").read_text())).T
            difference = (code() - ours[file["order"][: batch.sizes[0]].long()]).abs().max() / ours.max()
            given = lambda: torch.softmax(model.decode(batch, encode(), z)[0], 0)
            answer |= {"difference": difference.item(), "code": timed(STEPS, code), "given": timed(STEPS, given)}
            answer["whole"] = timed(STEPS, lambda: (find_neighbours(points, config), given()))
    else:
        weights = start(file)
        model, optimiser = network("vmao", config, weights), torch.optim.Adam(weights.values(), LEARNING_RATE)
        losses, clouds = [], file["points"].unflatten(0, (CLOUDS, -1))

        def step():
            if task == "search":
                find_neighbours(clouds, config)
            losses.append(descend(model, optimiser, batch, file["noise"], config))

        if task == "search":
            answer["same"] = same_neighbours(find_neighbours(clouds, config), file, config, batch.sizes[0])
        step()
        answer |= {"times": timed(STEPS, step), "losses": losses}
    print(json.dumps(answer | {"vm_hwm_kib": memory("VmHWM")}))


def timed(steps, work):
    """CPU and wall seconds of each repetition."""
    times = []
    for _ in range(steps):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        times.append([time.process_time() - cpu, time.perf_counter() - wall])
    return times


def memory(field):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(field))


def layered(paths):
    """[network] of the shipped configuration with the files laid over it."""
    network = tomllib.loads((peer.ROOT / "configs" / "demo.toml").read_text())["network"]
    for path in paths:
        network |= tomllib.loads(open(path).read())["network"]
    return network


def run(command):
    return json.loads(subprocess.run([str(c) for c in command], check=True, capture_output=True, text=True).stdout)


def compare(name, config, rounds, program):
    folder = FOLDER / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "network.json").write_text(json.dumps(config))
    ours = lambda task: [program, folder, CLOUDS, THREADS, STEPS, task]
    subprocess.run([str(c) for c in ours("export")], check=True)
    sides = {"vmao": ours} | {
        f"PyTorch, {layout}": lambda task, layout=layout: [sys.executable, __file__, "--side", folder, layout, task] for layout in ["rows", "conv"]
    }
    turns = {(side, task): [] for task in ["step", "search", "map"] for side in sides}
    for _ in range(rounds):
        for side, task in turns:
            turns[side, task].append(run(sides[side](task)))
    losses = [turns[side, "step"][0]["losses"] for side in sides]
    # Only the first is of the same weights: Adam's first step goes by the signs of gradients, even of those that are mere rounding.
    worst = max(abs(losses[0][0] - other[0]) / losses[0][0] for other in losses[1:])
    assert all(side[-1] < side[0] for side in losses), f"a side does not learn: {losses}"
    maps = max(turns[side, "map"][0]["difference"] for side in list(sides)[1:])
    same = min(turns[side, "search"][0]["same"] for side in list(sides)[1:])
    assert worst < 1e-4 and maps < 1e-3 and same > 0.99, f"losses differ by {worst}, maps by {maps}, {same} of the neighbours are the same"
    rows = []
    tasks = {
        "step": ("step", "times"),
        "step with search": ("search", "times"),
        "map from a cloud": ("map", "whole"),
        "map, neighbours given": ("map", "given"),
        "map, another code": ("map", "code"),
    }
    for title, (task, key) in tasks.items():
        cell = lambda side, which: min(t[which] for turn in turns[side, task] for t in turn[key])
        figures = {side: (cell(side, 0), cell(side, 1), peer.median([t["vm_hwm_kib"] for t in turns[side, task]]) / 1024) for side in sides}
        best = min(list(sides)[1:], key=lambda side: figures[side][0])
        for side, (cpu, wall, peak) in figures.items():
            own = figures["vmao"]
            ratios = [f"{cpu / own[0]:.2f}", f"{wall / own[1]:.2f}", f"{peak / own[2]:.2f}"]
            rows.append([title, side + (" (best)" if side == best else ""), f"{cpu * 1e3:.1f}", f"{wall * 1e3:.1f}", f"{peak:.0f}", *ratios])
    start = turns["PyTorch, rows", "step"][0]["start_kib"] / 1024
    print(f"\n{name}: {config['points']} points, {CLOUDS} clouds a step; loss {losses[0][0]:.6f}, relative difference {worst:.1e}; maps differ")
    print(f"by {maps:.1e} of their largest value; {same:.2%} of the neighbours are the same; PyTorch alone takes {start:.0f} MiB.\n")
    peer.table(["task", "side", "CPU ms", "wall ms", "peak MiB", "CPU / ours", "wall / ours", "peak / ours"], rows)


if __name__ == "__main__":
    if "--side" in sys.argv:
        folder, layout, task = sys.argv[2:]
        theirs(peer.ROOT / folder, layout, task)
    else:
        rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
        built = peer.cargo("vmao-net", "example", "network_step")
        print(f"CPU time and wall time: least of {rounds} turns of {STEPS} repetitions, {os.cpu_count()} cores, torch {torch.__version__}.")
        compare("demo", layered([]), rounds, built)
        for path in sys.argv[2:]:
            compare(os.path.basename(path).removesuffix(".toml"), layered([path]), rounds, built)
