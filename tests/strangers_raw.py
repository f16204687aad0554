"""Raw files that made-up ships deliver: drawn by seed, written as test basins, yards and autonomy teams write them.

The files are in the words, units, signs, frames and formats of one team, with the errors and lags of its instruments.
Beside them is the truth of every column, so that a test can say whether an import is right, or wrong and silent.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Dataset
from shipid.errors import ShipidError
from shipid.units import DEGREE
from shipid.vessel.load import Vessel
from tests.strangers_ships import (
    Random,
    Run,
    candidates,
    dataset_columns,
    known_of,
    programme_of,
    record_of,
    true_values,
)
from tests.strangers_words import CODES, DATES, GERMAN, IDLE, JOINED, LANGUAGES, ROLES, SIDES, SPELLED, UNITS, WORDS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RawColumn:
    """What a column of the raw files truly is: raw = scale x SI + offset + zero, then wrapped, with noise, rounded.

    header : as written, with side and unit. signal : column of `RawStranger.record`; "time", "date", "run" or "" for
    what means nothing. also : other signals with the same values. unit : true unit. written : place of the unit,
    "header", "row" or "nowhere". scale : with the sign. offset : of the convention (zone of a map, frame). zero : error
    of the instrument, not in the log. wrap : least and greatest value of an angle. late, held : s by which a value
    is old, and between new values. at : m forward of amidships, where the sensor is. noise, quantum : raw units.
    """

    header: str
    signal: str
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0
    zero: float = 0.0
    wrap: tuple[float, float] | None = None
    late: float = 0.0
    held: float = 0.0
    at: float = 0.0
    noise: float = 0.0
    decimals: int = 3
    also: tuple[str, ...] = ()
    written: str = "nowhere"

    @property
    def sign(self) -> int:
        """-1 where the column counts against the convention of datasets."""
        return -1 if self.scale < 0 else 1

    @property
    def quantum(self) -> float:
        """Last digit."""
        return float(10.0**-self.decimals)


@dataclass(frozen=True)
class RawFile:
    """A file: its path in the folder, runs, number of the header's and first data line, and row of `record` by line."""

    path: str
    runs: tuple[str, ...]
    header_line: int
    data_line: int
    rows: NDArray[np.intp]


@dataclass(frozen=True)
class RawStranger:
    """What strangers hand over, and the truth.

    known : option of `shipid vessel new` -> what people know. notes : what they tell of their conventions, if asked.
    style : how the files are written (team, language, separator, decimal, encoding, time, layout, ...).
    record : true rows [SI] with all that can be measured. dataset : its columns of datasets, with ordered commands.
    """

    seed: int
    folder: Path
    words: str
    known: Mapping[str, float | str | bool]
    notes: tuple[str, ...]
    style: Mapping[str, Any]
    files: tuple[RawFile, ...]
    columns: tuple[RawColumn, ...]
    truth: Vessel
    dataset: Dataset
    record: pd.DataFrame
    kinds: Mapping[str, str]


def raw_stranger(seed: int, folder: Path, runs: int | None = None) -> RawStranger:
    """Draw a ship, its team and its runs (12 to 30 unless given), and write the files into `folder`."""
    random = np.random.default_rng([seed, 1907])
    for drawn, vessel, n in candidates(random, f"stranger-raw-{seed}.toml"):
        style = _style(random, drawn)
        programme = programme_of(random, int(random.integers(12, 31)), style)[:runs]
        try:
            record, starts = record_of(random, vessel, n, drawn, style, programme)
        except ShipidError:
            continue
        break
    columns = _headers(random, _channels(random, drawn, style, record), style)
    folder.mkdir(parents=True, exist_ok=True)
    files = _write(random, folder, style, columns, record, programme, starts)
    notes = _notes(random, drawn, columns)
    if random.random() < 0.3:
        text = [f"{drawn['name']}, {style['team']}", *notes]
        (folder / str(random.choice(["readme.txt", "NOTES.txt", "README.md"]))).write_text("\n".join(text) + "\n")
    measured = {column.signal for column in columns}
    known = known_of(random, drawn, n)
    kept = dataset_columns(record, wind=bool({"wind_from", "awa"} & measured))
    dataset = Dataset(record[[name for name in record if name in kept]], {"clock": "run", "flags": []})
    kinds = dict(zip(dataset.runs, (run.kind for run in programme), strict=True))
    return RawStranger(
        seed, folder, drawn["words"], known, notes, style, files, tuple(columns), vessel, dataset, record, kinds
    )  # fmt: skip


