#!/usr/bin/env python3
"""An independent PyTorch implementation of the network's objective, in float64, and the golden files it mints.

Everything from the world-frame clouds on is done again here: local spacing, farthest-point order, ball queries, nearest points,
the object's frame, features, label maps, set abstraction, set up-convolution, posterior, cross entropy and divergence; gradients
by torch's autograd. The Rust tests (src/pytorch_goldens.rs) read configuration, inputs and weights from the files and must agree.

    python3 -m venv /tmp/mint && /tmp/mint/bin/pip install torch==2.13.0 numpy==2.4.6 safetensors==0.8.0
    /tmp/mint/bin/python crates/vmao-net/goldens/mint.py
"""

import json
import pathlib
import sys

import numpy as np
import safetensors.torch
import torch

from pytorch_network import Batch, Network, shapes

torch.set_default_dtype(torch.float64)
FOLDER = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).parent

# No two sizes are equal, so that no transposed or misplaced array can pass.
NETWORK = {
    "points": 83,
    "density_power": 0.7,
    "abstraction": [
        {"num_centroids": 37, "radius": 0.031, "num_neighbours": 7, "channels": [8, 9]},
        {"num_centroids": 17, "radius": 0.062, "num_neighbours": 6, "channels": [10, 11, 12]},
        {"num_centroids": 4, "radius": 10.0, "num_neighbours": 5, "channels": [13]},
    ],
    "up_conv": [
        {"num_neighbours": 1, "channels": [14], "refine": [15]},
        {"num_neighbours": 2, "channels": [16, 18], "refine": [19]},
        {"num_neighbours": 3, "channels": [20], "refine": [21, 22]},
    ],
    "head": 23,
    "latent_size": 3,
    "latent_placement": "every_level",
    "beta": 0.1,
    "free_bits": 0.0,
    "warm_up": 0.0,
    "label_sigma": 0.012,
    "table_height": 0.003,
    "height_origin": 0.03,
    "position_unit": 0.05,
}
CLOUD_SIZES = [83, 71]

def squared_distances(a, b):
    return ((a[:, None] - b[None]) ** 2).sum(-1)


def neighbourhoods(points, config):
    """Farthest-point order, then for each level its balls and nearest coarser points, all on the float32 points."""
    d2 = squared_distances(points, points)
    spacing = np.sort(np.sqrt(d2), axis=1)[:, :9].mean(1)
    weights = np.maximum(spacing, 5e-4) ** -config["density_power"]
    scaled = weights**2 * ((points - points.mean(0)) ** 2).sum(1)
    order = [int(np.argmax(scaled))]
    gap = np.full(len(points), np.inf)
    while len(order) < len(points):
        gap = np.minimum(gap, weights**2 * d2[order[-1]])
        gap[order] = -np.inf
        order.append(int(np.argmax(gap)))
    ordered = points[order]
    balls, nearest, fine = [], [], ordered
    for level, up in zip(config["abstraction"], reversed(config["up_conv"])):
        coarse = ordered[: level["num_centroids"]]
        rows = []
        for centre in squared_distances(coarse, fine):
            inside = np.flatnonzero(centre <= level["radius"] ** 2)[: level["num_neighbours"]]
            rows.append(np.concatenate([inside, np.full(level["num_neighbours"] - len(inside), inside[0])]))
        balls.append(np.array(rows))
        nearest.append(np.argsort(squared_distances(fine, coarse), axis=1, kind="stable")[:, : up["num_neighbours"]])
        fine = coarse
    return spacing, np.array(order), balls, nearest


def object_frame(points, spacing, config):
    """Origin (geometric median by Weiszfeld's iteration) and heading (third moment) of what stands on the table."""
    up = points[:, 2] > config["table_height"]
    xy, density = points[up, :2], np.maximum(spacing[up], 1e-3) ** -2.0
    median = xy.mean(0)
    for _ in range(30):
        weight = 1.0 / np.maximum(np.hypot(*(xy - median).T), 1e-3)
        median = (weight[:, None] * xy).sum(0) / weight.sum()
    near = np.hypot(*(xy - median).T) < 0.2
    xy, density = xy[near], density[near]
    r = xy - (density[:, None] * xy).sum(0) / density.sum()
    moment = ((density * (r**2).sum(1))[:, None] * r).sum(0)
    cos, sin = moment / np.linalg.norm(moment)
    return median, np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def prepare(points, colors, contacts, config):
    """One cloud as the network reads it, in farthest-point order."""
    spacing, order, balls, nearest = neighbourhoods(points, config)
    origin, turn = object_frame(points, spacing, config)
    placed = (points - [*origin, config["height_origin"]]) @ turn.T
    radius = config["abstraction"][0]["radius"]
    near = squared_distances(points, points) <= radius**2
    outward = np.stack([(p - points[n]).mean(0) for p, n in zip(points, near)]) / radius @ turn.T
    maps = []
    for contact in contacts:
        d2 = ((points - contact) ** 2).sum(1)
        assert d2.min() <= 9 * config["label_sigma"] ** 2, "every contact lies on the cloud here"
        weight = np.exp(-d2 / (2 * config["label_sigma"] ** 2))
        maps.append(weight / weight.sum())
    maps = np.stack(maps, 1)
    features = np.concatenate([placed / config["position_unit"], 2 * colors - 1, 2 * outward], 1)
    return {
        "order": order,
        "balls": balls,
        "nearest": nearest,
        "placed": torch.tensor(placed[order]),
        "features": torch.tensor(features[order]),
        "maps": torch.tensor(maps[order]),
        "means": torch.tensor((maps[:, :, None] * placed[:, None] / config["position_unit"]).sum(0).ravel()),
    }


