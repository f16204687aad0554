"""`shipid.predictor.fit`: a method fitted on windows is a predictor, by the folds that were asked for."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.data.windows import Instants, Windows, cut_windows
from shipid.errors import DataError, ShipidError
from shipid.hybrid.alone import Alone, UnchangedPath
from shipid.hybrid.features import Memory
from shipid.hybrid.forest import Forest
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.method import FitResult, Method, Task
from shipid.hybrid.methods import METHODS
from shipid.hybrid.one_step import OneStep
from shipid.hybrid.path_trained import PathTrained
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import trial_row
from shipid.metrics import position_error
from shipid.predictor import Predictor, _split_folds, fit
from shipid.vessel.load import Vessel, load_vessel
from tests.export.strange import drawn

HORIZON, SMALL = 5, Kernel(trials=2, steps=2, terms=2)
NONE = Physics(None, HORIZON, 1.0)


def turns(count: int = 6, rows: int = 30, first: int = 0) -> Windows:
    """Windows of steady turns on circles, each run with another speed, rate and order; `first` begins the table."""
    frames = []
    for number in range(count):
        t = np.arange(float(rows))
        u, r = 2.0 + 0.2 * number, 0.01 * (number - 2)
        psi = r * t
        north = u * t if r == 0 else u / r * np.sin(psi)
        east = 0 * t if r == 0 else u / r * (1 - np.cos(psi))
        columns = {"t": t, "north": north, "east": east, "psi": psi, "u": u, "v": 0.0, "r": r}
        columns |= {f"{side}.{name}": r if name == "alpha" else u / 2 for side in SIDES for name in ("n", "alpha")}
        frame = pd.DataFrame(columns).astype("float64").assign(flags=0)
        frame.insert(0, "run", pd.Series([f"M{number}"] * rows, dtype="str"))
        frames.append(frame)
    frame = pd.concat([*frames[first:], *frames[:first]], ignore_index=True)
    return cut_windows(Dataset(frame, {"clock": "run", "flags": []}), horizon=HORIZON)


SIDES = ("port", "starboard")
WINDOWS = turns()


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return fit(SMALL, NONE, WINDOWS)


def test_it_predicts_what_it_was_fitted_to(predictor: Predictor) -> None:
    error = position_error(predictor.predict(WINDOWS.instants()), WINDOWS.future)
    still = position_error(np.zeros_like(WINDOWS.future), WINDOWS.future)
    assert error.mean() < 0.1 * still.mean()


def test_it_says_what_it_was_fitted_with(predictor: Predictor) -> None:
    assert predictor.method == "kernel"
    assert predictor.limits["u"] == (2.0, 3.0)
    assert set(predictor.limits) == {"u", "v", "r", *WINDOWS.planned}
    assert not predictor.outside(WINDOWS.columns).any()
    assert predictor.provenance == {"runs": [f"M{number}" for number in range(6)], "seed": 0}


@pytest.mark.parametrize(
    "method", [Forest(trials=1, trees=5), PathTrained(trials=1, epochs=2, units=4, layers=1)], ids=["forest", "trained"]
)
def test_the_order_of_the_runs_in_the_table_changes_no_digit(method: Method) -> None:
    """A forest draws rows, and a network its batches: both had other errors, by up to 16 %."""
    if isinstance(method, Forest):
        pytest.importorskip("sklearn")
    one, other = (fit(method, NONE, turns(first=first)).predict(WINDOWS.instants()) for first in (0, 4))
    np.testing.assert_array_equal(one, other)


def test_known_commands_are_needed_to_predict() -> None:
    known = fit(SMALL, NONE, WINDOWS, commands="known")
    assert known.predict(WINDOWS.instants(known=True)).shape == WINDOWS.future.shape
    with pytest.raises(DataError, match="planned over the horizon"):
        known.predict(WINDOWS.instants())


def test_held_commands_are_never_those_of_the_plan() -> None:
    """A plan given to a predictor for held commands changes nothing; one for known commands follows it."""
    ship = Physics(load_vessel("gunnerus-28.9"), HORIZON, 1.0)
    now = WINDOWS.instants()
    planned = replace(now, planned={name: values + 0.5 for name, values in WINDOWS.planned.items()})
    held = Predictor(ship, "alone", UnchangedPath({}))
    known = replace(held, commands="known")
    np.testing.assert_array_equal(held.predict(planned), held.predict(now))
    np.testing.assert_array_equal(held.alone(planned), held.alone(now))
    assert np.abs(known.predict(planned) - held.predict(now)).max() > 0.01


class Shared(Method):
    """A method that holds out a fifth of the runs."""

    corrector: ClassVar[type[Any]] = UnchangedPath

    def fit(self, task: Task) -> dict[str, FitResult]:  # noqa: ARG002
        return {}


def test_a_method_without_a_name_is_refused_before_it_is_fitted() -> None:
    """A class that a user wrote, or one derived from a method of shipid: what it gave could not be saved."""

    class Mine(Kernel):
        def fit(self, task: Task) -> dict[str, FitResult]:
            raise AssertionError(task)

    for method, name in ((Shared(), "Shared"), (Mine(), "Mine")):
        with pytest.raises(DataError, match=rf"the method {name} has no name yet: write .*METHODS\['mine'\] = {name}$"):
            fit(method, NONE, WINDOWS)


def test_folds_are_by_run() -> None:
    """Every run in turn, a fifth of the runs, or those that are named; training and validation share no run."""

    def validated(method: Method, windows: Windows = WINDOWS, runs: list[str] | None = None) -> list[set[str]]:
        folds = _split_folds(method, windows, runs, seed=0)
        for training, validation in folds:
            assert not set(windows.run[training]) & set(windows.run[validation])
            assert len(training) + len(validation) == len(windows)
        return [set(windows.run[validation]) for _, validation in folds]

    assert validated(SMALL) == [{f"M{number}"} for number in range(6)]
    (fifth,) = validated(Shared())
    assert len(fifth) == 1
    assert validated(SMALL, runs=["M4", "M1"]) == [{"M1", "M4"}]


def test_one_run_is_split_in_time() -> None:
    one = WINDOWS.select(WINDOWS.run == "M3")
    for training, validation in _split_folds(SMALL, one, None, 0):
        begin, end = one.begin[validation].min(), one.end[validation].max()
        assert ((one.end[training] < begin) | (one.begin[training] > end)).all()


@pytest.mark.parametrize(
    ("method", "physics", "runs", "message"),
    [
        (SMALL, Physics(None, 4, 1.0), None, "the physics has 4 steps of 1 s, the windows have 5 steps of 1 s"),
        (Kernel(memory=Memory(history=(3.0,))), NONE, None, "needs a past of 3 s: cut windows with past = 3"),
        (Alone(), NONE, None, "'alone' needs a vessel"),
        (Alone(), Physics(load_vessel("mariner"), HORIZON, 1.0), None, "needs this command"),
        (SMALL, NONE, ["M1", "M9"], "validation_runs: no run with windows"),
        (SMALL, NONE, WINDOWS.spans, "no training window is left"),
    ],
)
def test_what_does_not_fit_is_one_sentence(method: Method, physics: Physics, runs: list[str], message: str) -> None:
    with pytest.raises(DataError, match=message):
        fit(method, physics, WINDOWS, validation_runs=runs)


def test_diverging_physics_is_refused() -> None:
    wild = load_vessel("gunnerus-28.9").with_values({"hull.derivatives.X_u|u|": 1e23})
    with pytest.raises(DataError, match=r"diverges on .*% of the windows"):
        fit(SMALL, Physics(wild, HORIZON, 1.0), WINDOWS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"psi": np.zeros(1)}, "psi: columns must be .150., not .1,."),
        ({"u": np.array(2.0)}, r"u: must be \(S,\), a value for each instant, not \(\)"),
        ({"port.n": np.array(["2"] * len(WINDOWS))}, r"columns 'port\.n' must be an array of numbers"),
    ],
)
def test_a_column_of_another_shape_is_named(predictor: Predictor, change: dict[str, Any], message: str) -> None:
    """Before, one value was taken for all instants."""
    with pytest.raises(DataError, match=message):
        predictor.predict(Instants({**WINDOWS.columns, **change}))


@pytest.mark.parametrize("vessel", [None, load_vessel("gunnerus-28.9")])
@pytest.mark.parametrize("method", [Forest(trials=1), OneStep(trials=1, units=8)])
def test_an_input_that_is_no_number_gives_no_path(method: Method, vessel: Vessel | None) -> None:
    """Trees send it to one side, and of two shafts that turn alike one is an input: the path would look sound."""
    pytest.importorskip("sklearn", reason="comes with the extra `forest`")
    made = fit(method, Physics(vessel, HORIZON, 1.0), WINDOWS)
    instants = WINDOWS.instants()
    for name in ("u", "starboard.n"):
        columns = {key: np.array(values) for key, values in instants.columns.items()}
        columns[name][3] = np.nan
        paths, rest = made.predict(replace(instants, columns=columns)), np.arange(len(WINDOWS)) != 3
        assert np.isnan(paths[:, 3]).all(), name
        np.testing.assert_allclose(paths[:, rest], made.predict(instants)[:, rest], rtol=1e-12)


@pytest.mark.parametrize(("kind", "seed"), [("forest", 203), ("kernel", 204)])
def test_a_past_that_is_no_number_gives_no_path(kind: str, seed: int) -> None:
    """Before, the error of the physics over the last seconds was 0 then, as if it had predicted them exactly."""
    strange = drawn(kind, seed, count=5)
    instants, known = strange.instants, strange.predictor
    usual = known.predict(instants)
    for name in ("u", "r", "psi", "x", "y", "port.n"):
        past = {key: np.array(values) for key, values in instants.past.items()}
        past[name][-1, 3] = np.nan
        paths = known.predict(replace(instants, past=past))
        assert np.isnan(paths[:, 3]).all(), name
        np.testing.assert_array_equal(np.delete(paths, 3, axis=1), np.delete(usual, 3, axis=1))
        past[name][-1, 3], past[name][: -known.past, 3] = instants.past[name][-1, 3], np.nan
        np.testing.assert_array_equal(known.predict(replace(instants, past=past)), usual)  # it looks not so far


@pytest.mark.parametrize("part", ["past", "hidden", "estimates"])
def test_a_part_of_another_shape_is_named(part: str) -> None:
    """Before, one value was taken for all instants, and others ended in a ValueError."""
    strange = drawn("kernel", 203, count=5, vessel="mariner")
    given = getattr(strange.instants, part) or {"rudder.delta": np.zeros(5)}
    for name, values in given.items():
        for wrong in (values[..., :2], values[..., 0], values[None]):
            changed = replace(strange.instants, **{part: {**given, name: wrong}})
            with pytest.raises(DataError, match=rf"{re.escape(name)}: {part} must be \((P, )?5\), not \("):
                strange.predictor.predict(changed)


def test_an_estimate_that_is_missing_is_named() -> None:
    """Before, it ended in a KeyError."""
    strange = next(one for one in (drawn("alone", seed, 5, "mariner") for seed in range(99)) if one.instants.estimates)
    for name in strange.instants.estimates:
        estimates = {key: values for key, values in strange.instants.estimates.items() if key != name}
        with pytest.raises(DataError, match=rf"{re.escape(name)}: the physics has an observer: instants must hold"):
            strange.predictor.predict(replace(strange.instants, estimates=estimates))


def test_paths_of_another_shape_are_refused(predictor: Predictor) -> None:
    """Before, the path of one instant was taken for all, and without a method whatever was given came back."""
    instants = WINDOWS.instants()
    alone = fit(Alone(), Physics(load_vessel("gunnerus-28.9"), HORIZON, 1.0), WINDOWS)
    for known in (predictor, alone):
        paths = known.alone(instants)
        np.testing.assert_array_equal(known.predict(instants, paths.tolist()), known.predict(instants))
        for wrong in (paths[:, :1], paths[:2], paths[..., 0], paths.transpose(1, 0, 2)):
            with pytest.raises(DataError, match="paths must be"):
                known.predict(instants, wrong)


def test_a_prediction_is_no_view_of_what_was_passed_in() -> None:
    instants = WINDOWS.instants()
    known = fit(Alone(), Physics(load_vessel("gunnerus-28.9"), HORIZON, 1.0), WINDOWS)
    paths = known.alone(instants)
    predicted = known.predict(instants, paths)
    predicted[:] = 0.0
    np.testing.assert_array_equal(paths, known.alone(instants))


@dataclass(frozen=True)
class Mistaken:
    """A corrector that a user wrote; `predict` is the mistake."""

    predict: Callable[[Physics, Instants, Any], Any]
    past: float = 0.0
    hyperparameters: Any = field(default_factory=dict)


def added(physics: Physics, instants: Instants, paths: Any) -> Any:  # noqa: ARG001
    """A path that is moved where it lies."""
    paths += 1.0
    return paths


def centred(physics: Physics, instants: Instants, paths: Any) -> Any:  # noqa: ARG001
    """Inputs that are normalised where they lie."""
    columns: Any = instants.columns
    columns["u"] -= columns["u"].mean()
    return paths


@pytest.mark.parametrize("predict", [added, centred])
def test_a_method_changes_no_array_that_others_have(predict: Any) -> None:
    """A corrector that added to the paths of the physics changed A, and H of the methods after it, without a word."""
    instants, paths = WINDOWS.instants(), np.zeros((HORIZON, len(WINDOWS), 2))
    with pytest.raises(
        ShipidError, match=r"^Mistaken\.predict: ValueError: .*read-only in .*, line \d+: .*`paths \+ shift`"
    ):
        Predictor(NONE, "mine", Mistaken(predict)).predict(instants, paths)
    assert not paths.any()
    paths += 1.0
    instants.columns["u"] += 0.0  # those who passed them in may change them, as before


def test_a_method_changes_no_window_that_others_are_fitted_to(monkeypatch: pytest.MonkeyPatch) -> None:
    class Greedy(Shared):
        def fit(self, task: Task) -> dict[str, FitResult]:
            for array in (task.windows.future, task.windows.columns["u"], task.cases["none"].paths):
                with pytest.raises(ValueError, match="read-only"):
                    array += 1.0
            return {"none": FitResult(UnchangedPath({}), [trial_row(0, {}, 1.0, 0.0)], 0.0)}

    monkeypatch.setitem(METHODS, "greedy", Greedy)
    fit(Greedy(), NONE, WINDOWS)
    assert WINDOWS.future.flags.writeable


def _two_lines(_: Any) -> Any:
    raise ValueError("first\n  second")


def _parts_that_do_not_fit(paths: Any) -> Any:
    return paths + np.zeros(3)[: len(paths)]


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (_parts_that_do_not_fit, r"Mistaken\.predict: ValueError: operands .*"),
        (lambda paths: {}["slope"] + paths, r"Mistaken\.predict: KeyError: 'slope'"),
        (lambda paths: {}["u"] + paths, r"Mistaken\.predict: KeyError: 'u'"),  # the instants have it
        (lambda paths: {}["gone"] + paths, "gone: the method was trained with this input, and the instants lack it"),
        (lambda _: sys.exit(2), r"Mistaken\.predict calls sys\.exit"),
        (lambda paths: paths + 1 / len(paths[:0]), r"Mistaken\.predict: ZeroDivisionError: .*"),
        (lambda paths: paths.mean_of_all(), r"Mistaken\.predict: AttributeError: .*"),
        (_two_lines, r"Mistaken\.predict: ValueError: first second"),
    ],
)
def test_a_mistake_in_a_method_of_a_user_has_its_place(made: Callable[[Any], Any], message: str) -> None:
    """One sentence without file and line: the mistake might be anywhere. The last line of the user's file is named."""
    seen = {"u": (0.0, 9.0), "gone": (0.0, 1.0)}
    known = Predictor(NONE, "mine", Mistaken(lambda _, __, paths: made(paths)), seen)
    with pytest.raises(ShipidError, match=f"^{message} in {re.escape(__file__)}, line ") as caught:
        known.predict(WINDOWS.instants())
    lines = Path(__file__).read_text().splitlines()
    line = lines[int(re.search(r"line (\d+)", str(caught.value))[1]) - 1]  # type: ignore[index]
    assert any(part in line for part in ("np.zeros(3)", "{}[", "sys.exit", "1 / len", "mean_of_all", "first"))


