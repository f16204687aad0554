"""A standard manoeuvre simulated with its measures, and the content of its report page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from shipid.errors import ShipidError
from shipid.measures.criteria import criterion_rows, judge_criteria, measure_rows
from shipid.measures.recognise import record_of
from shipid.measures.record import Record
from shipid.physics.signals import ACTUAL, is_steering, neutral_value, signal_of
from shipid.report.figure import ship_outline
from shipid.report.motion import ManoeuvreContent
from shipid.simulation.approach import Controls, NotStraight
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.standard import Standard, define_standard
from shipid.units import RPM
from shipid.version import __version__
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.schema import term_blocks

TRIALS: tuple[tuple[str, tuple[float, ...]], ...] = (("turning", (35,)), ("zigzag", (10, 10)), ("zigzag", (20, 20)))
"""Standard manoeuvres [deg] that have criteria."""
FROM_REST = "the ship comes from rest: the tests ask for a steady approach at the test speed"
SLOW, FAST = 0.9, 1.1  # of the service speed: the approach of the tests


@dataclass(frozen=True, eq=False)
class MeasuredManoeuvre:
    """A simulated standard manoeuvre with its measures.

    vessel, standard : the ship and the manoeuvre.
    frame : the log, one row every `standard.interval` [s]: run, t, states and commands in SI units and radians.
    record : the log as a `Record`, the input of the measures.
    measures, criteria : one dict for each measure, and for each applicable criterion of IMO MSC.137(76).
    """

    vessel: Vessel
    standard: Standard
    frame: pd.DataFrame
    record: Record
    measures: list[dict[str, Any]]
    criteria: list[dict[str, Any]]


def measure_standard(
    vessel: Vessel,
    name: str,
    angles: Sequence[float] | float = (),
    *,
    speed: float | None = None,
    side: str = "starboard",
    duration: float | None = None,
    approach: str | None = None,
    engine: str = "auto",
) -> MeasuredManoeuvre:
    """Simulate a standard manoeuvre in calm deep water and compute its measures; arguments as of `define_standard`.

    engine : of the rollout; `repeated` where many vessels of one structure follow.
    approach : None: with the helm amidships; where the ship then does not go straight, a helmsman holds the course.

    Raises ShipidError as `define_standard` and `perform_manoeuvres` do.
    """
    wanted = [(name, angles, side)]
    return measure_all(vessel, wanted, speed=speed, duration=duration, approach=approach, engine=engine)[0]


def measure_all(
    vessel: Vessel,
    wanted: Sequence[tuple[str, Sequence[float] | float, str]],
    *,
    speed: float | None = None,
    duration: float | None = None,
    approach: str | None = None,
    engine: str = "auto",
) -> list[MeasuredManoeuvre]:
    """Simulate standard manoeuvres from one approach, each a name, angles [deg] and side; see `measure_standard`."""
    for given in (approach,) if approach else ("steady", "helmsman"):
        chosen = list[Standard]()
        for name, angles, side in wanted:
            n = chosen[0].manoeuvre.n_rpm * RPM if chosen else None
            chosen.append(
                define_standard(vessel, name, angles, speed=speed, side=side, duration=duration, approach=given, n=n)
            )
        runs = [
            one.manoeuvre.model_copy(update={"name": f"{one.kind}-{number + 1}"}) for number, one in enumerate(chosen)
        ]
        try:
            log = perform_manoeuvres(vessel, runs, step=chosen[0].step, interval=chosen[0].interval, engine=engine)
        except NotStraight:
            if approach is not None or given == "helmsman":
                raise
            continue
        break
    log = log[[column for column in log if not str(column).startswith(ACTUAL)]]
    return [
        _measure_log(vessel, one, log[log["run"] == run.name].reset_index(drop=True))
        for one, run in zip(chosen, runs, strict=True)
    ]


def _measure_log(vessel: Vessel, chosen: Standard, frame: pd.DataFrame) -> MeasuredManoeuvre:
    """The measures of one log."""
    columns = {str(column): frame[column].to_numpy() for column in frame if column != "run"}
    record = record_of(_limit_angles(vessel, columns), Controls(vessel).effects[1])
    measures, length = chosen.manoeuvre.measured(record), vessel.length
    judged = judge_criteria(chosen.kind, measures, length, calm=True)
    if chosen.manoeuvre.approach == "rest":
        judged = [replace(one, met=None, note=FROM_REST) for one in judged]
    else:
        remarks = [_speed_remark(vessel, chosen.speed), _thrust_remark(vessel) if chosen.kind == "stop" else ""]
        judged = [replace(one, note="; ".join(filter(None, [*remarks, one.note]))) for one in judged]
    return MeasuredManoeuvre(vessel, chosen, frame, record, measure_rows(measures, length), criterion_rows(judged))


def _speed_remark(vessel: Vessel, speed: float) -> str:
    """Whether the approach speed [m/s] is another than that of the tests, as far as U_0 says; empty near it."""
    service = vessel.document.get("particulars", {}).get("U_0", speed)
    if SLOW <= speed / service <= FAST:
        return ""
    return f"the approach is at {speed:.3g} m/s, {speed / service:.2g} times the service speed U_0"


def _thrust_remark(vessel: Vessel) -> str:
    """Which screws push astern by the polynomial of ahead, which was not measured there; empty if none does."""
    ahead = [
        path
        for path, key, block in term_blocks(vessel.document)
        if key == "thruster.propeller" and "K_T_astern" not in block
    ]
    return f"thrust astern of {', '.join(ahead)} is extrapolated: K_T is for ahead, give K_T_astern" if ahead else ""


def _limit_angles(vessel: Vessel, columns: Mapping[str, Any]) -> dict[str, Any]:
    """The columns, with every angle kept within the stops of its gear: the helm is what the gear does of an order."""
    numbers, result = vessel.parameters, dict(columns)
    for name in filter(is_steering, vessel_dynamics(vessel).commands):
        component, _, signal = name.rpartition(".")
        gear = f"thruster.{component}.actuator.{signal}"
        low, high = numbers.get(f"{gear}.low", -np.inf), numbers.get(f"{gear}.high", np.inf)
        result[name] = np.clip(result[name], low, high)
    return result


def approach_words(measured: MeasuredManoeuvre) -> str:
    """The approach in words."""
    chosen = measured.standard
    pitches = {neutral_value(name) for name in vessel_dynamics(measured.vessel).commands if signal_of(name) == "pitch"}
    shaft = ", ".join(
        [
            f"{chosen.manoeuvre.n_rpm:.4g} {Controls(measured.vessel).drive_unit}",
            *(f"P/D {pitch:g} ordered" for pitch in pitches),
        ]
    )
    if chosen.manoeuvre.approach == "rest":
        return f"from rest, {shaft}"
    held = ", held on course by a helmsman" if chosen.manoeuvre.approach == "helmsman" else ""
    return f"approach at {chosen.speed:.3g} m/s ({shaft}){held}"


def measure_trials(vessel: Vessel, speed: float | None = None) -> tuple[list[dict[str, Any]], list[str]]:
    """Criteria of IMO MSC.137(76) for a turn at 35 deg of helm and zigzags 10/10 and 20/20, one dict for each.

    Also why this vessel cannot perform some of them, one sentence a reason. `speed` [m/s] is that of the approach.
    """
    rows: list[dict[str, Any]] = []
    refused: dict[str, list[str]] = {}
    for name, angles in TRIALS:
        try:
            rows += measure_standard(vessel, name, angles, speed=speed).criteria
        except ShipidError as error:
            refused.setdefault(error.message, []).append(f"{name} {'/'.join(f'{angle:g}' for angle in angles)}")
    return rows, [f"{', '.join(names)}: {message}" for message, names in refused.items()]


def _cut_at_end(log: pd.DataFrame, measured: MeasuredManoeuvre) -> pd.DataFrame:
    """Rows up to the end of the manoeuvre itself, as its kind says."""
    ends = measured.standard.manoeuvre.ends
    known = {row["measure"]: float(row["value"]) for row in measured.measures}
    end = known["execute"] + known[ends] if ends else np.inf
    return log[: int(np.searchsorted(log["t"], end)) + 1] if np.isfinite(end) else log


def manoeuvre_content(measured: MeasuredManoeuvre, command: str = "") -> ManoeuvreContent:
    """Assemble the report page of a manoeuvre; `command` is the command line that reproduces it."""
    ship, chosen, record = measured.vessel, measured.standard, measured.record
    columns = {key: getattr(record, key) for key in ("t", "north", "east", "psi", "u", "v", "r", "helm")}
    shaft = np.zeros(len(record.t)) if record.shaft is None else record.shaft
    steady = chosen.manoeuvre.levels(record)
    return ManoeuvreContent(
        title=f"{ship.name}: {chosen.title}",
        name=chosen.kind,
        first=chosen.manoeuvre.first,
        drive_unit=Controls(ship).drive_unit,
        log=_cut_at_end(pd.DataFrame({**columns, "shaft": shaft}), measured),
        measures=pd.DataFrame(measured.measures),
        criteria=pd.DataFrame(measured.criteria),
        outline=ship_outline(ship.document["particulars"]),
        levels=pd.DataFrame({"helm": steady.helm, "rate": steady.rate}),
        provenance={
            "Vessel": f"{ship.name}, digest {ship.digest}",
            "Approach": f"{approach_words(measured)}, calm deep water, no wind",
            "Simulation": f"steps of {chosen.step:g} s, rows of {chosen.interval:g} s",
            "shipid": __version__,
        },
        command=command,
    )
