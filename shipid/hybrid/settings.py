"""Settings that methods with a search share: a number is fixed, a pair is a range that is searched."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Annotated, ClassVar, Self
from zlib import crc32

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt
from pydantic import model_validator as validator

from shipid.hybrid.features import NO_MEMORY, Memory
from shipid.hybrid.method import Method, Traits

Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Scale = PositiveFloat | tuple[PositiveFloat, PositiveFloat]
Point = Mapping[str, float]
"""A trial: values of hyperparameters by name."""


@dataclass(frozen=True)
class SearchSpan:
    """Where a hyperparameter is searched: from low to high, by its logarithm or not, in whole numbers or not."""

    low: float
    high: float
    log: bool = True
    whole: bool = False


class SearchMethod(Method):
    """A method that tries sets of hyperparameters and keeps the best by validation.

    SEARCHED : names of the settings that may be ranges, searched by their logarithm. LINEAR : those of them that are
        not, such as a share from 0 to 1. COUNTS : those that are whole numbers.

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation.
    budget : core-seconds [s] per foundation for the whole fit, in place of `trials`: as many trials are made as fit,
        by the time that the first ones take (`shipid.hybrid.search`), one at least.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ()
    COUNTS: ClassVar[tuple[str, ...]] = ()
    LINEAR: ClassVar[tuple[str, ...]] = ()

    trials: PositiveInt = 50
    budget: PositiveFloat | None = None

    @validator(mode="after")
    def _ranges_rise(self) -> Self:
        for name, (low, high) in self.ranges().items():
            if low >= high:
                raise ValueError(f"{name}: a range goes from low to high, got [{low}, {high}]")
        return self

    @property
    def traits(self) -> Traits:
        """What a study compares this method by: its settings `mirror`, `memory` and `terms`, where it has such."""
        mirror, memory, terms = (getattr(self, name, None) for name in ("mirror", "memory", "terms"))
        return Traits(
            mirror > 0 if isinstance(mirror, bool | float) else None,
            memory if isinstance(memory, Memory) else NO_MEMORY,
            terms if isinstance(terms, int) else None,
        )

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what is to be searched: name -> (low, high)."""
        return {name: value for name in self.SEARCHED if isinstance(value := getattr(self, name), tuple)}

    def varied(self) -> tuple[str, ...]:
        """Return the names of the hyperparameters that differ between trials."""
        return tuple(self.ranges())

    def num_trials(self) -> int | None:
        """Return how many sets of hyperparameters are tried per foundation; None where the budget decides it."""
        return None if self.budget else self.trials

    def choices(self) -> dict[str, tuple[float, ...]]:
        """Return what is searched among some values: name -> values."""
        return {}

    def space(self) -> dict[str, SearchSpan | tuple[float, ...]]:
        """Return where each hyperparameter that differs between trials is searched: a span, or some values."""
        spans = {
            name: SearchSpan(low, high, log=name not in (*self.COUNTS, *self.LINEAR), whole=name in self.COUNTS)
            for name, (low, high) in self.ranges().items()
        }
        return {**spans, **self.choices()}


def spread_points(num_dims: int, num_points: int | None = None) -> Iterator[list[float]]:
    """Spread points evenly over the unit cube, any number of them, the first in the middle: an additive recurrence.

    Point k is frac(1/2 + k / phi^j) in dimension j = 1 ... d with phi^(d+1) = phi + 1 (Roberts, "The unreasonable
    effectiveness of quasirandom sequences", 2018). Without a number of points it never ends.
    """
    phi = 2.0
    for _ in range(60):  # the fixed point phi = (1 + phi)^(1 / (d + 1)) contracts by at least a half
        phi = (1.0 + phi) ** (1.0 / (num_dims + 1))
    for k in count() if num_points is None else range(num_points):
        yield [(0.5 + k / phi**j) % 1.0 for j in range(1, num_dims + 1)]


def seed_of(*entropy: int | str) -> int:
    """Draw a seed from numbers and names, the same on every machine."""
    words = [crc32(part.encode()) if isinstance(part, str) else part for part in entropy]
    return int(np.random.SeedSequence(words).generate_state(1)[0])
