"""A function as physics: what it is given, what is refused in one line, and families of its numbers."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import shipid
from shipid.data.windows import Instants
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.foundations import function
from shipid.foundations.function import FUNCTIONS, SimulatorFunction
from shipid.study.prepare import obtain_runs, prepare
from tests.cli.running import ended
from tests.foundations.ships import STATES, study_file

Array = np.ndarray
FAMILY = '[[family]]\nname = "mine"\nfunction = "{}"\n'
DRAWN = """members = 3
[[family.perturb]]
parameters = ["N_ur", "Y_uv"]
factor = [0.5, 1.5]
"""


@pytest.fixture
def registry() -> Iterator[dict[str, Any]]:
    with patch.dict(FUNCTIONS):
        yield FUNCTIONS


def instants(count: int, horizon: int | None = 3) -> Instants:
    rng = np.random.default_rng(count)
    names = (*STATES, "port.n", "V_w", "beta_w")
    columns = {name: rng.normal(size=count) for name in names}
    planned = None if horizon is None else {"port.n": rng.normal(size=(horizon, count))}
    return Instants(columns, planned=planned)


def test_the_function_is_given_states_orders_and_weather_in_batches() -> None:
    calls: list[Any] = []

    def simulate(states: Array, orders: Any, weather: Any, step: float, m: float = 2.0) -> Array:
        calls.append((states, orders, weather, step, m))
        return np.repeat(states[:, None], orders["port.n"].shape[1], axis=1) * m

    one, many = SimulatorFunction("mine", parameters={"m": 3.0}, given=simulate), instants(25)
    with patch.object(function, "BATCH", 10):
        states = one.states(many, 3, 0.5)
    assert [len(call[0]) for call in calls] == [10, 10, 5]
    for place, name in enumerate(STATES):
        np.testing.assert_array_equal(np.concatenate([call[0][:, place] for call in calls]), many.columns[name])
        np.testing.assert_array_equal(states[name], np.tile(3.0 * many.columns[name], (3, 1)))
    planned: Any = many.planned
    np.testing.assert_array_equal(np.concatenate([call[1]["port.n"] for call in calls]), planned["port.n"].T)
    assert {name: values.shape for name, values in calls[0][2].items()} == {"V_w": (10, 3), "beta_w": (10, 3)}
    assert calls[0][3:] == (0.5, 3.0)
    held = one.states(instants(4, None), 2, 0.5)
    assert held["u"].shape == (2, 4)
    assert (calls[-1][1]["port.n"] == calls[-1][1]["port.n"][:, :1]).all()


def test_a_family_of_its_numbers_is_the_family_of_the_vessel(tmp_path: Path) -> None:
    plan = shipid.read_plan(study_file(tmp_path, FAMILY.format("my_ship:simulate") + DRAWN), trust=True)
    prepared, ship = prepare(plan, obtain_runs(plan)), shipid.load_vessel("gunnerus-28.9")
    drawn = {one.name: one.variant.factors for one in prepared.foundations if one.variant is not None}
    assert len({tuple(factors.values()) for factors in drawn.values()}) == 3
    for name, factors in drawn.items():
        assert all(0.5 <= factor <= 1.5 for factor in factors.values())
        paths = {f"hull.derivatives.{parameter}": factor for parameter, factor in factors.items()}
        changed = ship.with_values({path: ship.parameters[path] * factor for path, factor in paths.items()})
        physics = shipid.Physics(changed, plan.study.prediction.horizon, plan.study.prediction.step)
        np.testing.assert_allclose(prepared.known[name].test_paths, physics.paths(prepared.test.instants()), atol=1e-9)


def test_where_it_gives_no_number_the_path_goes_on_and_a_note_says_so(tmp_path: Path) -> None:
    plan = shipid.read_plan(study_file(tmp_path, FAMILY.format("my_ship:fails")), trust=True)
    prepared = prepare(plan, obtain_runs(plan))
    lost = prepared.pool.columns["u"] > 2.0
    assert 0 < lost.sum() < len(lost)
    np.testing.assert_array_equal(prepared.known["mine"].diverged, lost)
    assert np.isfinite(prepared.known["mine"].paths).all()
    assert any(note.startswith("mine diverges on") for note in prepared.notes)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("my_ship", "write 'module:function', or a name that Python put into FUNCTIONS"),
        ("my_ship:simulat", "my_ship has no function 'simulat'.*simulate"),
        ("my_ship:few", r"must take \(states, orders, weather, step\), and numbers by keyword"),
        ("no_such_ship:simulate", "no_such_ship: cannot be imported: .*; write no_such_ship.py beside the document"),
    ],
)
def test_a_wrong_name_is_one_line(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(DocumentError, match=words) as error:
        shipid.read_plan(study_file(tmp_path, FAMILY.format(name)), trust=True)
    assert (error.value.path, str(error.value).count("\n")) == ("family.mine.function", 0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("my_ship:narrow", r"must give states \(\d+, 5, 6\), north, east, psi, u, v, r, not \(\d+, 1, 6\)"),
        ("my_ship:broken", "my_ship:broken: KeyError: 'no' in .*my_ship.py, line"),
    ],
)
def test_a_mistake_of_the_function_is_one_line(tmp_path: Path, name: str, words: str) -> None:
    plan = shipid.read_plan(study_file(tmp_path, FAMILY.format(name)), trust=True)
    with pytest.raises(ShipidError, match=words):
        prepare(plan, obtain_runs(plan))


WRONG = """
import numpy as np
from my_ship import simulate

