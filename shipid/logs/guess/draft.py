"""Draft a mapping document from a guess, with the evidence beside every line, for a person to read and correct."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from collections.abc import Mapping as PlainMapping
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from shipid import document
from shipid.errors import ShipidError
from shipid.logs import segments as cutting
from shipid.logs.dates import format_date
from shipid.logs.guess.clues import LIKELY, Clue, Suggestion
from shipid.logs.guess.columns import Guess
from shipid.logs.guess.evidence import usual_step
from shipid.logs.guess.lapses import FILLS
from shipid.logs.importing import file_digest, import_log
from shipid.logs.mapping import (
    FileClock,
    Mapping,
    Segment,
    degrees_and_minutes,
    is_date,
    is_dated,
    parse_mapping,
    to_si,
)
from shipid.logs.readers import LARGE
from shipid.physics.signals import is_command

NOT_YET = "# Cannot be imported as it is: "
SPARSE = 0.5  # of the rows, without a value of an order: it is written where it changes
ENABLED = 0.8  # a repair less sure than this is drafted switched off
ORDER = ("wrap_interpolation", "break", "despike", "latency", "scale", "heading_offset", "lever_arm")
NOISE = {"position": 1.0, "heading_deg": 0.5, "acceleration": 0.05, "angular_acceleration_deg": 0.2}
QUESTIONS = (
    "Which point of the ship do positions and velocities belong to? If not the vessel's origin: a lever_arm.",
    "Are the commands orders or feedback? Are their names before the dot those of the vessel document?",
)
OF_WIND = "Is the wind true or apparent (relative = true), 'from' or 'towards'?"


def draft_mapping(guess: Guess) -> str:
    """The text of a mapping: columns with their confidence, repairs, and manoeuvres if it can be imported."""
    text = draft_text(guess)
    if guess.source.pattern is None and guess.file.stat().st_size > LARGE:
        return text + "\n# A large log: find its manoeuvres with `shipid data segment`.\n"
    try:
        if guess.source.pattern is not None or guess.source.parts:
            import_log(_parse_draft(text), guess.file)
            return text
        segments = segment_log(_parse_draft(text), guess.file)
    except ShipidError as error:
        place = f"{error.file}: " if guess.source.pattern is not None and error.file else ""
        return text + f"\n{NOT_YET}{place}{error.path or ''}: {error.message}\n"
    return text + segments_text(segments, guess.sniffed.clock.get("unit", "s"))


def draft_text(guess: Guess) -> str:
    """The text of a mapping that is neither tried nor cut into runs."""
    parts = [
        *_draft_head(guess),
        *_origin_lines(guess),
        *_column_lines(guess),
        *_estimate_lines(guess),
        *_repair_lines(guess),
    ]
    return (
        "\n".join(
            "\n" * part.startswith("\n") + " ".join(part.split()) if part.lstrip().startswith(("#", "[")) else part
            for part in parts
        )
        + "\n"
    )


def segment_log(mapping: Mapping, log: Path) -> list[Segment]:
    """The manoeuvres in the whole log of a mapping; segments of the mapping are ignored."""
    whole = mapping.model_copy(update={"segment": ()})
    unit = to_si(mapping.clock.unit, "t")
    return cutting.find_manoeuvres(import_log(whole, log), unit, files=mapping.source.runs is not None)


def segments_text(segments: Iterable[Segment], unit: str = "s") -> str:
    """Segments as TOML, to be corrected by hand; `unit` is the unit of the log's clock."""
    blocks = ["\n# Segmented by helm and heading: correct names, starts and ends, and remove what is no run."]
    segments = list(segments)
    dated = all(is_date(segment.start, unit) for segment in segments)  # whose times are seconds then
    if dated:
        blocks.append("# Starts and ends are seconds since 1970; the dates are UTC.")
    elif is_dated(unit):
        blocks.append("# Starts and ends are seconds since the midnight before the log, whose clock has no date.")
    digits = 3 + max(0, math.ceil(math.log10(to_si(unit, "t"))))  # to 1 ms, of hours and days, too
    for segment in segments:
        values = {key: value for key, value in segment.model_dump().items() if value is not None}
        values |= {end: round(values[end], digits) for end in ("start", "end")}
        dates = f"    # {clock_moment(segment.start, unit)} to {clock_moment(segment.end, unit)}" if dated else ""
        blocks.append("\n".join([f"[[segment]]{dates}", *_toml_lines(values)]))
    return "\n".join(blocks) + "\n"


def clock_moment(value: float, unit: str) -> str:
    """A moment on the log's clock as text: a date in UTC, or the number."""
    return format_date(value) if is_date(value, unit) else f"{value:.10g}"


def _parse_draft(text: str) -> Mapping:
    raw = document.parse_toml(text)
    document.check_values(raw, None)
    return parse_mapping(raw, Path("draft.toml"))


def _toml_lines(values: PlainMapping[str, Any]) -> Iterator[str]:
    for key, value in values.items():
        yield f"{tomlkit.key(key).as_string()} = {tomlkit.item(value).as_string()}"


def _block(name: str, values: PlainMapping[str, Any], remark: str = "") -> Iterator[str]:
    """Yield the lines of a table, with a remark beside its name."""
    yield f"\n{name if name.startswith('[') else f'[{name}]'}{'    # ' * bool(remark)}{remark}"
    yield from _toml_lines(values)