def _one(random: Random, words: str, by: str = "|") -> str:
    return str(random.choice(words.split(by)))


def _style(random: Random, drawn: Mapping[str, Any]) -> dict[str, Any]:
    """Habits of a team: language, instruments, frames, and format of the files."""
    team = _one(random, "basin basin autonomy" if drawn["model"] else "yard yard logger autonomy", " ")
    pace = drawn["L"] / drawn["U"]
    offered, most = ((4, 5, 10, 20), 60) if drawn["model"] else ((1, 2, 4, 5, 10), 80)
    rates = [hz for hz in offered if 3 <= hz * pace <= most] or [offered[0]]
    hz = int(random.choice(rates))
    digits = 0 if hz == 1 else 1 if hz in (2, 5, 10) else 2
    if random.random() < 0.15 and hz <= 5 and team in ("yard", "logger"):
        digits = 0  # clocks without parts of a second: stamps repeat
    language = _one(random, LANGUAGES[team], " ")
    comma = language in ("de", "fr", "es", "no") and random.random() < 0.6
    plain = team == "autonomy"
    separator = _one(random, "; ; \t" if comma else ", , ," if plain else ", ; \t blanks", " ")
    encodings = "utf-8 utf-8 utf-8-sig" if plain else "utf-8 latin-1 latin-1 utf-8-sig utf-16"
    places = {
        "basin": "row row brackets", "yard": "brackets brackets row nowhere",
        "autonomy": "joined nowhere nowhere", "logger": "brackets nowhere joined",
    }  # fmt: skip
    times = {"basin": "seconds", "yard": "clock clock two iso seconds", "autonomy": "epoch iso seconds",
             "logger": "iso two clock epoch"}  # fmt: skip
    frames = {"basin": "xy zup zup", "yard": "lat lat map", "logger": "lat",
              "autonomy": "ned enu ros zup" if drawn["model"] else "ned lat ros"}  # fmt: skip
    layouts = {"autonomy": "days one flat", "logger": "days days one"}
    speeds = {"basin": "uv uv none", "yard": "sog sog both", "autonomy": "uv uv earth sog", "logger": "sog sog both"}
    return {
        "team": team, "language": language, "tidy": bool(random.random() < 0.5), "hz": hz, "digits": digits,
        "job": drawn["name"], "a day": int(random.integers(6, 20)),
        "separator": separator, "decimal": "," if comma else ".",
        "encoding": _one(random, encodings, " "), "newline": _one(random, "\n" if plain else "\r\n|\n"),
        "missing": "NaN" if separator == "blanks" else _one(random, "|NaN|-999|hold|"),
        "preamble": 0 if plain else int(random.choice([0, 0, 2, 4, 9])), "comment": _one(random, "|#|%|"),
        "layout": _one(random, layouts.get(team, "flat kinds daily kinds"), " "),
        "time": _one(random, times[team], " "), "units": _one(random, places[team], " "),
        "brackets": _one(random, " [{}]| ({})|[{}]| / {}|, {}"), "case": _one(random, "as is|as is|lower|UPPER"),
        "frame": _one(random, frames[team], " "), "speed": _one(random, speeds[team], " "),
        "empty": int(random.choice([0, 0, 1, 3])), "run column": bool(random.random() < 0.4),
        "names": int(random.integers(5)),
    }  # fmt: skip


