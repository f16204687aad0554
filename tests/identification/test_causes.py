"""Laws of causes: no size changes nothing, what has no size is undone by itself, a repair holds its numbers."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from shipid.identification.causes import Cause, Motion, Scales, list_causes
from shipid.logs.repairs import REPAIRS
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel

SCALES = Scales(30.0, 5.0, 1.0)
SHIPS = ("gunnerus-33.9", "mariner", "otter")


def motion_of(ship: str) -> tuple[Motion, list[Cause]]:
    """Two stretches of noise for a ship, and their causes."""
    vessel, random = load_vessel(ship), np.random.default_rng(1)
    model = vessel_dynamics(vessel)
    names = ["north", "east", "psi", "u", "v", "r", *model.commands, "V_w", "beta_w", "V_c", "beta_c"]
    columns = {name: random.normal(size=60) for name in names}
    motion = Motion(columns, np.array([*vessel.parameters.values()]), (slice(0, 30), slice(30, 60)), (0, 1), 0.5)
    return motion, list_causes(vessel, model.commands, motion, SCALES)


@pytest.mark.parametrize("ship", SHIPS)
def test_a_cause_of_no_size_changes_nothing(ship: str) -> None:
    motion, causes = motion_of(ship)
    assert len({cause.key for cause in causes}) == len(causes)
    for cause in (one for one in causes if one.trial and "current" not in one.key and "water" not in one.key):
        after = cause.change(motion, np.zeros(len(cause.trial)))
        for name, values in motion.columns.items():
            np.testing.assert_allclose(after.columns[name], values, atol=1e-12, err_msg=cause.key)
        np.testing.assert_array_equal(after.parameters, motion.parameters)


@pytest.mark.parametrize("ship", SHIPS)
def test_a_cause_without_a_size_is_undone_by_itself(ship: str) -> None:
    motion, causes = motion_of(ship)
    for cause in (one for one in causes if not one.trial and one.key != "heading is course"):
        after = cause.change(cause.change(motion, np.empty(0)), np.empty(0))
        for name, values in motion.columns.items():
            np.testing.assert_array_equal(after.columns[name], values, err_msg=cause.key)


@pytest.mark.parametrize("ship", SHIPS)
def test_a_trial_step_is_felt_and_a_repair_holds_its_numbers(ship: str) -> None:
    motion, causes = motion_of(ship)
    for cause in causes:
        after = cause.change(motion, np.array(cause.trial))
        moved = [name for name, values in motion.columns.items() if not np.array_equal(after.columns[name], values)]
        assert moved or after.course or not np.array_equal(after.parameters, motion.parameters), cause.key
        text = cause.repair_text(np.array(cause.trial))
        assert "{" not in text, cause.key
        if text.startswith("[[repair]]"):  # lines that a mapping takes as they are
            (table,) = tomllib.loads(text)["repair"]
            REPAIRS[table["kind"]][0].model_validate(table)
        elif "offset" in text:
            assert f"offset = {-cause.trial[0]:.4g}  # {cause.unit}, added to what is there" in text, cause.key


def test_an_offset_is_that_of_the_mapping_in_the_unit_of_its_column() -> None:
    vessel, (motion, _) = load_vessel("gunnerus-33.9"), motion_of("gunnerus-33.9")
    mapped = {"psi": {"unit": "deg", "size": np.pi / 180, "offset": 90.0}}
    (cause,) = (one for one in list_causes(vessel, (), motion, SCALES, mapped) if one.key == "sensor psi bias")
    assert cause.repair_text(np.radians([2.5])) == "[columns.psi]\noffset = 87.5  # deg"


def test_a_delay_is_undone_within_each_stretch() -> None:
    motion, causes = motion_of("otter")
    (cause,) = (one for one in causes if one.key == "sensor r delay")
    after = cause.change(motion, np.array([1.0])).columns["r"]  # two steps
    for part in motion.stretches:
        values = motion.columns["r"][part]
        np.testing.assert_allclose(after[part], np.append(values[2:], [values[-1]] * 2))