def _draft_head(guess: Guess) -> Iterator[str]:
    source, sniffed = guess.source, guess.sniffed
    yield f"# Drafted from {guess.file.name}. Check every line: a percentage says how sure it is, the rest why."
    wind = [OF_WIND] if guess.column("V_w") or guess.column("beta_w") else []
    yield from (f"# ? {words}" for words in (*(one.sentence for one in guess.questions), *QUESTIONS, *wind))
    yield from _toml_lines({"name": guess.file.stem or "log"})
    if source.pattern is None:
        yield from _block("source", {} if sniffed.channels else {"sha256": file_digest(guess.file)})
    else:
        alike = [name for name in source.skipped if name.endswith(source.pattern.rpartition("*")[2])]
        remark = f"{len(source.files)} files, {'see [parts]' if source.parts else 'one run each'}"
        yield from _block("source", {"runs": source.pattern} | ({"skip": alike} if alike else {}), remark)
        yield from (f"# ! {name} is left out: {reason}" for name, reason in source.skipped.items())
    if source.manoeuvres:
        yield from _block("source.manoeuvres", source.manoeuvres, "as the names of the files say")
    if source.parts:
        remark = f"where runs begin: {source.held} runs in {len(source.files)} files"
        yield from _block("parts", source.parts, remark)
    yield from _block("format", sniffed.form)
    yield from _block("clock", sniffed.clock)
    first = guess.columns[0].source
    usual = usual_step(sniffed.t[np.isfinite(sniffed.columns[first])] if sniffed.scattered else sniffed.t)
    longest = max(3.0, 5 * usual)
    sparse = [
        column.source
        for column in guess.columns
        if is_command(column.name) and _is_sparse_order(guess, column, longest)
    ]
    if sparse or sniffed.scattered:
        why = f"{', '.join(map(repr, sparse))} has values where it changes: held in between"
        why = (
            "sentences, topics or files have other instants; this is the step of the position"
            if sniffed.scattered
            else why
        )
        yield f"step = {usual:g}    # s: {why}"
    if sniffed.scattered or guess.kinds & {"holes in time", "missing values"}:
        yield f"max_gap = {longest:g}    # s: missing for less: interpolated, for more: the run breaks"
    for file, log in dict(sniffed.channels.values()).items():
        clock = {key: value for key, value in log.clock.items() if key in FileClock.model_fields or key == "from"}
        name = f"file.{tomlkit.key(file.stem).as_string()}"
        for part, values in (("", {"path": file.name}), (".clock", clock), (".format", log.form)):
            yield from _block(name + part, values)


def _is_sparse_order(guess: Guess, column: Suggestion, longest: float) -> bool:
    """Whether an order is written only where it changes: it lacks most values, some for longer than `longest` [s]."""
    known = np.isfinite(guess.sniffed.columns[column.source])
    return bool(known.mean() < 1.0 - SPARSE and np.diff(guess.sniffed.t[known]).max(initial=0.0) > longest)


def _origin_lines(guess: Guess) -> Iterator[str]:
    """Yield the [origin] that the files of all runs share, and that of a log whose first position may be none."""
    columns = [column for key in ("latitude", "longitude") if (column := guess.column(key)) is not None]
    if columns and (guess.source.pattern is not None or "no fix" in guess.kinds):
        places = np.array([guess.sniffed.columns[column.source] for column in columns])
        known = np.isfinite(places).all(axis=0)
        sure = known & ~np.isin(places, FILLS).any(axis=0)
        first = places[:, np.flatnonzero(sure if sure.any() else known)[:1]]
        origin = {}
        for column, value in zip(columns, first, strict=True):
            value = degrees_and_minutes(value) if column.unit == "ddmm" else value * column.extra.get("factor", 1.0)
            value = np.degrees(value) if column.unit == "rad" else value
            origin[column.name] = round(column.extra.get("sign", 1) * float(value[0]), 7)
        yield from _block("origin", origin, f"the first position{', of all runs' * (guess.source.pattern is not None)}")


def _column_lines(guess: Guess) -> Iterator[str]:
    yield ""
    yield from (f"# ! {_clue_text(finding)}" for finding in guess.findings if finding.repair is None)
    for column in guess.columns:
        sure = f"{100 * column.confidence:.0f} %{', UNSURE' * (column.confidence < LIKELY)}"
        parts = guess.sniffed.in_parts.get(column.source, (column.source,))
        none = dict.fromkeys(x for one in {column.source, *parts} for x in guess.sniffed.fillers.get(one, ()))
        values = {"from": parts[0] if len(parts) == 1 else parts, "unit": column.unit, **column.extra}
        values |= {"missing": list(none)} if none else {}
        values |= (
            {"file": guess.sniffed.channels[column.source][0].stem} if column.source in guess.sniffed.channels else {}
        )
        key = f'"{column.name}"' if "." in column.name else column.name
        yield from _block(f"columns.{key}", values, f"{sure}: {column.evidence}")
    yield ""
    yield from (f"# column {name!r} is not used: {why}" for name, why in guess.unused.items())
    yield from (f"# {words}" for words in guess.sniffed.notes)


def _estimate_lines(guess: Guess) -> Iterator[str]:
    """Yield the [estimate] block if only velocities are missing in the log."""
    named = {column.name for column in guess.columns}
    lacking = [name for name in ("u", "v", "r") if name not in named and (name == "r" or "speed" not in named)]
    if lacking:
        remark = f"{', '.join(lacking)} not logged; noise is assumed: the import shows whether it fits"
        yield from _block("estimate", NOISE, remark)


def _repair_lines(guess: Guess) -> Iterator[str]:
    mendable = [(finding, finding.repair) for finding in guess.findings if finding.repair is not None]
    for finding, repair in sorted(mendable, key=lambda entry: ORDER.index(entry[1]["kind"])):
        more = {"enabled": finding.confidence >= ENABLED, "reason": _clue_text(finding)}
        yield from _block("[[repair]]", repair | more)


def _clue_text(finding: Clue) -> str:
    return f"{finding.kind} ({100 * finding.confidence:.0f} %): {finding.sentence}"
