"""Path, refined: the networks of `path-drawn`, whose hidden weights are then trained on the runs left out."""

from __future__ import annotations

from pydantic import PositiveFloat, PositiveInt

from shipid.hybrid.method import FitResult, Task
from shipid.hybrid.path_drawn import PathDrawn


class PathRefined(PathDrawn):
    """`path-drawn`, whose hidden weights are then trained by Adam; output weights are solved anew at every step.

    All other settings are those of `path-drawn`.

    Parameters
    ----------
    epochs : steps of Adam on the errors of runs left out, by output weights solved without them.
    learning_rate : of Adam, constant.
    """

    epochs: PositiveInt = 10
    learning_rate: PositiveFloat = 0.01

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Solve the networks of the best trials for every foundation, and train them; the corrector is their mean."""
        from shipid.hybrid.gradient import train_drawn  # a study is read without Optuna and PyTorch

        return train_drawn(task, self, super().fit(task))
