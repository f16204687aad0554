"""The page of a comparison of structures: errors on runs held out, and standard manoeuvres side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from shipid.report.content import AnswerSentence, PageContent, rows_as_tuples
from shipid.report.motion import DEGREES
from shipid.report.page import Section, write_page
from shipid.report.tables import PageTable, TableCell, frame_table, range_cell, with_cells, word_cell
from shipid.report.wording import fixed_text
from shipid.units import digit_decimals


@dataclass(frozen=True, eq=False, kw_only=True)
class StructuresContent(PageContent):
    """Everything the page shows.

    errors : `structure`, `set` (`folds`, `test`), `run` (`all` at first), RMS `u`, `v` [m/s], `r` [rad/s], `position`
        [m] of runs that the fit has not seen.
    table : `structure`, `numbers`, means over runs `u`, `v`, `r`, `position`; `test`, that of the position on the test
        runs; `more`, `low`, `high`: difference of the position to the chosen one with its interval; `equal`: whether
        it is not shown to be worse, corrected for how many there are (Holm), and says something; `note`.
    manoeuvres : `manoeuvre`, `measure`, `unit`, `structure`, `value`, `low`, `high`, `note`.
    spread : `manoeuvre`, `measure`, `unit`, `least`, `greatest` over the structures that are equally good, `spread`
        and `width`, the greatest width of the interval within one of them.
    cautions : structure -> why its intervals may mislead. ahead : length of a free run [s], 0: whole runs.
    """

    sentences: Sequence[str]
    table: pd.DataFrame
    errors: pd.DataFrame
    manoeuvres: pd.DataFrame
    spread: pd.DataFrame
    chosen: str
    cautions: Mapping[str, str]
    ahead: float
    level: float | None

    @property
    def answer(self) -> list[AnswerSentence]:
        """The structure chosen, and the sentences on it."""
        words = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in self.sentences]
        return [AnswerSentence(text, "" if i else "structures") for i, text in enumerate(words)]


def structures_table(content: StructuresContent) -> PageTable:
    """Mean errors on runs that the fit has not seen, best first, with paired intervals."""
    frame = content.table
    between = [range_cell(row.low, row.high) for row in rows_as_tuples(frame)]
    columns = {
        "structure": "structure",
        "numbers": "numbers",
        "u [m/s]": "u",
        "v [m/s]": "v",
        "r [deg/s]": "r",
        "position [m]": "position",
        "above the least [m]": "more",
        "95 % interval [m]": "between",
        "test runs [m]": "test",
        "not worse": "equal",
        "why left out": "note",
    }
    equal = frame["equal"].map({True: "yes", False: "no"})
    shown = with_cells(frame.assign(r=DEGREES * frame["r"], equal=equal), between=between)
    length = f"of {content.ahead:g} s" if content.ahead else "as long as the runs"
    title = f"Free runs {length}, of runs that the fit has not seen"
    takeaway = "Means over runs of root mean square errors; intervals of differences are paired over runs."
    return frame_table("structures", title, takeaway, shown, columns)


def runs_table(content: StructuresContent) -> PageTable:
    """Error of the position, run by run."""
    known = content.errors[content.errors["run"] != "all"]
    wide = known.pivot(index=["set", "run"], columns="structure", values="position").reset_index()
    shown = known[["set", "run"]].drop_duplicates().merge(wide, how="left")
    shown = shown.assign(set=np.where(shown["set"].eq("test"), "test", "held out"))
    columns = {"run": "run", "set": "set"} | {f"{name} [m]": name for name in _structures_in(content, known)}
    return frame_table("runs", "Position, run by run", "Root mean square errors.", shown, columns)


def _structures_in(content: StructuresContent, frame: pd.DataFrame) -> list[str]:
    """Names of the structures in a frame, in the order of the table."""
    return [str(name) for name in content.table["structure"] if name in set(frame["structure"])]


def structure_manoeuvres(content: StructuresContent) -> PageTable:
    """Measures of standard manoeuvres by structure, the spread between structures beside the interval within one."""
    known = content.manoeuvres[content.manoeuvres["measure"] != ""]
    names, place = _structures_in(content, known), ["manoeuvre", "measure"]
    cells = with_cells(known, cell=[_measure_cell(row) for row in known.to_dict("records")])
    by_structure = cells.pivot(index=place, columns="structure", values="cell").reset_index()
    shown = known.drop_duplicates(place)[[*place, "unit"]].merge(by_structure, how="left")
    shown = shown.merge(content.spread[[*place, "spread", "width"]], how="left")
    takeaway = "" if content.level is None else f"With {100 * content.level:g} % intervals. "
    takeaway += "Between: range over the structures not shown to be worse; within: the widest interval of one of them."
    words = [f"{name}: {why}" for name, why in content.cautions.items() if why]
    takeaway += f" Intervals may be too narrow. {'; '.join(words)}." if words else ""
    columns = {name: name for name in (*place, *names)} | {
        "between structures": "spread",
        "within one": "width",
        "unit": "unit",
    }
    return frame_table("manoeuvres", "Standard manoeuvres in calm deep water", takeaway, shown, columns)


def _measure_cell(row: Mapping[Any, Any]) -> TableCell:
    """A measure with its interval, where there is one."""
    value, low, high = (float(row[name]) for name in ("value", "low", "high"))
    if np.isnan(value):
        return word_cell(None)
    places = digit_decimals(value, 4)
    ends = "" if np.isnan(low + high) else f" ({fixed_text(low, places)} … {fixed_text(high, places)})"
    return TableCell(fixed_text(value, places) + ends, value)


STRUCTURES_PAGE = {
    "structures": Section(
        "Which structure", {"structures": (structures_table, "table"), "runs": (runs_table, "errors")}
    ),
    "manoeuvres": Section(
        "What each says of standard manoeuvres", {"manoeuvres": (structure_manoeuvres, "manoeuvres")}
    ),
}
write_structures = partial(write_page, "structures", STRUCTURES_PAGE)
