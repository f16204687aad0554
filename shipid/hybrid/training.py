"""Training by PyTorch, with one loop, `minimise_losses`: stacks of small networks, and gated recurrent units.

The K members of a stack share inputs, batches and structure; nothing that one computes depends on the others. One small
network leaves a core waiting; nineteen of them as one batched product do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import cos, pi

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits
from torch import Tensor

from shipid.hybrid.method import Array

Layers = tuple[tuple[Array, Array], ...]
Stack = Sequence[tuple[Tensor, Tensor]]
Masks = Sequence[Tensor | None]
Shapes = Mapping[str, tuple[int, ...]]
Part = tuple[Sequence[tuple[Array, Array]], Array]
"""What is read, the past (P + 1, S, d) with inputs at the instant (S, e), then its mirror image if there is one; and
outputs (S, 2 r)."""

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8  # Kingma & Ba (2015), as PyTorch's defaults


@dataclass(frozen=True)
class Length:
    """How long networks are trained: `epochs` at most.

    batch : samples per optimiser step; 0 = all of them.
    patience : epochs without a better validation loss after which a member stops; 0 = it never does.
    """

    epochs: int
    batch: int = 0
    patience: int = 0


@dataclass(frozen=True)
class TrainedStack:
    """What a stack of K members learned: the weights of its best epoch.

    layers : K tuples of (weight (i, o), bias (o,)) per layer. epochs : (K,) until the member stopped.
    loss : (K,) best validation loss [m^2], per coordinate; NaN where a loss stopped being a number.
    """

    layers: tuple[Layers, ...]
    loss: Array
    epochs: NDArray[np.int64]


def train_stack(
    inputs: Array,
    targets: Array,
    train_idx: NDArray[np.int64],
    val_idx: NDArray[np.int64],
    members: Sequence[Mapping[str, float]],
    length: Length,
    seeds: Sequence[int],
    *,
    order_seed: int = 0,
    device: str = "cpu",
) -> TrainedStack:
    """Train K networks, sample -> target, on the mean squared error.

    Parameters
    ----------
    inputs : (n, d), normalised; the same for all members. targets : (K, n, m) [m].
    train_idx, val_idx : samples to learn from, and to watch.
    members : hyperparameters of each: `layers` hidden layers of `units` tanh, alike for all, `learning_rate`,
        `weight_decay` (AdamW; 0 is Adam), and `input_dropout` and `hidden_dropout`, the probabilities to be dropped.
    seeds : (K,) of the initial weights and drop-out of each member.
    order_seed : of the order of the samples in batches, the same for all members.
    device : a PyTorch device; random numbers are drawn on the CPU.

    A member that diverges keeps its best weights before that; others go on.
    """
    num_samples = len(train_idx)
    num_layers, units = int(members[0]["layers"]), int(members[0]["units"])
    widths = [inputs.shape[1], *[units] * num_layers, targets.shape[2]]
    learning = _single_tensor([one["learning_rate"] for one in members], device)[:, None]
    dropout = [[one[name] for one in members] for name in ("input_dropout", *["hidden_dropout"] * num_layers)]
    x, y = _single_tensor(inputs[train_idx], device), _single_tensor(targets[:, train_idx], device)
    x_val, y_val = _single_tensor(inputs[val_idx], device), _single_tensor(targets[:, val_idx], device)

    generators = [torch.Generator().manual_seed(int(seed)) for seed in seeds]
    order = torch.Generator().manual_seed(order_seed)
    weights = initial_weights(widths, generators).to(device)
    layers = [(w.requires_grad_(), b.requires_grad_()) for w, b in _layer_views(weights, widths)]  # leaves, same memory

    def loss(rows: Tensor | slice) -> Tensor:
        x_batch, y_batch = x[rows], y[:, rows]
        masks = [  # for the input of each layer, or None where no member drops any
            draw_dropout(rates, (len(x_batch), width), generators).to(device) if any(rates) else None
            for rates, width in zip(dropout, widths[:-1], strict=True)
        ]
        return (stack_outputs(x_batch, layers, masks) - y_batch).square().mean(dim=(1, 2))

    batch = min(length.batch or num_samples, num_samples)
    best = minimise_losses(
        weights,
        [leaf for layer in layers for leaf in layer],
        [one["weight_decay"] for one in members],
        length,
        batches=lambda: (  # a single batch stays in order
            [slice(None)] if batch == num_samples else torch.split(torch.randperm(num_samples, generator=order), batch)
        ),
        rate=lambda _: learning,
        loss=loss,
        watched=lambda: (stack_outputs(x_val, layers) - y_val).square().mean(dim=(1, 2)),
    )
    arrays = [
        (w.cpu().numpy().astype(float), b[:, 0].cpu().numpy().astype(float)) for w, b in _layer_views(best.kept, widths)
    ]
    losses = torch.where(best.finite & best.best.isfinite(), best.best, torch.nan).cpu().numpy().astype(float)
    kept = tuple(tuple((w[k], b[k]) for w, b in arrays) for k in range(len(members)))
    return TrainedStack(kept, losses, best.epochs.cpu().numpy())


def minimise_losses(
    weights: Tensor,
    leaves: Sequence[Tensor],
    decay: Sequence[float],
    length: Length,
    *,
    batches: Callable[[], Iterable[Tensor | slice]],
    rate: Callable[[int], Tensor],
    loss: Callable[[Tensor | slice], Tensor],
    watched: Callable[[], Tensor],
) -> BestEpochs:
    """Minimise the losses of K members by AdamW, and keep the weights of the best epoch of each.

    Parameters
    ----------
    weights : (K, P), changed in place. leaves : parts of the same memory that have gradients, in order.
    decay : (K,) of the weights.
    batches : rows of the batches of the next epoch. rate : epoch, from 0 -> learning rates (K, 1).
    loss : rows -> losses (K,). watched : validation losses (K,) now.
    """
    adam, watch = Adam(weights, decay), BestEpochs(weights, length.patience)
    with threadpool_limits(1):  # for the same digits anywhere; networks as small as these are slower on more
        for epoch in range(length.epochs):
            total = torch.zeros(len(weights), device=weights.device)
            for rows in batches():
                losses = loss(rows)
                gradients = torch.autograd.grad(losses.sum(), leaves)
                with torch.no_grad():
                    adam.step(torch.cat([one.reshape(len(weights), -1) for one in gradients], dim=1), rate(epoch))
                total += losses.detach()
            with torch.no_grad():
                watch.compare(total, watched())
            if not watch.running.any():
                break
    return watch


def stack_outputs(x: Tensor, layers: Stack, masks: Masks = ()) -> Tensor:
    """Return outputs (K, n, m) of K networks for inputs (n, d): tanh layers, a linear one; masks (K, n, i) drop."""
    h = x.expand(len(layers[0][0]), *x.shape)
    for i, (weight, bias) in enumerate(layers):
        mask = masks[i] if masks else None
        h = torch.baddbmm(bias, h if mask is None else h * mask, weight)
        if i < len(layers) - 1:
            h = h.tanh()
    return h


def initial_weights(widths: Sequence[int], generators: Sequence[torch.Generator]) -> Tensor:
    """Draw PyTorch's default start of `Linear`, U(-1, 1) / sqrt(i), as flat weights (K, P), a member per generator."""
    members = []
    for generator in generators:
        parts = []
        for i, o in pairwise(widths):
            draws = [torch.empty(shape).uniform_(-1.0, 1.0, generator=generator) for shape in ((o, i), (o,))]
            parts += [draws[0].T.reshape(-1) / i**0.5, draws[1] / i**0.5]
        members.append(torch.cat(parts))
    return torch.stack(members)


