"""The table of cells over ships: one row per ship, foundation, amount of data and horizon."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from shipid.errors import DataError
from shipid.files import open_file
from shipid.study.schema import KINDS_OF_PHYSICS

CELL_COLUMNS = {
    "ship": "name",
    "type": "of the ship",
    "bundled": "whether shipid ships the vessel",
    "length": "m",
    "speed": "m/s, service",
    "froude": "speed / sqrt(g length)",
    "foundation": "the member",
    "kind": "what is wrong with the physics",
    "A": "m, mean error of the physics alone over the horizon; NaN for none",
    "N_D": "runs; 0: physics alone",
    "ahead": "ship lengths",
    "H": "m, mean error over the horizon with data",
    "baseline": "m, error of constant u, v, r on the same windows",
    "floor": "m, A of the true 3-DOF physics, blind to sea and sensors",
}
CELL_KINDS = (*KINDS_OF_PHYSICS, "none")
NUMBERS = ("length", "speed", "froude", "N_D", "ahead", "H", "baseline", "floor")


def read_cell_table(file: Path) -> pd.DataFrame:
    """Read a table of cells, CSV or Parquet; rows without a finite H, whose prediction diverged, are left out.

    Raises DataError for what is no table, a column that is missing, a kind that the law does not know, and a number
    that is not above 0.
    """
    with open_file(file) as source:
        try:
            frame = pd.read_csv(source) if file.suffix == ".csv" else pd.read_parquet(source)
            frame = frame.astype({name: float for name in (*NUMBERS, "A") if name in frame})
        except ValueError as error:
            reason = str(error).partition("\n")[0]
            raise DataError(f"is no table of cells, CSV or Parquet ({reason})", file=file) from error
    return check_cells(frame, file)


def check_cells(cells: pd.DataFrame, file: Path | None = None) -> pd.DataFrame:
    """Cells with a finite H, their values checked as those of `read_cell_table`; an empty kind is not known."""
    if missing := [name for name in CELL_COLUMNS if name not in cells]:
        raise DataError(
            f"missing: a table of cells has the columns {', '.join(CELL_COLUMNS)}", file=file, path=missing[0]
        )
    if strange := sorted({*cells["kind"]} - {*CELL_KINDS, ""}):
        raise DataError(f"{strange[0]!r} is no kind: give one of {', '.join(CELL_KINDS)}", file=file, path="kind")
    cells = cells[np.isfinite(cells["H"])]
    least = {name: cells[name].min() for name in NUMBERS}
    least["A"] = cells["A"][cells["kind"] != "none"].min()
    for name, value in least.items():
        if value < 0 or (value == 0 and name != "N_D"):
            raise DataError(f"{value:g} is not above 0", file=file, path=name)
    return cells.reset_index(drop=True)
