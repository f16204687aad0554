"""Guess what the columns of an unknown log are, how sure that is, and what is wrong with them.

Names give candidates; kinematic tests decide between them. What the log cannot decide is asked.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from shipid.arguments import as_names, as_path, check_choice, check_class
from shipid.errors import DataError
from shipid.logs.guess import evidence
from shipid.logs.guess.bound import name_commands
from shipid.logs.guess.changes import ask_for_changes
from shipid.logs.guess.clock import is_clock
from shipid.logs.guess.clues import Clue, Question, State, Suggestion
from shipid.logs.guess.commands import choose_commands, likely_unit
from shipid.logs.guess.defects import defects_of_motion, defects_of_rows
from shipid.logs.guess.lapses import report_spikes, report_stuck_sensors, take_fills, take_spikes
from shipid.logs.guess.motion import check_clock, choose_motion, report_misnomers
from shipid.logs.guess.outputs import reserve_outputs, suggest_outputs
from shipid.logs.guess.scales import take_scales
from shipid.logs.guess.search import Frame
from shipid.logs.guess.sniff import LogTable
from shipid.logs.guess.sources import PAUSE, GuessFiles, read_source
from shipid.logs.guess.unused import unused_reasons
from shipid.logs.guess.wind import choose_wind
from shipid.logs.mapping import to_si
from shipid.physics.signals import rows_of_role
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

NUMBERED = 0.95  # share of the rows, at least, whose number is the next one: a few may be lost, or a file begin anew


@dataclass(frozen=True)
class Guess:
    """The result of a guess.

    source : the files. columns, findings, questions : suggested columns, defects, and what the log cannot decide.
    unused : column without a meaning -> why.
    """

    source: GuessFiles
    columns: tuple[Suggestion, ...]
    findings: tuple[Clue, ...]
    questions: tuple[Question, ...]
    unused: Mapping[str, str]

    @property
    def file(self) -> Path:
        """The file, or the folder of several."""
        return self.source.path

    @property
    def sniffed(self) -> LogTable:
        """The log as numbers; of several files all rows."""
        return self.source.sniffed

    def column(self, name: str) -> Suggestion | None:
        """The suggestion for a column of the dataset; None if there is none."""
        return next((column for column in self.columns if column.name == name), None)

    @property
    def kinds(self) -> set[str]:
        """Kinds of all findings."""
        return {finding.kind for finding in self.findings}


def guess(
    path: str | Path, names: tuple[str, ...] = (), vessel: Vessel | None = None, frame: Frame | None = None
) -> Guess:
    """Guess the mapping of a log.

    path : text, a workbook, Parquet, MATLAB or NMEA 0183; a folder or a glob of such files, one run each.
    names : of the columns of a text log without a header. frame : of x, y and the heading, where a person knows it.
    vessel : whose names the commands take, and whose length says which speeds are possible.

    Raises DataError if the log cannot be read, has no clock, heading or position, or does not move as in that frame.
    """
    names = as_names("names", names, DataError)
    if vessel is not None:
        check_class("vessel", vessel, Vessel, "as of `load_vessel`, or None", DataError)
    if frame is not None:
        check_choice("frame", frame, get_args(Frame), DataError)
    source = read_source(as_path("path", path, DataError), names)
    sniffed = source.sniffed
    columns = evidence.fill_columns(sniffed.t, sniffed.columns.items())
    spiky = take_spikes(sniffed.t, columns)
    joined = len(source.files) > 1 or bool(sniffed.runs)
    state = State(sniffed.t, sniffed.clock["unit"], columns, evidence.row_windows(sniffed.t), joined, spiky)
    state.sides, state.words, state.other = sniffed.sides, sniffed.words, sniffed.other
    state.units |= {name: "quaternion" for name, parts in sniffed.in_parts.items() if len(parts) == 4}
    state.commands = () if vessel is None else vessel_dynamics(vessel).commands
    numbering = tuple(name for name, values in columns.items() if np.mean(np.diff(values) == 1.0) > NUMBERED)
    state.taken.update(numbering)
    state.taken |= {*columns} & {source.parts.get("from")}
    take_scales(state)
    take_fills(state)
    if len(state.chosen.first) < 5:
        rows = f"{len(sniffed.t)} rows over {sniffed.t[-1] - sniffed.t[0]:.3g} s are too few for a draft"
        clock = f"is {sniffed.clock['from']!r} the clock, in {sniffed.clock['unit']}?"
        raise DataError(f"{rows}: {clock}", file=source.path)
    outputs = reserve_outputs(state)
    choose_motion(state, source.path, frame)
    check_clock(state, np.inf if vessel is None else vessel.document.get("particulars", {}).get("L_pp", np.inf))
    for doubt in sniffed.doubts:
        state.ask(("clock", "t"), doubt)
    clock = sniffed.clock["from"]
    if isinstance(clock, str) and sniffed.clock["unit"] != "date" and not (is_clock(clock) or state.numbered):
        state.ask(("clock",), f"no column is called a clock: {clock!r} rises from row to row. Is it the time?")
    choose_commands(state)
    suggest_outputs(state, outputs)
    if vessel is not None:
        name_commands(state, vessel)
    report_misnomers(state)
    _choose_other_columns(state)
    choose_wind(state)
    defects_of_rows(state, sniffed)
    report_stuck_sensors(state)
    report_spikes(state)
    ask_for_changes(state, PAUSE)
    defects_of_motion(state)
    left = unused_reasons(state, numbering)
    return Guess(source, tuple(state.suggestions), tuple(state.findings), tuple(state.questions), left)


def _choose_other_columns(state: State) -> None:
    """Choose roll, pitch and other environment columns by their names alone."""
    further = [name for name, row in rows_of_role("environment").items() if row.names and name not in ("V_w", "beta_w")]
    for meaning in ("phi", "theta", *further):
        for name in state.called(meaning):
            unit, top = likely_unit(state, name, meaning), float(np.abs(state.columns[name]).max())
            if meaning in further or top * to_si(unit, meaning) <= np.pi / 2:  # `stamp` is a pitch, and a time
                why = "by its name" if meaning in further else "by its name; the log does not show its sign"
                state.ask_for_unit(meaning, name, unit)
                state.suggest(meaning, name, unit, 0.5, why)
                break
