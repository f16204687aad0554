"""What one core of this machine can do, and how far the training of a study is from it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch.profiler import ProfilerActivity, profile

from shipid.estimation.recipe import Recipe
from shipid.estimation.training import Settings, train
from tests.benchmarks.timing import best_of

ORDER = 2048  # of the big matrices
MEMBERS, BATCH, UNITS, LAYERS, INPUTS, OUTPUTS = 20, 64, 64, 3, 8, 60  # a stack of the recipe `fast`, horizon 30
WEIGHTS = INPUTS * UNITS + (LAYERS - 1) * UNITS**2 + UNITS * OUTPUTS  # of one network, without biases
REPEAT = 200  # of small work, so that a clock can tell
SAMPLES, EPOCHS = 4096, 5
ROUNDS = 7


def run() -> dict[str, Any]:
    """Rates of one core [G/s], the time of a training step, the least time its parts allow, and where it goes."""
    figures = rates()
    seconds = step_seconds()
    least = bounds(figures)
    result: dict[str, Any] = {name: round(value, 2) for name, value in figures.items()}
    result["training step, 20 networks [us]"] = round(1e6 * seconds, 1)
    result |= {f"least time: {name} [us]": round(1e6 * value, 1) for name, value in least.items()}
    result["training step / least time"] = round(seconds / sum(least.values()), 2)
    return result | shares()


def rates() -> dict[str, float]:
    """Best rates of one thread: products, copies (read and written), functions of float32 and float64."""
    big, other = torch.rand(2, ORDER, ORDER)
    small, weight = torch.rand(MEMBERS, BATCH, UNITS), torch.rand(MEMBERS, UNITS, UNITS)
    source = torch.rand(1 << 27)  # 512 MiB, more than caches hold
    target = torch.empty_like(source)
    stack, copied = torch.rand(2, MEMBERS * WEIGHTS)
    short = torch.rand(1 << 14)
    out = torch.empty_like(short)
    double = short.double()
    wide = torch.empty_like(double)
    seconds = best_of(
        {
            "product": lambda: big @ other,
            "batched": _often(lambda: torch.bmm(small, weight)),
            "copy": lambda: target.copy_(source),
            "copy in cache": _often(lambda: copied.copy_(stack)),
            "tanh": _often(lambda: torch.tanh(short, out=out)),
            "exp": _often(lambda: torch.exp(short, out=out)),
            "exp64": _often(lambda: torch.exp(double, out=wide)),
        },
        ROUNDS,
    )
    values = REPEAT * len(short)
    return {
        "product of order 2048, float32 [Gflop/s]": 2e-9 * ORDER**3 / seconds["product"],
        "20 products 64 x 64, float32 [Gflop/s]": 2e-9 * REPEAT * MEMBERS * BATCH * UNITS**2 / seconds["batched"],
        "copy of 512 MiB [GB/s]": 2e-9 * 4 * len(source) / seconds["copy"],
        "copy of 20 networks [GB/s]": 2e-9 * REPEAT * 4 * len(stack) / seconds["copy in cache"],
        "tanh, float32 [G/s]": 1e-9 * values / seconds["tanh"],
        "exp, float32 [G/s]": 1e-9 * values / seconds["exp"],
        "exp, float64 [G/s]": 1e-9 * values / seconds["exp64"],
    }


def _often(run: Callable[[], object]) -> Callable[[], None]:
    def repeated() -> None:
        for _ in range(REPEAT):
            run()

    return repeated


def bounds(figures: dict[str, float]) -> dict[str, float]:
    """Least time [s] of a step's parts: its flops at the peak of a product, its tanh at their rate, Adam as a copy."""
    flops = 3 * 2 * MEMBERS * BATCH * WEIGHTS - 2 * MEMBERS * BATCH * INPUTS * UNITS  # no gradient of the inputs
    tanh = MEMBERS * BATCH * UNITS * LAYERS
    traffic = 4 * 7 * MEMBERS * WEIGHTS  # float32: weight and two moments read and written, gradient read
    return {
        "products": 1e-9 * flops / figures["product of order 2048, float32 [Gflop/s]"],
        "tanh": 1e-9 * tanh / figures["tanh, float32 [G/s]"],
        "Adam": 1e-9 * traffic / figures["copy of 20 networks [GB/s]"],
    }


def step_seconds() -> float:
    """Wall time [s] of one optimiser step of a stack of networks, by `train` as a study calls it."""
    return best_of({"train": _training()}, ROUNDS)["train"] / (EPOCHS * SAMPLES // BATCH)


def shares() -> dict[str, Any]:
    """Share of each operation in the time that `train` spends inside PyTorch's operations, the six greatest."""
    with profile(activities=[ProfilerActivity.CPU]) as found:
        _training()()
    spent = {event.key.removeprefix("aten::"): event.self_cpu_time_total for event in found.key_averages()}
    most = sorted(spent, key=spent.__getitem__, reverse=True)[:6]
    return {f"share of {name}": round(spent[name] / sum(spent.values()), 3) for name in most}


def _training() -> Callable[[], object]:
    rng, fast = np.random.default_rng(0), Recipe.preset("fast")
    settings = Settings(
        layers=LAYERS,
        units=UNITS,
        learning_rate=(1e-2,) * MEMBERS,
        weight_decay=(0.1,) * MEMBERS,
        input_dropout=(0.0,) * MEMBERS,
        hidden_dropout=(0.0,) * MEMBERS,
        epochs=EPOCHS,
        batch=BATCH,
        one_cycle=fast.one_cycle,
    )
    inputs, targets = rng.normal(size=(SAMPLES, INPUTS)), rng.normal(size=(MEMBERS, SAMPLES, OUTPUTS))
    return lambda: train(inputs, targets, np.arange(SAMPLES), None, settings, range(MEMBERS))
