"""Path, trained: the paper's compensator. Networks trained by Adam, searched by Optuna's TPE.

[dx_1 ... dx_T, dy_1 ... dy_T] = f(u, v, r, commands, relative wind), trained on the errors dx_i = x_i - x_i^physics of
the path (Kanazawa et al. 2022, eqs. 12 and 13); the prediction is the path of the physics plus f.
"""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from shipid.hybrid.compensator import Compensator
from shipid.hybrid.features import Memory
from shipid.hybrid.method import FitResult, Task
from shipid.hybrid.search import Probability, Scale, SearchMethod


class PathTrained(SearchMethod):
    """Networks trained on the errors of the path, as in the paper; the defaults are the paper's.

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation.
    layers, units : hidden layers of tanh, and their one width.
    input_dropout, hidden_dropout : probability that an input or a hidden unit is dropped.
    learning_rate : of Adam, constant; a range is searched by its logarithm.
    weight_decay : decoupled (AdamW), 0 is Adam; a range is searched by its logarithm.
    epochs : passes over the training samples, at most.
    batch : samples per optimiser step; 0 = all.
    patience : epochs without a better validation loss after which training stops; 0 = never.
    memory : what the inputs hold of the past.
    at_once : trials that are proposed at a time. More than one race: the better half goes on, after 1/16, 1/8, ... of
        the epochs.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = (
        "layers",
        "units",
        "input_dropout",
        "hidden_dropout",
        "learning_rate",
        "weight_decay",
    )
    COUNTS: ClassVar[tuple[str, ...]] = ("layers", "units")
    LINEAR: ClassVar[tuple[str, ...]] = ("input_dropout", "hidden_dropout")
    corrector: ClassVar[type[Any]] = Compensator

    layers: PositiveInt | tuple[PositiveInt, PositiveInt] = (1, 3)
    units: PositiveInt | tuple[PositiveInt, PositiveInt] = (10, 500)
    input_dropout: Probability | tuple[Probability, Probability] = (0.0, 1.0)
    hidden_dropout: Probability | tuple[Probability, Probability] = (0.0, 1.0)
    learning_rate: Scale = (1e-5, 1e-1)
    weight_decay: NonNegativeFloat | tuple[PositiveFloat, PositiveFloat] = 0.0
    epochs: PositiveInt = 3000
    batch: NonNegativeInt = 0
    patience: NonNegativeInt = 200
    memory: Memory = Memory()
    at_once: PositiveInt = 1

    @property
    def together(self) -> bool:
        """Networks of one architecture train as one stack; where it is searched, hardly any two are alike."""
        return not any(isinstance(getattr(self, name), tuple) for name in self.COUNTS)

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Train networks for every foundation; the corrector is the mean of the fold networks of the best trial."""
        from shipid.hybrid.gradient import tune_gradient  # a study is read without Optuna and PyTorch
        from shipid.hybrid.training import Length

        length = Length(self.epochs, self.batch, self.patience)
        return tune_gradient(task, self, self.inputs(task.commands), length, self.at_once)
