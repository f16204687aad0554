"""The recipe: what is searched and how a network gets its weights, with the two named presets `paper` and `fast`."""

from __future__ import annotations

from math import exp, log
from typing import Annotated, Any, ClassVar, Self
from zlib import crc32

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt
from pydantic import model_validator as validator

from shipid.document import parse
from shipid.errors import DocumentError, choices

RIDGES = 9  # of a range
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Scale = PositiveFloat | tuple[PositiveFloat, PositiveFloat]
Ridge = Annotated[float, Field(ge=1e-8)]  # below it rounding decides


class Recipe(BaseModel):
    """What all recipes share; of what may be searched, a number is fixed and a pair is a range.

    Parameters
    ----------
    trials : sets of hyperparameters tried per model.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    SEARCHED: ClassVar[tuple[str, ...]] = ()

    trials: PositiveInt

    @validator(mode="after")
    def _ranges_rise(self) -> Self:
        for name, (low, high) in self.ranges().items():
            if low >= high:
                raise ValueError(f"{name}: a range goes from low to high, got [{low}, {high}]")
        return self

    @staticmethod
    def kind(name: str) -> type[Recipe]:
        """Return the class of the preset `paper` or `fast`; raises DocumentError for another name."""
        if name not in PRESETS:
            raise DocumentError(f"no such recipe: {choices(name, PRESETS)}", path="recipe")
        return PRESETS[name][0]

    @staticmethod
    def preset(name: str, **changes: Any) -> Recipe:
        """Take `paper` or `fast` with some fields changed; raises DocumentError for a wrong name, key or value."""
        kind = Recipe.kind(name)
        recipe: Recipe = parse(kind, PRESETS[name][1] | changes, None, "recipe")
        return recipe

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what is to be searched: name -> (low, high)."""
        return {name: value for name in self.SEARCHED if isinstance(value := getattr(self, name), tuple)}

    def varied(self) -> tuple[str, ...]:
        """Name what may differ between trials."""
        return tuple(self.ranges())

    def num_chosen(self) -> int:
        """Return how many of the best trials make the compensator, at most."""
        return 1


class GradientRecipe(Recipe):
    """Networks trained by Adam, searched by Optuna's TPE: what the paper does.

    Parameters
    ----------
    layers, units : hidden layers of tanh, and their one width.
    input_dropout, hidden_dropout : probability that an input or a hidden unit is dropped.
    learning_rate : of Adam, constant; a range is searched by its logarithm.
    weight_decay : decoupled (AdamW), 0 is Adam; a range is searched by its logarithm.
    epochs : passes over the training samples, at most.
    batch : samples per optimiser step; 0 = all.
    patience : epochs without a better validation loss after which training stops; 0 = never.
    """

    SEARCHED = ("layers", "units", "input_dropout", "hidden_dropout", "learning_rate", "weight_decay")
    COUNTS: ClassVar = ("layers", "units")
    LOGARITHMIC: ClassVar = ("learning_rate", "weight_decay")

    layers: PositiveInt | tuple[PositiveInt, PositiveInt]
    units: PositiveInt | tuple[PositiveInt, PositiveInt]
    input_dropout: Probability | tuple[Probability, Probability]
    hidden_dropout: Probability | tuple[Probability, Probability]
    learning_rate: Scale
    weight_decay: NonNegativeFloat | tuple[PositiveFloat, PositiveFloat]
    epochs: PositiveInt
    batch: NonNegativeInt
    patience: NonNegativeInt


