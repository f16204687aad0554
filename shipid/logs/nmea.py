"""NMEA 0183: sentences as rows, with the times of their fixes or those before them."""

from __future__ import annotations

import bisect
import math
import re
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.dates import DAY, HALF_DAY, NEXT_DAY
from shipid.logs.foreign import refuse_foreign
from shipid.logs.formats import LOOKED_AT, NmeaFormat
from shipid.units import KNOT

FIRST_DAY = datetime(1970, 1, 1).toordinal()
LATE_DATE = 60.0  # s after midnight: so long a receiver may write the date of the day before
_DOTTED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})")
_DATED = re.compile(r"\d{4}([-/]?)\d\d\1\d\d")
_TAG_TIME = re.compile(r"[\\,]c:(\d+)")
_SENTENCE = re.compile(r"\$[A-Z]{2}[A-Z]{3},")


def read_nmea(file: Path, form: NmeaFormat, _: str) -> pd.DataFrame:
    """Return sentences as rows: `time` [s] and the columns of `SENTENCES`, NaN where a sentence has no value."""
    import pynmea2

    refuse_foreign(file)
    rows: list[dict[str, float]] = []
    unreadable, clock = 0, _Clock()
    for number, line in enumerate(file.read_bytes().decode("latin-1").splitlines(), start=1):
        stamp, dollar, body = line.partition("$")
        if not line.strip():
            continue
        try:
            sentence = pynmea2.parse(dollar + body.strip(), check=True) if dollar else None
            values = _values_of(sentence)
        except (pynmea2.ParseError, ValueError, TypeError, AttributeError, IndexError):
            sentence = None
        if sentence is None:
            unreadable += 1
            continue
        if form.time == "line":
            try:
                rows.append({"time": _stamp(stamp), **values})
            except ValueError as error:
                message = f"{error}: set [format] time = 'fix'"
                raise DataError(message, file=file, path=f"row {number}") from None
            continue
        clock.read(sentence)
        if clock.fixes:  # before the first fix the time is unknown
            rows.append({"time": len(clock.fixes) - 1, **values})
    if not rows:
        message = f"no NMEA 0183 sentence with a time in {unreadable} unreadable lines: set [format] kind or time"
        raise DataError(message, file=file, path="format.kind")
    table = pd.DataFrame(rows).reindex(columns=["time", *NMEA_COLUMNS])
    if form.time == "fix":
        table["time"] = clock.times()[table["time"]]
    again = table["time"].ne(table["time"].shift()).cumsum()  # sentences of one instant are one row
    table = table.groupby(again).first().reset_index(drop=True)
    table.attrs["unreadable"] = unreadable
    return table


class _Clock:
    """Times of fixes: seconds since 1970, by the dates of RMC and ZDA, or since the midnight before the first fix.

    A fix without a date is of the day of that one before or behind it whose time of day is nearer. Without any date
    a time of day that goes back by twelve hours is of the next day.
    """

    def __init__(self) -> None:
        self.fixes: list[tuple[float, int | None]] = []  # s of the day, and day

    def read(self, sentence: Any) -> None:
        """Add the fix of a sentence that has one."""
        time: Any = getattr(sentence, "timestamp", None)
        if hasattr(time, "hour"):
            seconds = 3600.0 * time.hour + 60.0 * time.minute + time.second + 1e-6 * time.microsecond
            self.fixes.append((seconds, _day_of(sentence)))

    def times(self) -> Array:
        """Return the times (N,) [s] of the fixes."""
        since = np.array([seconds for seconds, _ in self.fixes])
        known = [place for place, (_, day) in enumerate(self.fixes) if day is not None]
        if not known:
            return np.asarray(since + DAY * np.cumsum(np.diff(since, prepend=since[:1]) < -HALF_DAY))
        days = [self._day(place, known) for place in range(len(since))]
        result = since + DAY * (np.array(days) - FIRST_DAY)
        for place in np.flatnonzero(since < LATE_DATE):
            if place and 0.0 <= result[place] + DAY - result[place - 1] < NEXT_DAY:  # the date is of the day before
                result[place] += DAY
        return np.asarray(result)

    def _day(self, place: int, known: list[int]) -> int:
        """Day of a fix, where those at the places `known` say theirs."""
        now, day = self.fixes[place]
        if day is not None:
            return day
        behind = bisect.bisect_left(known, place)
        near = [self.fixes[one] for one in known[max(0, behind - 1) : behind + 1]]
        apart = [(now - seconds + HALF_DAY) % DAY - HALF_DAY for seconds, _ in near]
        nearest = int(np.argmin(np.abs(apart)))
        seconds, day = near[nearest]
        return int(day or 0) + round((seconds + apart[nearest] - now) / DAY)


def _day_of(sentence: Any) -> int | None:
    """Day of a valid RMC or ZDA, None of another sentence and of one without a date."""
    kind = getattr(sentence, "sentence_type", "")
    if kind not in ("RMC", "ZDA") or getattr(sentence, "status", "A") == "V":
        return None
    try:
        return int(sentence.datestamp.toordinal())
    except (AttributeError, TypeError, ValueError):
        return None