def _channels(
    random: Random, drawn: Mapping[str, Any], style: Mapping[str, Any], record: pd.DataFrame
) -> list[RawColumn]:
    """Columns without their headers: what each instrument sees, its unit, sign, error and lag. header: key of WORDS."""
    team, model = style["team"], drawn["model"]
    plain = team == "autonomy"
    angle = "rad" if plain and random.random() < 0.6 else "deg"
    frame, quick, U = style["frame"], drawn["quick"], drawn["U"]
    gps = team != "basin"
    at = float(drawn["L"] * random.choice([0.0, random.uniform(-0.4, 0.3)])) if gps else 0.0
    late = float(random.uniform(0.3, 1.5) if gps else random.choice([0.0, 0.05]))
    held = 1.0 if team in ("yard", "logger") and style["hz"] > 1 and random.random() < 0.5 else 0.0
    channels: list[RawColumn] = []
    digits: dict[str, float] = {}  # of one kind of channel: equal to port and starboard

    def add(word: str, signal: str, unit: str, noise: float, **more: Any) -> None:
        scale = UNITS[unit] * more.pop("sign", 1)
        coarse = digits.setdefault(word, float(random.uniform(0.5, 3.0)) * max(noise, 1e-12) * abs(scale))
        decimals = more.pop("decimals", int(np.clip(np.ceil(-np.log10(coarse)), 0, 8)))
        channels.append(RawColumn(word, signal, unit, scale, noise=noise * abs(scale), decimals=decimals, **more))

    turned = -1 if frame in ("zup", "ros") else 1  # z upwards: y, yaw and rate to port
    spot = float(random.choice([0.02, 0.5, 1.5])) if not model else float(random.choice([0.002, 0.01, 0.02]))
    seen: dict[str, Any] = {"at": at, "late": late * float(random.choice([0.0, 0.3])), "held": held}
    zone = (float(random.integers(400_000, 600_000)), float(random.integers(4_000_000, 7_000_000)))
    if frame == "lat":
        add("lat", "lat", "deg", spot / 6.371e6, **seen)
        add("lon", "lon", "deg", spot / 6.371e6, **seen)
    elif frame == "map":
        add("east", "east", "m", spot, offset=zone[0], **seen)
        add("north", "north", "m", spot, offset=zone[1], **seen)
    elif frame in ("enu", "ros"):
        add("axis x", "east", "m", spot, **seen)
        add("axis y", "north", "m", spot, **seen)
    else:
        words = ("axis x", "axis y") if frame != "ned" or random.random() < 0.6 else ("north", "east")
        add(words[0], "north", "m", spot, **seen)
        add(words[1], "east", "m", spot, sign=turned, **seen)
    circle = 360.0 if angle == "deg" else 2 * np.pi
    wrap = (0.0, circle) if gps and not plain else (-circle / 2, circle / 2)
    if plain and random.random() < 0.3:
        wrap = (0.0, circle)
    east_is_zero = circle / 4 if frame == "ros" else 0.0
    add("psi", "psi", angle, np.radians(random.uniform(0.03, 0.25)), sign=turned, wrap=wrap, offset=east_is_zero,
        zero=float(random.normal(0, 0.4)) * circle / 360)  # fmt: skip
    if gps and random.random() < 0.2:
        add("magnetic", "psi", "deg", np.radians(0.8), wrap=(0.0, 360.0), zero=float(random.uniform(-8, 8)), late=1.0)
    slow: dict[str, Any] = {"at": at, "late": late, "held": held}
    knots = "m/s" if model or plain else _one(random, "kn kn kn m/s km/h", " ")
    if style["speed"] in ("uv", "both"):
        unit = "m/s" if style["speed"] == "uv" else knots
        moving = slow if style["speed"] == "uv" and gps else {"at": 0.0}
        add("u", "u", unit, 0.006 * U, **moving)
        add("v", "v", unit, 0.006 * U, sign=turned, **moving)
    if style["speed"] in ("sog", "both"):
        add("sog", "sog", knots, 0.006 * U, **slow)
        if style["speed"] == "both" or random.random() < 0.85:
            add("cog", "cog", "deg", np.radians(0.5), wrap=(0.0, 360.0), **slow)
    if style["speed"] == "earth":
        add("vn", "vn", "m/s", 0.006 * U, **slow)
        add("ve", "ve", "m/s", 0.006 * U, **slow)
    if gps and not model and random.random() < 0.35:
        add("stw", "stw", knots, 0.02 * U, late=2.0)
    if random.random() < 0.8:
        rate = "rad/s" if angle == "rad" else "deg/s" if model or plain else _one(random, "deg/min deg/min deg/s", " ")
        add("r", "r", rate, np.radians(random.uniform(0.01, 0.06)) * quick, sign=turned, late=random.choice([0.0, 0.2]))
    _commands(random, drawn, style, record, angle, add)
    if gps and not model and random.random() < 0.5:
        pair = ("aws", "awa") if random.random() < 0.4 else ("V_w", "wind_from")
        limits = (-180.0, 180.0) if pair[1] == "awa" and random.random() < 0.5 else (0.0, 360.0)
        add(pair[0], pair[0], _one(random, "m/s kn m/s", " "), 0.3)
        add(pair[1], pair[1], "deg", np.radians(3), wrap=limits)
    if random.random() < 0.35:
        add("phi", "phi", "deg", np.radians(0.05), sign=int(random.choice([1, -1])))
        if random.random() < 0.6:
            add("theta", "theta", "deg", np.radians(0.03))
    for place in random.permutation(len(IDLE))[: int(random.integers(0, 6))]:
        word, unit, level, scatter = IDLE[place]
        channels.append(
            RawColumn(word, "", unit, 0.0, level, noise=scatter, decimals=0 if scatter <= 0 or scatter > 0.5 else 2)
        )
    if random.random() < 0.25:
        random.shuffle(channels)
    return channels


