"""Raw files of strangers: a seed makes the same bytes, and each column is what its truth says."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from tests.strangers_raw import Array, RawColumn, RawFile, RawStranger, raw_stranger
from tests.strangers_ships import true_values

SEEDS = (611, 612)
RUNS = 4


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


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


def test_a_seed_makes_the_same_bytes_and_another_seed_others(tmp_path: Path, ships: list[RawStranger]) -> None:
    first, other = ships
    again = raw_stranger(first.seed, tmp_path, RUNS)
    assert bytes_of(again.folder) == bytes_of(first.folder)
    assert again.dataset.digest == first.dataset.digest
    assert again.known == first.known
    assert bytes_of(other.folder) != bytes_of(first.folder)
    assert other.truth.digest != first.truth.digest


def test_all_runs_are_in_the_files_and_in_the_dataset(ship: RawStranger) -> None:
    assert sorted(run for file in ship.files for run in file.runs) == ship.dataset.runs == list(ship.kinds)
    assert len(ship.dataset.runs) == RUNS
    assert {"length", "beam", "draught", "block"} <= ship.known.keys()
    assert len({column.header for column in ship.columns}) == len(ship.columns)
    assert not [name for name in ship.dataset.frame if str(name).startswith("actual.")]
    assert {column.signal for column in ship.columns} & {"time"}


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


def test_options_are_words_of_the_command_line(ship: RawStranger) -> None:
    assert "--length" in ship.options
    assert "True" not in ship.options
    assert [word for word in ship.options if word.startswith("--")] == [f"--{name}" for name in ship.known]


@pytest.mark.slow
def test_ships_and_teams_differ(tmp_path: Path) -> None:
    """Over some seeds there are models and ships, several teams, formats, frames and signs."""
    ships = [raw_stranger(seed, tmp_path / str(seed), 2) for seed in range(700, 712)]
    for what in ("team", "language", "separator", "encoding", "time", "frame", "units", "layout"):
        assert len({ship.style[what] for ship in ships}) > 1, what
    signs = {column.sign for ship in ships for column in ship.columns if column.signal.endswith(".delta")}
    assert signs == {1, -1}
    lengths = [float(ship.known["length"]) for ship in ships]
    assert min(lengths) < 7.1
    assert max(lengths) > 30