class RidgeRecipe(Recipe):
    """Networks with drawn hidden units and output weights in closed form, judged by runs left out in turn.

    All ranges are searched by their logarithm, with the same trials for all models.

    Parameters
    ----------
    units : hidden units of tanh, drawn at random; twice as many where they come in mirrored pairs.
    motion_scale, command_scale, wind_scale : how far an input must move, in its standard deviations, to change a hidden
        unit by about one: u, v, r; the commands; the relative wind. Large = the compensation varies slowly with it.
    offset : spread of the offsets of the hidden units: large bends more.
    ridge : weight of the squared output weights; from low to high, the best of 9 is taken for each trial and model.
    terms : the compensation is a polynomial of time with so many terms: what is faster is waves.
    mirror : share of the trials in which port and starboard are mirror images.
    averaged : the compensation is the mean of the networks of so many best trials.
    """

    SEARCHED = ("motion_scale", "command_scale", "wind_scale", "offset", "ridge")

    units: PositiveInt
    motion_scale: Scale
    command_scale: Scale
    wind_scale: Scale
    offset: Scale
    ridge: Ridge | tuple[Ridge, Ridge]
    terms: PositiveInt
    mirror: Probability
    averaged: PositiveInt

    def varied(self) -> tuple[str, ...]:
        """Name what may differ between trials."""
        return (*self.ranges(), "mirror") if 0 < self.mirror < 1 else tuple(self.ranges())

    def num_chosen(self) -> int:
        """Return how many of the best trials make the compensator, at most."""
        return self.averaged

    def points(self) -> list[dict[str, float]]:
        """Return the trials: a value of everything searched but the ridge, and `mirror`, 1 or 0."""
        ranges = {name: pair for name, pair in self.ranges().items() if name != "ridge"}
        fixed = {name: value for name in self.SEARCHED if not isinstance(value := getattr(self, name), tuple)}
        found = []
        for shares in spread(len(ranges) + 1, self.trials):
            point = {**fixed, "mirror": float(shares[0] < self.mirror)}
            for share, (name, (low, high)) in zip(shares[1:], ranges.items(), strict=True):
                point[name] = exp(log(low) + share * (log(high) - log(low)))
            found.append(point)
        return found

    def path(self) -> list[float]:
        """Return the ridges that every trial is solved with, evenly spread by their logarithm."""
        return [self.ridge] if isinstance(self.ridge, float) else [float(r) for r in np.geomspace(*self.ridge, RIDGES)]


# Method, section 2, with the free choices pinned there: what the paper did, or may have done.
PAPER: dict[str, Any] = {
    "trials": 50,
    "layers": (1, 3),
    "units": (10, 500),
    "input_dropout": (0.0, 1.0),
    "hidden_dropout": (0.0, 1.0),
    "learning_rate": (1e-5, 1e-1),
    "weight_decay": 0.0,
    "epochs": 3000,
    "batch": 0,
    "patience": 200,
}
# Chosen on held-out windows of five worlds of `simulation`: docs/performance.md, "What lowers H".
FAST: dict[str, Any] = {
    "trials": 50,
    "units": 256,
    "motion_scale": (1.0, 16.0),
    "command_scale": (1.0, 16.0),
    "wind_scale": (4.0, 64.0),
    "offset": (0.5, 4.0),
    "ridge": (1e-5, 10.0),
    "terms": 8,
    "mirror": 0.75,
    "averaged": 8,
}
PRESETS: dict[str, tuple[type[Recipe], dict[str, Any]]] = {
    "paper": (GradientRecipe, PAPER),
    "fast": (RidgeRecipe, FAST),
}


def spread(num_dims: int, num_points: int) -> list[list[float]]:
    """Spread points evenly over the unit cube, any number of them, the first in the middle: an additive recurrence.

    Point k is frac(1/2 + k / phi^j) in dimension j = 1 ... d with phi^(d+1) = phi + 1 (Roberts, "The unreasonable
    effectiveness of quasirandom sequences", 2018).
    """
    phi = 2.0
    for _ in range(60):  # the fixed point phi = (1 + phi)^(1 / (d + 1)) contracts by at least a half
        phi = (1.0 + phi) ** (1.0 / (num_dims + 1))
    return [[(0.5 + k / phi**j) % 1.0 for j in range(1, num_dims + 1)] for k in range(num_points)]


def seed_of(*entropy: int | str) -> int:
    """Draw a seed from numbers and names, the same on every machine."""
    words = [crc32(part.encode()) if isinstance(part, str) else part for part in entropy]
    return int(np.random.SeedSequence(words).generate_state(1)[0])
