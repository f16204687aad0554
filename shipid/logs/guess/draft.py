"""Draft a mapping document from a guess, with the evidence beside every line, for a person to read and correct."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
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
from shipid.logs.guess.defects import lost_fixes
from shipid.logs.importing import file_digest, import_log
from shipid.logs.mapping import Mapping, Segment, degrees_and_minutes, is_date, is_dated, parse_mapping, to_si
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
    whole = mapping.model_copy(update={"segment": (), "resample": None})
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


def _toml_lines(values: dict[str, Any]) -> Iterator[str]:
    for key, value in values.items():
        yield f"{key} = {tomlkit.item(value).as_string()}"


def _draft_head(guess: Guess) -> Iterator[str]:
    yield f"# Drafted from {guess.file.name}. Check every line: a percentage says how sure it is, the rest why."
    yield from (f"# ? {question.sentence}" for question in guess.questions)
    wind = {"V_w", "beta_w"} & {suggestion.name for suggestion in guess.columns}
    yield from (f"# ? {question}" for question in (*QUESTIONS, *([OF_WIND] if wind else [])))
    source = guess.source
    yield from _toml_lines({"name": guess.file.stem or "log"})
    yield "\n[source]"
    if source.pattern is None:
        yield from _toml_lines({"sha256": file_digest(guess.file)})
    else:
        yield f"# {len(source.files)} files, {'see [parts]' if source.parts else 'one run each'}"
        yield from _toml_lines({"runs": source.pattern})
        if source.skipped:
            yield from (f"# ! {name} is left out: {reason}" for name, reason in source.skipped.items())
            ending = source.pattern.rpartition("*")[2]
            alike = [name for name in source.skipped if name.endswith(ending)]
            yield from _toml_lines({"skip": alike} if alike else {})
        if source.manoeuvres:
            yield "[source.manoeuvres]    # as the names of the files say"
            yield from (
                f"{tomlkit.item(run).as_string()} = {tomlkit.item(kind).as_string()}"
                for run, kind in source.manoeuvres.items()
            )
    if source.parts:
        yield f"\n[parts]    # where runs begin: {source.held} runs in {len(source.files)} files"
        yield from _toml_lines(source.parts)
    yield "\n[format]"
    yield from _toml_lines(guess.sniffed.form)
    yield "\n[clock]"
    yield from _toml_lines(guess.sniffed.clock)
    scattered = guess.sniffed.scattered
    first = guess.columns[0].source
    steps = np.diff(guess.sniffed.t[np.isfinite(guess.sniffed.columns[first])] if scattered else guess.sniffed.t)
    usual = float(np.median(steps))
    longest = max(3.0, 5 * usual)
    sparse = [
        column.source
        for column in guess.columns
        if is_command(column.name) and _is_sparse_order(guess, column, longest)
    ]
    if sparse and not scattered:
        yield f"step = {usual:g}    # s: {', '.join(map(repr, sparse))} has values where it changes: held in between"
    if scattered:
        yield f"step = {usual:g}    # s: sentences or topics have other instants; this is the step of the position"
    if scattered or guess.kinds & {"holes in time", "missing values"}:
        yield f"max_gap = {longest:g}    # s: missing for less: interpolated, for more: the run breaks"


def _is_sparse_order(guess: Guess, column: Suggestion, longest: float) -> bool:
    """Whether an order is written only where it changes: it lacks most values, some for longer than `longest` [s]."""
    known = np.isfinite(guess.sniffed.columns[column.source])
    return bool(known.mean() < 1.0 - SPARSE and np.diff(guess.sniffed.t[known]).max(initial=0.0) > longest)


def _origin_lines(guess: Guess) -> Iterator[str]:
    """Yield the [origin] that the files of all runs share, and that of a log whose first position may be none."""
    columns = [column for key in ("latitude", "longitude") if (column := guess.column(key)) is not None]
    if columns and (guess.source.pattern is not None or "no fix" in guess.kinds):
        yield f"\n[origin]    # the first position{', of all runs' if guess.source.pattern is not None else ''}"
        places = [guess.sniffed.columns[column.source] for column in columns]
        known = np.isfinite(places).all(axis=0)
        fixed = ~np.any([lost_fixes(values[known]) for values in places], axis=0)
        for column, values in zip(columns, places, strict=True):
            first = values[known][fixed][:1]
            first = degrees_and_minutes(first) if column.unit == "ddmm" else first * column.extra.get("factor", 1.0)
            first = np.degrees(first) if column.unit == "rad" else first
            yield from _toml_lines({column.name: round(column.extra.get("sign", 1) * float(first[0]), 7)})


def _column_lines(guess: Guess) -> Iterator[str]:
    findings = [finding for finding in guess.findings if finding.repair is None]
    if findings:
        yield ""
        yield from (f"# ! {_clue_text(finding)}" for finding in findings)
    for column in guess.columns:
        sure = f"{_confidence_text(column.confidence)}{', UNSURE' * (column.confidence < LIKELY)}"
        key = f'"{column.name}"' if "." in column.name else column.name
        yield f"\n[columns.{key}]    # {sure}: {column.evidence}"
        parts = guess.sniffed.in_parts.get(column.source, (column.source,))
        source = parts[0] if len(parts) == 1 else parts
        yield from _toml_lines({"from": source, "unit": column.unit, **column.extra})
    unused = [*(f"column {name!r} is not used: {why}" for name, why in guess.unused.items()), *guess.sniffed.notes]
    if unused:
        yield ""
        yield from (f"# {words}" for words in unused)


def _confidence_text(confidence: float) -> str:
    return f"{100 * confidence:.0f} %"


def _estimate_lines(guess: Guess) -> Iterator[str]:
    """Yield the [estimate] block if only velocities are missing in the log."""
    named = {column.name for column in guess.columns}
    lacking = [name for name in ("u", "v", "r") if name not in named]
    if "speed" in named:
        lacking = [name for name in lacking if name == "r"]
    if lacking:
        yield f"\n[estimate]    # {', '.join(lacking)} not logged; noise is assumed: the import shows whether it fits"
        yield from _toml_lines(NOISE)


def _repair_lines(guess: Guess) -> Iterator[str]:
    mendable = [(finding, finding.repair) for finding in guess.findings if finding.repair is not None]
    for finding, repair in sorted(mendable, key=lambda entry: ORDER.index(entry[1]["kind"])):
        yield "\n[[repair]]"
        yield from _toml_lines(repair)
        yield from _toml_lines({"enabled": finding.confidence >= ENABLED, "reason": _clue_text(finding)})


def _clue_text(finding: Clue) -> str:
    return f"{finding.kind} ({_confidence_text(finding.confidence)}): {finding.sentence}"