def _commands(
    random: Random, drawn: Mapping[str, Any], style: Mapping[str, Any], record: pd.DataFrame, angle: str, add: Any
) -> None:
    """Rudders or azimuth units, shafts, tunnel: ordered, measured or both; thrust and torque of some."""
    names = [str(name)[7:] for name in record if str(name).startswith("actual.")]
    model, plain = drawn["model"], style["team"] == "autonomy"
    sign = int(random.choice([1, 1, -1]))
    neutral = float(random.choice([0.0, random.uniform(-1.5, 1.5)])) * (1.0 if angle == "deg" else DEGREE)
    steered = [name for name in names if name.endswith((".delta", ".alpha"))]
    shafts = [name for name in names if name.endswith(".n") and not name.startswith("bow")]
    shown = steered[:1] if len(steered) > 1 and random.random() < 0.4 else steered  # one feedback, the other coupled
    given = _one(random, "measured measured ordered both both", " ")
    dead = float(random.choice([0.0, random.uniform(0.2, 0.8) / drawn["quick"]]))  # from the order to the pump
    around = (0.0, 360.0) if angle == "deg" and random.random() < 0.4 and "azimuth" in drawn["drive"] else None
    for name in shown:
        word = name.rpartition(".")[2]
        rest = tuple(other for other in steered if other not in shown)
        both = {"sign": sign, "wrap": around}
        if given != "ordered":
            actual = f"actual.{name}"
            add(word, actual, angle, np.radians(random.uniform(0.05, 0.3)), zero=neutral, **both,
                also=tuple(f"actual.{other}" for other in rest))  # fmt: skip
        if given != "measured":
            add(word, name, angle, 0.0, late=-dead, also=rest, decimals=1 if angle == "deg" else 4, **both)
    n = float(record[shafts[0]].max())
    unit = "rps" if (plain or model) and random.random() < 0.35 else "rpm"
    given = _one(random, "measured measured measured both ordered", " ")
    for name in shafts:
        if given != "ordered":
            add("n", f"actual.{name}", unit, 0.003 * n)
        if given != "measured":
            add("n", name, unit, 0.0, decimals=1 if unit == "rpm" else 3)
    if "bow.n" in names:
        add("bow", "actual.bow.n" if random.random() < 0.6 else "bow.n", unit, 0.05)
    if random.random() < (0.6 if style["team"] == "basin" else 0.15):
        for name in [str(name) for name in record if str(name).startswith("thrust.")]:
            size = float(record[name].abs().max())
            add("thrust", name, "N" if model else "kN", 0.01 * size)
            add("torque", name.replace("thrust", "torque"), "Nm" if model else "kNm", 0.0015 * drawn["B"] * size)


