"""Zigzags of Nomoto's ship, whose overshoots are known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.measures.recognise import recognise_kinds, record_of
from shipid.measures.record import FirstExecute, Record
from shipid.measures.zigzag import last_row_of_zigzag, zigzag_measures
from shipid.units import DEGREE
from tests.measures.made_records import (
    FINE,
    GAIN,
    START,
    TIME,
    clock,
    every,
    made_record,
    nomoto,
    zigzag_10,
    zigzag_legs,
)

RECORDED = ("t", "north", "east", "psi", "u", "v", "r", "helm")


@pytest.mark.parametrize(("helm", "heading"), [(10, 10), (20, 20), (20, 10), (10, 5), (15, 1)])
@pytest.mark.parametrize("interval", [0.1, 1.0])
def test_overshoots_and_times_of_nomoto(helm: float, heading: float, interval: float) -> None:
    """Overshoot T r - K d T ln(1 + r / (K d)), at T ln(1 + r / (K d)) after a reversal at rate r."""
    legs, peaks = zigzag_legs(helm * DEGREE, heading * DEGREE, 8)
    t = clock(200.0)
    psi, r, order = nomoto(t, legs)
    measures = zigzag_measures(every(made_record(t, psi, r, order, np.full_like(t, 5.0), 0 * t), interval))
    assert measures["execute_heading"].value == pytest.approx(heading * DEGREE)
    assert measures["execute"].value == pytest.approx(START)
    # the helm jumps, so the heading has kinks in its third derivative, which 1 Hz rounds off
    angle, time = (1e-4, 1e-3) if interval < 1 else (0.02, 0.02)
    for number, (overshoot, check) in enumerate(peaks[:4], start=1):
        assert measures[f"overshoot_{number}"].value / DEGREE == pytest.approx(overshoot / DEGREE, abs=angle)
        assert measures[f"time_to_check_{number}"].value == pytest.approx(check, abs=time)
    assert measures["initial_turning_time"].value == pytest.approx(legs[1][0] - START, abs=time)
    assert measures["initial_turning"].value == pytest.approx(5.0 * (legs[1][0] - START), abs=5 * time)
    assert measures["period"].value == pytest.approx(legs[3][0] - legs[1][0], abs=time)
    assert GAIN * helm * DEGREE * TIME > 0


def test_overshoots_count_from_the_execute_heading_not_from_the_helm() -> None:
    """Where a measured rudder follows 0.5 s after the order, the overshoot still counts from the execute heading."""
    record = every(zigzag_10(), 0.1)
    late = replace(record, helm=np.append(np.zeros(5), record.helm[:-5]))
    measures, expected = (
        zigzag_measures(late, course=0.0)["overshoot_1"],
        zigzag_measures(record, course=0.0)["overshoot_1"],
    )
    assert measures.value == pytest.approx(expected.value, abs=1e-9)
    assert zigzag_measures(late)["execute_heading"].value == pytest.approx(10 * DEGREE)


def test_execute_heading_and_course_may_be_given() -> None:
    record = every(zigzag_10(), 0.1)
    given = zigzag_measures(record, execute_heading=8 * DEGREE, course=0.5 * DEGREE)
    assert given["execute_heading"].value == 8 * DEGREE
    difference = zigzag_measures(record)["overshoot_1"].value - given["overshoot_1"].value
    assert difference == pytest.approx(-1.5 * DEGREE, abs=1e-3 * DEGREE)


def test_a_manoeuvre_after_a_long_pause_is_not_of_the_zigzag() -> None:
    """The helm is over for 20 s at a time; after 100 s amidships it is put over once more."""
    t = np.arange(0.0, 200.0)
    helm = np.select([t < 10, t < 30, t < 50, t < 52, t < 70, t < 170, t < 185], [0, 10, -10, 0, 10, 0, 10], 0) * DEGREE
    still = np.zeros_like(t)
    record = Record(t, still, still, still, still, still, still, helm)
    over = FirstExecute(start=10.0, row=10, angle=10 * DEGREE, side=1.0)
    assert last_row_of_zigzag(record, over) == 69
    soon = replace(record, t=np.interp(t, [0, 70, 170, 199], [0, 70, 80, 109]))  # amidships for 10 s only
    assert last_row_of_zigzag(soon, over) == 184


@pytest.mark.parametrize(("heading", "interval"), [(7.0, 0.1), (10.0, 0.5), (12.0, 0.1)])
def test_the_execute_heading_is_seen_from_a_measured_helm(heading: float, interval: float) -> None:
    """A steering gear of 2 deg/s: where the helm is half back, the heading is beyond that of the order."""
    t = clock(200.0)
    psi, r, order = nomoto(t, zigzag_legs(10 * DEGREE, heading * DEGREE, 6)[0])
    helm = np.zeros_like(t)
    for row in range(1, len(t)):
        helm[row] = helm[row - 1] + np.clip(order[row] - helm[row - 1], -0.02 * DEGREE, 0.02 * DEGREE)
    record = every(made_record(t, psi, r, helm, np.full_like(t, 5.0), 0 * t), interval)
    assert zigzag_measures(record)["execute_heading"].value / DEGREE == pytest.approx(heading)


@pytest.mark.parametrize("interval", [0.5, 2.0, 4.0, 6.0])
def test_a_pass_between_two_rows_is_said_and_no_later_one_takes_its_place(interval: float) -> None:
    """Where an overshoot lies between two rows, the pass was taken from the next cycle, and the period was doubled."""
    t, cycle, unseen = clock(250.0), 46.0, 0
    phase = 2 * np.pi * np.maximum(t - START, 0) / cycle
    psi, r = 10.3 * DEGREE * np.sin(phase), np.gradient(10.3 * DEGREE * np.sin(phase), t)
    executes = np.floor((phase + np.arccos(10 / 10.3)) / np.pi + 0.5).astype(int)  # passes of 10 deg so far
    helm = np.where(t < START, 0.0, np.where(executes % 2, -1, 1) * 10 * DEGREE)
    fine = made_record(t, psi, r, helm, np.full_like(t, 5.0), 0 * t)
    for first in range(0, int(interval / FINE), 25):
        record = Record(*(getattr(fine, name)[first :: int(interval / FINE)] for name in RECORDED))
        period = zigzag_measures(record, execute_heading=10 * DEGREE, course=0.0)["period"]
        unseen += "rows are too far apart" in period.why
        if np.isfinite(period.value):
            assert period.value == pytest.approx(cycle, abs=interval)
        else:
            assert "rows are too far apart" in period.why
    assert (unseen > 0) == (interval > 2)


@pytest.mark.parametrize("held", [-7.0, -5.5, 5.5, 7.0])
@pytest.mark.parametrize("wait", [20.0, 200.0])
@pytest.mark.parametrize("slow", [0.0, 2.0])
def test_a_helm_that_holds_the_course_before_is_no_execute(held: float, wait: float, slow: float) -> None:
    """Against wind, with more than half of the helm of the zigzag, to either side, for longer than the zigzag takes.

    The ship turns by what the helm is beyond that. slow : s that a measured helm takes to its order.
    """
    s = np.linspace(0, 400, 400001)  # from the course, straight on, until 10 deg off it
    needed = float(s[np.argmax(GAIN * (10 - held) * (s - TIME * (1 - np.exp(-s / TIME))) >= 10)])
    legs = [(wait, (10 - held) * DEGREE), (wait + needed, (-10 - held) * DEGREE)]
    t = clock(wait + needed + 40)
    psi, r, order = nomoto(t, legs)
    shown = np.convolve(np.append(np.zeros(round(slow / FINE)), order), np.ones(round(slow / FINE) + 1), "valid")
    shown = shown / (round(slow / FINE) + 1) + held * DEGREE
    record = every(made_record(t, psi, r, shown, np.full_like(t, 5.0), 0 * t), 0.5)
    measures = zigzag_measures(record)
    assert recognise_kinds(record)[0] == ("zigzag",)
    assert measures["execute"].value == pytest.approx(wait, abs=0.25 if slow else 1e-9)
    assert measures["helm"].value == pytest.approx(10 * DEGREE)
    assert measures["execute_heading"].value == pytest.approx(10 * DEGREE)
    assert measures["initial_turning_time"].value == pytest.approx(needed, abs=0.3)
    assert measures["overshoot_1"].value > 0


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
