"""Arguments of any type that means the same are taken, and all others are refused in one line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

import shipid
from shipid.arguments import as_float_array, as_names, check_number, check_positive, check_whole_number, whole_steps
from shipid.errors import DataError, ShipidError
from shipid.export.write import export_predictor, export_vessel
from shipid.hybrid.alone import UnchangedPath
from shipid.observer import filter_bank, run_observer
from shipid.vessel.dynamics import vessel_dynamics


@pytest.mark.parametrize("value", [3, 3.0, np.int32(3), np.uint8(3), np.float32(3), np.array(3)])
def test_a_whole_number_of_any_type_is_an_int(value: Any) -> None:
    assert type(check_whole_number("horizon", value, 1)) is int
    assert check_whole_number("horizon", value, 1) == 3


@pytest.mark.parametrize("value", [0, -3, 2.5, "3", None, True, np.bool_(True), np.nan, np.inf, [3], 3 + 0j])
def test_anything_else_is_no_whole_number(value: Any) -> None:
    with pytest.raises(DataError, match="horizon must be a whole number, 1 or more, not"):
        check_whole_number("horizon", value, 1, DataError)


@pytest.mark.parametrize("value", [0.5, np.float64(0.5), np.float32(0.5), np.float16(0.5)])
def test_a_number_of_any_type_is_a_float(value: Any) -> None:
    assert type(check_positive("step", value)) is float
    assert check_positive("step", value) == 0.5


@pytest.mark.parametrize("value", [0, -0.5, "0.5", None, True, np.nan, np.inf, [0.5], 0.5 + 0j, np.complex128(0.5)])
def test_anything_else_is_no_positive_number(value: Any) -> None:
    with pytest.raises(ShipidError, match=r"step must be a number.*, not"):
        check_positive("step", value)


@pytest.mark.parametrize(
    ("time", "step", "steps"),
    [
        (30.0, 1.0, 30),
        (0.3, 0.1, 3),
        (1.0, 0.3333333, 3),
        (1.0, 0.3333, 0),
        (0.4, 1.0, 0),
        (1.0, 0.3, 0),
        (9.0, 1e-320, 0),
    ],
)
def test_a_time_consists_of_whole_steps_up_to_the_digits_that_one_writes(time: float, step: float, steps: int) -> None:
    assert whole_steps(time, step) == steps


@pytest.mark.parametrize(
    "values",
    [
        [1, 2],
        (1.0, 2.0),
        pd.Series([1, 2], index=[7, 3]),
        torch.tensor([1, 2]),
        np.array([1, 2], dtype=np.uint8),
        np.array([1, 2], dtype=object),
        np.array([1, 9, 2], dtype=np.float32)[::2],
    ],
)
def test_numbers_of_any_type_are_floats(values: Any) -> None:
    assert as_float_array("u", values).dtype == np.float64
    np.testing.assert_array_equal(as_float_array("u", values), [1.0, 2.0])


@pytest.mark.parametrize("values", [["1"], [1j], [[1], [1, 2]], [pd.NA], {"u": 1}, torch.ones(1).requires_grad_()])
def test_what_holds_no_numbers_is_refused(values: Any) -> None:
    with pytest.raises(ShipidError, match="u must be an array of numbers, not"):
        as_float_array("u", values)


@pytest.mark.parametrize("value", ["a", ["a"], ("a",), np.array(["a"]), pd.Series(["a"], index=[3]), iter(["a"])])
def test_one_name_or_several_are_names(value: Any) -> None:
    assert as_names("runs", value) == ("a",)


@pytest.mark.parametrize("value", [None, 3, np.nan, b"a"])
def test_anything_else_is_no_name(value: Any) -> None:
    with pytest.raises(DataError, match="runs must be a name, or several names, not"):
        as_names("runs", value, DataError)


@pytest.mark.parametrize("value", [None, "1", [1.0], True, 1j, pd.NA])
def test_what_is_no_number_is_refused(value: Any) -> None:
    assert check_number("speed", np.float32(0.5)) == 0.5
    with pytest.raises(ShipidError, match="speed must be a number, not"):
        check_number("speed", value)


ANY: Any = object()
SHIP = shipid.load_vessel("mariner")
NAMES = ("north", "east", "psi", "u", "v", "r")
START = {name: np.array([7.0 if name == "u" else 0.0]) for name in NAMES}
ORDERS = {name: np.zeros(1) for name in vessel_dynamics(SHIP).commands}
STRAIGHT = shipid.define_standard(SHIP, "zigzag").manoeuvre
LOG = shipid.perform_manoeuvres(SHIP, STRAIGHT, step=1.0, duration=60.0)
DATA = shipid.Dataset(LOG[[name for name in LOG if not str(name).startswith("actual.")]], {})
WINDOWS = shipid.cut_windows(DATA, horizon=3, step=1.0)
PHYSICS = shipid.Physics(SHIP, 3, 1.0)
PREDICTOR = shipid.Predictor(PHYSICS, "alone", UnchangedPath({}))
IDENTIFY = shipid.Identify(parameters=["hull.abkowitz.X_vv"])


def roll(start: Any = START, **given: Any) -> Any:
    return shipid.rollout(SHIP, start, ORDERS, **{"step": 1.0, "num_steps": 1, "engine": "casadi", **given})


def identify(**given: Any) -> Any:
    return shipid.run_identification(SHIP, **{"dataset": DATA, "settings": IDENTIFY, **given})


def standard(**given: Any) -> Any:
    return shipid.define_standard(SHIP, **{"name": "zigzag", **given})


def performed(**given: Any) -> Any:
    return shipid.perform_manoeuvres(SHIP, **{"manoeuvres": STRAIGHT, "step": 1.0, "duration": 2.0, **given})


def exported(**given: Any) -> Any:
    return export_vessel(SHIP, "casadi", "nowhere/v.casadi", **given)


CALLS: dict[str, tuple[Callable[[], Any], str]] = {
    "rollout": (lambda: shipid.rollout(ANY, {}, {}, step=1.0, num_steps=1), "vessel must be a Vessel, as of"),
    "members": (
        lambda: shipid.draw_members(shipid.Family(name="f"), ANY),
        "base must be a PerturbedBase, such as a Vessel",
    ),
    "simulate": (lambda: shipid.simulate_truth(ANY, ANY), "truth must be a Truth, such as"),
    "cut_windows": (lambda: shipid.cut_windows(ANY, horizon=1), "dataset must be a Dataset, as of"),
    "write_dataset": (lambda: shipid.write_dataset(ANY, "x.parquet"), "dataset must be a Dataset, such as"),
    "check_dataset": (lambda: shipid.check_dataset(ANY), "dataset must be a Dataset, as of"),
    "import_log": (lambda: shipid.import_log(ANY, "log.csv"), "mapping must be a Mapping, as of"),
    "identify": (lambda: shipid.identify(ANY, ANY, [], ANY), "dataset must be a Dataset, as of"),
    "rollout commands": (
        lambda: shipid.rollout(shipid.load_vessel("mariner"), {}, ANY, step=1.0, num_steps=1),
        "commands must be a dict, of a name to an array, not object",
    ),
    "Vessel": (lambda: shipid.Vessel({}, "x"), "no document of a vessel: read one with `load_vessel`"),
    "standard": (lambda: shipid.define_standard(ANY, "zigzag"), "vessel must be a Vessel, as of"),
    "Physics": (lambda: shipid.Physics(None, 2, 1.0, observer=ANY), "observer must be an Observer, such as"),
    "draw": (lambda: shipid.draw_variant(ANY, 0, ANY), "family must be a Family, such as"),
    "numbers": (
        lambda: shipid.draw_members(shipid.Family(name="f"), ANY, numbers=ANY),
        "base must be a PerturbedBase, such as a Vessel",
    ),
    "run_identification": (lambda: shipid.run_identification(ANY, ANY, ANY), "settings must be an Identify, such as"),
    "screen": (lambda: next(shipid.screen(ANY, ANY, [], 1)), "plan must be a Plan, as of"),
    "compare": (lambda: shipid.compare(ANY), "folders: name two folders or more"),
    "compare_methods": (lambda: shipid.compare_methods(ANY), "results must be a Results, as of"),
    "read_dataset": (lambda: shipid.read_dataset(ANY), "file must be a path, a text or a Path, not <object"),
    "read_results": (lambda: shipid.read_results(ANY), "folder must be a path"),
    "read_cells": (lambda: shipid.read_cells(ANY), "folder must be a path"),
    "write_pages": (lambda: shipid.write_pages(ANY), "folder must be a path"),
    "guess": (lambda: shipid.guess(ANY), "path must be a path"),
    "guess.names": (lambda: shipid.guess("log.csv", SHIP), "names must be a name, or several names"),  # type: ignore[arg-type]
    "guess.vessel": (lambda: shipid.guess("log.csv", vessel="mariner"), "vessel must be a Vessel, as of `load_vessel`"),  # type: ignore[arg-type]
    "guess.frame": (lambda: shipid.guess("log.csv", frame="nwu"), "frame 'nwu' is not known"),  # type: ignore[arg-type]
    "export_predictor": (lambda: export_predictor(ANY, "c", "x"), "give a Predictor, as of `fit` or `Predictor.load`"),
    "export_vessel": (lambda: export_vessel(ANY, "c", ANY), "out must be a path"),
    "run_study": (lambda: next(shipid.run_study(ANY, "run")), "plan must be a Plan, as of"),
    "relative_to": (lambda: shipid.load_vessel("mariner", 3), "relative_to must be a path"),  # type: ignore[arg-type]
    "changes": (lambda: shipid.read_plan("quick", ANY), "changes must be a dict, of a dotted path to a value, not"),
    "changes of no path": (lambda: shipid.read_plan("quick", {3: 4}), "no such block"),  # type: ignore[dict-item]
    "paths": (lambda: PHYSICS.paths(ANY), "instants must be an Instants, such as"),
    "no columns": (lambda: PHYSICS.paths(shipid.Instants({})), "u: the instants lack this column"),
    "reached": (lambda: PHYSICS.reached(shipid.Instants(ANY)), "columns of the instants must be a dict"),
    "step of the instants": (
        lambda: PREDICTOR.predict(shipid.Instants(WINDOWS.columns, step="1 s")),  # type: ignore[arg-type]
        "step must be a number, not '1 s'",
    ),
    "outside": (
        lambda: PREDICTOR.outside({"u": np.zeros(3), "observer.age": np.zeros(2)}),
        r"age: columns must be \(3\), not",
    ),
    "observe": (lambda: run_observer(SHIP, ANY), "dataset must be a Dataset, as of"),
    "bank": (lambda: filter_bank(SHIP, {"fade": 0.0}), "settings must be an Observer, such as"),  # type: ignore[arg-type]
    "bank of a name": (lambda: filter_bank("mariner"), "vessel must be a Vessel, as of"),  # type: ignore[arg-type]
    "position_error": (lambda: shipid.position_error(np.zeros(2), np.zeros(3)), "paths must both be"),
    "a wind": (lambda: roll(environment={"V_wind": np.zeros(1)}), "environment: .* has no 'V_wind'"),
    "keep": (lambda: roll(keep=3), "keep must be a name, or several names, not 3"),
    "keep nothing known": (lambda: roll(keep="uu"), "'uu' is not known: did you mean 'u'?"),
    "engine": (lambda: roll(engine=None), "engine None is not known: valid"),
    "engines": (lambda: roll(engine=["casadi"]), "engine .* is not known"),
    "name": (lambda: standard(name=None), "manoeuvre None is not known: valid"),
    "approach": (lambda: standard(approach=3), "approach 3 is not known: valid"),
    "duration": (lambda: standard(duration="long"), "duration must be a number, not"),
    "speed": (lambda: standard(speed=[1.0]), "speed must be a number"),
    "n": (lambda: standard(n="1"), "n must be a number, not '1'"),
    "manoeuvres": (lambda: performed(manoeuvres=3), "give manoeuvres of"),
    "components": (lambda: performed(components=3), "components must be a dict"),
    "components of one": (
        lambda: performed(components={"waves": 1.0}),
        "there is no|whose components are drawn",
    ),
    "engine of a list": (lambda: performed(engine=["casadi"]), "engine .* is not known"),
    "outputs": (lambda: performed(outputs=3), "outputs must be a name, or several names"),
    "runs": (lambda: shipid.identify(SHIP, DATA, ANY, IDENTIFY), "runs must be a name, or several names"),
    "progress": (lambda: shipid.identify(SHIP, DATA, "M001", IDENTIFY, progress=ANY), "progress must be a function"),
    "dataset": (lambda: identify(dataset=ANY), "dataset must be a Dataset, as of"),
    "runs to fit": (lambda: identify(runs=3), "runs must be a name, or several names"),
    "held out": (lambda: identify(held_out=3), "--test must be a name, or several names"),
    "ahead": (lambda: identify(ahead="long"), "ahead must be a number, not 'long'"),
    "profiles": (lambda: identify(profiles=3), "profiles must be a name, or several names"),
    "band": (lambda: identify(band="0.9"), "0.9 is no level of a band"),
    "validation runs": (
        lambda: shipid.fit(shipid.Kernel(trials=1), PHYSICS, WINDOWS, validation_runs=ANY),
        "validation_runs must be a name, or several names",
    ),
    "integrator": (lambda: exported(integrator="rk5"), "integrator 'rk5' is not known: did you mean 'rk4'?"),
    "name in C": (lambda: exported(name=3), "name must be a str, such as"),
    "estimates": (
        lambda: shipid.figures.estimates(ANY),
        "source must be an IdentificationContent, as of `run_identification`",
    ),
    "track": (lambda: shipid.figures.track(ANY), "source must be a MeasuredManoeuvre, as of `measure_standard`"),
    "no cells": (lambda: shipid.figures.error_map({}), "source must be a Results"),
}


def test_a_table_is_taken_where_names_with_arrays_are() -> None:
    """Before, pandas refused to say whether a table is true."""
    weather = pd.DataFrame({name: np.zeros(1) for name in vessel_dynamics(SHIP).environment})
    pd.testing.assert_frame_equal(performed(environment=weather), performed())
    known = shipid.fit(shipid.Alone(), PHYSICS, WINDOWS, kinds=pd.Series({"M001": "zigzag"}))
    columns = {name: values for name, values in WINDOWS.columns.items() if name != "run"}
    np.testing.assert_array_equal(known.outside(pd.DataFrame(columns)), known.outside(columns))


@pytest.mark.parametrize(("call", "message"), CALLS.values(), ids=CALLS)
def test_public_functions_refuse_what_they_do_not_take(call: Callable[[], Any], message: str) -> None:
    """Before, an AttributeError or a TypeError from deep inside, or no word at all."""
    with pytest.raises(ShipidError, match=message):
        call()
