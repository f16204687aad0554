"""NMEA 0183: sentences as rows, with the times of their fixes or those before them."""

from __future__ import annotations

import bisect
import io
import math
import re
from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.dates import COMPACT, DAY, HALF_DAY, NEXT_DAY, WEEKS
from shipid.logs.foreign import refuse_foreign
from shipid.logs.formats import LOOKED_AT, NmeaFormat
from shipid.logs.sentences import NMEA_COLUMNS, SENTENCES, TIMES, has_checksum, parse_sentence

FIRST_DAY = datetime(1970, 1, 1).toordinal()
LATE_DATE = 60.0  # s after midnight: so long a receiver may write the date of the day before
LONG_LOG = 31  # days: dates of one log are no farther apart
SILENT = 1.5  # usual steps of a talker: where it says nothing for longer, another one may speak for it
SAID = 100_000  # lines, after which it is said how far the log is read
_DOTTED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})")
_DATED = re.compile(r"\d{4}([-/]?)\d\d\1\d\d")
_TAG_TIME = re.compile(r"[\\,]c:(\d+)")
_BEGIN = re.compile(r"[$!]([A-Z][A-Z0-9]{3,7}),")


def read_nmea(file: Path, form: NmeaFormat, _: str, progress: Callable[[float], None] | None = None) -> pd.DataFrame:
    """Sentences as rows: `time` [s] and columns of their values, NaN where a sentence has no value.

    The talker who says a column most often has it; others have columns with their letters, such as `heading_GP`.
    `attrs["unreadable"]` counts lines that are no sentence or fail their checksum.
    progress : called with the share of a long log that has been read, 0 to 1.
    """
    refuse_foreign(file)
    size = file.stat().st_size
    heard = _Heard(form.time == "line")
    with file.open("rb") as raw, io.TextIOWrapper(raw, encoding="latin-1") as stream:
        heard.checked = any(has_checksum(line.partition("$")[2]) for line in islice(stream, LOOKED_AT))
        stream.seek(0)
        for number, line in enumerate(stream, start=1):
            if progress is not None and number % SAID == 0:
                progress(raw.tell() / size)
            try:
                heard.hear(line)
            except ValueError as error:
                raise DataError(f"{error}: set [format] time = 'fix'", file=file, path=f"row {number}") from None
    if not heard.said:
        raise DataError(heard.nothing(), file=file, path="format.kind")
    table = heard.table()
    table.attrs |= {"unreadable": heard.unreadable, "notes": list(heard.notes(table))}
    return table


