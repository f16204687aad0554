"""Training by PyTorch, with one loop, `minimise_losses`: stacks of small networks, and gated recurrent units.

The K members of a stack have equally many layers and samples; nothing that one computes depends on the others. One
small network leaves a core waiting for Python; four of 16 units as one batched product do not. Wide ones gain nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, pairwise
from math import ceil, cos, pi, prod

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits
from torch import Tensor

from shipid.hybrid.compensator import Layers
from shipid.hybrid.method import Array

Stack = Sequence[tuple[Tensor, Tensor]]
Shapes = Mapping[str, tuple[int, ...]]
Part = tuple[Sequence[tuple[list[Array], Array]], Array]
"""What is read, P + 1 rows (S, d) of the past with inputs at the instant (S, e), then its mirror image if there is one;
and outputs (S, 2 r)."""

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


@dataclass(frozen=True, eq=False)
class Learner:
    """One network to be trained, and its data.

    inputs : (n, d), normalised. targets : (n, m) [m]. training, validation : samples to learn from, and to watch.
    settings : `layers` hidden layers of `units` tanh, `learning_rate`, `weight_decay` (AdamW; 0 is Adam), and
        `input_dropout` and `hidden_dropout`, the probabilities to be dropped.
    seed : of the initial weights and drop-out.
    """

    inputs: Array
    targets: Array
    training: NDArray[np.int64]
    validation: NDArray[np.int64]
    settings: Mapping[str, float]
    seed: int

    @property
    def widths(self) -> list[int]:
        """Number of inputs, of units in each hidden layer, and of outputs."""
        hidden = [int(self.settings["units"])] * int(self.settings["layers"])
        return [self.inputs.shape[1], *hidden, self.targets.shape[1]]


class StackTraining:
    """K networks, sample -> target, that are trained together on the mean squared error, some epochs at a time.

    Parameters
    ----------
    learners : with the same widths and as many samples each.
    order_seed : of the order of the samples in batches, the same for all.
    device : a PyTorch device; random numbers are drawn on the CPU.

    A member that diverges keeps its best weights before that; others go on.
    """

    def __init__(
        self,
        learners: Sequence[Learner],
        length: Length,
        *,
        order_seed: int = 0,
        device: str = "cpu",
    ) -> None:
        self.learners = learners
        widths = learners[0].widths
        self._shapes = [shape for i, o in pairwise(widths) for shape in ((i, o), (1, o))]
        settings = [one.settings for one in learners]
        learning = _single_tensor([one["learning_rate"] for one in settings], device)[:, None]
        dropout = [
            [one[name] for one in settings] for name in ("input_dropout", *["hidden_dropout"] * (len(widths) - 2))
        ]
        (x, y), watched = (self._samples(part, device) for part in ("training", "validation"))
        num_samples = y.shape[1]
        generators = [torch.Generator().manual_seed(int(one.seed)) for one in learners]
        order = torch.Generator().manual_seed(order_seed)
        weights = initial_weights(widths, generators).to(device)
        leaves = [leaf.requires_grad_() for leaf in split_layers(weights, self._shapes)]
        layers = list(zip(leaves[::2], leaves[1::2], strict=True))

        def loss(rows: Tensor | slice) -> Tensor:
            seen = x[:, rows]
            masks = [  # for the input of each layer, or None where no member drops any
                draw_dropout(rates, (seen.shape[1], width), generators).to(device) if any(rates) else None
                for rates, width in zip(dropout, widths, strict=False)
            ]
            return _stack_losses(stack_outputs(seen, layers, masks), y[:, rows])

        batch = min(length.batch or num_samples, num_samples)
        self.best = BestEpochs(weights, length.patience)
        self._epochs = minimise_losses(
            weights,
            leaves,
            [one["weight_decay"] for one in settings],
            length,
            self.best,
            batches=lambda: (  # a single batch stays in order
                [slice(None)]
                if batch == num_samples
                else torch.split(torch.randperm(num_samples, generator=order), batch)
            ),
            rate=lambda _: learning,
            loss=loss,
            watched=lambda: _stack_losses(stack_outputs(watched[0], layers), watched[1]),
        )

    def _samples(self, part: str, device: str) -> tuple[Tensor, ...]:
        """Inputs (K, n, d) and targets (K, n, m) of `training` or `validation`."""
        pairs = [(one.inputs[rows], one.targets[rows]) for one in self.learners for rows in (getattr(one, part),)]
        return tuple(_single_tensor(np.stack(side), device) for side in zip(*pairs, strict=True))

    def advance(self, epochs: int | None = None) -> None:
        """Train for so many further epochs, by default to the end."""
        with threadpool_limits(1):  # for the same digits anywhere; networks as small as these are slower on more
            for _ in islice(self._epochs, epochs):
                pass

    def losses(self) -> Array:
        """Best validation losses (K,) [m^2] so far, per coordinate; NaN where a loss stopped being a number."""
        best = self.best
        kept = torch.where(best.finite & best.best.isfinite(), best.best, torch.nan)
        return np.asarray(kept.cpu().numpy().astype(float))

    def layers(self) -> tuple[Layers, ...]:
        """Weight (i, o) and bias (o,) of each layer of each network, of its best epoch."""
        pieces = [one.detach().cpu().numpy().astype(float) for one in split_layers(self.best.kept, self._shapes)]
        pairs = list(zip(pieces[::2], pieces[1::2], strict=True))
        return tuple(tuple((w[k], b[k, 0]) for w, b in pairs) for k in range(len(self.learners)))


def _stack_losses(made: Tensor, targets: Tensor) -> Tensor:
    """Mean squared errors (K,) of outputs (K, n, m)."""
    return (made - targets).square().mean(dim=(1, 2))


def minimise_losses(
    weights: Tensor,
    leaves: Sequence[Tensor],
    decay: Sequence[float],
    length: Length,
    best: BestEpochs,
    *,
    batches: Callable[[], Iterable[Tensor | slice]],
    rate: Callable[[int], Tensor],
    loss: Callable[[Tensor | slice], Tensor],
    watched: Callable[[], Tensor],
) -> Iterator[None]:
    """Minimise the losses of K members by AdamW, an epoch at a time.

    Parameters
    ----------
    weights : (K, P), changed in place. leaves : parts of the same memory that have gradients, in order.
    decay : (K,) of the weights. best : keeps the weights of the best epoch of each.
    batches : rows of the batches of the next epoch. rate : epoch, from 0 -> learning rates (K, 1).
    loss : rows -> losses (K,). watched : validation losses (K,) now.
    """
    adam = Adam(weights, decay)
    for epoch in range(length.epochs):
        total = torch.zeros(len(weights), device=weights.device)
        for rows in batches():
            losses = loss(rows)
            gradients = torch.autograd.grad(losses.sum(), leaves)
            with torch.no_grad():
                adam.step(torch.cat([one.reshape(len(weights), -1) for one in gradients], dim=1), rate(epoch))
            total += losses.detach()
        with torch.no_grad():
            best.compare(total, watched())
        yield
        if not best.running.any():
            return


def stack_outputs(h: Tensor, layers: Stack, masks: Sequence[Tensor | None] = ()) -> Tensor:
    """Return outputs (K, n, m) of K networks for inputs (K, n, d): tanh layers, a linear one; masks drop."""
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


def split_layers(flat: Tensor, shapes: Sequence[tuple[int, ...]]) -> list[Tensor]:
    """Split flat weights (K, P) into views (K, ...) of these shapes."""
    pieces = torch.split(flat, [prod(shape) for shape in shapes], dim=1)
    return [piece.view(-1, *shape) for piece, shape in zip(pieces, shapes, strict=True)]


def draw_dropout(rates: Sequence[float], shape: tuple[int, int], generators: Sequence[torch.Generator]) -> Tensor:
    """Draw inverted drop-out (K, n, i): 1 / (1 - p) with probability 1 - p, else 0; for p = 1 all is 0, not 0 / 0.

    A member without drop-out draws nothing, alone or in company.
    """
    masks = []
    for p, generator in zip(rates, generators, strict=True):
        if p > 0:  # the draws of `bernoulli_`, bit by bit, in less than half of its time
            bits = torch.empty(shape, dtype=torch.int64).random_(0, 2**53, generator=generator)
            masks.append((bits < ceil((1 - p) * 2**53)).float().div_(1 - p if p < 1 else 1.0))
        else:
            masks.append(torch.ones(shape))
    return torch.stack(masks)


def _single_tensor(values: object, device: str) -> Tensor:
    return torch.as_tensor(np.asarray(values), dtype=torch.float32, device=device)


def train_gated(
    parts: Sequence[Part], units: int, learning_rate: float, decay: float, length: Length, seed: int
) -> tuple[dict[str, Array], int]:
    """Train on the first part of the data, stop by the second; layers by name and the number of epochs."""
    generator, ((past, now), *_), outputs = torch.Generator().manual_seed(seed), *parts[0]
    shapes = {
        "W_i": (3 * units, past[0].shape[1]),
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
    held: Callable[[], dict[str, Array]] = dict,
) -> tuple[dict[str, Array], int]:
    """Train what reads past and present on the first part, stop by the second; layers by name, number of epochs.

    network : (layers, past, now) -> outputs. weights : (1, P), changed in place. shapes : of the layers in them.
    rates : of learning, and of decay. generator : of the batches.
    held : what else the network predicts with, by name, as it is now; that of the best epoch is kept beside the layers.
    """
    layers = {name: layer.requires_grad_() for name, layer in _layers_by_name(weights, shapes).items()}
    (seen, outputs), watched = (
        ([(_single_tensor(past, "cpu"), _single_tensor(now, "cpu")) for past, now in pairs], _single_tensor(out, "cpu"))
        for pairs, out in parts
    )
    reader = partial(network, layers)
    best = BestEpochs(weights, length.patience)
    epochs = minimise_losses(
        weights,
        list(layers.values()),
        [rates[1]],
        length,
        best,
        batches=lambda: torch.split(torch.randperm(len(outputs), generator=generator), length.batch),
        rate=lambda epoch: torch.tensor([[rates[0] * (1 + cos(pi * epoch / length.epochs)) / 2]]),
        loss=lambda rows: _mirrored_loss(reader, [(past[:, rows], now[rows]) for past, now in seen], outputs[rows]),
        watched=lambda: _mirrored_loss(reader, *watched),
    )
    kept = held()
    with threadpool_limits(1):
        for _ in epochs:
            kept = kept if best.waited[0] else held()
    kept |= {name: layer.double().numpy() for name, layer in _layers_by_name(best.kept, shapes).items()}
    return kept, int(best.epochs[0])


def _first_weights(shapes: Shapes, units: int, generator: torch.Generator) -> Tensor:
    """Initial weights (1, P), drawn as PyTorch draws them."""
    bounds = {name: (units if name[2] in "ih" else shape[-1]) ** -0.5 for name, shape in shapes.items()}
    draws = [(torch.rand(shape, generator=generator) * 2 - 1) * bounds[name] for name, shape in shapes.items()]
    return torch.cat([draw.flatten() for draw in draws])[None]


def _layers_by_name(weights: Tensor, shapes: Shapes) -> dict[str, Tensor]:
    """Layers by name, in the memory of weights (1, P)."""
    pieces = split_layers(weights, list(shapes.values()))
    return {name: piece[0] for name, piece in zip(shapes, pieces, strict=True)}


def gated_outputs(layers: Mapping[str, Tensor], past: Tensor, now: Tensor) -> Tensor:
    """Outputs (S, 2 r) of a gated recurrent unit on the past (P + 1, S, d), with inputs at the instant (S, e)."""
    flat = [layers[name] for name in ("W_i", "W_h", "b_i", "b_h")]
    start = now.new_zeros(1, len(now), layers["W_h"].shape[1])
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
        sign = torch.tensor([1.0, -1.0]).repeat_interleave(made.shape[1] // 2)
        plain, image = made.chunk(2)
        made = (plain + sign * image) / 2
    return _stack_losses(made[None], outputs[None])