@dataclass(frozen=True)
class Stored:
    """A corrector that a user wrote: a shift, which it keeps or loses."""

    shift: float
    kept: bool = True
    past: float = 0.0
    hyperparameters: Any = field(default_factory=dict)

    def predict(self, physics: Physics, instants: Instants, paths: Any) -> Any:  # noqa: ARG002
        return paths + self.shift

    def header(self) -> dict[str, Any]:
        return {"shift": self.shift} if self.kept else {}

    def arrays(self) -> dict[str, Any]:
        return {}

    @classmethod
    def from_arrays(cls, header: Any, arrays: Any) -> Stored:
        assert arrays == {}
        return cls(4.0 / header.get("shift", 2.0))


def test_a_method_that_loses_what_it_learned_is_seen_before_its_results(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its errors were those of the fit, and the predictor of the same cell was 3 m beside them, without a word."""
    instants, paths = WINDOWS.instants(), np.zeros((HORIZON, len(WINDOWS), 2))
    Predictor(NONE, "mine", Stored(2.0)).check_restored(instants, paths, Stored)
    with pytest.raises(
        ShipidError, match=r"the method 'mine', saved and read back, predicts places 4\.2 m away: `header`"
    ):
        Predictor(NONE, "mine", Stored(5.0, kept=False)).check_restored(instants, paths, Stored)
    with pytest.raises(ShipidError, match=r"^Stored\.from_arrays: ZeroDivisionError: .*, line "):
        Predictor(NONE, "mine", Stored(0.0)).check_restored(instants, paths, Stored)
    monkeypatch.setattr(Stored, "from_arrays", classmethod(lambda *_: None))
    with pytest.raises(
        ShipidError, match=r"^`from_arrays` of Stored in .* must return a corrector: NoneType lacks `pred"
    ):
        Predictor(NONE, "mine", Stored(2.0)).check_restored(instants, paths, Stored)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda paths: paths[..., 0], rf"must be \({HORIZON}, 150, 2\), not \({HORIZON}, 150\)"),
        (lambda paths: paths.transpose(1, 0, 2), rf"must be \({HORIZON}, 150, 2\), not \(150, {HORIZON}, 2\)"),
        (lambda paths: paths[1:], r"must be \(5, 150, 2\), not \(4, 150, 2\)"),
        (lambda paths: paths + 0j, r"must be an array of numbers, not ndarray \(complex128\)"),
        (lambda paths: None, r"must be \(5, 150, 2\), not \(\)"),  # noqa: ARG005
    ],
)
def test_paths_of_a_method_that_are_none_are_named(made: Callable[[Any], Any], message: str) -> None:
    """They came back as they were, or ended a study with a sentence that named no method."""
    assert len(WINDOWS) == 150
    known = Predictor(NONE, "mine", Mistaken(lambda _, __, paths: made(paths)))
    with pytest.raises(DataError, match=f"^paths of the method 'mine' {message}"):
        known.predict(WINDOWS.instants())
    as_list = Predictor(NONE, "mine", Mistaken(lambda _, __, paths: (paths + 2.0).tolist()))
    np.testing.assert_array_equal(as_list.predict(WINDOWS.instants()), np.full((HORIZON, 150, 2), 2.0))


@pytest.mark.parametrize(
    ("header", "arrays", "message"),
    [
        ({}, {"points": np.array([1.0, np.nan])}, "arrays of the method 'mine': 'points' holds NaN"),
        ({}, {"points": np.array([{}, 1], dtype=object)}, "arrays of the method 'mine': 'points' holds object"),
        ({}, {"std": np.zeros(2)}, "arrays of the method 'mine': 'std' must be above 0"),
        ({}, {"header": np.zeros(2)}, "arrays of the method 'mine': 'header' is a name that is taken: use another"),
        ({}, {"bands.x": np.zeros(2)}, "arrays of the method 'mine': 'bands.x' is a name that is taken"),
        ({}, {"ragged": [[1.0], [1.0, 2.0]]}, "arrays of the method 'mine' must .*inhomogeneous"),
        ({}, None, "the arrays of the method 'mine' must be a table of arrays"),
        ([1], {}, "the header of the method 'mine' must be a table of texts, numbers and lists of them"),
        ({"a": {1, 2}}, {}, "the header of the method 'mine' must be a table .* not JSON serializable"),
    ],
)
def test_what_could_not_be_read_back_is_not_saved(header: Any, arrays: Any, message: str, tmp_path: Path) -> None:
    """A study ended well, and its predictors were said to be damaged; a set came back as a text."""
    corrector = Mistaken(centred)
    object.__setattr__(corrector, "header", lambda: header)
    object.__setattr__(corrector, "arrays", lambda: arrays)
    with pytest.raises(DataError, match=message):
        Predictor(NONE, "mine", corrector).save(tmp_path / "mine.npz")  # type: ignore[arg-type]
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("level", ["0.9", np.array([0.5]), np.nan])
def test_what_is_no_level_is_refused(predictor: Predictor, level: Any) -> None:
    with pytest.raises(DataError, match="is no level of a band"):
        predictor.predict(WINDOWS.instants(), level=level)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"commands": "Known"}, r"commands 'Known' is not known: did you mean 'known'\?"),
        ({"seed": "0"}, "seed must be a whole number, 0 or more, not '0'"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"seed": np.random.default_rng(0)}, "seed must be a whole number"),
        ({"refits": 1.5}, "refits must be a whole number"),
        ({"method": Kernel}, r"method must be a Method, such as Kernel\(\), not <class"),
        ({"method": "kernel"}, "method must be a Method, such as Kernel\\(\\), not 'kernel'"),
        ({"physics": load_vessel("gunnerus-28.9")}, "physics must be a Physics, such as Physics.*, not Vessel"),
        ({"windows": WINDOWS.instants()}, "windows must be a Windows, as of `cut_windows`, not Instants"),
        ({"validation_runs": [1]}, "validation_runs: no run with windows"),
    ],
)
def test_a_wrong_argument_is_one_line(wrong: dict[str, Any], message: str) -> None:
    """Before, commands that were neither held nor known were one in the fit and the other in the prediction."""
    with pytest.raises(DataError, match=message):
        fit(**{"method": SMALL, "physics": NONE, "windows": WINDOWS, **wrong})


def test_planned_commands_are_all_there_and_of_the_horizon() -> None:
    """Before, an order that was not planned was held without a word, and so was one of a single step."""
    physics = Physics(load_vessel("gunnerus-28.9"), HORIZON, 1.0)
    for known in (fit(Alone(), physics, WINDOWS, commands="known"), fit(SMALL, NONE, WINDOWS, commands="known")):
        planned = WINDOWS.planned
        plain = {name: values.tolist() for name, values in planned.items()}
        given: Any = Instants(WINDOWS.columns, planned=plain)
        np.testing.assert_array_equal(known.predict(given), known.predict(WINDOWS.instants(known=True)))
        for wrong, message in (
            ({}, "port.n: "),
            ({name: values for name, values in planned.items() if name != "port.n"}, "port.n: "),
            (planned | {"port.n": planned["port.n"][0]}, "port.n: planned must be"),
            (planned | {"port.n": planned["port.n"][:2]}, "port.n: planned must be"),
        ):
            with pytest.raises(DataError, match=message):
                known.predict(Instants(WINDOWS.columns, planned=wrong))


def test_one_fold_calibrates_no_band() -> None:
    """The runs that validate chose the trials and the ridge, and no other fold can choose them without these."""
    method = Kernel(trials=2, steps=2, terms=2)
    one = fit(method, NONE, turns(12), validation_runs=["M1", "M2", "M3", "M4"])
    assert one.bands is None
    assert "refits" in one.provenance["no_band"]
    assert fit(method, NONE, turns(12)).bands is not None
    assert fit(method, NONE, turns(12), validation_runs=["M1", "M2"], refits=4).bands is not None