def _headers(random: Random, channels: list[RawColumn], style: Mapping[str, Any]) -> list[RawColumn]:
    """The columns with headers in the team's words, time first; equal ones get a number."""
    language, blank = style["language"], style["separator"] == "blanks"
    sides = _one(random, SIDES[language]).split(" ")
    roles = [_one(random, words) for words in ROLES[language]]
    ordered_too = {column.header for column in channels if column.signal in _orders(channels)}
    spelled = {unit: _one(random, words) for unit, words in SPELLED.items()} | (GERMAN if language == "de" else {})
    joined = {unit: _one(random, words) for unit, words in JOINED.items()}
    before, place = bool(random.random() < 0.3), style["units"]
    pick: dict[str, str] = {}
    stamps = {"seconds": "s", "epoch": "s"}
    time = [RawColumn("time", "time", stamps.get(style["time"], ""), decimals=3)]
    if style["time"] == "two":
        time.insert(0, RawColumn("date", "date"))
    if style["layout"] in ("days", "one") and style["run column"]:
        time.append(RawColumn("run", "run"))
    headed: list[RawColumn] = []
    for column in [*time, *channels]:
        key, signal = column.header, column.signal
        words = WORDS.get(key, {"en": key})
        word = pick.setdefault(key, _one(random, words.get(language, words["en"])))
        parts = [word]
        component = signal.removeprefix("actual.").removeprefix("thrust.").removeprefix("torque.").partition(".")[0]
        if component.startswith(("port", "starboard")) and not column.also:
            side = sides[component.startswith("starboard")]
            parts = [side, word] if before else [word, side]
        if key in ("delta", "alpha", "n"):
            order = not signal.startswith("actual.")
            role = roles[0] if order else roles[1] if key in ordered_too else ""
            parts += [role] if role and (not order or key in ordered_too or random.random() < 0.7) else []
        glue = "_" if blank or place == "joined" or language == "si" or "_" in word else " "
        text = glue.join(parts)
        text = {"lower": text.lower(), "UPPER": text.upper()}.get(style["case"], text)
        unit, written = column.unit, "nowhere"
        if unit and place == "brackets":
            text, written = text + str(style["brackets"]).format(spelled.get(unit, unit)), "header"
        elif unit and place == "joined":
            text, written = f"{text}_{joined.get(unit, unit)}", "header"
        elif unit and place == "row":
            written = "row"
        text = text.replace(" ", "_") if blank or place == "joined" else text
        if style["separator"] == "," or style["decimal"] == ",":
            text = text.replace(", ", " ")
        taken = sum(other.header.rpartition("#")[0] == text or other.header == text for other in headed)
        headed.append(replace(column, header=f"{text}#{taken + 1}" if taken else text, written=written))
    return [replace(one, header=one.header.replace("#", "_")) for one in headed]


def _orders(channels: Iterable[RawColumn]) -> set[str]:
    """Orders that stand beside a measurement of the same."""
    signals = {column.signal for column in channels}
    return {signal for signal in signals if f"actual.{signal}" in signals}


def _measured(random: Random, rows: pd.DataFrame, column: RawColumn) -> Array:
    """Values of a column in a run, in raw units, not yet rounded."""
    count, t = len(rows), rows["t"].to_numpy()
    if column.noise < 0:
        return np.arange(count, dtype=float)
    noise = random.normal(0, column.noise, count)
    if not column.signal:
        return np.asarray(column.offset + noise)
    taken = t if not column.held else np.floor(t / column.held + 1e-9) * column.held
    true = true_values(rows, column.signal, column.at)
    true = np.unwrap(true) if column.wrap else true
    value = column.scale * np.interp(taken - column.late, t, true) + column.offset + column.zero
    value = value + (noise if not column.held else noise[np.searchsorted(t, taken - 1e-6)])
    if column.wrap:
        low, high = column.wrap
        value = np.round((value - low) % (high - low) + low, column.decimals)
        value = np.where(value >= high, low, value)
    return np.asarray(value)


def _texts(values: Array, column: RawColumn, style: Mapping[str, Any]) -> list[str]:
    missing = "" if style["missing"] == "hold" else style["missing"]
    digits, comma = f"%.{column.decimals}f", style["decimal"] == ","
    texts = [digits % value if np.isfinite(value) else missing for value in values]
    return [text.replace(".", ",") for text in texts] if comma else texts


