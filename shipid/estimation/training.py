"""The one training loop: K small networks of one architecture, trained at once on the same inputs.

The members share inputs, batches and structure; each has its own targets, initial weights, learning rate, weight decay
and drop-out, and nothing it computes depends on who else is in the stack. One small network leaves a core waiting;
nineteen of them as one batched product do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Array = NDArray[np.float64]
Layers = tuple[tuple[Array, Array], ...]
Masks = Sequence[Tensor | None]

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8  # Kingma & Ba (2015), as PyTorch's defaults
WARM_UP, START, END = 0.3, 1 / 25, 1 / 25e4  # shape of the one-cycle rate, as PyTorch's OneCycleLR


@dataclass(frozen=True)
class Settings:
    """Structure and schedule shared by a stack, and the hyperparameters of each of its K members.

    Parameters
    ----------
    layers, units : hidden layers of tanh, and the one width of all of them.
    learning_rate : (K,) peak rate of each member.
    weight_decay : (K,) decoupled decay (AdamW); 0 is Adam.
    input_dropout, hidden_dropout : (K,) probability in [0, 1] that an input or a hidden unit is dropped.
    epochs : at most so many passes over the training samples.
    batch : samples per optimiser step; None = all of them.
    patience : epochs without a better validation loss after which a member stops; None = it never does.
    one_cycle : anneal the rate up and down once over all epochs; False = constant.
    """

    layers: int
    units: int
    learning_rate: tuple[float, ...]
    weight_decay: tuple[float, ...]
    input_dropout: tuple[float, ...]
    hidden_dropout: tuple[float, ...]
    epochs: int
    batch: int | None = None
    patience: int | None = None
    one_cycle: bool = False


@dataclass(frozen=True)
class Trained:
    """What a stack of K members learned: the weights of its best epoch, or of the last where nothing was watched.

    Parameters
    ----------
    layers : K tuples of (weight (i, o), bias (o,)) per layer.
    loss : (K,) best validation loss [m^2], per coordinate; NaN where nothing was watched.
    epochs : (K,) epochs until the member stopped.
    status : K times `ok`, or `diverged` where a loss stopped being a number.
    """

    layers: tuple[Layers, ...]
    loss: Array
    epochs: NDArray[np.int64]
    status: tuple[str, ...]


def train(
    inputs: Array,
    targets: Array,
    train_idx: NDArray[np.int64],
    val_idx: NDArray[np.int64] | None,
    settings: Settings,
    seeds: Sequence[int],
    *,
    scale: Array | None = None,
    order_seed: int = 0,
    device: str = "cpu",
) -> Trained:
    """Train K networks, sample -> target / scale, on the mean squared error of the scaled targets.

    Parameters
    ----------
    inputs : (n, d), normalised; the same for all members.
    targets : (K, n, m) [m].
    train_idx, val_idx : samples to learn from, and to watch; None = watch nothing and keep the last weights.
    settings : structure and hyperparameters.
    seeds : (K,) of the initial weights and drop-out of each member.
    scale : (K, m) [m], ones by default.
    order_seed : of the order of the samples in batches, the same for all members.
    device : a PyTorch device; random numbers are drawn on the CPU, hence the same everywhere.

    Returns
    -------
    Trained : a member whose loss stopped being a number is `diverged`, with its best weights before; others go on.
    """
    num_members, num_outputs = targets.shape[0], targets.shape[2]
    widths = [inputs.shape[1], *[settings.units] * settings.layers, num_outputs]
    metres = np.ones((num_members, num_outputs)) if scale is None else scale
    unit = _tensor(metres, device)[:, None, :]
    x_train, x_val = (_tensor(inputs[i], device) for i in (train_idx, [] if val_idx is None else val_idx))
    y_train = _tensor(targets[:, train_idx], device) / unit
    y_val = None if val_idx is None else _tensor(targets[:, val_idx], device)

    generators = [torch.Generator().manual_seed(int(seed)) for seed in seeds]
    order = torch.Generator().manual_seed(order_seed)
    flat = initial_weights(widths, generators).to(device)
    layers = [(w.requires_grad_(), b.requires_grad_()) for w, b in _views(flat, widths)]  # leaves in flat's memory
    leaves = [leaf for layer in layers for leaf in layer]
    adam = Adam(flat, settings.weight_decay)
    rate = _tensor(settings.learning_rate, device)[:, None]
    watch = _Watch(flat, settings.patience)

    num_samples = len(train_idx)
    batch = min(settings.batch or num_samples, num_samples)
    steps_per_epoch = -(-num_samples // batch)
    num_steps = settings.epochs * steps_per_epoch
    for epoch in range(settings.epochs):
        shuffled = torch.randperm(num_samples, generator=order).to(device) if batch < num_samples else None
        total = torch.zeros(num_members, device=device)
        for i in range(steps_per_epoch):
            rows = slice(None) if shuffled is None else shuffled[i * batch : (i + 1) * batch]
            x, y = x_train[rows], y_train[:, rows]
            masks = _masks(x.shape, widths, settings, generators, device)
            losses = (forward(x, layers, masks) - y).square().mean(dim=(1, 2))
            gradients = torch.autograd.grad(losses.sum(), leaves)
            with torch.no_grad():
                total += losses
                factor = one_cycle(epoch * steps_per_epoch + i, num_steps) if settings.one_cycle else 1.0
                adam.step(torch.cat([g.flatten(1) for g in gradients], dim=1), rate * factor)
        with torch.no_grad():
            if y_val is None:
                watch.follow(total)
            else:
                watch.compare(total, (forward(x_val, layers) * unit - y_val).square().mean(dim=(1, 2)))
            if not watch.running.any():
                break
    return watch.result(widths)


def forward(x: Tensor, layers: Sequence[tuple[Tensor, Tensor]], masks: Masks = ()) -> Tensor:
    """Outputs (K, n, m) of K networks for inputs (n, d): tanh layers and a linear one, drop-out by masks (K, n, i)."""
    h = x.expand(len(layers[0][0]), *x.shape)
    for i, (weight, bias) in enumerate(layers):
        mask = masks[i] if masks else None
        h = torch.baddbmm(bias, h if mask is None else h * mask, weight)
        if i < len(layers) - 1:
            h = h.tanh()
    return h


def initial_weights(widths: Sequence[int], generators: Sequence[torch.Generator]) -> Tensor:
    """PyTorch's default start of `Linear` layers, U(-1, 1) / sqrt(i), as flat weights (K, P), a member per generator."""
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
        spread = (self.second / (1 - BETA_2**self.count)).sqrt_().add_(EPSILON)
        self.weights.mul_(1 - rate * self.decay)
        self.weights.sub_((rate / (1 - BETA_1**self.count)) * self.first / spread)


