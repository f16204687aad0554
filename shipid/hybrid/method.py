"""The skeleton of a method: how data improve what the physics says. A method is one file and one line in METHODS."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, NonNegativeInt, model_validator

from shipid.arguments import as_float_array, check_mapping, check_number
from shipid.checked import CheckedModel
from shipid.data.windows import Instants, Windows, locked_view
from shipid.document import parse_model
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.hybrid.features import NO_MEMORY, Inputs, Memory
from shipid.hybrid.journal import Journal
from shipid.hybrid.physics import Needs, Physics
from shipid.plugins import definition_file, locate_errors
from shipid.vessel.load import Vessel

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Corrector(Protocol):
    """A fitted method: what it makes of the physics at instants of prediction.

    `from_arrays` rebuilds it from `header` and `arrays`; ResultError where a part is missing or does not fit.
    """

    @property
    def hyperparameters(self) -> Mapping[str, float]:
        """What the search chose, for the record."""

    @property
    def past(self) -> float:
        """Length of the past that a prediction needs [s]."""

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:
        """Return paths (T, S, 2) [m] in the frame (11); `paths` are those of the physics alone."""

    def header(self) -> dict[str, Any]:
        """Return all that is not an array."""

    def arrays(self) -> dict[str, Array]:
        """Return all arrays by name."""

    @classmethod
    def from_arrays(cls, header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Self:
        """Rebuild what `header` and `arrays` gave."""


@dataclass(frozen=True, eq=False)
class Case:
    """One foundation of a task.

    physics : equations with the numbers that the foundation says; without a vessel for no physics.
    paths : (T, S, 2) [m] of the physics alone on the windows of the task; zeros without a vessel.
    """

    physics: Physics
    paths: Array


Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Task:
    """What a method is fitted to: foundations on the same windows. Its arrays cannot be written to.

    cases : foundation -> its physics and paths. The result for one does not depend on the others.
    windows : windows that train or validate.
    folds : (training, validation) indices of windows, split by run; one pair, or one per fold.
    commands : names of the command columns. known : whether those over the horizon are known to a prediction.
    hidden : foundation -> states of its actuators at the instants (S,), where it has any.
    estimates : foundation -> what its observer knows at the instants (S,), where it has one.
    device : a PyTorch device. journal : where searches are written as they go and read back.
    cells : foundation -> name of its search in the journal.
    """

    cases: Mapping[str, Case]
    windows: Windows
    folds: Sequence[tuple[Index, Index]]
    commands: tuple[str, ...]
    known: bool = False
    seed: int = 0
    hidden: Mapping[str, Mapping[str, Array] | None] = field(default_factory=dict)
    estimates: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    device: str = "cpu"
    journal: Journal | None = None
    cells: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if any(len(part) == 0 for fold in self.folds for part in fold):
            raise DataError("a fold has no windows to train on or to validate with: use more manoeuvres")
        cases = {name: replace(case, paths=locked_view(case.paths)) for name, case in self.cases.items()}
        object.__setattr__(self, "cases", cases)
        object.__setattr__(self, "windows", self.windows.locked())

    def instants(self, name: str) -> Instants:
        """What a prediction of a foundation knows at each window."""
        hidden, estimates = self.hidden.get(name), self.estimates.get(name)
        return self.windows.instants(known=self.known, hidden=hidden, estimates=estimates)

    @property
    def targets(self) -> dict[str, Array]:
        """Foundation -> (T, S, 2) [m] what its physics misses; the true path itself without physics."""
        return {name: self.windows.future - case.paths for name, case in self.cases.items()}


@dataclass(frozen=True, eq=False)
class FitResult:
    """Result of a method for one foundation.

    corrector : None where every trial failed.
    trials : a row each: number, params, value (mean squared validation error [m^2]), epochs, seconds, state
        (`complete`, `stopped` where a race ended it, or `diverged`).
    seconds : time spent on this foundation, its share of what is done for several at once.
    left_out : errors (T, S, 2) [m], true less predicted, by models that saw the run of the window neither in training
        nor in the choice of hyperparameters; not numbers where there are none. None: `refits` of `shipid.predictor.fit`
        gives them.
    sentence : why the windows do not suffice; else empty.
    """

    corrector: Corrector | None
    trials: list[dict[str, Any]]
    seconds: float
    left_out: Array | None = None
    sentence: str = ""


@dataclass(frozen=True)
class Traits:
    """What sentences, comparisons and findings of a study know of a method; no number depends on it.

    mirror : whether it may use that port and starboard are mirror images; None where it has no such choice.
    memory : what its inputs hold of the past.
    terms : of time, of the polynomial that compensates the path; None where it is something else.
    """

    mirror: bool | None = None
    memory: Memory = NO_MEMORY
    terms: int | None = None


class Method(CheckedModel, BaseModel, ABC):
    """A way to improve physics by data: its fields are its settings. It must have `fit` and `corrector`.

    validation : `runs` leaves out every run in turn to judge a trial; `share` holds out a fifth of the runs.
    compensates : whether anything is learned from data.
    meets_none : whether it works without physics.
    meets_observer : whether it starts from the filtered state of physics with an observer, under the slow force.
    needs : what it asks of the physics, see `shipid.hybrid.physics.Needs`.
    corrector : the class that a saved predictor is rebuilt with.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    validation: ClassVar[str] = "share"
    compensates: ClassVar[bool] = True
    meets_none: ClassVar[bool] = True
    meets_observer: ClassVar[bool] = True
    needs: ClassVar[Needs] = "path"
    corrector: ClassVar[type[Any]]

    @property
    def past(self) -> float:
        """Length of the past that windows must hold for this method [s]."""
        return self.traits.memory.past

    @property
    def together(self) -> bool:
        """Whether several foundations, which cost much less in one fit, are one unit of work."""
        return False

    @property
    def traits(self) -> Traits:
        """What a study says of this method and compares it by."""
        return Traits()

    def unfit(self, vessel: Vessel) -> str:
        """Why this method cannot work with a vessel, and what to do; empty where it can."""
        del vessel
        return ""

    def varied(self) -> tuple[str, ...]:
        """Names of the hyperparameters that differ between trials."""
        return ()

    def num_trials(self) -> int | None:
        """Number of trials of each foundation; None where nothing is searched, or a budget decides it."""
        return None

    def num_chosen(self) -> int:
        """Number of the best trials that make the corrector, at most."""
        return 1

    @abstractmethod
    def fit(self, task: Task) -> dict[str, FitResult]:
        """Fit every foundation of a task; name of the foundation -> result."""


