"""The recipe: what is searched and how a network is trained, with the two named presets `paper` and `fast`."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, log
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt
from pydantic import model_validator as validator

from shipid.document import parse
from shipid.errors import DocumentError, choices

Probability = Annotated[float, Field(ge=0.0, le=1.0)]
COUNTS = ("layers", "units")
LOGARITHMIC = ("learning_rate", "weight_decay")
SEARCHED = (*COUNTS, "input_dropout", "hidden_dropout", *LOGARITHMIC)


class Recipe(BaseModel):
    """How a compensator is tuned and trained; of what may be searched, a number is fixed and a pair is a range.

    Parameters
    ----------
    sampler : `tpe` learns from the trials before; `sequence` spreads the trials evenly, the same for all models.
    trials : sets of hyperparameters tried per model.
    layers, units : hidden layers of tanh, and their one width.
    input_dropout, hidden_dropout : probability that an input or a hidden unit is dropped.
    learning_rate : of Adam, or the peak of the one cycle; a range is searched by its logarithm.
    weight_decay : decoupled (AdamW), 0 is Adam; a range is searched by its logarithm.
    epochs : passes over the training samples, at most.
    min_steps : raises the epochs of small data sets to at least so many optimiser steps; 0 = does not.
    batch : samples per optimiser step; 0 = all.
    patience : epochs without a better validation loss after which training stops; 0 = never.
    one_cycle : anneal the learning rate once up and down; else it is constant.
    scale_targets : divide targets by their size in the training samples; else they stay in metres.
    refit : networks trained on all samples with the best hyperparameters; 0 = keep the networks of the folds.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    sampler: Literal["tpe", "sequence"]
    trials: PositiveInt
    layers: PositiveInt | tuple[PositiveInt, PositiveInt]
    units: PositiveInt | tuple[PositiveInt, PositiveInt]
    input_dropout: Probability | tuple[Probability, Probability]
    hidden_dropout: Probability | tuple[Probability, Probability]
    learning_rate: PositiveFloat | tuple[PositiveFloat, PositiveFloat]
    weight_decay: NonNegativeFloat | tuple[PositiveFloat, PositiveFloat]
    epochs: PositiveInt
    min_steps: NonNegativeInt
    batch: NonNegativeInt
    patience: NonNegativeInt
    one_cycle: bool
    scale_targets: bool
    refit: NonNegativeInt

    @validator(mode="after")
    def _ranges_rise(self) -> Self:
        for name, (low, high) in self.ranges().items():
            if low >= high:
                raise ValueError(f"{name}: a range goes from low to high, got [{low}, {high}]")
        return self

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Self:
        """Take `paper` or `fast` with some fields changed; raises DocumentError for a wrong name, key or value."""
        if name not in PRESETS:
            raise DocumentError(f"no such recipe: {choices(name, PRESETS)}", path="recipe")
        recipe: Self = parse(cls, PRESETS[name] | changes, None, "recipe")
        return recipe

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what is to be searched: name -> (low, high)."""
        return {name: value for name in SEARCHED if isinstance(value := getattr(self, name), tuple)}


# Method, section 2, with the free choices pinned there: what the paper did, or may have done.
PAPER: dict[str, Any] = {
    "sampler": "tpe",
    "trials": 50,
    "layers": (1, 3),
    "units": (10, 500),
    "input_dropout": (0.0, 1.0),
    "hidden_dropout": (0.0, 1.0),
    "learning_rate": (1e-5, 1e-1),
    "weight_decay": 0.0,
    "epochs": 3000,
    "min_steps": 0,
    "batch": 0,
    "patience": 200,
    "one_cycle": False,
    "scale_targets": False,
    "refit": 0,
}
# Chosen on residuals of a 3-DOF ship with perturbed derivatives, 10 to 100 manoeuvres, with and without wave noise:
# 3 x 64 beat 2 x 64 and 3 x 32 at 100, twice the width gained nothing; the best decay was 0.01 ... 0.1 with much data
# and 0.1 ... 0.5 with little; two refitted networks lowered the test error by 7 to 20 % against the fold network,
# except for an accurate model on 10 noisy manoeuvres, where it rose.
FAST: dict[str, Any] = {
    "sampler": "sequence",
    "trials": 4,
    "layers": 3,
    "units": 64,
    "input_dropout": 0.0,
    "hidden_dropout": 0.0,
    "learning_rate": 1e-2,
    "weight_decay": (1e-2, 1.0),
    "epochs": 50,
    "min_steps": 1500,
    "batch": 64,
    "patience": 0,
    "one_cycle": True,
    "scale_targets": True,
    "refit": 2,
}
PRESETS = {"paper": PAPER, "fast": FAST}


def sequence(ranges: Mapping[str, tuple[float, float]], num_trials: int) -> list[dict[str, float]]:
    """Spread trials evenly over ranges, any number of them, the first in the middle: an additive recurrence.

    Point k is frac(1/2 + k / phi^j) in dimension j = 1 ... d with phi^(d+1) = phi + 1 (Roberts, "The unreasonable
    effectiveness of quasirandom sequences", 2018), in the logarithm where the range is searched so.
    """
    phi = 2.0
    for _ in range(60):  # the fixed point phi = (1 + phi)^(1 / (d + 1)) contracts by at least a half
        phi = (1.0 + phi) ** (1.0 / (len(ranges) + 1))
    points = []
    for k in range(num_trials):
        point: dict[str, float] = {}
        for j, (name, (low, high)) in enumerate(ranges.items(), start=1):
            share = (0.5 + k / phi**j) % 1.0
            if name in COUNTS:
                point[name] = int(low + share * (high - low + 1))
            elif name in LOGARITHMIC:
                point[name] = exp(log(low) + share * (log(high) - log(low)))
            else:
                point[name] = low + share * (high - low)
        points.append(point)
    return points
