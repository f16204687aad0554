"""Path, drawn: networks whose hidden units are drawn at random and whose output weights are solved in closed form.

f(z) = B W tanh(V z + c) with V, c drawn, B polynomials of time, and W = argmin |targets - f|^2 + ridge |W|^2; every
trial is judged by every run left out in turn (`shipid.hybrid.ridge`). Random features: Rahimi and Recht (2007).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, PositiveInt
from pydantic import model_validator as validator

from shipid.hybrid.compensator import Compensator
from shipid.hybrid.features import Inputs, Memory
from shipid.hybrid.method import FitResult, Task
from shipid.hybrid.search import Probability, Scale, SearchMethod, setting_at_share, spread_points

MEMORY_KINDS = ("history", "error", "observer")  # of memory
MEMORY_CHOICES = ((), ("error",), ("history", "error"))  # that validation chooses from, as far as a memory has them
OBSERVER_CHOICES = (("observer",), MEMORY_KINDS)  # and with estimates of an observer
MEMORIES = (*MEMORY_CHOICES, *OBSERVER_CHOICES, ("history",), ("error", "observer"), ("history", "observer"))
"""What a trial may take, by the number that its record has."""
Ridge = Annotated[float, Field(ge=1e-8)]  # below it rounding decides


class PathDrawn(SearchMethod):
    """Networks with drawn hidden units on the errors of the path, solved in closed form.

    All ranges are searched by their logarithm. Source of the defaults: docs/performance.md, "What lowers H".

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation.
    units : hidden units of tanh, drawn at random; twice as many where they come in mirrored pairs.
    motion_scale, command_scale, wind_scale : how far an input must move, in its standard deviations, to change a hidden
        unit by about one.
    offset : spread of the offsets of the hidden units: large bends more.
    ridge : weight of the squared output weights; each trial takes for each model the best of 9 by descent from the
        middle.
    terms : the compensation is a polynomial of time with so many terms: what is faster is waves.
    mirror : share of the trials in which port and starboard are mirror images.
    averaged : the compensation is the mean of the networks of so many best trials; by default 8, and 4 with `choose`.
    search_windows : about so many windows, evenly taken from each run, judge all trials where there are more; the
        best are then judged, and solved, with all windows.
    memory : what the inputs hold of the past; `history_scale`, `error_scale`, `observer_scale` are their scales.
    choose : whether validation chooses between no memory, the error of the physics, and that with history; with
        `memory.observer` also between its estimates alone and everything. Each has an equal share of the trials.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = (
        "motion_scale",
        "command_scale",
        "wind_scale",
        "history_scale",
        "error_scale",
        "observer_scale",
        "offset",
        "ridge",
    )
    validation: ClassVar[str] = "runs"
    corrector: ClassVar[type[Any]] = Compensator

    units: PositiveInt = 256
    motion_scale: Scale = (1.0, 16.0)
    command_scale: Scale = (1.0, 16.0)
    wind_scale: Scale = (4.0, 64.0)
    offset: Scale = (0.5, 4.0)
    ridge: Ridge | tuple[Ridge, Ridge] = (1e-5, 10.0)
    terms: PositiveInt = 8
    mirror: Probability = 0.75
    averaged: PositiveInt | None = None
    search_windows: PositiveInt = 1000
    memory: Memory = Memory()
    history_scale: Scale = (2.0, 32.0)
    error_scale: Scale = (2.0, 32.0)
    observer_scale: Scale = (2.0, 32.0)
    choose: bool = False

    @property
    def together(self) -> bool:
        """One decomposition a trial serves all foundations."""
        return True

    def inputs(self, commands: tuple[str, ...]) -> Inputs:
        """Return which quantities the networks may take, given the names of the command columns."""
        return Inputs(commands, self.memory)

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what is to be searched: name -> (low, high); scales of a memory that is not taken are left out."""
        idle = {f"{kind}_scale" for kind in MEMORY_KINDS if kind not in self.memory.kinds}
        return {name: pair for name, pair in super().ranges().items() if name not in idle}

    def left_out(self, point: Mapping[str, float]) -> frozenset[str]:
        """Return the kinds of memory that a trial does without."""
        taken = MEMORIES[int(point["memory"])] if "memory" in point else MEMORY_KINDS
        return frozenset(set(MEMORY_KINDS) - set(taken))

    @property
    def memories(self) -> tuple[int, ...]:
        """What validation chooses from, as places in `MEMORIES`."""
        choices = (*MEMORY_CHOICES, *OBSERVER_CHOICES) if self.memory.observer else MEMORY_CHOICES
        kept = (tuple(kind for kind in choice if kind in self.memory.kinds) for choice in choices)
        return tuple(dict.fromkeys(map(MEMORIES.index, kept)))

    @validator(mode="after")
    def _something_to_choose(self) -> Self:
        """Refuse a choice where nothing is remembered."""
        if self.choose and len(self.memories) < 2:
            raise ValueError("choose: there is no memory to choose from: give `memory`, or leave `choose` out")
        return self

    def num_chosen(self) -> int:
        """Return how many of the best trials make the compensator, at most."""
        return self.averaged or (4 if self.choose else 8)

    def choices(self) -> dict[str, tuple[float, ...]]:
        """Return what is searched among some values: the mirror, and which memory is taken."""
        mirror = {"mirror": (0.0, 1.0)} if 0 < self.mirror < 1 else {}
        memory = {"memory": tuple(map(float, self.memories))} if self.choose else {}
        return {**mirror, **memory}

    def points(self) -> Iterator[dict[str, float]]:
        """Return the trials: a value of everything searched but the ridge, and `mirror`; endless by budget."""
        ranges = [name for name in self.ranges() if name != "ridge"]
        fixed = {name: value for name in self.SEARCHED if not isinstance(value := getattr(self, name), tuple)}
        for number, shares in enumerate(spread_points(len(ranges) + 1, None if self.budget else self.trials)):
            point = {**fixed, "mirror": float(shares[0] < self.mirror)}
            if self.choose:
                point["memory"] = float(self.memories[number % len(self.memories)])
            yield point | {
                name: setting_at_share(self, name, share) for share, name in zip(shares[1:], ranges, strict=True)
            }

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Solve networks for every foundation; the corrector is the mean of the networks of the best trials."""
        from shipid.hybrid.ridge import tune_ridge  # a study is read without PyTorch

        return tune_ridge(task, self)
