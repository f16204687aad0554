"""From the columns of a run to a record, and which standard manoeuvre it is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shipid.errors import DataError
from shipid.measures.record import DEGREE, Array, Record, helm_over

STATES = ("t", "north", "east", "psi", "u", "v", "r")
LEAST_HELM, LEAST_TURN = 3 * DEGREE, 90 * DEGREE
MOSTLY = 0.7  # of the time that a zigzag's helm is over, to either side
SHARE = 0.9  # of the greatest helm that counts as over


def record_of(columns: Mapping[str, Array]) -> Record:
    """Record of one run from the columns of a dataset.

    The helm is the mean of the angle commands that move, each with the sign that turned the ship to starboard: that of
    the integral of helm over yaw rate. The shaft is the mean of the speeds that run at first.

    Raises
    ------
    DataError : a column is missing.
    """
    missing = next((name for name in STATES if name not in columns), None)
    if missing is not None:
        raise DataError("missing column", path=missing)
    states = {name: np.asarray(columns[name], dtype=float) for name in STATES}
    angles = [np.asarray(values, dtype=float) for values in _commands(columns, (".delta", ".alpha"))]
    shafts = [np.asarray(values, dtype=float) for values in _commands(columns, (".n",))]
    helms = [sign * angle for angle in angles if (sign := _sense(angle, states["r"]))]
    running = [shaft for shaft in shafts if shaft[0] != 0]
    return Record(
        **states,
        helm=np.mean(helms, axis=0) if helms else np.zeros(len(states["t"])),
        shaft=np.mean(running, axis=0) if running else None,
    )


def _commands(columns: Mapping[str, Array], endings: tuple[str, ...]) -> list[Array]:
    return [values for name, values in columns.items() if name.count(".") == 1 and name.endswith(endings)]


def _sense(angle: Array, r: Array) -> float:
    """+1 or -1, the sign with which an angle turns the ship to starboard; 0 for one that does nothing."""
    return float(np.sign(angle[:-1] @ np.diff(r)))


def kind_of(record: Record) -> tuple[str, str]:
    """Kind of manoeuvre, a key of `MEASURES`, or an empty one and a sentence why it is none.

    A stop: the shaft turns from ahead to astern. Else by the helm, from where it is first put over: zigzag, over to
    either side in turn, at least once reversed; pull-out, over to one side, then less than a tenth of it to the end,
    which is at least a fifth of the time; turning, over to one side to the end, through 90 deg or more.
    Spirals are not recognised.
    """
    shaft = record.shaft
    if shaft is not None and shaft[0] > 0 > shaft.min():
        return "stop", ""
    start, helm, side = helm_over(record)
    if helm < LEAST_HELM:
        return "", f"the helm moves by less than {LEAST_HELM / DEGREE:g} deg, and the shafts are not reversed"
    after = record.t >= start
    share = side * record.helm[after] / helm
    starboard, port = share >= SHARE, share <= -SHARE
    if port.any():
        both = float((starboard | port).mean())
        good = both >= MOSTLY
        return ("zigzag", "") if good else ("", f"the helm is over to either side for {both:.0%} of the time only")
    psi = side * record.psi[after]
    released = int(np.flatnonzero(starboard)[-1]) + 1 if starboard.any() else 0
    held = float(starboard[:released].mean()) if released else 0.0
    if held >= MOSTLY and released >= SHARE * len(share):
        turned = float(psi[-1] - psi[0])
        return (
            ("turning", "")
            if turned >= LEAST_TURN
            else ("", "the helm is held, but the ship turns by less than 90 deg")
        )
    if held >= MOSTLY and released <= 0.8 * len(share) and float((np.abs(share[released:]) < 0.1).mean()) >= SHARE:
        return "pull-out", ""
    return "", "the helm is neither held to one side nor put over to either side in turn"
