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

import numpy as np
import safetensors.torch
import torch

torch.set_default_dtype(torch.float64)
HERE = pathlib.Path(__file__).parent

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
    "warm_up": 0.0,
    "label_sigma": 0.012,
    "table_height": 0.003,
    "height_origin": 0.03,
    "position_unit": 0.05,
}
CLOUD_SIZES = [83, 71]
CONTEXT = 4  # modulators of the last layer that the scene sets
EPSILON = 1e-5


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


def shapes(kind, config):
    """Every array of the network by name, and the function that starts it."""
    found = {}

    def norm_linear(name, inputs, channels):
        found[f"{name}.weight"] = (inputs, channels)
        found[f"{name}.norm.weight"] = (channels,)
        found[f"{name}.norm.bias"] = (channels,)
        return channels

    def encoder(name, inputs):
        widths = []
        for i, level in enumerate(config["abstraction"]):
            inputs += 3
            for j, channels in enumerate(level["channels"]):
                inputs = norm_linear(f"{name}.abstraction.{i}.mlp.{j}", inputs, channels)
            widths.append(inputs)
        return widths

    widths = encoder("scene", 9)
    latent = config["latent_size"] if kind == "vmao" else 0
    if latent:
        encoder("posterior", 11)
        for name in ["posterior.mean", "posterior.log_variance"]:
            found[f"{name}.weight"], found[f"{name}.bias"] = (widths[-1] + 6, latent), (latent,)
    coarse = widths[-1] + latent
    for i, layer in enumerate(config["up_conv"]):
        inputs = coarse + 3
        for j, channels in enumerate(layer["channels"]):
            inputs = norm_linear(f"decoder.up_conv.{i}.mlp.{j}", inputs, channels)
        inputs += ([9] + widths)[len(widths) - 1 - i] + (latent if config["latent_placement"] == "every_level" else 0)
        for j, channels in enumerate(layer["refine"]):
            inputs = norm_linear(f"decoder.up_conv.{i}.refine.{j}", inputs, channels)
        coarse = inputs
    norm_linear("decoder.head", coarse, config["head"])
    found["decoder.context.weight"], found["decoder.context.bias"] = (widths[-1], CONTEXT), (CONTEXT,)
    found["decoder.logits.weight"] = ((1 + latent + CONTEXT) * config["head"], 2)
    found["decoder.logits.bias"] = (2,)
    return found