def _stamp(text: str) -> float:
    """Time before a sentence: a number, a date as seconds since 1970, or the time of an NMEA 4.10 TAG block.

    Dates are year-month-day, or day.month.year with dots. ValueError where it is none, or a date that may be two days.
    """
    words = text.strip().rstrip(",;")
    if words.startswith("\\"):
        tag = _TAG_TIME.search(words)
        if tag is None:
            raise ValueError("no time in the TAG block before the sentence")
        return float(tag[1]) / (1000.0 if len(tag[1]) > 11 else 1.0)  # some write milliseconds
    try:
        return float(words)
    except ValueError:
        pass
    shown = repr(words[:30])
    if _DOTTED.match(words):
        words = _DOTTED.sub(r"\3-\2-\1", words)
    elif not _DATED.match(words):
        raise ValueError(f"no number and no date year-month-day before the sentence ({shown})")
    try:
        moment = pd.Timestamp(words)
        return (moment if moment.tzinfo else moment.tz_localize("UTC")).timestamp()
    except (ValueError, AttributeError):
        raise ValueError(f"no number and no date before the sentence ({shown})") from None


def _is_stamp(text: str) -> bool:
    try:
        return math.isfinite(_stamp(text))
    except ValueError:
        return False


def _values_of(sentence: Any) -> dict[str, float]:
    """Return the values of a sentence by column; none of an invalid one (status V; GGA: quality 0; VTG: mode N)."""
    kind = getattr(sentence, "sentence_type", "")
    if getattr(sentence, "status", "A") == "V" or str(getattr(sentence, "gps_qual", 1)) == "0":
        return {}
    if kind == "VTG" and getattr(sentence, "faa_mode", None) == "N":
        return {}
    values = {name: read(sentence) for name, read in SENTENCES.get(kind, {}).items()}
    return {name: float(value) for name, value in values.items() if value not in (None, "")}


def _position(name: str) -> Callable[[Any], Any]:
    """Return the position in decimal degrees; nothing where the field is empty (the parser would return 0)."""
    return lambda sentence: getattr(sentence, name) if getattr(sentence, name[:3]) else None


def _apparent(name: str) -> Callable[[Any], Any]:
    return lambda sentence: getattr(sentence, name) if sentence.reference == "R" else None


def _turns(sentence: Any, source: str) -> str | None:
    """Number of the shaft (source S) or engine (E) whose speed a sentence has; None where it is of the other kind."""
    return str(sentence.engine_no) if sentence.source == source else None


def _revolutions(source: str, *numbers: str) -> Callable[[Any], Any]:
    return lambda sentence: sentence.speed if _turns(sentence, source) in numbers else None


def _rudder(side: str) -> Callable[[Any], Any]:
    """Return the angle of the rudder of a side; nothing where its status says that it is invalid."""
    return lambda s: None if getattr(s, f"rsa_{side}_status", "A") == "V" else getattr(s, f"rsa_{side}")


def _speed(sentence: Any) -> Any:
    """Return the apparent wind speed [m/s] from a value in N (knots), K (km/h) or M (m/s)."""
    if sentence.reference != "R" or not sentence.wind_speed:
        return None
    factor = {"N": KNOT, "K": 1.0 / 3.6, "M": 1.0}.get(sentence.wind_speed_units)
    return None if factor is None else float(sentence.wind_speed) * factor


def _true_wind(sentence: Any) -> Any:
    """Return the true wind speed [m/s], which a sentence has in m/s, in knots or in both."""
    if sentence.wind_speed_meters in (None, "") and sentence.wind_speed_knots:
        return float(sentence.wind_speed_knots) * KNOT
    return sentence.wind_speed_meters


SENTENCES: dict[str, dict[str, Callable[[Any], Any]]] = {
    "GGA": {"latitude": _position("latitude"), "longitude": _position("longitude")},
    "GLL": {"latitude": _position("latitude"), "longitude": _position("longitude")},
    "RMC": {
        "latitude": _position("latitude"),
        "longitude": _position("longitude"),
        "sog": lambda s: s.spd_over_grnd,
        "cog": lambda s: s.true_course,
    },
    "VTG": {"sog": lambda s: s.spd_over_grnd_kts, "cog": lambda s: s.true_track},
    "HDT": {"heading": lambda s: s.heading},
    "ROT": {"rot": lambda s: s.rate_of_turn},
    "RSA": {"rudder": _rudder("starboard"), "rudder_port": _rudder("port")},
    "RPM": {
        "rpm": _revolutions("S", "0", "1"),
        "rpm_2": _revolutions("S", "2"),
        "engine_rpm": _revolutions("E", "0", "1"),
        "engine_rpm_2": _revolutions("E", "2"),
    },
    "MWV": {"apparent_angle": _apparent("wind_angle"), "apparent_speed": _speed},
    "MWD": {"wind_from": lambda s: s.direction_true, "wind_speed": _true_wind},
}
"""Sentence -> column -> how it is read: deg; rot deg/min; sog kn; rpm; wind speeds m/s."""
NMEA_COLUMNS = tuple(dict.fromkeys(name for columns in SENTENCES.values() for name in columns))


def is_nmea(_: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise NMEA 0183: most lines are sentences; the time is before them, or in the position fixes."""
    if b"\0" in head:
        return None
    lines = [line for line in head.decode("latin-1").splitlines()[:LOOKED_AT] if line.strip()]
    sentences = [line for line in lines if _SENTENCE.search(line)]
    if len(sentences) <= len(lines) / 2:
        return None
    stamped = sum(_is_stamp(line.partition("$")[0]) for line in sentences)
    return {"kind": "nmea", "time": "line" if stamped > len(sentences) / 2 else "fix"}
