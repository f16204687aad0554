"""Kernel ridge regression on the errors of the path.

f(z) = B sum_c w_c k(z, c) over some windows c of training, k(z, c) = exp(-|z - c|^2 / 2) + l (1 + z c) with inputs
divided by the length scale of their group, B polynomials of time, and w = (K + ridge)^-1 targets. Scales, l and ridge
are found by descent on the error of every run left out (`shipid.hybrid.kernel_ridge`).

Where port and starboard are mirror images, k(z, c) + k(z', c) makes x and k(z, c) - k(z', c) makes y, z' the image of
z: mirrored inputs then give the mirrored path exactly.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import repeat
from typing import Any, ClassVar

from pydantic import PositiveFloat, PositiveInt

from shipid.hybrid.features import Memory
from shipid.hybrid.kernel_compensator import GROUPS, KernelCompensator
from shipid.hybrid.method import Task
from shipid.hybrid.search import Point, Scale, SearchedAlone, SearchProblem, trial_points


class Kernel(SearchedAlone):
    """Kernel ridge regression on the errors of the path.

    Parameters
    ----------
    trials : descents, each without its own part of the runs; their solutions are averaged. With fewer
        than three runs for each trial, one more is on all runs.
    steps : of a descent, at most.
    scale : range of the length scales, in standard deviations of the inputs.
    linear : range of the weight of the linear kernel. ridge : range of the variance of noise, that of the kernel is 1.
    terms : the compensation is a polynomial of time with so many terms.
    mirror : whether port and starboard are mirror images, where the inputs allow it.
    search_windows, centres : windows that a descent sees and that a solution has, evenly taken from each run.
    memory : what the inputs hold of the past.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("linear", "ridge")
    validation: ClassVar[str] = "runs"
    corrector: ClassVar[type[Any]] = KernelCompensator

    budget: ClassVar[None] = None  # type: ignore[misc]
    trials: PositiveInt = 3
    steps: PositiveInt = 12
    scale: tuple[PositiveFloat, PositiveFloat] = (1.0, 400.0)
    linear: Scale = (0.01, 4.0)
    ridge: Scale = (1e-3, 10.0)
    terms: PositiveInt = 8
    mirror: bool = True
    search_windows: PositiveInt = 200
    centres: PositiveInt = 1200
    memory: Memory = Memory()

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what a descent chooses where the inputs have the group: name -> (low, high)."""
        given = [group for group, setting in GROUPS.items() if not setting or getattr(self.memory, setting)]
        return {f"{group}_scale": self.scale for group in given} | super().ranges()

    def num_chosen(self) -> int:
        """Return how many trials make the compensator: all."""
        return self.trials

    def points(self) -> Iterable[Point]:
        """Return where the descents begin: in the middle of all ranges."""
        return repeat(next(iter(trial_points(self, frozenset()))), self.trials)

    def problem(self, task: Task, name: str) -> SearchProblem:
        """Return a foundation as this method sees it."""
        from shipid.hybrid.kernel_ridge import KernelProblem  # a study is read without PyTorch

        return KernelProblem(self, task, name)
