"""The skeleton of a method: what a task holds, and inputs that foundations share."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import numpy as np
import pytest

from shipid.data.windows import cut_windows
from shipid.errors import DataError, ShipidError
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.features import Inputs, Memory
from shipid.hybrid.method import (
    Case,
    FitResult,
    Method,
    Task,
    Traits,
    fault_of_corrector,
    fit_all,
    input_table_key,
    shared_tables,
)
from shipid.hybrid.methods import METHODS
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import SearchMethod, trial_row
from shipid.vessel.load import load_vessel
from tests.study.test_whole import windy

SHIP = load_vessel("gunnerus-28.9")


def task(**options: object) -> Task:
    """Two ships and no physics on a few windows."""
    windows = cut_windows(windy("ab"), horizon=3, interval=5.0, past=4)
    wrong = SHIP.with_values({"hull.derivatives.N_ur": -3e5})
    every = {"right": Physics(SHIP, 3, 1.0), "wrong": Physics(wrong, 3, 1.0), "none": Physics(None, 3, 1.0)}
    cases = {name: Case(physics, physics.paths(windows.instants())) for name, physics in every.items()}
    folds = [(np.flatnonzero(windows.run == "a"), np.flatnonzero(windows.run == "b"))]
    commands = ("port.n", "port.alpha", "starboard.n", "starboard.alpha")
    return Task(cases, windows, options.pop("folds", folds), commands, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("empty", [0, 1])
def test_a_fold_without_windows_is_refused(empty: int) -> None:
    fold = [np.arange(4), np.arange(4, 8)]
    fold[empty] = np.arange(0)
    with pytest.raises(DataError, match="use more manoeuvres"):
        task(folds=[tuple(fold)])


def test_inputs_without_physics_are_one_array_for_all() -> None:
    given = task()
    inputs = Inputs(given.commands, Memory(history=(2.0,), error=(4.0,)))
    tables = shared_tables(given, inputs)
    assert tables["right"]["past-2.u"] is tables["none"]["past-2.u"]
    assert "error-4.x" not in tables["none"]
    assert np.abs(tables["right"]["error-4.x"] - tables["wrong"]["error-4.x"]).max() > 0
    assert len({input_table_key(table) for table in tables.values()}) == 3
    plain = shared_tables(given, Inputs(given.commands))
    assert len({input_table_key(table) for table in plain.values()}) == 1
    for name, table in tables.items():
        alone = inputs.table(given.cases[name].physics, given.instants(name))
        assert table.keys() == alone.keys()
        for key, values in alone.items():
            np.testing.assert_array_equal(table[key], values)


ROW = trial_row(0, {}, 1.0, 0.0)


@pytest.mark.parametrize(
    ("gives", "message"),
    [
        (None, "must give a FitResult for 'right', not NoneType"),
        ({}, "must give a FitResult for 'right', not NoneType"),
        (dict.fromkeys(("right", "wrong", "none"), (None, [ROW], 0.0)), "must give a FitResult for 'right', not tuple"),
        ({"right": FitResult(None, [{"number": 0}], 0.0)}, "trial 0.params: missing: make trials by .*trial_row"),
        ({"right": FitResult(None, None, 0.0)}, "'NoneType' object is not iterable: make trials by"),  # type: ignore[arg-type]
        ({"right": FitResult(None, [{**ROW, "params": None}], 0.0)}, "trial 0.params: None: must be a table"),
        ({"right": FitResult(None, [{**ROW, "value": "low"}], 0.0)}, "trial 0.value: 'low': must be a number"),
        ({"right": FitResult(None, [{**ROW, "value": np.nan}], 0.0)}, "trial 0: value must be finite, not nan, unless"),
        ({"right": FitResult(None, [{**ROW, "value": np.inf}], 0.0)}, "trial 0: value must be finite, not inf, unless"),
        (
            {"right": FitResult(None, [{**ROW, "value": np.nan, "state": "stopped"}], 0.0)},
            "trial 0: value must be finite, not nan, unless",
        ),
        ({"right": FitResult(UnchangedPath({}, "1 s"), [ROW], 0.0)}, "past must be a number, not '1 s'"),  # type: ignore[arg-type]
        ({"right": FitResult(UnchangedPath({}, -1.0), [ROW], 0.0)}, "past of the corrector must be seconds, from 0 on"),
        ({"right": FitResult(UnchangedPath({}), [ROW], "1 s")}, "seconds must be a number, not '1 s'"),  # type: ignore[arg-type]
        ({"right": FitResult(UnchangedPath({"k": "3"}), [ROW], 0.0)}, "k must be a number"),  # type: ignore[dict-item]
        ({"right": FitResult(UnchangedPath({}), [], 0.0)}, "a corrector needs a trial that is complete, or give"),
        (
            {"right": FitResult(UnchangedPath({}), [trial_row(0, {}, np.nan, 0.0)], 0.0)},
            "a corrector needs a trial that is comp",
        ),
        ({"right": FitResult(None, [{**ROW, "number": "1"}], 0.0)}, "trial 0.number: '1': must be a number"),
        (
            {"right": FitResult(None, [{**ROW, "state": "done"}], 0.0)},
            "trial 0.state: 'done': must be 'complete', 'stopped' or",
        ),
        ({"right": FitResult(None, [{**ROW, "params": {"seed": 1.0}}], 0.0)}, "trial 0: params: 'seed' is a name that"),
        ({"right": FitResult(None, [{**ROW, "seen": {1}}], 0.0)}, "trial 0.seen: unknown key: valid: epochs"),
        (
            {"right": FitResult(None, [{**ROW, "params": {"k": {1}}}], 0.0)},
            "trial 0.params.k: .*: must be a number",
        ),
        ({"right": FitResult(None, [ROW], 0.0, np.zeros((2, 4)))}, r"left_out must be \(3, \d+, 2\), not \(2, 4\)"),
    ],
)
def test_what_a_method_gives_is_checked(gives: Any, message: str) -> None:
    """A mistake in a method that somebody wrote was a traceback, or errors by runs of other windows."""

    class Mine(Method):
        def fit(self, given: Task) -> dict[str, FitResult]:  # noqa: ARG002
            return gives  # type: ignore[no-any-return]

    with pytest.raises(DataError, match=rf"^Mine\.fit:? {message}"):
        fit_all(Mine(), task())


@pytest.mark.parametrize("of", ["fit", "hyperparameters", "past"])
@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ValueError("first\nsecond"), "ValueError: first second"),
        (KeyError("left"), "KeyError: 'left'"),
        (AssertionError(), "AssertionError"),
        (StopIteration(), "StopIteration"),
        (ValueError("output array is read-only"), "ValueError: output array is read-only"),
    ],
)
def test_every_error_of_a_users_code_is_one_line(of: str, error: Exception, said: str) -> None:
    def raised(*_: object) -> Any:
        raise error

    class Mine(Method):
        def fit(self, given: Task) -> dict[str, FitResult]:
            if of == "fit":
                raised()
            parts = {"hyperparameters": {}, "past": 0.0, of: property(raised)}
            kind = type("Held", (UnchangedPath,), {**parts, "__init__": lambda _: None, "__module__": __name__})
            return dict.fromkeys(given.cases, FitResult(kind(), [ROW], 0.0))  # type: ignore[arg-type]

    with pytest.raises(ShipidError) as caught:
        fit_all(Mine(), task())
    remedy = r": what a method is given cannot be .*: `paths \+ shift`, .*" if "read-only" in said else ""
    where = re.escape(__file__)
    assert re.fullmatch(rf"Mine\.fit: {re.escape(said)} in {where}, line \d+{remedy}", str(caught.value))


@pytest.mark.parametrize("kind", METHODS)
def test_every_listed_method_tells_of_its_mirror_memory_and_terms(kind: str) -> None:
    fields, memory = METHODS["kernel" if kind == "stack" else kind].model_fields, Memory(history=(2.0,))
    without = 0.0 if "mirror" in fields and fields["mirror"].annotation is float else False  # a share of the trials
    given: dict[str, Any] = {"mirror": without, "memory": memory, "terms": 5}
    told = {name: value for name, value in given.items() if name in fields}
    method = METHODS[kind](**({"kernel": told} if kind == "stack" else told))
    assert method.traits == Traits(**told)
    assert method.traits.mirror in (False, None)
    assert method.past >= method.traits.memory.past


class Bare(Method):
    """A method without a corrector."""

    def fit(self, task: Task) -> dict[str, FitResult]:  # noqa: ARG002
        return {}


class Mine(SearchMethod):
    """A method with all that is asked."""

    corrector: ClassVar[type[Any]] = UnchangedPath

    def fit(self, task: Task) -> dict[str, FitResult]:  # noqa: ARG002
        return {}


def of(**parts: Any) -> type[Method]:
    """The method with other parts of its class."""
    return type("Mine", (Mine,), {"__module__": __name__, **parts})


def on(**parts: Any) -> type[Method]:
    """The method with other parts of the class of its corrector."""
    return of(corrector=type("Shift", (UnchangedPath,), {"__module__": __name__, **parts}))


def shift(self: Any, instants: Any, paths: Any) -> Any:  # noqa: ARG001
    """Predict without being given the physics."""
    return paths


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Bare, "Bare in FILE must have `corrector` as a class variable, the class of what `fit` gives"),
        (of(corrector=UnchangedPath({})), "Mine in FILE must have `corrector` as a class variable, .*"),
        (of(validation="run"), r"`validation` of Mine in FILE must be .* one of \('share', 'runs'\), not 'run'"),
        (of(SEARCHED=("widht",)), "`SEARCHED` of Mine in FILE must be a tuple of names .*, 'widht' is none"),
        (of(fit=lambda _: {}), r"`fit` of Mine in FILE must take \(self, task\): .*"),
        *((on(**{name: None}), f"Shift in FILE lacks .*`{name}`.*") for name in ("predict", "arrays", "from_arrays")),
        (on(predict=shift), r"`predict` of Shift in FILE must take \(self, physics, instants, paths\): .*"),
    ],
)
def test_what_a_class_lacks_is_said_as_it_is_named(kind: type[Method], message: str) -> None:
    """It ended in a traceback, in the middle of a study."""
    said = message.replace("FILE", re.escape(__file__))
    with pytest.raises(ShipidError, match=rf"^'mine' in shipid\.methods: {said}$"):
        METHODS["mine"] = kind


def test_what_a_corrector_lacks_is_said() -> None:
    assert fault_of_corrector(UnchangedPath({})) == ""
    assert re.fullmatch("Mine in .* lacks `predict`", fault_of_corrector(Mine()))
