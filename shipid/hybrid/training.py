"""Training by PyTorch, with one loop, `NetworkTraining`: small networks, and those that read the past."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from math import cos, pi
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits
from torch import Tensor

from shipid.hybrid.compensator import Layers
from shipid.hybrid.method import Array, Index

Part = tuple[Sequence[tuple[Array | list[Array], ...]], Array]
"""What a network reads, arrays (..., S, d), then its mirror image if there is one; and outputs (S, 2 r)."""


class NetworkTraining:
    """One network that is trained on the mean squared error, some epochs at a time; that of the best epoch is kept.

    Parameters
    ----------
    build : makes the network.
    parts : what it learns from, and what it is judged by.
    method : its settings `epochs`, `batch` (0: all samples) and `patience` (0: without end).
    rate : epoch, from 0 -> learning rate of AdamW. decay : decoupled; without it AdamW is Adam.
    seed : of the initial weights, drop-out and the order of the samples in batches.
    device : a PyTorch device.

    A network that diverges keeps what it was before, and has no loss.
    """

    def __init__(
        self,
        build: Callable[[], torch.nn.Module],
        parts: Sequence[Part],
        method: Any,
        rate: Callable[[int], float],
        decay: float,
        seed: int,
        device: str = "cpu",
    ) -> None:
        self.method, self.rate, self.epochs, self.waited, self.running = method, rate, 0, 0, True
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network, self.state = build().float().to(device), torch.get_rng_state()
        self.seen = [
            ([tuple(_single_tensor(one, device) for one in side) for side in sides], _single_tensor(outputs, device))
            for sides, outputs in parts
        ]
        learned = [one for one in self.network.parameters() if one.requires_grad]
        self.optimiser = torch.optim.AdamW(learned, rate(0), weight_decay=decay, fused=True)
        self.best, self.kept = np.inf, {name: np.full_like(one, np.nan, float) for name, one in self._layers().items()}

    @property
    def loss(self) -> float:
        """Least mean squared validation error [m^2] per coordinate so far; NaN where a loss was no number."""
        return self.best if np.isfinite(self.best) else np.nan

    def advance(self, epochs: int) -> None:
        """Train for so many further epochs."""
        with threadpool_limits(1), torch.random.fork_rng(devices=[]):  # the same digits anywhere, in any company
            torch.set_rng_state(self.state)
            for _ in range(epochs if self.running else 0):
                self._train_epoch()
                if not self.running:
                    break
            self.state = torch.get_rng_state()

    def _train_epoch(self) -> None:
        total, count = 0.0, len(self.seen[0][1])
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate(self.epochs)
        batch = self.method.batch or count
        for rows in torch.split(torch.randperm(count), batch) if batch < count else [slice(None)]:
            self.network.train(
                isinstance(rows, slice) or len(rows) > 1
            )  # one window alone has no spread that BatchNorm could learn
            loss = self._loss(0, rows)
            self.optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            self.optimiser.step()
            total += loss.item()
        self.network.eval()
        with torch.no_grad():
            judged = self._loss(1, slice(None)).item()
        self.epochs += 1
        better = judged < self.best
        self.waited = 0 if better else self.waited + 1
        if not np.isfinite(total + judged):
            self.best, self.running = np.nan, False
        elif better:
            self.best, self.kept = judged, self._layers()
        self.running &= self.waited < (self.method.patience or np.inf)

    def _loss(self, part: int, rows: Tensor | slice) -> Tensor:
        """Mean squared error of rows of a part (S, 2 r); with an image, x is made even and y odd."""
        sides, outputs = self.seen[part]
        chosen = [[one[..., rows, :] for one in side] for side in sides]
        made = self.network(
            *(torch.cat(same, dim=-2) if len(same) > 1 else same[0] for same in zip(*chosen, strict=True))
        )
        if len(sides) == 2:
            sign = torch.tensor([1.0, -1.0], device=made.device).repeat_interleave(made.shape[1] // 2)
            plain, image = made.chunk(2)
            made = (plain + sign * image) / 2
        loss: Tensor = (made - outputs[rows]).square().mean()
        return loss

    def _layers(self) -> dict[str, Array]:
        """Parameters and buffers by name, as they are now."""
        held = {**dict(self.network.named_parameters()), **dict(self.network.named_buffers())}
        return {
            name: (one.double() if one.is_floating_point() else one).numpy(force=True).copy()
            for name, one in held.items()
        }


def tanh_network(widths: Sequence[int], input_dropout: float, hidden_dropout: float) -> torch.nn.Sequential:
    """Layers of tanh and a linear one, with drop-out before each."""
    parts: list[torch.nn.Module] = []
    for inputs, outputs in pairwise(widths):
        dropped = hidden_dropout if parts else input_dropout
        parts += [torch.nn.Dropout(dropped)] if dropped else []
        parts += [torch.nn.Linear(inputs, outputs), torch.nn.Tanh()]
    return torch.nn.Sequential(*parts[:-1])


class GatedModule(torch.nn.Module):
    """A gated recurrent unit on the past (P + 1, S, d); its state and the inputs at the instant (S, e) give outputs."""

    def __init__(self, past: int, now: int, units: int, outputs: int) -> None:
        super().__init__()
        self.gru = torch.nn.GRU(past, units)
        self.full, self.last = torch.nn.Linear(units + now, units), torch.nn.Linear(units, outputs)

    def forward(self, past: Tensor, now: Tensor) -> Tensor:
        """Outputs (S, 2 r)."""
        _, hidden = self.gru(past)
        outputs: Tensor = self.last(torch.tanh(self.full(torch.cat([hidden[0], now], dim=1))))
        return outputs


GATED_LAYERS = {
    **{"W_i": "gru.weight_ih_l0", "W_h": "gru.weight_hh_l0", "b_i": "gru.bias_ih_l0", "b_h": "gru.bias_hh_l0"},
    **{"W_1": "full.weight", "c_1": "full.bias", "W_2": "last.weight", "c_2": "last.bias"},
}
"""Layers of `GatedModule`, as formulas call them."""


def train_reader(
    build: Callable[[], torch.nn.Module], parts: Sequence[Part], method: Any, learning_rate: float, seed: int
) -> tuple[dict[str, Array], int]:
    """Train what reads past and present to the end: layers by name, number of epochs.

    method : as in `NetworkTraining`, and `weight_decay`. learning_rate : at the start; it falls by half a cosine to 0.
    """

    def rate(epoch: int) -> float:
        return learning_rate * (1 + cos(pi * epoch / method.epochs)) / 2

    training = NetworkTraining(build, parts, method, rate, method.weight_decay, seed)
    training.advance(method.epochs)
    return training.kept, training.epochs


def train_units(
    layer: tuple[Array, Array],
    mirrors: Sequence[Array],
    values: Array,
    outputs: Array,
    rows: Index,
    dealt: Iterable[Sequence[tuple[Tensor, Tensor]]],
    learning_rate: float,
    ridge: float,
) -> Layers:
    """Train the weight (d, M) and offset (M,) of hidden units, a step of Adam for each list of parts.

    The output weights of a step are solved with a ridge [m^2] on a part, and judged by another; in the end, on all.

    mirrors : (d, d) of inputs, the identity first, for each block of the units; with two, x is made of even units, y of
        odd ones. values, outputs : (S, d), normalised, and (S, 2 r) [m]. rows : windows that train.
    dealt : masks of these rows, of the windows that solve and of those that judge.
    """
    sides = [torch.from_numpy(values @ mirror) for mirror in mirrors]
    targets = torch.from_numpy(outputs).chunk(len(mirrors), dim=1)
    first = [torch.from_numpy(part).chunk(len(mirrors), dim=-1)[0] for part in layer]
    leaves = [part.clone().requires_grad_() for part in first]
    adam, size = torch.optim.Adam(leaves, learning_rate), len(layer[1]) ** 0.5

    def weighed(rows: Index | slice) -> Iterator[tuple[Tensor, Tensor]]:
        """Features (S, M) and what they make, for x and y."""
        units = [torch.tanh(side[rows] @ leaves[0] + leaves[1]) / size for side in sides]
        parts = units if len(units) == 1 else [units[0] + units[1], units[0] - units[1]]
        return zip(parts, [side[rows] for side in targets], strict=True)

    with threadpool_limits(1):
        for parts in dealt:
            errors = [
                made[judged] @ _ridge_solution(made[rest], wanted[rest], ridge * len(rows) / len(values))
                - wanted[judged]
                for made, wanted in weighed(rows)
                for rest, judged in parts
            ]
            adam.zero_grad()
            torch.cat(errors).square().sum().backward()  # type: ignore[no-untyped-call]
            adam.step()
        solved = [_ridge_solution(made, wanted, ridge).detach().numpy() / size for made, wanted in weighed(slice(None))]
    weight, offset = (leaf.detach().numpy() for leaf in leaves)
    blocks = [solved, *([one, -other] for one, other in [solved][: len(mirrors) - 1])]
    last = np.concatenate([np.concatenate(block, axis=1) for block in blocks])
    inner = np.concatenate([mirror @ weight for mirror in mirrors], axis=1)
    return (inner, np.tile(offset, len(mirrors))), (last, np.zeros(last.shape[1]))


def _ridge_solution(features: Tensor, targets: Tensor, ridge: float) -> Tensor:
    """Weights (M, K) of features (S, M) that minimise |targets - features W|^2 + ridge |W|^2."""
    gram = features.T @ features + ridge * torch.eye(features.shape[1], dtype=features.dtype)
    solved: Tensor = torch.linalg.solve(gram, features.T @ targets)
    return solved


def _single_tensor(values: object, device: str) -> Tensor:
    return torch.as_tensor(np.asarray(values), dtype=torch.float32, device=device)
