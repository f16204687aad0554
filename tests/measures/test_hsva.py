"""Zigzags of a KVLCC2 model at HSVA (SIMMAN 2008): the overshoots that were read off these files."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.measures.recognise import recognise_kinds, record_of
from shipid.measures.zigzag import zigzag_measures
from shipid.units import DEGREE

# README beside the files; the tank repeats them to 0.2 to 0.5 deg
READ_OFF = {
    "10_10_P": (9.73, 17.77),
    "10_10_S": (9.69, 20.54),
    "20_10_P": (11.97, 13.87, 13.16),
    "20_10_S": (11.71, 15.62, 12.41),
}


def columns_of(hsva: Dataset, name: str) -> dict[str, np.ndarray]:
    rows = hsva.frame[hsva.frame["run"] == name]
    return {str(column): values.to_numpy() for column, values in rows.items()}


@pytest.mark.parametrize("name", READ_OFF)
def test_overshoots_are_those_of_the_readme(hsva: Dataset, name: str) -> None:
    """About the ordered course, 0, to 0.03 deg; about the heading at the execute to 0.1 deg."""
    record = record_of(columns_of(hsva, name))
    exact, measures = zigzag_measures(record, course=0.0), zigzag_measures(record)
    assert measures["execute_heading"].value == pytest.approx(10 * DEGREE)
    assert measures["helm"].value == pytest.approx(int(name[:2]) * DEGREE, abs=0.05 * DEGREE)
    for number, angle in enumerate(READ_OFF[name], start=1):
        assert exact[f"overshoot_{number}"].value / DEGREE == pytest.approx(angle, abs=0.03)
        assert measures[f"overshoot_{number}"].value / DEGREE == pytest.approx(angle, abs=0.1)


@pytest.mark.parametrize(("name", "heading"), [("05_01", 1), ("10_05", 5), ("15_01", 1), ("20_05", 5), ("35_05", 5)])
def test_every_zigzag_is_recognised_with_its_execute_heading(hsva: Dataset, name: str, heading: int) -> None:
    record = record_of(columns_of(hsva, name))
    assert recognise_kinds(record) == (("zigzag",), "")
    assert zigzag_measures(record)["execute_heading"].value == pytest.approx(heading * DEGREE)
