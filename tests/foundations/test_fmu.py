"""FMUs of others give the motion of the same ship in NumPy; of shipid's own, that of the vessel."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.foundations.fmu import RunTrack, SimulatorFmu
from tests.foundations.foreign import build_ship, motion_of_ship, write_table

STEP, HORIZON, COUNT = 0.5, 20, 6


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmus")


def as_fmu(table):
    return SimulatorFmu.read(str(table), table.parent, True)[0]


def drawn_windows(count=COUNT, seed=3):
    draw = np.random.default_rng(seed)
    low, high = [-500, -500, -7, 2, 0, -0.02], [500, 500, 7, 6, 0, 0.02]
    states = draw.uniform(low, high, (count, 6))
    states[:, 4] = -8.0 * states[:, 5]
    orders = {
        "rudder.delta": draw.uniform(-0.4, 0.4, (count, HORIZON)),
        "propeller.n": draw.uniform(1, 4, (count, HORIZON)),
    }
    return states, orders


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("reset", [True, False])
def test_another_ship_moves_as_in_numpy(folder, version, reset):
    """Knots, degrees, east and north, to port: each row turned back; an instance without reset is made anew."""
    fmu = as_fmu(write_table(build_ship(folder / f"s{version}{reset}.fmu", version, reset=reset)))
    states, orders = drawn_windows()
    for numbers in ({}, {"X_uu": 0.006, "K": 0.03}):
        motion, faults = fmu.with_values(numbers).simulate(states, orders, STEP)
        assert faults == []
        np.testing.assert_allclose(motion[:, 1:], motion_of_ship(states, orders, STEP, **numbers), rtol=0, atol=1e-9)


def test_the_descriptions_are_valid(folder):
    validation = pytest.importorskip("fmpy.validation")
    for version in (2, 3):
        assert validation.validate_fmu(str(build_ship(folder / f"valid{version}.fmu", version))) == []


@pytest.mark.parametrize(
    ("ending", "old", "new", "words"),
    [
        (".so", b"fmi2DoStep", b"fmi2DoStop", r"\.so' in it is damaged"),
        (".xml", b'start="', b'start="x', "to float: 'x"),
    ],
)
def test_a_part_that_is_damaged_is_refused(tmp_path, ending, old, new, words):
    """Before, a traceback at the first run."""
    file = build_ship(tmp_path / "ship.fmu", 2)
    table = write_table(file)
    with zipfile.ZipFile(file) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in parts.items():
            archive.writestr(
                name, content.replace(old, new) if name.endswith(ending) == (ending == ".xml") else content
            )
    if ending == ".so":  # of which the archive has another checksum
        content = file.read_bytes()
        assert old in content
        file.write_bytes(content.replace(old, new))
    with pytest.raises(DocumentError, match=rf"is no FMU: .*{words}"):
        as_fmu(table)


def record_of_run(rows=60):
    """Orders every STEP, and the motion that they give to a ship that begins at rest at the origin."""
    t = STEP * np.arange(rows)
    orders = {"rudder.delta": 0.3 * np.sin(t / 9), "propeller.n": 3 + np.cos(t / 20)}
    motion = motion_of_ship(np.zeros((1, 6)), {k: v[None] for k, v in orders.items()}, STEP)[0]
    return orders, np.concatenate([np.zeros((1, 6)), motion])


@pytest.mark.parametrize(("version", "branches"), [(2, True), (2, False), (3, True)])
def test_a_ship_without_start_values_runs_along_the_run(folder, version, branches):
    """From the beginning of the run to each instant, and on by what is known there; then moved to the true place."""
    fmu = as_fmu(
        write_table(
            build_ship(folder / f"along{version}{branches}.fmu", version, starts=False, branches=branches), False
        )
    )
    assert not fmu.fmu.startable
    assert fmu.fmu.branches == branches
    orders, motion = record_of_run()
    rows = [0, 5, 17, 30]
    held = {name: np.repeat(values[rows][:, None], HORIZON, axis=1) for name, values in orders.items()}
    known = {name: np.stack([values[row : row + HORIZON] for row in rows]) for name, values in orders.items()}
    along = [RunTrack({**orders, "psi": motion[:-1, 2]}, range(len(rows)), rows)]
    begun = motion[rows]
    for ahead in (held, known):
        found, faults = fmu.simulate(begun, ahead, STEP, along)
        assert faults == []
        np.testing.assert_allclose(found[:, 1:], motion_of_ship(begun, ahead, STEP), rtol=0, atol=1e-9)
    turned = begun + np.array([100.0, -50.0, 0.7, 0, 0, 0])
    found, _ = fmu.simulate(turned, known, STEP, along)
    np.testing.assert_allclose(found[:, 1:], motion_of_ship(turned, known, STEP), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("fault", "words"),
    [(1, "status 3 (error). at 5 s (the propeller is lost)"), (2, "ends its"), (3, "longer than 1 s"), (5, "Exit")],
)
def test_a_failing_ship_is_lost_from_there_on(folder, fault, words):
    """An error keeps what was before; the first window does not take the second one with it."""
    fmu = as_fmu(write_table(build_ship(folder / "fails.fmu"), more="limit = 1"))
    states, orders = drawn_windows(2)
    motion, faults = fmu.with_values({"fault": fault}).simulate(states, orders, STEP)
    assert len(faults) == 2
    assert words in faults[1]
    kept = np.isfinite(motion).all(axis=-1).sum(axis=1).tolist()
    assert kept == ([11, 11] if fault == 1 else [0, 0])
    sound = motion_of_ship(states, orders, STEP)
    np.testing.assert_allclose(motion[:, 1:11][:, : kept[0]], sound[:, :10][:, : kept[0]], rtol=0, atol=1e-9)


def test_a_place_that_is_no_number_is_named(folder):
    """In a step response the fault is in the outputs alone: no function of the FMU returns an error."""
    fmu = as_fmu(write_table(build_ship(folder / "nan.fmu"))).with_values({"fault": 6})
    with pytest.raises(DocumentError, match=r"fails in a step response: its motion is no number after 5.4 s"):
        fmu.describe_response(np.array([0, 0, 0, 5.0, 0, 0]), *RESPONSE)


def test_what_a_ship_prints_goes_nowhere(folder, capfd):
    fmu = as_fmu(write_table(build_ship(folder / "prints.fmu")))
    states, orders = drawn_windows(2)
    motion, faults = fmu.with_values({"fault": 4}).simulate(states, orders, STEP)
    assert faults == []
    np.testing.assert_allclose(motion[:, 1:], motion_of_ship(states, orders, STEP), rtol=0, atol=1e-9)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('north = { variable = "y" }', "", "no row gives north; variables of the FMU for a row of role output: x, y"),
        ('variable = "rpm"', 'variable = "rpms"', "no real variable 'rpms': did you mean 'rpm'?"),
        ('unit = "rpm"', 'unit = "kn"', "'kn': give one of rev/s, rpm"),
        ('variable = "rudder"', 'variable = "rate"', "'rate' has the causality output, no output of rudder.delta"),
        ('"rudder.delta"', '"rudder.angle"', "no signal: give north, east"),
        ("file =", "fil =", "missing"),
        ('variable = "rpm"', 'variables = "rpm"', "fmu.propeller.n.variables: unknown key"),
        ("scale = -1", "scale = true", "fmu.v.scale: "),
        ("scale = -1", "scale = 0", "a scale that is not 0"),
        ("limit = 1", "limit = -1", "must be"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_one_line(folder, old, new, words):
    table = write_table(build_ship(folder / "table.fmu"), more="limit = 1")
    assert old in table.read_text()
    table.write_text(table.read_text().replace(old, new))
    with pytest.raises(DocumentError) as error:
        as_fmu(table)
    assert words in str(error.value)


RESPONSE = ({"rudder.delta": 0.0, "propeller.n": 2.5}, {"rudder.delta": 0.2, "propeller.n": 0.5})


def test_a_step_response_says_which_way_and_how_fast(folder):
    fmu = as_fmu(write_table(build_ship(folder / "response.fmu")))
    rudder, screw = fmu.describe_response(np.array([0, 0, 0, 5.0, 0, 0]), *RESPONSE)
    orders = {"rudder.delta": np.full((1, 200), 0.2), "propeller.n": np.full((1, 200), 2.5)}
    u, v, r = motion_of_ship(np.array([[0, 0, 0, 5.0, 0, 0]]), orders, 0.6)[0, -1, 3:]
    words = f"it turns to port by {np.degrees(-r):.2g} deg/s at {np.hypot(u, v):.3g} m/s"
    assert rudder == f"rudder.delta +0.2 rad: after 120 s {words}"
    assert screw.startswith("propeller.n +0.5 rev/s: after 120 s")


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ('variable = "rate", unit = "deg/s", frame = "enu"', 'variable = "rate", unit = "deg/s"', "fmu.r"),
        ('variable = "rate", unit = "deg/s"', 'variable = "rate", unit = "rad/s"', "fmu.r"),
        ('variable = "surge", unit = "kn"', 'variable = "surge", unit = "m/s"', "fmu.u"),
        ("scale = -1", "scale = 1", "fmu.v"),
        ('"yaw", unit = "deg", frame = "enu" },', '"yaw", unit = "deg" },', "fmu."),
    ],
)  # fmt: skip
def test_a_wrong_sign_unit_or_frame_shows_in_the_step_response(folder, old, new, where):
    table = write_table(build_ship(folder / "wrong.fmu"))
    assert old in table.read_text()
    table.write_text(table.read_text().replace(old, new))
    with pytest.raises(DocumentError) as error:
        as_fmu(table).describe_response(np.array([0, 0, 0, 5.0, 0, 0]), *RESPONSE)
    assert where in str(error.value)


def test_the_table_of_the_page_is_that_of_the_ship(folder):
    page = (Path(__file__).parents[2] / "docs" / "own-simulator.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"^```toml\n(# ship.toml\n.*?)^```", page, re.MULTILINE | re.DOTALL)
    build_ship(folder / "ship.fmu", 3)
    (folder / "ship.toml").write_text(table)
    states, orders = drawn_windows()
    motion, faults = as_fmu(folder / "ship.toml").simulate(states, orders, STEP)
    assert faults == []
    np.testing.assert_allclose(motion[:, 1:], motion_of_ship(states, orders, STEP), rtol=0, atol=1e-9)