def _stamps(style: Mapping[str, Any], begin: datetime, first: datetime, t: Array) -> dict[str, list[str]]:
    """Text of the columns of time for rows at t [s] after `begin`, in a file whose first row is at `first`."""
    digits = style["digits"]
    moments = [begin + timedelta(seconds=round(float(value), digits)) for value in t]
    part = [f".{moment.microsecond:06d}"[: digits + 1] if digits else "" for moment in moments]
    mark = style["decimal"]
    if style["time"] in ("clock", "two"):
        day = DATES.get(style["language"], "%Y-%m-%d")
        clock = [f"{moment:%H:%M:%S}{text.replace('.', mark)}" for moment, text in zip(moments, part, strict=True)]
        return {"time": clock, "date": [f"{moment:{day}}" for moment in moments]}
    if style["time"] == "iso":
        joint, end = ("T", "Z") if style["names"] % 2 else (" ", "")
        return {"time": [f"{m:%Y-%m-%d}{joint}{m:%H:%M:%S}{text}{end}" for m, text in zip(moments, part, strict=True)]}
    since = datetime(1970, 1, 1) if style["time"] == "epoch" else first
    seconds = [f"{(begin - since).total_seconds() + value:.{max(digits, 1)}f}" for value in t]
    return {"time": [text.replace(".", mark) for text in seconds]}


def _path(style: Mapping[str, Any], number: int, run: Run, moment: datetime) -> str:
    """Path of the file of one run, as this team names its files."""
    word = CODES[run.kind][2 if style["language"] == "de" else int(style["names"] > 1)]
    side = {"de": ("StB", "BB"), "no": ("SB", "BB")}.get(style["language"], ("stb", "prt"))[run.side == "port"]
    angles = f"_{run.angle}_{run.other}" if run.other else f"_{run.angle}" if run.kind in ("circle", "pull-out") else ""
    full = f"{word}{angles}_{side}" if angles else word
    end = {",": "csv", ";": "csv", "\t": "txt", "blanks": ("dat", "asc")[style["names"] % 2]}[style["separator"]]
    name = (
        f"{full}_{number:02d}.{end}",
        f"{moment:%Y-%m-%d}_run{number:02d}_{full.replace('_', '')}.{end}",
        f"Test{number:03d}.{end}",
        f"{full.replace('_', ' ')} ({number}).{end}",
        f"{moment:%y%m%d_%H%M%S}_{word}.{end}",
    )[style["names"]]
    return {
        "kinds": f"{CODES[run.kind][1]}/{name}", "daily": f"{moment:%Y%m%d}/{name}",
        "days": f"log_{moment:%Y-%m-%d}.{end}", "one": f"all_tests.{end}",
    }.get(style["layout"], name)  # fmt: skip


def _write(
    random: Random,
    folder: Path,
    style: Mapping[str, Any],
    columns: Sequence[RawColumn],
    record: pd.DataFrame,
    programme: Sequence[Run],
    starts: Mapping[str, datetime],
) -> tuple[RawFile, ...]:
    """Write all files; a run a file, or the runs of a day or all in one."""
    groups: dict[str, list[str]] = {}
    for number, (name, run) in enumerate(zip(starts, programme, strict=True), 1):
        groups.setdefault(_path(style, number, run, starts[name]), []).append(name)
    places = record.groupby("run", sort=False).indices
    faults = {key: bool(random.random() < 0.35) for key in ("dropouts", "lost rows", "repeated rows")}
    gps = {"lat", "lon", "north", "east", "sog", "cog", "vn", "ve"}
    files: list[RawFile] = []
    for path, names in groups.items():
        lines: list[list[str]] = []
        kept: list[NDArray[np.intp]] = []
        for name in names:
            rows = record.iloc[places[name]]
            order = _order(random, len(rows), faults)
            gap = np.zeros(len(rows), dtype=bool)
            if faults["dropouts"] and len(rows) > 40:
                begin = int(random.integers(5, len(rows) - 30))
                gap[begin : begin + int(random.integers(1, 12))] = True
            texts = _stamps(style, starts[name], starts[names[0]], rows["t"].to_numpy())
            texts["run"] = [str(int(name[1:]))] * len(rows)
            cells: list[list[str]] = []
            for column in columns:
                if column.signal in texts:
                    cells.append(texts[column.signal])
                    continue
                values = _measured(random, rows, column)
                if column.signal in gps and gap.any():
                    begin = int(np.argmax(gap))
                    values = np.where(gap, values[begin - 1] if style["missing"] == "hold" else np.nan, values)
                cells.append(_texts(values, column, style))
            table = list(zip(*cells, strict=True))
            lines += [list(table[place]) for place in order]
            kept.append(np.asarray(places[name])[order])
        head, header_line = _head(style, columns, starts[names[0]], path)
        text = _joined([*head[header_line:], *lines], style["separator"])
        tail = [style["separator"] * (len(columns) - 1) if style["separator"] in ",;" else ""] * style["empty"]
        whole = [*(line[0] for line in head[:header_line]), *text, *tail]
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        body = str(style["newline"]).join(whole) + str(style["newline"])
        target.write_bytes(body.encode(style["encoding"], errors="replace"))
        files.append(RawFile(path, tuple(names), header_line, len(head), np.concatenate(kept)))
    return tuple(files)