class Adam:
    """AdamW on flat weights (K, P) with a decay per member; without decay it is Adam (Loshchilov & Hutter, 2019)."""

    def __init__(self, weights: Tensor, decay: Sequence[float]) -> None:
        self.weights = weights
        self.decay = torch.tensor(decay, device=weights.device)[:, None]
        self.first, self.second = torch.zeros_like(weights), torch.zeros_like(weights)
        self.count = 0

    def step(self, gradient: Tensor, rate: Tensor) -> None:
        """Move the weights in place, with gradient (K, P) and learning rates (K, 1)."""
        self.count += 1
        self.first.lerp_(gradient, 1 - BETA_1)
        self.second.mul_(BETA_2).addcmul_(gradient, gradient, value=1 - BETA_2)
        spread = self.second.sqrt().mul_((1 - BETA_2**self.count) ** -0.5).add_(EPSILON)
        self.weights.mul_(1 - rate * self.decay)
        self.weights.addcdiv_(self.first * rate, spread, value=-1 / (1 - BETA_1**self.count))


class BestEpochs:
    """Keeps the best weights of each member and decides who is still running."""

    def __init__(self, weights: Tensor, patience: int) -> None:
        num_members, device = len(weights), weights.device
        self.weights, self.kept, self.patience = weights, torch.full_like(weights, torch.nan), patience
        self.best = torch.full((num_members,), float("inf"), device=device)
        self.waited = torch.zeros(num_members, dtype=torch.long, device=device)
        self.epochs = torch.zeros(num_members, dtype=torch.long, device=device)
        self.running = torch.ones(num_members, dtype=torch.bool, device=device)
        self.finite = torch.ones(num_members, dtype=torch.bool, device=device)

    def compare(self, training: Tensor, validation: Tensor) -> None:
        """Judge an epoch by validation loss (K,): keep better weights; who has waited too long stops for good."""
        self.epochs += self.running
        self.finite &= (training + validation).isfinite() | ~self.running
        self.running &= self.finite
        better = self.running & (validation < self.best)
        self.best = torch.where(better, validation, self.best)
        self.kept = torch.where(better[:, None], self.weights, self.kept)
        self.waited = torch.where(better, 0, self.waited + 1)
        if self.patience:
            self.running &= self.waited < self.patience