def batch(clouds, config):
    """The clouds one after the other; neighbours become row numbers of the whole batch."""
    levels = range(len(config["abstraction"]))
    counts = [[len(c["placed"]) for c in clouds]]
    counts += [[level["num_centroids"]] * len(clouds) for level in config["abstraction"]]

    def edges(key, level, centres, sources):
        unit = min(config["abstraction"][level]["radius"], 0.15)
        rows, offsets, base = [], [], 0
        for b, cloud in enumerate(clouds):
            near = torch.tensor(cloud[key][level])
            points = cloud["placed"]
            rows.append((near + base).ravel())
            offsets.append(((points[near] - points[: counts[centres][b], None]) / unit).flatten(0, 1))
            base += counts[sources][b]
        return torch.cat(rows), torch.cat(offsets), clouds[0][key][level].shape[1]

    return Batch(
        len(clouds),
        torch.cat([c["features"] for c in clouds]),
        torch.cat([torch.cat([c["features"], c["maps"] / c["maps"].amax(0)], 1) for c in clouds]),
        torch.stack([c["means"] for c in clouds]),
        torch.cat([c["maps"] for c in clouds]),
        [edges("balls", i, i + 1, i) for i in levels],
        [edges("nearest", i, i, i + 1) for i in levels],
        counts[0],
        [torch.repeat_interleave(torch.arange(len(clouds)), torch.tensor(count)) for count in counts],
    )


def mint(name, kind, config, seed):
    rng = np.random.default_rng(seed)
    tensors, clouds = {}, []
    for b, size in enumerate(CLOUD_SIZES):
        points = (rng.random((size, 3)) * [0.21, 0.13, 0.06]).astype(np.float32)
        points[: size // 6, 2] = 0.0
        colors = rng.random((size, 3)).astype(np.float32)
        contacts = points[rng.integers(size // 6, size, 2)] + np.float32(0.002)
        cloud = prepare(points.astype(np.float64), colors.astype(np.float64), contacts.astype(np.float64), config)
        clouds.append(cloud)
        tensors |= {f"cloud.{b}.{key}": torch.tensor(v) for key, v in [("points", points), ("colors", colors), ("contacts", contacts)]}
        tensors[f"cloud.{b}.order"] = torch.tensor(cloud["order"].astype(np.int32))
        tensors[f"cloud.{b}.features"] = cloud["features"].float()
        tensors[f"cloud.{b}.maps"] = cloud["maps"].float()
    noise = torch.tensor(rng.standard_normal((len(clouds), config["latent_size"])).astype(np.float32))
    tensors["noise"] = noise
    weights = {}
    for array, shape in shapes(kind, config).items():
        # Before a normalisation the scale of a weight is free; elsewhere it is kept small, so that no exponential saturates.
        scale = 0.4 if array.replace(".weight", ".norm.weight") in shapes(kind, config) else 0.1
        start = 1.0 if array.endswith("norm.weight") else 0.0
        weights[array] = torch.tensor((start + scale * rng.standard_normal(shape)).astype(np.float32))
    tensors |= {f"weight.{array}": value for array, value in weights.items()}
    weights = {array: value.double().requires_grad_() for array, value in weights.items()}
    loss, kl, charged, logits = Network(kind, config, weights).terms(batch(clouds, config), noise.double())
    (loss if kl is None else loss + config["beta"] * charged).backward()
    tensors |= {f"gradient.{array}": value.grad.float() for array, value in weights.items()}
    tensors |= {f"cloud.{b}.logits": y.detach().float() for b, y in enumerate(logits)}
    tensors["reconstruction"] = loss.detach().float().reshape(1)
    tensors["kl"] = torch.zeros(1).float() if kl is None else kl.detach().float().reshape(1)
    versions = f"torch {torch.__version__.split('+')[0]}, numpy {np.__version__}"
    metadata = {"kind": kind, "network": json.dumps(config), "versions": versions}
    tensors = {key: value.contiguous() for key, value in tensors.items()}
    safetensors.torch.save_file(tensors, FOLDER / f"{name}.safetensors", metadata)
    print(f"{name}: reconstruction {loss.item():.6f}, kl {0.0 if kl is None else kl.item():.6f}, {versions}")


if __name__ == "__main__":
    mint("every_level", "vmao", NETWORK, 1)
    mint("bottleneck", "vmao", NETWORK | {"latent_placement": "bottleneck", "density_power": 0.0, "free_bits": 0.3}, 2)  # one of three numbers says less
    mint("top1", "top1", NETWORK, 3)
