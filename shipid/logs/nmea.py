"""NMEA 0183: sentences as rows, with the times of their fixes or those before them. pynmea2 reads the sentences."""

from __future__ import annotations

import functools
import io
import math
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pynmea2
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.dates import COMPACT, DAY, HALF_DAY, NEXT_DAY, over_midnights, parse_dates
from shipid.logs.formats import LOOKED_AT, NmeaFormat
from shipid.units import KNOT

KMH, KMH_IN_KNOTS = 1.0 / 3.6, 1.0 / 1.852
LATE_DATE = 60.0  # s after midnight: so long a receiver may write the date of the day before
SILENT = 1.5  # usual steps of a talker: where it says nothing for longer, another one may speak for it
SAID = 100_000  # lines, after which it is said how far the log is read
_CHECKED = re.compile(r"\*[0-9A-F]{2}\W*$", re.IGNORECASE)
_TAG_TIME = r"[\\,]c:(\d+)"
_STAMP_DATE = r"\d{4}([-/]?)\d\d\1\d\d|\d\d?\.\d\d?\.\d{4}"  # not 06/05: it may be two days
_BEGIN = re.compile(r"[$!]([A-Z][A-Z0-9]{3,7}),")
Said = Iterator[tuple[str, Any]]
_ADDRESS = re.compile(r"(!?[A-Z][A-Z0-9]{3,7}),", re.IGNORECASE)


class THS(pynmea2.TalkerSentence):  # type: ignore[misc]
    """True heading with its status, which pynmea2 does not know (IEC 61162-1)."""

    fields = (("Heading", "heading"), ("Status", "status"))


@dataclass(frozen=True)
class Sentence:
    """What a kind of sentence says.

    columns : column -> names of fields that say it, the first that is filled, and the factor to the column's unit.
    invalid : name of the field of its status, and the letters by which it calls itself invalid. fix : whether it has a
    position. more : what a formula says of it.
    """

    columns: dict[str, dict[str, float]] = field(default_factory=dict)
    invalid: tuple[str, str] = ("", "")
    fix: bool = False
    more: Callable[[Any], Said] = lambda _: iter(())


def _rudders(said: Any) -> Said:
    for name, side in (("rudder", "starboard"), ("rudder_port", "port")):
        if getattr(said, f"rsa_{side}_status") != "V":
            yield name, getattr(said, f"rsa_{side}")


def _shafts(said: Any) -> Said:
    """Shafts (S) and engines (E) by their number: 0 is that of the middle, odd ones are to starboard."""
    if said.source in ("S", "E"):
        number = "" if said.engine_no == 1 else f"_{said.engine_no or 0}"
        yield f"{'rpm' if said.source == 'S' else 'engine_rpm'}{number}", said.speed


def _apparent_wind(said: Any) -> Said:
    """The apparent wind (reference R), its speed in knots (N), km/h (K) or m/s (M)."""
    if said.reference == "R":
        yield "apparent_angle", said.wind_angle
        factor = {"N": KNOT, "K": KMH, "M": 1.0}.get(said.wind_speed_units)
        yield "apparent_speed", float(said.wind_speed) * factor if said.wind_speed is not None and factor else None


def _compass(said: Any) -> Said:
    """Heading of a compass plus its deviation; true where the variation is said, too: east is positive."""
    if said.heading is not None:
        off = [
            float(size or 0.0) * (-1.0 if side == "W" else 1.0)
            for size, side in ((said.deviation, said.dev_dir), (said.variation, said.var_dir))
        ]
        name = "heading_magnetic" if said.variation is None else "heading_compass"
        yield name, (float(said.heading) + sum(off)) % 360.0