def _layer_views(flat: Tensor, widths: Sequence[int]) -> list[tuple[Tensor, Tensor]]:
    """Split flat weights (K, P) into views: weights (K, i, o) and biases (K, 1, o) of each layer."""
    views, start = [], 0
    for i, o in pairwise(widths):
        middle, end = start + i * o, start + i * o + o
        views.append((flat[:, start:middle].view(-1, i, o), flat[:, None, middle:end]))
        start = end
    return views


def draw_dropout(rates: Sequence[float], shape: tuple[int, int], generators: Sequence[torch.Generator]) -> Tensor:
    """Draw inverted drop-out (K, n, i): 1 / (1 - p) with probability 1 - p, else 0; for p = 1 all is 0, not 0 / 0."""
    return torch.stack(
        [
            # A member without drop-out draws nothing, alone or in company.
            torch.empty(shape).bernoulli_(1 - p, generator=generator).div_(1 - p if p < 1 else 1.0)
            if p > 0
            else torch.ones(shape)
            for p, generator in zip(rates, generators, strict=True)
        ]
    )


def _single_tensor(values: object, device: str) -> Tensor:
    return torch.as_tensor(np.asarray(values), dtype=torch.float32, device=device)


def train_gated(
    parts: Sequence[Part], units: int, learning_rate: float, decay: float, length: Length, seed: int
) -> tuple[dict[str, Array], int]:
    """Train on the first part of the data, stop by the second; layers by name and the number of epochs."""
    generator, ((past, now), *_), outputs = torch.Generator().manual_seed(seed), *parts[0]
    shapes = {
        "W_i": (3 * units, past.shape[2]),
        "W_h": (3 * units, units),
        "b_i": (3 * units,),
        "b_h": (3 * units,),
        "W_1": (units, units + now.shape[1]),
        "c_1": (units,),
        "W_2": (outputs.shape[1], units),
        "c_2": (outputs.shape[1],),
    }
    weights = _first_weights(shapes, units, generator)
    return train_reader(parts, gated_outputs, weights, shapes, (learning_rate, decay), length, generator)


