"""Raw files of strangers: a seed makes the same bytes, and each column is what its truth says."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from tests.strangers_raw import Array, RawColumn, RawFile, RawStranger, raw_stranger
from tests.strangers_ships import true_values

SEEDS = (611, 612)
RUNS = 4


def cells(ship: RawStranger, file: RawFile) -> list[list[str]]:
    """Data lines of a file, the empty ones at its end left out."""
    text = (ship.folder / file.path).read_bytes().decode(ship.style["encoding"])
    lines = text.replace("\r\n", "\n").split("\n")[file.header_line :]
    separator = ship.style["separator"]
    if separator == "blanks":
        table = [line.split() for line in lines]
    else:
        table = list(csv.reader(io.StringIO("\n".join(lines)), delimiter=separator))
    rows = [row for row in table if any(row)]
    assert rows[0] == [column.header for column in ship.columns]
    return rows[file.data_line - file.header_line :]


def numbers(ship: RawStranger, texts: list[str]) -> Array:
    plain = [text.replace(ship.style["decimal"], ".") for text in texts]
    return np.array([float(text) if text not in ("", "NaN", "-999") else np.nan for text in plain])


def late_and_held(ship: RawStranger, column: RawColumn) -> Array:
    """True values (rows of the record,) [SI], late as the column's sensor is, for sensors that are not held."""
    held = np.empty(len(ship.record))
    for rows in ship.record.groupby("run", sort=False).indices.values():
        frame = ship.record.iloc[rows]
        true = true_values(frame, column.signal, column.at)
        true = np.unwrap(true) if column.wrap else true
        t = frame["t"].to_numpy()
        held[rows] = np.interp(t - column.late, t, true)
    return held


@pytest.fixture(scope="module")
def ships(tmp_path_factory: pytest.TempPathFactory) -> list[RawStranger]:
    return [raw_stranger(seed, tmp_path_factory.mktemp("raw"), RUNS) for seed in SEEDS]


@pytest.fixture(params=range(len(SEEDS)))
def ship(request: pytest.FixtureRequest, ships: list[RawStranger]) -> RawStranger:
    chosen: RawStranger = ships[request.param]
    return chosen


def test_every_column_is_what_its_truth_says(ship: RawStranger) -> None:
    """Raw values, brought to SI with unit, sign, offset and zero, are the true ones but for noise and rounding."""
    for file in ship.files:
        table = cells(ship, file)
        assert len(table) == len(file.rows)
        for place, column in enumerate(ship.columns):
            if column.signal in ("", "time", "date", "run") or column.held:
                continue
            raw = numbers(ship, [row[place] for row in table])
            got = (raw - column.offset - column.zero) / column.scale
            error = got - late_and_held(ship, column)[file.rows]
            if column.wrap:
                error = np.angle(np.exp(1j * error))
            seen = np.isfinite(error)
            assert seen.sum() > 0.7 * len(error), column.header
            allowed = (6 * column.noise + column.quantum) / abs(column.scale) + 1e-9
            share = float(np.mean(np.abs(error[seen]) <= allowed))
            assert share > (0.9 if ship.style["missing"] == "hold" else 0.9999), (column, share)
