"""Training of a gated recurrent unit by PyTorch, from arrays to arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, pi

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shipid.hybrid.training import Length, minimise_losses

Array = NDArray[np.float64]
Shapes = Mapping[str, tuple[int, ...]]
Part = tuple[Sequence[tuple[Array, Array]], Array]
"""What is read, the past (P + 1, S, d) with inputs at the instant (S, e), then its mirror image if there is one; and
outputs (S, 2 r)."""


def train_gated(
    parts: Sequence[Part], units: int, learning_rate: float, decay: float, length: Length, seed: int
) -> tuple[dict[str, Array], int]:
    """Train on the first part of the data, stop by the second; layers by name and the number of epochs."""
    generator = torch.Generator().manual_seed(seed)
    (seen, outputs), watched = map(_tensors, parts)
    (past, now), *_ = seen
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
    layers = {name: layer.requires_grad_() for name, layer in _layers_by_name(weights, shapes).items()}

    def loss(rows: Tensor | slice) -> Tensor:
        return _gated_loss(layers, [(past[:, rows], now[rows]) for past, now in seen], outputs[rows])

    best = minimise_losses(
        weights,
        list(layers.values()),
        [decay],
        length,
        batches=lambda: torch.split(torch.randperm(len(outputs), generator=generator), length.batch),
        rate=lambda epoch: torch.tensor([[learning_rate * (1 + cos(pi * epoch / length.epochs)) / 2]]),
        loss=loss,
        watched=lambda: _gated_loss(layers, *watched),
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


def _tensors(part: Part) -> tuple[list[tuple[Tensor, Tensor]], Tensor]:
    """What is read, and the outputs, in single precision."""
    seen, outputs = part
    pairs = [(torch.as_tensor(past).float(), torch.as_tensor(now).float()) for past, now in seen]
    return pairs, torch.as_tensor(outputs).float()


def _gated_loss(layers: Mapping[str, Tensor], seen: Sequence[tuple[Tensor, Tensor]], outputs: Tensor) -> Tensor:
    """Mean squared error (1,) of the network on outputs (S, 2 r); with an image, x is made even and y odd."""
    past, now = (torch.cat(arrays, dim=-2) for arrays in zip(*seen, strict=True))
    flat = [layers[name] for name in ("W_i", "W_h", "b_i", "b_h")]
    start = torch.zeros(1, len(now), layers["W_h"].shape[1])
    _, hidden = torch.gru(past, start, flat, True, 1, 0.0, False, False, False)
    full = torch.cat([hidden[0], now], dim=1)
    made = torch.tanh(full @ layers["W_1"].T + layers["c_1"]) @ layers["W_2"].T + layers["c_2"]
    if len(seen) == 2:
        sign = torch.ones(made.shape[1])
        sign[len(sign) // 2 :] = -1.0
        plain, image = made.chunk(2)
        made = (plain + sign * image) / 2
    return (made - outputs).square().mean()[None]