def train_reader(
    parts: Sequence[Part],
    network: Callable[[Mapping[str, Tensor], Tensor, Tensor], Tensor],
    weights: Tensor,
    shapes: Shapes,
    rates: tuple[float, float],
    length: Length,
    generator: torch.Generator,
) -> tuple[dict[str, Array], int]:
    """Train what reads past and present on the first part, stop by the second; layers by name, number of epochs.

    network : (layers, past, now) -> outputs. weights : (1, P), changed in place. shapes : of the layers in them.
    rates : of learning, and of decay. generator : of the batches.
    """
    layers = {name: layer.requires_grad_() for name, layer in _layers_by_name(weights, shapes).items()}
    (seen, outputs), watched = (
        ([(_single_tensor(past, "cpu"), _single_tensor(now, "cpu")) for past, now in pairs], _single_tensor(out, "cpu"))
        for pairs, out in parts
    )
    reader = partial(network, layers)
    best = minimise_losses(
        weights,
        list(layers.values()),
        [rates[1]],
        length,
        batches=lambda: torch.split(torch.randperm(len(outputs), generator=generator), length.batch),
        rate=lambda epoch: torch.tensor([[rates[0] * (1 + cos(pi * epoch / length.epochs)) / 2]]),
        loss=lambda rows: _mirrored_loss(reader, [(past[:, rows], now[rows]) for past, now in seen], outputs[rows]),
        watched=lambda: _mirrored_loss(reader, *watched),
    )
    kept = {name: layer.double().numpy() for name, layer in _layers_by_name(best.kept, shapes).items()}
    return kept, int(best.epochs[0])


def _first_weights(shapes: Shapes, units: int, generator: torch.Generator) -> Tensor:
    """Initial weights (1, P), drawn as PyTorch draws them."""
    bounds = {name: (units if name[2] in "ih" else shape[-1]) ** -0.5 for name, shape in shapes.items()}
    draws = [(torch.rand(shape, generator=generator) * 2 - 1) * bounds[name] for name, shape in shapes.items()]
    return torch.cat([draw.flatten() for draw in draws])[None]


def _layers_by_name(weights: Tensor, shapes: Shapes) -> dict[str, Tensor]:
    """Layers by name, in the memory of weights (1, P)."""
    pieces = torch.split(weights[0], [int(np.prod(shape)) for shape in shapes.values()])
    return {name: piece.view(shape) for (name, shape), piece in zip(shapes.items(), pieces, strict=True)}


def gated_outputs(layers: Mapping[str, Tensor], past: Tensor, now: Tensor) -> Tensor:
    """Outputs (S, 2 r) of a gated recurrent unit on the past (P + 1, S, d), with inputs at the instant (S, e)."""
    flat = [layers[name] for name in ("W_i", "W_h", "b_i", "b_h")]
    start = torch.zeros(1, len(now), layers["W_h"].shape[1])
    _, hidden = torch.gru(past, start, flat, True, 1, 0.0, False, False, False)
    full = torch.cat([hidden[0], now], dim=1)
    return torch.tanh(full @ layers["W_1"].T + layers["c_1"]) @ layers["W_2"].T + layers["c_2"]


def _mirrored_loss(
    network: Callable[[Tensor, Tensor], Tensor], seen: Sequence[tuple[Tensor, Tensor]], outputs: Tensor
) -> Tensor:
    """Mean squared error (1,) of the network on outputs (S, 2 r); with an image, x is made even and y odd."""
    past, now = (torch.cat(arrays, dim=-2) for arrays in zip(*seen, strict=True))
    made = network(past, now)
    if len(seen) == 2:
        sign = torch.ones(made.shape[1])
        sign[len(sign) // 2 :] = -1.0
        plain, image = made.chunk(2)
        made = (plain + sign * image) / 2
    return (made - outputs).square().mean()[None]