TRIAL_COLUMNS = ("cell", "model", "N_D", "seed", "chosen", "number", "value", "epochs", "seconds", "state")
"""Columns of a table of trials beside their params."""


class TrialRow(BaseModel):
    """What the row of a trial holds, see `FitResult`."""

    model_config = ConfigDict(extra="forbid")
    number: NonNegativeInt
    params: dict[str, float]
    value: float
    epochs: NonNegativeInt
    seconds: float
    state: Literal["complete", "stopped", "diverged"]

    @model_validator(mode="after")
    def _can_be_stored(self) -> Self:
        """Refuse a name of a column that there is already, and a value that is none."""
        if taken := sorted({*self.params} & {*TRIAL_COLUMNS}):
            raise ValueError(f"params: {taken[0]!r} is a name that is taken: use another")
        if self.state != "diverged" and not np.isfinite(self.value):
            raise ValueError(f"value must be finite, not {self.value}, unless the state is 'diverged'")
        return self


NEEDED: dict[Needs, str] = {
    "path": "paths",
    "motion": "psi, u, v, r along the path",
    "steps": "single steps from any state, which a function gives",
    "equations": "the equations of a vessel",
}
"""What a method needs -> what the physics must give, in words."""


def misfit_words(method: Method, gives: Sequence[Needs], vessel: Vessel | None) -> str:
    """Why a method cannot work with physics that gives this; empty where it can."""
    if method.needs not in gives:
        return f"the method needs {NEEDED[method.needs]}: take one that works on the path, such as kernel"
    return "" if vessel is None else method.unfit(vessel)


def fit_all(method: Method, task: Task) -> dict[str, FitResult]:
    """Fit every foundation of a task.

    DataError for a vessel that the method cannot work with, or where it gives something else; ShipidError for a mistake
    in the code of a user.
    """
    name, shape = type(method).__name__, task.windows.future.shape
    for physics in (case.physics for case in task.cases.values()):
        if words := misfit_words(method, physics.gives, physics.vessel):
            raise DataError(words)
    with locate_errors(f"{name}.fit", type(method)):
        given = method.fit(task)
    for case in task.cases:
        one = given.get(case) if isinstance(given, Mapping) else given
        if not isinstance(one, FitResult):
            raise DataError(f"{name}.fit must give a FitResult for {case!r}, not {type(one).__name__}")
        _check_fitted(f"{name}.fit", one, shape, method.compensates)
    return dict(given)


