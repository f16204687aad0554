"""Sentences of NMEA 0183 (IEC 61162-1): their checksum, their talker, and what each kind says."""

from __future__ import annotations

import functools
import operator
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime

from shipid.units import KNOT

KMH_IN_KNOTS = 1.0 / 1.852
MOST_FIELDS = 16  # that are read of a sentence; those that a device does not write are empty
_SENTENCE = re.compile(r"([A-Z][A-Z0-9]{3,7},[^*$!]*)(?:\*([0-9A-F]{2}))?\W*", re.IGNORECASE)
Fields = list[str]
Said = Iterator[tuple[str, str | float]]


@dataclass(frozen=True)
class NmeaSentence:
    """A sentence: the letters of its talker, its kind, such as RMC, and the fields behind them."""

    talker: str
    kind: str
    fields: Fields

    def values(self) -> dict[str, float]:
        """Column -> value, none of a sentence that calls itself invalid; ValueError where one is no number."""
        said = SENTENCES[self.kind](self.fields) if self.kind in SENTENCES else ()
        return {name: float(value) for name, value in said if value != ""}

    def time(self) -> float | None:
        """The time of day [s] of a fix; None of any other sentence, ValueError where it is no time."""
        text = self.fields[TIMES[self.kind]] if self.kind in TIMES else ""
        if not text:
            return None
        hour, minute, second = int(text[:2]), int(text[2:4]), float(text[4:])
        if not (0 <= hour < 24 and 0 <= minute < 60 and 0.0 <= second < 61.0):  # 60: a leap second
            raise ValueError(f"{text!r} is no time of day")
        return 3600.0 * hour + 60.0 * minute + second

    def day(self) -> int | None:
        """The number of the day that a valid RMC or ZDA says, None of any other sentence."""
        if self.kind == "RMC" and self.fields[1] != "V":
            return _day_number(self.fields[8])
        if self.kind == "ZDA":
            day, month, year = self.fields[1:4]
            return _day_number(f"{day:0>2}{month:0>2}{year[-2:]}")
        return None


def parse_sentence(text: str, checked: bool) -> NmeaSentence | None:
    """The sentence in a text that begins behind its `$`; None where it is none, or `checked` and its checksum fails."""
    match = _SENTENCE.fullmatch(text)
    if match is None:
        return None
    body, checksum = match.groups()
    if checksum is None and checked:
        return None
    if checksum is not None and int(checksum, 16) != functools.reduce(operator.xor, body.encode("latin-1")):
        return None
    address, *fields = body.split(",")
    address = address.upper()
    own = address.startswith("P")
    fields += [""] * (MOST_FIELDS - len(fields))
    return NmeaSentence("" if own else address[:2], address if own else address[2:], fields)


def has_checksum(text: str) -> bool:
    """Whether a text that begins behind a `$` is a sentence with a checksum."""
    match = _SENTENCE.fullmatch(text)
    return match is not None and match[2] is not None


@functools.cache
def _day_number(text: str) -> int | None:
    """Number of the day of a date DDMMYY, of 1969 to 2068; None where it is none."""
    try:
        return datetime.strptime(text, "%d%m%y").toordinal()
    except ValueError:
        return None


def _read_position(fields: Fields, place: int) -> Said:
    """Latitude and longitude [deg] of four fields from a place on; nothing where they are empty."""
    for name, at, sides in (("latitude", place, "NS"), ("longitude", place + 2, "EW")):
        text, side = fields[at : at + 2]
        if not text and not side:
            continue
        degrees, minutes = divmod(float(text), 100.0)
        if minutes >= 60.0 or side not in tuple(sides):
            raise ValueError(f"{text!r}, {side!r} is no {name}")
        yield name, (degrees + minutes / 60.0) * (1.0 if side == sides[0] else -1.0)


def _read_gga(fields: Fields) -> Said:
    return _read_position(fields, 1) if fields[5] != "0" else iter(())


def _read_gns(fields: Fields) -> Said:
    """A fix of several systems, with a letter each: N where a system takes no part in it."""
    return _read_position(fields, 1) if fields[5].strip("N") else iter(())


def _read_gll(fields: Fields) -> Said:
    return _read_position(fields, 0) if fields[5] != "V" else iter(())


def _read_rmc(fields: Fields) -> Said:
    if fields[1] != "V":
        yield from _read_position(fields, 2)
        yield from (("sog", fields[6]), ("cog", fields[7]))


def _read_vtg(fields: Fields) -> Said:
    if fields[8] != "N":
        yield "cog", fields[0]
        yield "sog", fields[4] or (float(fields[6]) * KMH_IN_KNOTS if fields[6] else "")


def _read_hdt(fields: Fields) -> Said:
    yield "heading", fields[0]


def _read_ths(fields: Fields) -> Said:
    yield "heading", fields[0] if fields[1] != "V" else ""


def _read_rot(fields: Fields) -> Said:
    yield "rot", fields[0] if fields[1] != "V" else ""


def _read_rsa(fields: Fields) -> Said:
    for name, place in (("rudder", 0), ("rudder_port", 2)):
        yield name, fields[place] if fields[place + 1] != "V" else ""


def _read_rpm(fields: Fields) -> Said:
    """Shafts (S) and engines (E) by their number: 0 is that of the middle, odd ones are to starboard."""
    source, number, speed = fields[:3]
    if fields[4] != "V" and source in ("S", "E"):
        yield f"{'rpm' if source == 'S' else 'engine_rpm'}{'' if number == '1' else f'_{number or 0}'}", speed


def _read_mwv(fields: Fields) -> Said:
    """The apparent wind (reference R), its speed in knots (N), km/h (K) or m/s (M)."""
    angle, reference, speed, unit, status = fields[:5]
    if status != "V" and reference == "R":
        yield "apparent_angle", angle
        factor = {"N": KNOT, "K": 1.0 / 3.6, "M": 1.0}.get(unit)
        yield "apparent_speed", float(speed) * factor if speed and factor is not None else ""


def _read_mwd(fields: Fields) -> Said:
    """The true wind, its speed in m/s, in knots or in both."""
    yield "wind_from", fields[0]
    yield "wind_speed", fields[6] or (float(fields[4]) * KNOT if fields[4] else "")


SENTENCES: dict[str, Callable[[Fields], Said]] = {
    "GGA": _read_gga, "GNS": _read_gns, "GLL": _read_gll, "RMC": _read_rmc, "VTG": _read_vtg, "HDT": _read_hdt,
    "THS": _read_ths, "ROT": _read_rot, "RSA": _read_rsa, "RPM": _read_rpm, "MWV": _read_mwv, "MWD": _read_mwd,
}  # fmt: skip
"""Kind of a sentence -> what its fields say: deg; rot deg/min; sog kn; rpm; wind speeds m/s."""
TIMES = {"GGA": 0, "GNS": 0, "GLL": 4, "RMC": 0, "ZDA": 0}
"""Kind of a sentence that says the time of a fix -> the field of it."""
NMEA_COLUMNS = (
    *("latitude", "longitude", "sog", "cog", "heading", "rot", "rudder", "rudder_port"),
    *("rpm", "rpm_2", "engine_rpm", "engine_rpm_2"),
    *("apparent_angle", "apparent_speed", "wind_from", "wind_speed"),
)
"""Columns of every log; shafts and engines of other numbers have further ones."""
