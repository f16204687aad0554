"""Every number that the search for the meaning of columns is tuned by, in one table with the reason for each.

`python -m tests.benchmarks.retune` tries others on logs drawn by seed.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchSettings:
    """Weights and limits of the search; costs are logarithms, so that 0.7 is a factor of two.

    floor : share of a motion that no model explains, of antennas and sensors that are not in one place.
    poor : 1 - agreement of course and heading from which a person is asked whether they are position and heading.
    spread : 1 - mean cosine of a heading that hardly turns, so that a straight course decides nothing.
    unnamed : weight of a name that says nothing, beside 1 of one that says the meaning.
    usual_unit : cost of a unit that logs usually have where no name says one.
    close : cost by which the best of two must lead, or both are asked.
    beam : poses that are tried with velocities and rates.
    alike_left : logarithm of the ratio of two shares, or of two scales, from which they are not one.
    left, named_left : share of a motion that a column may leave, without and with a fitting name; with half of it left
        the track says nothing of the heading: the ship is moored, or drifts to any side. Two scales leave at most half
        of what one leaves. The first is added to the misfit of a heading across the track: an acceleration looks so.
    off_unit : relative error of a factor from a unit, one standard deviation; a sensor is rarely off by more.
    outward : share of ships whose sway counts against the yaw rate in turns: those steered aft of midships.
    odd : cost of a name that says another axis, of no velocity or rate where columns may be one, of a unit that few
        logs have, of a clock in another unit than the one drafted.
    rare : cost of an axis that counts the other way, of a compass that is none, of a unit that is not written; a shaft
        at that cost, 14 times off a usual way in a turn, has another unit.
    settling : cost of axes against which a course or velocities to north and east speak: more than `rare`.
    seen : t value of an effect on the motion from which it is taken for one.
    astern : share of the turning shaft's rows in which it turns astern, of a screw whose sign is the other way.
    turned : range of a heading that no name says [rad], at least.
    steady : share of the mean wind speed by which a wind may change while the ship turns.
    advance : way of a ship in one turn of its shaft over the radius of a usual turn (0.002 to 0.05).
    """

    floor: float = 0.003
    poor: float = 0.2
    spread: float = 0.01
    unnamed: float = 0.25
    usual_unit: float = 0.5
    close: float = 1.5
    beam: int = 12
    alike_left: float = 0.22
    left: float = 0.1
    named_left: float = 0.5
    off_unit: float = 0.04
    outward: float = 0.95
    odd: float = 4.0
    rare: float = 7.0
    settling: float = 9.0
    seen: float = 4.0
    astern: float = 0.9
    turned: float = 0.14
    steady: float = 0.25
    advance: float = 0.01


SETTINGS = SearchSettings()