def _check_fitted(where: str, one: FitResult, shape: tuple[int, ...], learns: bool) -> None:
    """DataError where the parts of a result are not what a study stores."""
    try:
        rows: list[TrialRow] = [
            parse_model(TrialRow, row, None, f"trial {place}") for place, row in enumerate(one.trials)
        ]
    except (DocumentError, TypeError) as error:
        raise DataError(f"{where}: {error}: make trials by shipid.hybrid.search.trial_row") from None
    if one.left_out is not None and np.shape(as_float_array(f"{where}: left_out", one.left_out, DataError)) != shape:
        raise DataError(f"{where}: left_out must be {shape}, not {np.shape(one.left_out)}")
    if one.corrector is None:
        return
    if learns and not any(row.state == "complete" for row in rows):
        raise DataError(f"{where}: a corrector needs a trial that is complete, or give FitResult(None, ...)")
    with locate_errors(where, type(one.corrector)):
        if fault := fault_of_corrector(one.corrector):
            raise ShipidError(f"{where}: {fault}")
        chosen, past = one.corrector.hyperparameters, one.corrector.past
    check_mapping(f"{where}: hyperparameters of the corrector", chosen, "a name to a number", DataError)
    for key, value in {**chosen, "past": past, "seconds": one.seconds}.items():
        check_number(f"{where}: {key}", value, DataError)
    if not 0 <= past < np.inf:
        raise DataError(f"{where}: past of the corrector must be seconds, from 0 on, not {past!r}")


SPLITS = ("share", "runs")
CORRECTOR_CALLS = {
    "predict": ("physics", "instants", "paths"),
    "header": (),
    "arrays": (),
    "from_arrays": ("header", "arrays"),
}
"""Functions of a corrector, and what they are called with."""


def fault_of_method(kind: type[BaseModel]) -> str:
    """What a class of `Method` lacks, one sentence with its file; empty where it has all that it is asked for."""
    if not (isinstance(kind, type) and issubclass(kind, BaseModel)) or inspect.isabstract(kind):
        return "must be a class of Method with `fit`, such as shipid.hybrid.alone.Alone"
    corrector, validation = getattr(kind, "corrector", None), getattr(kind, "validation", None)
    if validation not in SPLITS:
        return f"`validation` of {name_of_class(kind)} must be a class variable, one of {SPLITS}, not {validation!r}"
    if unknown := [setting for setting in getattr(kind, "SEARCHED", ()) if setting not in kind.model_fields]:
        return f"`SEARCHED` of {name_of_class(kind)} must be a tuple of names of its settings, {unknown[0]!r} is none"
    if not isinstance(corrector, type):
        return f"{name_of_class(kind)} must have `corrector` as a class variable, the class of what `fit` gives"
    calls = [(kind, "fit", ("task",)), *((corrector, name, taken) for name, taken in CORRECTOR_CALLS.items())]
    return next(filter(None, (_fault_of_call(*call) for call in calls)), "")


def fault_of_corrector(corrector: object) -> str:
    """What an object that a method gives lacks to be a corrector, one sentence; empty where it lacks nothing."""
    for name in (*CORRECTOR_CALLS, "hyperparameters", "past"):
        if not hasattr(corrector, name):
            return f"{name_of_class(type(corrector))} lacks `{name}`"
    return ""


def _fault_of_call(kind: type, name: str, taken: tuple[str, ...]) -> str:
    """Why a function of a class cannot be called as shipid does, with what it takes; empty where it can."""
    function: Any = getattr(kind, name, None)
    if not inspect.isroutine(function):
        return f"{name_of_class(kind)} lacks the function `{name}`: a corrector of `StoredData` has all but `predict`"
    given = ("self", *taken) if inspect.isfunction(inspect.getattr_static(kind, name)) else taken
    try:
        inspect.signature(function).bind(*given)
    except TypeError as error:
        return f"`{name}` of {name_of_class(kind)} must take ({', '.join(given)}): {error}"
    return ""


def name_of_class(kind: type) -> str:
    """The name of a class, and its file where it has one."""
    return f"{kind.__name__} in {file}" if (file := definition_file(kind)) else kind.__name__


def widen_range(low: float, high: float) -> tuple[float, float]:
    """Least and greatest value that training has seen, apart by their rounding: what equals one of them is inside."""
    slack = 1e-9 * max(1.0, abs(low), abs(high))
    return low - slack, high + slack


def shared_tables(task: Task, inputs: Inputs) -> dict[str, dict[str, Array]]:
    """Inputs (S,) by name, for every foundation; what does not depend on the physics is one array for all."""
    common = inputs.common(task.windows.instants(known=task.known), task.windows.step)
    return {name: common | inputs.of_physics(case.physics, task.instants(name)) for name, case in task.cases.items()}


def input_table_key(table: Mapping[str, Array]) -> tuple[tuple[str, int], ...]:
    """A key that is equal for two tables of `shared_tables` that hold the same arrays."""
    return tuple((name, id(values)) for name, values in table.items())
