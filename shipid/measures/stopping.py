"""The crash stop (MSC.137(76); MSC/Circ.1053)."""

from __future__ import annotations

import numpy as np

from shipid.measures.record import (
    NAN,
    Measures,
    Record,
    cubic_value_at,
    integral_between,
    start_of_change,
    time_of_crossing,
)


def stopping_measures(record: Record) -> Measures:
    """Measures of a stop, from the order astern until the ship no longer moves ahead.

    Returns
    -------
    Measures : `execute`, instant of the order [s]; `approach_speed` [m/s]; `stopping_time` [s]; `track_reach` along the
        path, `head_reach` along the heading at the order, `lateral_deviation` to starboard of it [m]; `heading_change`
        [rad], > 0 to starboard.
    """
    t, measures, never = record.t, Measures(), "the shaft is not ordered to stop or astern"
    astern = np.flatnonzero(record.shaft <= 0) if record.shaft is not None else np.empty(0, dtype=int)
    start = NAN
    if record.shaft is not None and len(astern):
        start = start_of_change(t, record.shaft, int(astern[0])) if astern[0] else float(t[0])
    ahead, aside = record.along(start)
    end = time_of_crossing(t, record.u, 0.0, start, rising=False)
    ordered = bool(np.isfinite(start))
    before = float(np.interp(start, t, record.speed)) if ordered else NAN
    measures.add(never, execute=(start, "s"), approach_speed=(before, "m/s"))
    measures.add(
        "the ship still moves ahead when the log ends" if ordered else never,
        stopping_time=(end - start, "s"),
        track_reach=(integral_between(t, record.speed, start, end), "m"),
        head_reach=(cubic_value_at(t, ahead, end), "m"),
        lateral_deviation=(cubic_value_at(t, aside, end), "m"),
        heading_change=(cubic_value_at(t, record.psi, end) - cubic_value_at(t, record.psi, start), "rad"),
    )
    return measures