class Objective:
    """The network in plain tensor operations; a list of tensors is one tensor a cloud."""

    def __init__(self, kind, config, weights):
        self.kind, self.config, self.weights = kind, config, weights

    def norm_linear(self, name, rows):
        z = rows @ self.weights[f"{name}.weight"]
        z = torch.nn.functional.batch_norm(
            z, None, None, self.weights[f"{name}.norm.weight"], self.weights[f"{name}.norm.bias"], training=True, eps=EPSILON
        )
        return torch.relu(z)

    def grouped(self, name, depth, sources, source_points, centre_points, neighbours, unit):
        """[offset, feature] of each neighbour → shared perceptron over the whole batch → maximum over the neighbours."""
        rows = []
        for x, p, c, n in zip(sources, source_points, centre_points, neighbours):
            n = torch.tensor(n)
            rows.append(torch.cat([(p[n] - c[:, None]) / unit, x[n]], 2).flatten(0, 1))
        y = torch.cat(rows)
        for j in range(depth):
            y = self.norm_linear(f"{name}.{j}", y)
        pooled = y.unflatten(0, (-1, neighbours[0].shape[1])).amax(1)
        return list(pooled.split([len(c) for c in centre_points]))

    def encode(self, name, clouds, features):
        levels, x = [], features
        points = [c["placed"] for c in clouds]
        for i, level in enumerate(self.config["abstraction"]):
            centres = [p[: level["num_centroids"]] for p in points]
            balls = [c["balls"][i] for c in clouds]
            unit = min(level["radius"], 0.15)
            x = self.grouped(f"{name}.abstraction.{i}.mlp", len(level["channels"]), x, points, centres, balls, unit)
            levels.append(x)
            points = centres
        return levels

    def terms(self, clouds, noise):
        config, w = self.config, self.weights
        features = [c["features"] for c in clouds]
        scene = self.encode("scene", clouds, features)
        top = torch.stack([x.amax(0) for x in scene[-1]])
        modulators = [top @ w["decoder.context.weight"] + w["decoder.context.bias"]]
        coarse, kl, z = scene[-1], None, None
        if self.kind == "vmao":
            rows = [torch.cat([c["features"], c["maps"] / c["maps"].amax(0)], 1) for c in clouds]
            read = torch.stack([x.amax(0) for x in self.encode("posterior", clouds, rows)[-1]])
            read = torch.cat([read, torch.stack([c["means"] for c in clouds])], 1)
            mean = read @ w["posterior.mean.weight"] + w["posterior.mean.bias"]
            log_variance = (read @ w["posterior.log_variance.weight"] + w["posterior.log_variance.bias"]).clamp(-10, 10)
            posterior = torch.distributions.Normal(mean, (0.5 * log_variance).exp())
            prior = torch.distributions.Normal(torch.zeros_like(mean), torch.ones_like(mean))
            kl = torch.distributions.kl_divergence(posterior, prior).sum() / len(clouds)
            z = mean + (0.5 * log_variance).exp() * noise
            modulators.append(z)
            coarse = [torch.cat([x, z[b].expand(len(x), -1)], 1) for b, x in enumerate(coarse)]
        counts = [None] + [level["num_centroids"] for level in config["abstraction"]]
        for i, layer in enumerate(config["up_conv"]):
            fine = len(scene) - 1 - i
            points = [c["placed"][: counts[fine]] for c in clouds]
            sources = [c["placed"][: counts[fine + 1]] for c in clouds]
            unit = min(config["abstraction"][fine]["radius"], 0.15)
            nearest = [c["nearest"][fine] for c in clouds]
            y = self.grouped(f"decoder.up_conv.{i}.mlp", len(layer["channels"]), coarse, sources, points, nearest, unit)
            skip = scene[fine - 1] if fine > 0 else features
            rows = []
            for b in range(len(clouds)):
                parts = [y[b], skip[b]]
                if z is not None and config["latent_placement"] == "every_level":
                    parts.append(z[b].expand(len(y[b]), -1))
                rows.append(torch.cat(parts, 1))
            x = torch.cat(rows)
            for j in range(len(layer["refine"])):
                x = self.norm_linear(f"decoder.up_conv.{i}.refine.{j}", x)
            coarse = list(x.split([len(p) for p in points]))
        sizes = [len(x) for x in coarse]
        hidden = self.norm_linear("decoder.head", torch.cat(coarse)).split(sizes)
        bank = w["decoder.logits.weight"].unflatten(0, (-1, config["head"]))
        logits, loss = [], 0.0
        for h, m, cloud in zip(hidden, torch.cat(modulators, 1), clouds):
            own = bank[0] + torch.einsum("m,mhc->hc", m, bank[1:])
            logits.append(h @ own + w["decoder.logits.bias"])
            loss = loss - (cloud["maps"] * torch.log_softmax(logits[-1], 0)).sum() / (2 * len(clouds))
        return loss, kl, logits


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
    loss, kl, logits = Objective(kind, config, weights).terms(clouds, noise.double())
    (loss if kl is None else loss + config["beta"] * kl).backward()
    tensors |= {f"gradient.{array}": value.grad.float() for array, value in weights.items()}
    tensors |= {f"cloud.{b}.logits": y.detach().float() for b, y in enumerate(logits)}
    tensors["reconstruction"] = loss.detach().float().reshape(1)
    tensors["kl"] = torch.zeros(1).float() if kl is None else kl.detach().float().reshape(1)
    versions = f"torch {torch.__version__.split('+')[0]}, numpy {np.__version__}"
    metadata = {"kind": kind, "network": json.dumps(config), "versions": versions}
    tensors = {key: value.contiguous() for key, value in tensors.items()}
    safetensors.torch.save_file(tensors, HERE / f"{name}.safetensors", metadata)
    print(f"{name}: reconstruction {loss.item():.6f}, kl {0.0 if kl is None else kl.item():.6f}, {versions}")


if __name__ == "__main__":
    mint("every_level", "vmao", NETWORK, 1)
    mint("bottleneck", "vmao", NETWORK | {"latent_placement": "bottleneck", "density_power": 0.0}, 2)
    mint("top1", "top1", NETWORK, 3)
