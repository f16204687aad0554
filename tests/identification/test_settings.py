"""The `[identify]` table: validation, factors with bounds and priors, ties, and overrides of single runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.identification.settings import (
    POSITIVE,
    WIDE,
    Identify,
    free_factors,
    resolve_overrides,
)
from shipid.vessel.load import load_vessel

SHIP = load_vessel("gunnerus-28.9")
MASS, YAW = "inertia.m", "hull.derivatives.N_ur"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"weights": {"speed": 0.1}}, "weights.speed is no valid name"),
        ({"weights": {"r": [0.01]}}, "weights.r: must be a number"),
        ({"weights": {"propeller": {"thrust": [500]}}}, "weights: must be a number"),
        ({"nuisance": ["wind"]}, "nuisance.wind is no valid name"),
        ({"bounds": {MASS: (2.0, 1.0)}}, "give \\[low, high\\]"),
        ({"horizon": 1.5}, "must hold two steps of 1 s"),
    ],
)
def test_wrong_settings_are_refused(given: dict[str, object], message: str) -> None:
    with pytest.raises(DocumentError, match=message):
        Identify(parameters=[MASS], **given)


def test_a_position_weight_fits_two_columns() -> None:
    assert Identify(parameters=[MASS], weights={"position": 2.0, "psi": 0.1}).signals == {
        "north": 2.0,
        "east": 2.0,
        "psi": 0.1,
    }


def test_nuisances_have_default_widths_in_a_fixed_order() -> None:
    settings = Identify(parameters=[MASS], nuisance=["lever_arm", "current"])
    assert list(settings.widths.items()) == [("current", WIDE["current"]), ("lever_arm", WIDE["lever_arm"])]


def test_factors_have_the_bounds_of_the_vessel_checks() -> None:
    free = free_factors(SHIP, Identify(parameters=[MASS, YAW], prior={YAW: 0.5}))
    place = {path: i for i, path in enumerate(free.paths)}
    assert free.low[place[MASS]] == POSITIVE
    assert free.low[place[YAW]] == -math.inf
    assert free.prior[place[YAW]] == 0.5
    assert free.prior[place[MASS]] == math.inf
    assert np.array_equal(free.centre, np.ones(2))
    assert free.values(2 * free.centre)[MASS] == 2 * SHIP.parameters[MASS]


def test_tied_paths_share_one_factor() -> None:
    pair = ["thruster.port.k_T", "thruster.starboard.k_T"]
    free = free_factors(SHIP, Identify(parameters=pair, together=[pair]))
    assert free.groups == (tuple(pair),)
    with pytest.raises(DocumentError, match="is in two groups"):
        free_factors(SHIP, Identify(parameters=pair, together=[pair, pair[:1]]))


def test_zeros_of_a_table_that_is_tied_by_a_pattern_stay_zero() -> None:
    """A side force at 0 and 180 deg is 0: one factor on the table leaves them, and was refused."""
    table, zeros = "wind.C_Y.*", {"wind.C_Y.0", "wind.C_Y.18"}
    free = free_factors(SHIP, Identify(parameters=[table], together=[[table]], prior={table: 0.3}))
    (group,) = free.groups
    assert set(group) == {path for path in SHIP.parameters if path.startswith("wind.C_Y.")} - zeros
    assert free.prior.tolist() == [0.3]
    assert free.centre.tolist() == [1.0]
    twice = SHIP.parameters | free.values([2.0])
    assert SHIP.with_values(free.values([2.0])).parameters == twice
    assert twice["wind.C_Y.9"] == 2 * SHIP.parameters["wind.C_Y.9"]
    named = ["wind.C_Y.0", "wind.C_Y.9"]
    with pytest.raises(DocumentError, match="some are 0 and some are not"):
        free_factors(SHIP, Identify(parameters=named, together=[named]))


def test_overrides_belong_to_one_run() -> None:
    settings = Identify(parameters=[YAW], runs={"a": {"inertia": {"m": 7e5}, "environment": {"V_w": 3}}})
    assert resolve_overrides(settings, ["a", "b"], SHIP, ["V_w"]) == {"a": {MASS: 7e5, "environment.V_w": 3.0}, "b": {}}
    with pytest.raises(DocumentError, match="does not begin with the name of a run"):
        resolve_overrides(settings, ["b"], SHIP, ["V_w"])
    with pytest.raises(DocumentError, match="cannot be set for a run"):
        resolve_overrides(settings, ["a"], SHIP, [])


def test_a_pattern_selects_no_constant_and_no_dimension() -> None:
    """Density and length are known; a fit to them and to their coefficient has no answer."""
    otter = load_vessel("otter")
    paths = free_factors(otter, Identify(parameters=["hull.*"])).paths
    assert "hull.crossflow.C_d" in paths
    assert not {f"hull.crossflow.{name}" for name in ("rho", "T", "x_aft", "x_fwd")} & set(paths)
    some = Identify(parameters=["hull.*", "hull.crossflow.T"], fixed=["hull.crossflow.x_*"])
    assert set(free_factors(otter, some).paths) - set(paths) == {"hull.crossflow.T"}
    with pytest.raises(DocumentError, match=r"dimensions and constants only.*hull\.crossflow\.x_aft"):
        free_factors(otter, Identify(parameters=["hull.crossflow.x_*"]))


def test_the_time_constant_of_an_actuator_is_no_draught() -> None:
    paths = free_factors(load_vessel("otter"), Identify(parameters=["thruster.*.actuator.*"])).paths
    assert {"thruster.port.actuator.n.T", "thruster.starboard.actuator.n.T"} <= set(paths)


@pytest.mark.parametrize(
    ("given", "current"),
    [
        ({}, "none"),
        ({"nuisance": ["current"]}, "by run"),
        ({"nuisance": {"current": 0.3}}, "by run"),
        ({"current": "one"}, "one"),
    ],
)
def test_a_current_that_is_named_is_not_replaced_by_none(given: dict, current: str) -> None:
    assert Identify(parameters=[YAW], **given).with_current_named().current == current