SENTENCES = {
    "GGA": Sentence(invalid=("gps_qual", "0"), fix=True),
    "GNS": Sentence(invalid=("mode_indicator", "N"), fix=True),  # a letter for each system
    "GLL": Sentence(invalid=("status", "V"), fix=True),
    "RMC": Sentence({"sog": {"spd_over_grnd": 1.0}, "cog": {"true_course": 1.0}}, ("status", "V"), fix=True),
    "ZDA": Sentence(),
    "VTG": Sentence(
        {"cog": {"true_track": 1.0}, "sog": {"spd_over_grnd_kts": 1.0, "spd_over_grnd_kmph": KMH_IN_KNOTS}},
        ("faa_mode", "N"),
    ),
    "HDT": Sentence({"heading": {"heading": 1.0}}),
    "THS": Sentence({"heading": {"heading": 1.0}}, ("status", "V")),
    "HDG": Sentence(more=_compass),
    "HDM": Sentence({"heading_magnetic": {"heading": 1.0}}),
    "VHW": Sentence(
        {
            "heading_log": {"heading_true": 1.0},
            "heading_magnetic": {"heading_magnetic": 1.0},
            "stw": {"water_speed_knots": 1.0, "water_speed_km": KMH_IN_KNOTS},
        }
    ),
    "ROT": Sentence({"rot": {"rate_of_turn": 1.0}}, ("status", "V")),
    "RSA": Sentence(more=_rudders),
    "RPM": Sentence(invalid=("status", "V"), more=_shafts),
    "MWV": Sentence(invalid=("status", "V"), more=_apparent_wind),
    "MWD": Sentence(
        {"wind_from": {"direction_true": 1.0}, "wind_speed": {"wind_speed_meters": 1.0, "wind_speed_knots": KNOT}}
    ),
}
"""Kind of a sentence -> what it says: deg; rot deg/min; sog and stw kn; rpm; wind speeds m/s.

`heading` is that of a gyro or of satellites, `heading_compass` of a compass with its deviation and variation,
`heading_log` that of a log in its sentence of speed.
"""
NMEA_COLUMNS = (
    *("latitude", "longitude", "sog", "cog", "heading", "rot", "rudder", "rudder_port"),
    *("rpm", "rpm_2", "engine_rpm", "engine_rpm_2"),
    *("apparent_angle", "apparent_speed", "wind_from", "wind_speed"),
)
"""Columns of every log; other headings, shafts and engines of other numbers have further ones."""


def sentence_values(said: Any) -> dict[str, float]:
    """Column -> value of a sentence, none of one that calls itself invalid; ValueError where one is no number."""
    kind = SENTENCES[said.sentence_type]
    status, letters = kind.invalid
    given = str(getattr(said, status)) if status else ""
    if given and not given.strip(letters):
        return {}
    values = dict(kind.more(said))
    for name, fields in kind.columns.items():
        filled = ((getattr(said, one), factor) for one, factor in fields.items())
        values |= next(({name: float(text) * factor} for text, factor in filled if text not in (None, "")), {})
    if kind.fix:
        values |= dict(_position(said))
    return {name: float(value) for name, value in values.items() if value not in (None, "")}


def _position(said: Any) -> Iterator[tuple[str, float]]:
    """Latitude and longitude [deg]; nothing where they are empty: pynmea2 puts a position without its side at 0."""
    for name, text, side, sides in (
        ("latitude", said.lat, said.lat_dir, "NS"),
        ("longitude", said.lon, said.lon_dir, "EW"),
    ):
        if text or side:
            degrees, minutes = divmod(float(text), 100.0)
            if minutes >= 60.0 or side not in tuple(sides):
                raise ValueError(f"{text!r}, {side!r} is no {name}")
            yield name, (degrees + minutes / 60.0) * (1.0 if side == sides[0] else -1.0)


def sentence_moment(said: Any) -> tuple[float, float]:
    """Time of day [s] and number of the day since 1970 that a fix or ZDA says, NaN where it says none.

    ValueError where the time is none of any day.
    """
    kind, place = said.sentence_type, type(said).name_to_idx.get("timestamp", -1)
    dated = kind == "ZDA"
    text = said.data[place] if (SENTENCES[kind].fix or dated) and 0 <= place < len(said.data) else ""
    if not text:
        return math.nan, math.nan
    hour, minute, second = int(text[:2]), int(text[2:4]), float(text[4:])
    if not (0 <= hour < 24 and 0 <= minute < 60 and 0.0 <= second < 61.0):  # 60: a leap second
        raise ValueError(f"{text!r} is no time of day")
    day = "".join((*(one.zfill(2) for one in said.data[1:3]), said.data[3][-2:])) if dated else ""
    day = said.data[8] if kind == "RMC" and said.status != "V" and len(said.data) > 8 else day
    return 3600.0 * hour + 60.0 * minute + second, _day_number(day)


@functools.cache
def _day_number(text: str) -> float:
    """Number of the day DDMMYY, of 1969 to 2068, since 1970; NaN where it is none."""
    day = pd.to_datetime(pd.Series([text]), format="%d%m%y", errors="coerce") - pd.Timestamp(0)
    return float(day.dt.days.iloc[0])