def swapped(*given): return simulate(*given)[..., [1, 0, 2, 3, 4, 5]]
def degrees(*given): return simulate(*given) * [1, 1, 1, 1, 1, 57.3]
def knots(*given): return simulate(*given) / [1, 1, 1, 0.514, 0.514, 1]
"""


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("swapped", "wrong frame, north and east are exchanged"),
        ("degrees", "r: heading changes by 0.01.* times the integral of r"),
        ("knots", "u: place changes by 0.5.* times the integral of u"),
    ],
)
def test_a_wrong_frame_or_unit_of_the_motion_is_refused_unless_meant(tmp_path: Path, name: str, words: str) -> None:
    family = FAMILY.format(f"wrong:{name}")
    for more in ("", 'unusual = ["family.mine.function"]\n'):
        plan = shipid.read_plan(study_file(write_wrong(tmp_path), family, more), trust=True)
        with nullcontext() if more else pytest.raises(DataError, match=words):
            prepare(plan, obtain_runs(plan))


def write_wrong(folder: Path) -> Path:
    (folder / "wrong.py").write_text(WRONG)
    return folder


def test_code_of_a_document_runs_with_trust_or_from_python(tmp_path: Path, registry: dict[str, Any]) -> None:
    file = study_file(tmp_path, FAMILY.format("my_ship:simulate"))
    (tmp_path / "my_ship.py").write_text("raise SystemExit('it ran')")
    status, _, said = ended("study", "run", file, "--out", tmp_path / "run")
    assert status
    assert "my_ship:simulate is code that this document names: read it, and add --trust to run it" in said
    status, _, said = ended("study", "run", file, "--out", tmp_path / "run", "--trust")
    assert "my_ship.py: cannot be imported: SystemExit: it ran in " in said
    registry["mine"] = gives_the_start
    (one,) = SimulatorFunction.read("mine", tmp_path, trust=False)
    assert one.parameters == {"drag": 1.5}
    assert pickle.loads(pickle.dumps(one)).function is gives_the_start
    with pytest.raises(DocumentError, match="mine has no parameter 'm': "):
        one.with_values({"m": 1.0})


def gives_the_start(states: Array, orders: Any, weather: Any, step: float, *, drag: float = 1.5) -> Array:
    del orders, weather, step, drag
    return states[:, None]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("[family.identify]\nparameters = ['*']", "family.more.identify: it needs the equations of a vessel"),
        ("[family.observer]", "family.more.observer: it needs the equations of a vessel"),
    ],
)
def test_what_needs_equations_is_refused(tmp_path: Path, more: str, words: str) -> None:
    families = FAMILY.format("my_ship:simulate") + f'[[family]]\nname = "more"\nextends = "mine"\n{more}'
    with pytest.raises(DocumentError, match=words):
        shipid.read_plan(study_file(tmp_path, families), trust=True)


def test_no_states_are_refused() -> None:
    one = SimulatorFunction("mine", given=lambda *_: "none")
    with pytest.raises(DataError, match="states of mine"):
        one.states(instants(2), 3, 1.0)