def one_cycle(step: int, num_steps: int) -> float:
    """Factor on the peak rate: a cosine from 1/25 up to 1 in the first 30 %, then down to 4e-6 (Smith, 2018)."""
    peak, last = WARM_UP * num_steps - 1, num_steps - 1
    if step <= peak:
        start, end, share = START, 1.0, step / peak
    else:
        start, end, share = 1.0, END, (step - peak) / (last - peak)
    return end + (start - end) * (1 + cos(pi * share)) / 2


class _Watch:
    """Keeps the best weights of each member and decides who is still running."""

    def __init__(self, weights: Tensor, patience: int | None) -> None:
        num_members, device = len(weights), weights.device
        self.weights, self.kept, self.patience = weights, weights.clone(), patience
        self.best = torch.full((num_members,), float("inf"), device=device)
        self.waited = torch.zeros(num_members, dtype=torch.long, device=device)
        self.epochs = torch.zeros(num_members, dtype=torch.long, device=device)
        self.running = torch.ones(num_members, dtype=torch.bool, device=device)
        self.finite = torch.ones(num_members, dtype=torch.bool, device=device)

    def follow(self, training: Tensor) -> None:
        """An epoch without validation: keep the weights of all whose training loss (K,) is a number."""
        self._judge(training)
        self.kept = torch.where(self.running[:, None], self.weights, self.kept)

    def compare(self, training: Tensor, validation: Tensor) -> None:
        """An epoch with validation loss (K,): keep better weights; those that have waited too long stop for good."""
        self._judge(training + validation)
        better = self.running & (validation < self.best)
        self.best = torch.where(better, validation, self.best)
        self.kept = torch.where(better[:, None], self.weights, self.kept)
        self.waited = torch.where(better, 0, self.waited + 1)
        if self.patience is not None:
            self.running &= self.waited < self.patience

    def _judge(self, loss: Tensor) -> None:
        self.epochs += self.running
        self.finite &= loss.isfinite() | ~self.running
        self.running &= self.finite

    def result(self, widths: Sequence[int]) -> Trained:
        layers = [
            (w.cpu().numpy().astype(float), b[:, 0].cpu().numpy().astype(float)) for w, b in _views(self.kept, widths)
        ]
        best = self.best.cpu().numpy().astype(float)
        return Trained(
            layers=tuple(tuple((w[k], b[k]) for w, b in layers) for k in range(len(best))),
            loss=np.where(np.isfinite(best), best, np.nan),
            epochs=self.epochs.cpu().numpy(),
            status=tuple("ok" if finite else "diverged" for finite in self.finite.tolist()),
        )


def _views(flat: Tensor, widths: Sequence[int]) -> list[tuple[Tensor, Tensor]]:
    """Weights (K, i, o) and biases (K, 1, o) of each layer, as views of flat weights (K, P)."""
    views, start = [], 0
    for i, o in pairwise(widths):
        middle, end = start + i * o, start + i * o + o
        views.append((flat[:, start:middle].unflatten(1, (i, o)), flat[:, None, middle:end]))
        start = end
    return views


def _masks(
    shape: Sequence[int], widths: Sequence[int], settings: Settings, generators: Sequence[torch.Generator], device: str
) -> Masks:
    """Inverted drop-out, 0 or 1 / (1 - p), for the input of each layer: (K, n, i), or None where no member drops any."""
    rates = [settings.input_dropout] + [settings.hidden_dropout] * settings.layers
    return [
        dropout(per_member, (shape[0], width), generators).to(device) if any(per_member) else None
        for per_member, width in zip(rates, widths[:-1], strict=True)
    ]


def dropout(rates: Sequence[float], shape: tuple[int, int], generators: Sequence[torch.Generator]) -> Tensor:
    """Masks (K, n, i): 1 / (1 - p) with probability 1 - p, else 0; for p = 1 all is 0, not 0 / 0."""
    return torch.stack(
        [
            # A member without drop-out draws nothing, alone or in company.
            torch.empty(shape).bernoulli_(1 - p, generator=generator).div_(1 - p if p < 1 else 1.0)
            if p > 0
            else torch.ones(shape)
            for p, generator in zip(rates, generators, strict=True)
        ]
    )


def _tensor(values: object, device: str) -> Tensor:
    return torch.as_tensor(np.asarray(values), dtype=torch.float32, device=device)