def read_nmea(file: Path, form: NmeaFormat, _: object, progress: Callable[[float], None] | None = None) -> pd.DataFrame:
    """Sentences as rows: `time` [s] and columns of their values, NaN where a sentence has no value.

    The talker who says a column most often has it; others have columns with their letters, such as `heading_GP`.
    `attrs["unreadable"]` counts lines that are no sentence or fail their checksum.
    progress : called with the share of a long log that has been read, 0 to 1.
    """
    size, stamped, heard = file.stat().st_size, form.time == "line", _Heard()
    with file.open("rb") as raw, io.TextIOWrapper(raw, encoding="latin-1") as stream:
        checked = any(_CHECKED.search(line) for line in islice(stream, LOOKED_AT))
        stream.seek(0)
        for number, line in enumerate(stream, start=1):
            if progress is not None and number % SAID == 0:
                progress(raw.tell() / size)
            heard.hear(line, number, checked, stamped)
    times = stamp_times([stamp for stamp, _ in heard.instants]) if stamped else _fix_times(heard.instants)
    lost = np.flatnonzero(np.isnan(times))
    if stamped and len(lost):
        stamp, number = heard.instants[lost[0]]
        shown = f"no number and no date year-month-day before the sentence ({stamp[:30]!r})"
        raise DataError(f"{shown}: set [format] time = 'fix'", file=file, path=f"row {number}")
    if not heard.said:
        raise DataError(heard.nothing(), file=file, path="format.kind")
    table = _rows_of_times(heard.said, times)
    table.attrs |= {"unreadable": heard.unreadable, "notes": list(heard.notes(table))}
    return table


@dataclass
class _Heard:
    """What the lines of a log say.

    instants : of stamped lines stamp and number of the line, else time of day [s], day, talker of a position, else
    empty, of a fix. said : column -> values, places of their instants, talkers, in the order of the log.
    """

    instants: list[tuple[Any, ...]] = field(default_factory=list)
    said: dict[str, list[tuple[float, int, str]]] = field(default_factory=lambda: defaultdict(list))
    unreadable: int = 0
    unread: Counter[str] = field(default_factory=Counter)

    def hear(self, line: str, number: int, checked: bool, stamped: bool) -> None:
        """Take a line in; `checked` where a sentence needs its checksum."""
        stamp, _, body = line.partition("$")
        address = _ADDRESS.match(body or line)
        kind = "" if address is None else address[1].upper() if address[1][0] in "Pp!" else address[1][2:].upper()
        if kind and kind not in SENTENCES and (not body or _CHECKED.search(body) or not checked):
            self.unread[kind.lstrip("!")] += 1
            return
        try:
            sentence = pynmea2.parse(body, check=checked)
            values, (time, day) = sentence_values(sentence), sentence_moment(sentence)
        except (ValueError, KeyError, AttributeError):
            self.unreadable += not line.isspace()
            return
        if stamped and values:
            self.instants.append((stamp, number))
        elif not stamped and not math.isnan(time) and (values or sentence.sentence_type == "ZDA"):
            self.instants.append((time, day, sentence.talker if "latitude" in values else ""))
        for name, value in values.items() if self.instants else ():  # before the first fix the time is unknown
            self.said[name].append((value, len(self.instants) - 1, sentence.talker))

    def notes(self, table: pd.DataFrame) -> Iterator[str]:
        """Yield sentences on what of the log is not in the usual columns."""
        if self.unread:
            kinds = ", ".join(f"{kind} ({count})" for kind, count in self.unread.most_common())
            yield f"sentences of these kinds are not read: {kinds}"
        for name in table.columns:
            first, _, talker = name.rpartition("_")
            if first in table and talker.isupper():
                yield f"{first!r} is said by several talkers: {name!r} is that of {talker}"

    def nothing(self) -> str:
        """Say why no row is there."""
        others = "".join(f", {kind}" for kind, _ in self.unread.most_common(5))
        message = f"no sentence with a time and a value ({self.unreadable} unreadable lines{others})"
        return (
            f"{message}: set [format] kind or time; decode messages of AIS, and write a CSV with the rows of one ship"
        )


def _rows_of_times(said: dict[str, list[tuple[float, int, str]]], times: Array) -> pd.DataFrame:
    """The rows: what is said at one of the times (N,) [s] is in one, of a column what is said first."""
    columns: dict[str, pd.Series[float]] = {}
    for name, entries in said.items():
        frame = pd.DataFrame(entries, columns=["value", "place", "talker"])
        frame["time"] = times[frame["place"]]
        main = _from_main_talker(frame["time"].to_numpy(), (frame["talker"] == frame["talker"].mode()[0]).to_numpy())
        for talker, part in frame.groupby(np.where(main, "", "_" + frame["talker"]), sort=False):
            columns[f"{name}{talker}"] = part.drop_duplicates("place").set_index("place")["value"]
    for name in ("rpm", "engine_rpm"):  # a single shaft has the number 0 or 1
        if name not in columns and f"{name}_0" in columns:
            columns[name] = columns.pop(f"{name}_0")
    table = pd.DataFrame(columns).reindex(np.arange(len(times)))
    known = np.isfinite(times)
    rows = np.cumsum(times != np.append(np.nan, times[:-1]))[known]
    table = table[known].groupby(rows).first().assign(time=times[known][np.diff(rows, prepend=-1) > 0])
    return table.reindex(columns=list(dict.fromkeys(["time", *NMEA_COLUMNS, *sorted(columns)]))).reset_index(drop=True)


