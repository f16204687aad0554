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
    unseen : the same from which the track says nothing of the heading: the ship is moored, or drifts to any side.
    spread : the same of a heading that hardly turns, so that a straight course decides nothing.
    unnamed : weight of a name that says nothing, beside 1 of one that says the meaning.
    quarter : added to the misfit of a heading across the track: an acceleration looks like that.
    usual_unit, rare_unit : cost of a unit that logs usually have where no name says one, and of others.
    close : cost by which the best of two must lead, or both are asked.
    beam : poses that are tried with velocities and rates.
    alike_left : logarithm of the ratio of two shares from which one is better.
    none : cost of no velocity or no rate at all, where columns may be one.
    left, named_left : share of a motion that a column may leave, without and with a fitting name.
    misled : share of the heading that a rate with another name may leave.
    off_unit : relative error of a factor from a unit, one standard deviation; a sensor is rarely off by more.
    off_rare : largest relative distance from a unit that few logs have.
    other_clock : cost of a clock in another unit than the one drafted.
    outward : share of ships whose sway counts against the yaw rate in turns: those steered aft of midships.
    axis, turned_axis, compass : costs of a name that says another axis, of an axis that counts the other way, and of a
        compass that is none.
    settling : cost of axes against which a course or velocities to north and east speak.
    seen : t value of an effect on the motion from which it is taken for one.
    followed : correlation of the yaw rate with an earlier order from which its sign is taken, else.
    astern : share of the turning shaft's rows in which it turns astern, of a ship that goes astern all the time.
    turned : range of a heading that no name says [rad], at least.
    advance, near : way of a ship in one turn of its shaft over the radius of a usual turn (0.002 to 0.05), and the
        square of the logarithm of how many times a unit may be off that before it is doubted: 15 times.
    alike : ratio of two scales that are one.
    two_left : share of what one scale leaves that two leave, at most.
    steady : share of the mean wind speed by which a wind may change while the ship turns.
    """

    floor: float = 0.003
    poor: float = 0.2
    unseen: float = 0.5
    spread: float = 0.01
    unnamed: float = 0.25
    quarter: float = 0.1
    usual_unit: float = 0.5
    rare_unit: float = 3.0
    close: float = 1.5
    beam: int = 12
    alike_left: float = 0.22
    none: float = 4.0
    left: float = 0.1
    named_left: float = 0.5
    misled: float = 0.1
    off_unit: float = 0.04
    off_rare: float = 0.03
    other_clock: float = 4.0
    outward: float = 0.95
    axis: float = 4.0
    turned_axis: float = 7.0
    compass: float = 6.0
    settling: float = 9.0
    seen: float = 4.0
    followed: float = 0.4
    astern: float = 0.9
    turned: float = 0.14
    advance: float = 0.01
    near: float = 7.3
    alike: float = 1.4
    two_left: float = 0.3
    steady: float = 0.25


SETTINGS = SearchSettings()
