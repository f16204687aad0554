"""Units with a prefix."""

from __future__ import annotations

import pytest

from shipid.logs.amounts import without_prefix


@pytest.mark.parametrize(
    ("text", "unit", "factor"),
    [
        ("krpm", "rpm", 1e3),
        ("mrad", "rad", 1e-3),
        ("mrad/s", "rad/s", 1e-3),
        ("millidegrees", "degrees", 1e-3),
        ("cdeg", "deg", 0.01),
        ("ddeg/min", "deg/min", 0.1),
        *((unit, unit, 1.0) for unit in ("deg", "dpm", "kn", "cm/s", "mm/s", "ms", "mph", "kg", "mV", "dB", "m°", "")),
    ],
)
def test_a_prefix_is_that_of_a_unit_of_an_angle_or_a_shaft(text: str, unit: str, factor: float) -> None:
    assert without_prefix(text) == (unit, factor)