def _from_main_talker(t: Array, main: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether what was said at t (N,) [s, also of the day] is of a main talker, or said while that is silent."""
    places = np.flatnonzero(main)
    steps = _time_gap(t[places][1:], t[places][:-1])
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    behind = np.searchsorted(places, np.arange(len(t)))
    first, last = np.maximum(behind - 1, 0), np.minimum(behind, len(places) - 1)
    before, after = np.where(behind > 0, t[places[first]], t), np.where(behind < len(places), t[places[last]], t)
    inside = (behind > 0) & (behind < len(places))  # else half of the gap is in the log
    return np.asarray(main | (_time_gap(after, before) * np.where(inside, 1.0, 2.0) > SILENT * usual))


def _time_gap(after: Array, before: Array) -> Array:
    """How far times (N,) [s] are apart, over midnight, too."""
    return np.asarray(np.abs((after - before + HALF_DAY) % DAY - HALF_DAY))


def _fix_times(moments: list[tuple[Any, ...]]) -> Array:
    """Times (N,) [s] of fixes since 1970, or since the midnight before the first where none says its day.

    One of another talker than most has that of the fix before, or NaN.
    """
    fixes = pd.DataFrame(moments, columns=["time", "day", "talker"])
    since, talkers = fixes["time"].to_numpy(dtype=float), fixes["talker"]
    first = (talkers == next(iter(talkers[talkers != ""].mode()), "")).to_numpy()
    begins = since == fixes["time"].where(first).bfill()  # an instant may begin with another
    kept = _from_main_talker(since, first) | begins
    t = pd.Series(_dated_times(since, fixes["day"], kept), fixes.index[kept])
    return np.asarray(t.reindex(fixes.index).ffill(), dtype=np.float64)


def _dated_times(since: Array, days: pd.Series[float], kept: NDArray[np.bool_]) -> Array:
    """Times (M,) [s] of the fixes kept (N,) at times of day (N,) [s]; one without its day is near the next that has.

    Without any day a time that goes back is of the next day.
    """
    if days.isna().all():
        return over_midnights(since[kept])
    places = pd.Series(np.arange(len(since)), dtype=float).where(days.notna())
    refs = [places.ffill().bfill().astype(int).to_numpy(), places.bfill().ffill().astype(int).to_numpy()]
    apart = [(since - since[ref] + HALF_DAY) % DAY - HALF_DAY for ref in refs]
    near = np.abs(apart[0]) <= np.abs(apart[1])
    t = (DAY * days.to_numpy()[np.where(near, *refs)] + since[np.where(near, *refs)] + np.where(near, *apart))[kept]
    late = t + DAY - np.maximum.accumulate(t)
    return np.asarray(t + DAY * ((since[kept] < LATE_DATE) & (late >= 0.0) & (late < NEXT_DAY)))  # of the day before


def stamp_times(stamps: list[str]) -> Array:
    """Times (N,) [s] before sentences: numbers, dates as since 1970, times of NMEA 4.10 TAG blocks; NaN of others."""
    words = pd.Series(stamps, dtype="string").str.strip().str.rstrip(",;")
    tags = words.str.extract(_TAG_TIME)[0].astype("Float64")
    tags = tags.where(tags < 1e11, tags / 1000.0)  # some write milliseconds
    numbers = pd.to_numeric(
        words.mask(words.str.fullmatch(COMPACT)), errors="coerce"
    )  # 20240514080000 is a number, too
    dates = parse_dates(
        words.where(words.str.match(_STAMP_DATE) & numbers.isna()).str.replace(r"[;,]", " ", regex=True).astype(object)
    )
    return np.asarray(tags.fillna(numbers).fillna(pd.Series(dates)).to_numpy(dtype=float, na_value=np.nan))


def is_nmea(_: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise NMEA 0183: most lines are sentences; the time is before them, or in the position fixes."""
    if b"\0" in head:
        return None
    lines = [line for line in head.decode("latin-1").splitlines()[:LOOKED_AT] if line.strip()]
    sentences = [line for line in lines if _BEGIN.search(line)]
    if len(sentences) <= len(lines) / 2:
        return None
    stamps = [stamp for stamp, dollar, _ in (line.partition("$") for line in sentences) if dollar]
    return {"kind": "nmea", "time": "line" if np.isfinite(stamp_times(stamps)).sum() > len(stamps) / 2 else "fix"}
