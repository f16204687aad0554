"""Settings that methods with a search share: a number is fixed, a pair is a range that is searched."""

from __future__ import annotations

from typing import Annotated, ClassVar, Self
from zlib import crc32

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt
from pydantic import model_validator as validator

from shipid.hybrid.method import Method

Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Scale = PositiveFloat | tuple[PositiveFloat, PositiveFloat]


class Searched(Method):
    """A method that tries sets of hyperparameters and keeps the best by validation.

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ()

    trials: PositiveInt = 50

    @validator(mode="after")
    def _ranges_rise(self) -> Self:
        for name, (low, high) in self.ranges().items():
            if low >= high:
                raise ValueError(f"{name}: a range goes from low to high, got [{low}, {high}]")
        return self

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what is to be searched: name -> (low, high)."""
        return {name: value for name in self.SEARCHED if isinstance(value := getattr(self, name), tuple)}

    def varied(self) -> tuple[str, ...]:
        """Return the names of the hyperparameters that differ between trials."""
        return tuple(self.ranges())


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