class _Heard:
    """What the lines of a log say. stamped : whether each line begins with its time; else fixes say the time.

    said : column -> values, their places among the times, and their talkers, in the order of the log.
    """

    def __init__(self, stamped: bool) -> None:
        self.stamped, self.checked = stamped, True
        self.clock, self.stamps = _Clock(), array("d")
        self.said: dict[str, tuple[array[float], array[int], list[str]]] = defaultdict(
            lambda: (array("d"), array("q"), [])
        )
        self.unreadable, self.unread = 0, Counter[str]()

    def hear(self, line: str) -> None:
        """Take a line in; ValueError where no time is before a sentence that needs one."""
        stamp, dollar, body = line.partition("$")
        sentence = parse_sentence(body, self.checked) if dollar else None
        if sentence is None:
            other = None if dollar else _BEGIN.match(line)
            self.unread.update([other[1]] if other else ())
            self.unreadable += int(other is None and not line.isspace())
            return
        if sentence.kind not in SENTENCES and sentence.kind not in TIMES:
            self.unread[sentence.kind] += 1
            return
        try:
            values, time = sentence.values(), sentence.time()
        except ValueError:
            self.unreadable += 1
            return
        if self.stamped and values:
            self.stamps.append(_sentence_time(stamp))
        elif time is not None and (values or sentence.kind == "ZDA"):
            self.clock.add(sentence.talker, time, sentence.day(), "latitude" in values)
        place = len(self.stamps if self.stamped else self.clock.seconds) - 1
        for name, value in values.items() if place >= 0 else ():  # before the first fix the time is unknown
            values_of, places, talkers = self.said[name]
            values_of.append(value)
            places.append(place)
            talkers.append(sentence.talker)

    def table(self) -> pd.DataFrame:
        """The rows: what is said at one time is in one, of a column what is said first."""
        times = np.array(self.stamps) if self.stamped else self.clock.times()
        known = np.isfinite(times)
        new = known & (times != np.append(np.nan, times[:-1]))
        row = np.cumsum(new) - 1
        columns: dict[str, Array] = {}
        for name, (values, at, talkers) in self.said.items():
            places = np.array(at)
            for column, those in _by_talker(name, times[places], np.array(talkers)):
                those = those[known[places[those]]][::-1]
                columns[column] = np.full(int(new.sum()), np.nan)
                columns[column][row[places[those]]] = np.array(values)[those]
        for name in ("rpm", "engine_rpm"):  # a single shaft has the number 0 or 1
            if name not in columns and f"{name}_0" in columns:
                columns[name] = columns.pop(f"{name}_0")
        order = [*NMEA_COLUMNS, *sorted(columns.keys() - {*NMEA_COLUMNS})]
        return pd.DataFrame({"time": times[new], **columns}).reindex(columns=["time", *order])

    def notes(self, table: pd.DataFrame) -> Iterator[str]:
        """Yield sentences on what of the log is not in the usual columns."""
        if self.unread:
            kinds = ", ".join(f"{kind} ({count})" for kind, count in self.unread.most_common())
            yield f"sentences of these kinds are not read: {kinds}"
        for name in table.columns:
            first, _, talker = name.rpartition("_")
            if first in NMEA_COLUMNS and talker.isupper():
                yield f"{first!r} is said by several talkers: {name!r} is that of {talker}"
        if self.clock.rolled:
            words = f"{self.clock.rolled} dates are 1,024 weeks before the last one"
            yield f"{words}, as the week number of a receiver rolled over: they are read as that much later"

    def nothing(self) -> str:
        """Say why no row is there."""
        kinds = ", ".join(kind for kind, _ in self.unread.most_common(5))
        if self.unread and all(kind.endswith(("VDM", "VDO")) for kind in self.unread):
            return f"messages of AIS alone ({kinds}), not read: decode them, and write a CSV with the rows of one ship"
        others = f", and its sentences are of other kinds: {kinds}" if self.unread else ""
        message = f"no sentence with a time and a value ({self.unreadable} unreadable lines{others})"
        return f"{message}: set [format] kind or time"


def _by_talker(name: str, t: Array, talkers: NDArray[np.str_]) -> Iterator[tuple[str, NDArray[np.int_]]]:
    """Yield the columns of what was said at t (N,) [s] by talkers (N,) of one column, and which of it they have."""
    counts = Counter(talkers.tolist())
    main = _from_main_talker(t, talkers == counts.most_common(1)[0][0])
    yield name, np.flatnonzero(main)
    for talker in counts:
        those = np.flatnonzero((talkers == talker) & ~main)
        if len(those):
            yield f"{name}_{talker}", those