def _order(random: Random, count: int, faults: Mapping[str, bool]) -> NDArray[np.intp]:
    """Rows of a run as they come to the file: some lost, some twice."""
    order = np.arange(count)
    if faults["lost rows"] and count > 60 and random.random() < 0.5:
        begin = int(random.integers(20, count - 20))
        order = np.delete(order, slice(begin, begin + int(random.integers(1, 8))))
    if faults["repeated rows"] and random.random() < 0.5:
        twice = random.integers(1, len(order) - 1, int(random.integers(1, 5)))
        order = np.sort(np.concatenate([order, order[twice]]))
    return order


def _head(
    style: Mapping[str, Any], columns: Sequence[RawColumn], moment: datetime, path: str
) -> tuple[list[list[str]], int]:
    """Preamble lines, header and row of units; number of the header's line."""
    by = {",": ",", ";": ";"}.get(style["separator"], ": ")
    words = (
        ("Project", style["job"]), ("File", Path(path).stem), ("Date", f"{moment:%d.%m.%Y}"),
        ("Sampling", f"{style['hz']} Hz"), ("Loading condition", "design draught"), ("Channels", len(columns)),
        ("Operator", "JK"), ("Remarks", ""), ("Data", "start"),
    )  # fmt: skip
    head = [[f"{style['comment']} {word}{by}{value}".strip()] for word, value in words[: style["preamble"]]]
    place = len(head)
    head.append([column.header for column in columns])
    if style["units"] == "row":
        shown = GERMAN if style["language"] == "de" else {}
        empty = "-" if style["separator"] == "blanks" or style["names"] % 2 else ""
        brackets = "[{}]" if style["names"] > 2 else "{}"
        head.append([brackets.format(shown.get(one.unit, one.unit)) if one.unit else empty for one in columns])
    return head, place


def _joined(lines: Sequence[Sequence[str]], separator: str) -> list[str]:
    """Lines of text; fixed columns where the separator is blanks."""
    if separator != "blanks":
        return [separator.join(line) for line in lines]
    widths = [max(map(len, cells)) + 2 for cells in zip(*lines, strict=True)]
    return ["".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]


def _notes(random: Random, drawn: Mapping[str, Any], columns: Sequence[RawColumn]) -> tuple[str, ...]:
    """What the team says of its conventions, if it is asked; never what it does not know."""
    notes: list[str] = []
    for column in columns:
        if column.signal.endswith((".delta", ".alpha")):
            port = column.sign < 0
            notes.append(f"{column.header}: positive to {'port' if port else 'starboard'}" + (
                " turns the ship there" if column.signal.endswith("delta") else " (direction of thrust)"))  # fmt: skip
        if column.signal in ("sog", "lat", "axis x") and column.at:
            notes.append(f"GPS antenna {abs(column.at):.1f} m {'ahead' if column.at > 0 else 'aft'} of midship")
        if column.unit and column.written == "nowhere" and column.signal and random.random() < 0.5:
            notes.append(f"{column.header} in {column.unit}")
        if column.signal in ("r", "v") and column.sign < 0:
            notes.append(f"{column.header}: positive to port")
    return tuple(dict.fromkeys([*notes, f"model scale 1:{drawn['scale']:.4g}"] if drawn["model"] else notes))
