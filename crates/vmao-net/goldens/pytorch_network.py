"""The network of this crate in plain PyTorch, written independently of it: one implementation for golden files and comparisons.

All clouds of a batch lie one after the other in rows; neighbours are row numbers of the whole batch. `goldens/mint.py` feeds it
its own neighbourhoods in float64, `benches/peers/network.py` times it in float32.
"""

import torch
from torch.nn import functional

CONTEXT = 4  # modulators of the last layer that the scene sets
EPSILON = 1e-5


def shapes(kind, config):
    """Every array of the network by name, with its shape."""
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


class Batch:
    """What one step reads: rows of all clouds, and for each level (sources, offsets, neighbours per centre) down and up.

    `sizes` are the clouds' points; `owners` has the cloud of each row for every level, the points themselves first.
    """

    def __init__(self, clouds, features, posterior_features, map_means, targets, down, up, sizes, owners):
        self.clouds, self.features, self.posterior_features = clouds, features, posterior_features
        self.map_means, self.targets, self.down, self.up = map_means, targets, down, up
        self.sizes, self.owners = sizes, owners


class Network:
    """Rows × channels throughout, as in `nn.Linear`; the layout that is faster on a CPU."""

    def __init__(self, kind, config, weights):
        self.kind, self.config, self.weights = kind, config, weights

    def norm_linear(self, name, x):
        z = x @ self.weights[f"{name}.weight"]
        return torch.relu(self.normalised(name, z))

    def normalised(self, name, z):
        """By the batch in training, by running statistics (if the weights hold some) in prediction."""
        w = self.weights
        mean, variance = w.get(f"{name}.norm.running_mean"), w.get(f"{name}.norm.running_var")
        gain, bias = w[f"{name}.norm.weight"], w[f"{name}.norm.bias"]
        return functional.batch_norm(z, mean, variance, gain, bias, training=mean is None, eps=EPSILON)

    def grouped(self, name, depth, x, edges):
        """[offset, feature] of each neighbour → shared perceptron → maximum over the neighbours."""
        sources, offsets, k = edges
        y = torch.cat([offsets, x[sources]], 1)
        for j in range(depth):
            y = self.norm_linear(f"{name}.{j}", y)
        return y.unflatten(0, (-1, k)).max(1).values

    def joined(self, parts):
        return torch.cat(parts, 1)

    def spread(self, z, owners):
        """One row for each point, of its cloud."""
        return z[owners]

    def pooled(self, x, clouds):
        return x.unflatten(0, (clouds, -1)).amax(1)

    def head(self, x, modulators, sizes):
        """Logits of each cloud."""
        w = self.weights
        bank = w["decoder.logits.weight"].unflatten(0, (-1, self.config["head"]))
        own = bank[0] + torch.einsum("bm,mhc->bhc", modulators, bank[1:])
        return [h @ weight + w["decoder.logits.bias"] for h, weight in zip(x.split(sizes), own)]

    def encode(self, name, features, down):
        levels, x = [], features
        for i, level in enumerate(self.config["abstraction"]):
            x = self.grouped(f"{name}.abstraction.{i}.mlp", len(level["channels"]), x, down[i])
            levels.append(x)
        return levels

    def posterior(self, batch):
        w = self.weights
        read = self.pooled(self.encode("posterior", batch.posterior_features, batch.down)[-1], batch.clouds)
        read = torch.cat([read, batch.map_means], 1)
        mean = read @ w["posterior.mean.weight"] + w["posterior.mean.bias"]
        log_variance = (read @ w["posterior.log_variance.weight"] + w["posterior.log_variance.bias"]).clamp(-10, 10)
        return mean, log_variance

    def decode(self, batch, scene, z):
        config, w = self.config, self.weights
        modulators = [self.pooled(scene[-1], batch.clouds) @ w["decoder.context.weight"] + w["decoder.context.bias"]]
        coarse, levels = scene[-1], len(scene)
        if z is not None:
            modulators.append(z)
            coarse = self.joined([coarse, self.spread(z, batch.owners[levels])])
        for i, layer in enumerate(config["up_conv"]):
            fine = levels - 1 - i
            parts = [self.grouped(f"decoder.up_conv.{i}.mlp", len(layer["channels"]), coarse, batch.up[fine])]
            parts.append(scene[fine - 1] if fine > 0 else batch.features)
            if z is not None and config["latent_placement"] == "every_level":
                parts.append(self.spread(z, batch.owners[fine]))
            coarse = self.joined(parts)
            for j in range(len(layer["refine"])):
                coarse = self.norm_linear(f"decoder.up_conv.{i}.refine.{j}", coarse)
        return self.head(self.norm_linear("decoder.head", coarse), torch.cat(modulators, 1), batch.sizes)

    def terms(self, batch, noise):
        """Cross entropy, divergence (none without latent code), what of it the objective charges for, and the logits of each cloud."""
        scene = self.encode("scene", batch.features, batch.down)
        kl, charged, z = None, None, None
        if self.kind == "vmao":
            mean, log_variance = self.posterior(batch)
            deviation = (0.5 * log_variance).exp()
            each = 0.5 * (mean**2 + deviation**2 - 1.0 - log_variance).sum(0) / batch.clouds
            kl, charged = each.sum(), each.clamp(min=self.config["free_bits"]).sum()
            z = mean + deviation * noise
        logits = self.decode(batch, scene, z)
        pairs = zip(logits, batch.targets.split(batch.sizes))
        loss = -sum((target * torch.log_softmax(y, 0)).sum() for y, target in pairs) / (2 * batch.clouds)
        return loss, kl, charged, logits