def _from_main_talker(t: Array, main: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether what was said at t (N,) [s, also of the day] is of a main talker, or said while that is silent."""
    places = np.flatnonzero(main)
    steps = _time_gap(t[places][1:], t[places][:-1])
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    behind = np.searchsorted(places, np.arange(len(t)))
    first, last = np.maximum(behind - 1, 0), np.minimum(behind, len(places) - 1)
    before, after = np.where(behind > 0, t[places[first]], t), np.where(behind < len(places), t[places[last]], t)
    gap = _time_gap(after, before) * np.where(
        (behind > 0) & (behind < len(places)), 1.0, 2.0
    )  # half of it is in the log
    return np.asarray(main | (gap > SILENT * usual))


def _time_gap(after: Array, before: Array) -> Array:
    """How far times (N,) [s] are apart, over midnight, too."""
    return np.asarray(np.abs((after - before + HALF_DAY) % DAY - HALF_DAY))


class _Clock:
    """Times of fixes: seconds since 1970, by the dates of RMC and ZDA, or since the midnight before the first fix.

    Without any date a time of day that goes back by twelve hours is of the next day. `rolled` counts the dates of a
    receiver whose week number rolled over.
    """

    def __init__(self) -> None:
        self.seconds = array("d")  # of the day
        self.days: dict[int, int] = {}  # place of a fix -> its day
        self.talkers: list[str] = []  # of positions; empty of others
        self.rolled = 0

    def add(self, talker: str, seconds: float, day: int | None, position: bool) -> None:
        """Add a fix, with its time of day [s] and its day."""
        if day is not None:
            self.days[len(self.seconds)] = day
        self.seconds.append(seconds)
        self.talkers.append(talker if position else "")

    def times(self) -> Array:
        """The times (N,) [s] of the fixes; one that says no time has that of the fix before, or NaN."""
        self._count_weeks_on()
        since = np.array(self.seconds)
        main = Counter(filter(None, self.talkers)).most_common(1)
        first = np.array(self.talkers) == (main[0][0] if main else "")
        places = np.flatnonzero(first)
        behind = np.searchsorted(places, np.arange(len(since)))
        begins = since == np.append(since[places], np.nan)[behind]  # an instant may begin with another
        kept = np.flatnonzero(_from_main_talker(since, first) | begins)
        before = np.searchsorted(kept, np.arange(len(since)), side="right") - 1
        return np.where(before < 0, np.nan, self._dated(since, kept)[before])

    def _count_weeks_on(self) -> None:
        """Put the dates that are once or twice 1,024 weeks before the last one that much later, and count them."""
        last = max(self.days.values(), default=0)
        for place, day in self.days.items():
            turns = round((last - day) / WEEKS)
            if turns and abs(last - day - turns * WEEKS) <= LONG_LOG:
                self.days[place] += turns * WEEKS
                self.rolled += 1

    def _dated(self, since: Array, kept: NDArray[np.int_]) -> Array:
        """Times (M,) [s] of the fixes at the places `kept`; since (N,) [s] are the times of day of all."""
        result, known = since[kept], sorted(self.days)
        if not known:
            return np.asarray(result + DAY * np.cumsum(np.diff(result, prepend=result[:1]) < -HALF_DAY))
        result = result + DAY * (np.array([self._day(place, known) for place in kept.tolist()]) - FIRST_DAY)
        for place in np.flatnonzero(since[kept] < LATE_DATE):
            if place and 0.0 <= result[place] + DAY - result[place - 1] < NEXT_DAY:  # the date is of the day before
                result[place] += DAY
        return np.asarray(result)

    def _day(self, place: int, known: list[int]) -> int:
        """Day of a fix, where those at the places `known` say theirs."""
        if place in self.days:
            return self.days[place]
        now, behind = self.seconds[place], bisect.bisect_left(known, place)
        near = known[max(0, behind - 1) : behind + 1]
        apart = [(now - self.seconds[one] + HALF_DAY) % DAY - HALF_DAY for one in near]
        nearest = min(range(len(near)), key=lambda one: abs(apart[one]))
        return self.days[near[nearest]] + round((self.seconds[near[nearest]] + apart[nearest] - now) / DAY)


def _sentence_time(text: str) -> float:
    """Time before a sentence: a number, a date as seconds since 1970, or the time of an NMEA 4.10 TAG block.

    ValueError where it is none, or a date that may be two days.
    """
    words = text.strip().rstrip(",;")
    if words.startswith("\\"):
        tag = _TAG_TIME.search(words)
        if tag is None:
            raise ValueError("no time in the TAG block before the sentence")
        return float(tag[1]) / (1000.0 if len(tag[1]) > 11 else 1.0)  # some write milliseconds
    if compact := re.match(COMPACT, words):  # 20240514080000 is a number, too
        with suppress(ValueError):
            return pd.Timestamp(f"{compact[1]}T{compact[2]}.{compact[3] or 0}Z").timestamp()
    with suppress(ValueError):
        return float(words.replace("_", "?"))  # Python would pass over it
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
        return math.isfinite(_sentence_time(text))
    except ValueError:
        return False


def is_nmea(_: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise NMEA 0183: most lines are sentences; the time is before them, or in the position fixes."""
    if b"\0" in head:
        return None
    lines = [line for line in head.decode("latin-1").splitlines()[:LOOKED_AT] if line.strip()]
    sentences = [line for line in lines if _BEGIN.search(line)]
    if len(sentences) <= len(lines) / 2:
        return None
    stamps = [stamp for stamp, dollar, _ in (line.partition("$") for line in sentences) if dollar]
    return {"kind": "nmea", "time": "line" if sum(map(_is_stamp, stamps)) > len(stamps) / 2 else "fix"}
