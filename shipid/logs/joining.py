"""Join datasets of one vessel: recordings of several days, or of recorders that write in several ways."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import FIRST_DATED_TIME, Dataset, units_of_columns
from shipid.errors import DataError
from shipid.logs.frames import PARALLEL, meridian_convergence
from shipid.logs.importing import distinct_names
from shipid.units import percent_text

FARTHEST = 1e5  # m between origins
COPIED = 0.3  # share of the rows of a run from which on it is a copy: manoeuvres of a simulator may begin alike


def join_datasets(datasets: Mapping[Path, Dataset]) -> tuple[Dataset, list[str]]:
    """One dataset with all runs, and notes on what was changed.

    Positions have the origin of the first dataset. Columns that not all have are left out. Names of runs that clash get
    the name of their file before them.

    datasets : file -> dataset, two or more.
    Raises DataError where commands or vessels differ, a run is in two datasets, or origins or clocks cannot be one.
    """
    if len(datasets) < 2:
        raise DataError(f"{len(datasets)} dataset: joining needs two or more")
    _check_alike(datasets)
    _check_copies(datasets)
    notes: list[str] = []
    columns = _common_columns(datasets, notes)
    names = _joined_names(datasets, notes)
    clock = _common_clock(datasets, notes)
    flags = list(dict.fromkeys(name for one in datasets.values() for name in one.metadata.get("flags", [])))
    frames = []
    for file, one in datasets.items():
        north, east, turn = _origin_offset(datasets, file)
        frame = one.frame[columns].assign(run=one.frame["run"].map(names[file]), flags=_joined_flags(one, flags))
        place = (frame["north"] + 1j * frame["east"]).to_numpy() * np.exp(1j * turn)
        turned = {name: frame[name] + turn for name in ("psi", "beta_w") if name in frame}
        frame = frame.assign(north=place.real + north, east=place.imag + east, **turned)
        frames.append(frame.astype({"run": "str"}))
        if np.hypot(north, east) > 0:
            angle = f", and turned with all directions by {np.degrees(turn):+.2f} deg" if abs(turn) > PARALLEL else ""
            moved = f"positions moved by {north:.1f} m north, {east:.1f} m east{angle}"
            notes.append(f"{file.name}: {moved}, to the first origin")
    frame = pd.concat(frames, ignore_index=True)
    return Dataset(frame, _joined_metadata(datasets, names, flags, clock, list(frame.columns))), notes


def _check_alike(datasets: Mapping[Path, Dataset]) -> None:
    (first, wanted), *others = datasets.items()
    for file, one in others:
        for here, there, place in ((wanted, one, file), (one, wanted, first)):
            lacking = [name for name in here.commands if name not in there.commands]
            if lacking:
                raise DataError(
                    f"no command {', '.join(lacking)}, which {first.name if place is file else file.name} has"
                    f": name the columns alike in both mappings, and import again",
                    file=place,
                )
        vessels = {str(data.metadata["vessel"]) for data in (wanted, one) if data.metadata.get("vessel")}
        if len(vessels) > 1:
            raise DataError(f"of another vessel than {first.name}: {' and '.join(sorted(vessels))}", file=file)


def _check_copies(datasets: Mapping[Path, Dataset]) -> None:
    """Raise DataError for a run whose motion is, row by row, in another dataset too, whatever its name is there."""
    rows = {
        file: pd.util.hash_pandas_object(one.frame[["u", "v", "r"]], index=False).drop_duplicates(keep=False)
        for file, one in datasets.items()  # once only: a ship at rest is no copy of another one at rest
    }
    for first, second in combinations(datasets, 2):
        for file, other in ((second, first), (first, second)):  # a run may be a part of a longer one
            run = datasets[file].frame["run"]
            shares = rows[file].isin(rows[other]).groupby(run).sum() / run.groupby(run).size()
            if shares.max() > COPIED:
                raise DataError(
                    f"run {shares.idxmax()!r} has {percent_text(shares.max())} of its rows from {other.name}"
                    f": a copy would train on what it tests; leave one of them out",
                    file=file,
                )


def _common_columns(datasets: Mapping[Path, Dataset], notes: list[str]) -> list[str]:
    """Columns that all have, in the order of the first."""
    everywhere = set.intersection(*({str(name) for name in one.frame.columns} for one in datasets.values()))
    if not {"V_w", "beta_w"} <= everywhere:
        everywhere -= {"V_w", "beta_w"}
    first = next(iter(datasets.values())).frame.columns
    known = dict.fromkeys(str(name) for one in datasets.values() for name in one.frame.columns)
    left = [name for name in known if name not in everywhere]
    if left:
        notes.append(f"left out, because not all have them: {', '.join(left)}")
    return [str(name) for name in first if name in everywhere]


def _joined_names(datasets: Mapping[Path, Dataset], notes: list[str]) -> dict[Path, dict[str, str]]:
    """File -> run -> its name in the whole."""
    runs = [run for one in datasets.values() for run in one.runs]
    if len(set(runs)) == len(runs):
        return {file: {run: run for run in one.runs} for file, one in datasets.items()}
    notes.append(f"runs of one name in several files: names begin with {', '.join(file.stem for file in datasets)}")
    distinct = iter(distinct_names(f"{file.stem} {run}" for file, one in datasets.items() for run in one.runs))
    return {file: {run: next(distinct) for run in one.runs} for file, one in datasets.items()}


def _common_clock(datasets: Mapping[Path, Dataset], notes: list[str]) -> str:
    """Clock of the whole: that of each run where one has it, or where undated recordings overlap."""
    spans = {file: (float(one.frame["t"].min()), float(one.frame["t"].max())) for file, one in datasets.items()}
    if all(one.metadata.get("clock", "shared") != "run" for one in datasets.values()):
        bare = [file for file, (begin, _) in spans.items() if begin <= FIRST_DATED_TIME]
        if 0 < len(bare) < len(datasets):
            raise DataError("its clock has no date, that of another has: map the column of dates in both", file=bare[0])
        if not bare or not any(a <= d and c <= b for (a, b), (c, d) in combinations(spans.values(), 2)):
            return "shared"
        notes.append("clocks overlap and have no date: each run has a clock of its own")
    for file, one in datasets.items():
        if one.metadata.get("clock", "shared") != "run":
            _check_no_overlap(file, one)
    return "run"


def _check_no_overlap(file: Path, one: Dataset) -> None:
    """Raise DataError where two runs of one recording share moments, which clocks of runs do not say."""
    spans = one.frame.groupby("run", sort=False)["t"].agg(["min", "max"]).sort_values("min")
    over = np.flatnonzero(spans["max"].cummax().to_numpy()[:-1] >= spans["min"].to_numpy()[1:])
    if len(over):
        name = spans.index[over[0] + 1]
        raise DataError(
            f"run {name!r} shares moments with another, and the other datasets have a clock for each run"
            f": cut the segments of this mapping apart, and import again",
            file=file,
        )


def _origin_offset(datasets: Mapping[Path, Dataset], file: Path) -> tuple[float, float, float]:
    """North and east [m] of the origin of a dataset, seen from that of the first, and the angle of its north [rad]."""
    (first, wanted), *_ = datasets.items()
    here, there = (one.metadata.get("origin") for one in (datasets[file], wanted))
    if here == there:
        return 0.0, 0.0, 0.0
    if not here or not there:
        bare = file if here is None else first
        raise DataError(
            "positions have no origin on the Earth, those of the other datasets have"
            ": import all with latitude and longitude, or none",
            file=bare,
            path="origin",
        )
    from pymap3d import geodetic2ned

    places = here["latitude"], here["longitude"], there["latitude"], there["longitude"]
    north, east, _ = geodetic2ned(*places[:2], 0.0, *places[2:], 0.0)
    if np.hypot(north, east) > FARTHEST:
        away = f"{np.hypot(north, east) / 1e3:.0f} km from that of {first.name}"
        raise DataError(f"its origin is {away}: a plane holds {FARTHEST / 1e3:.0f} km", file=file, path="origin")
    return float(north), float(east), float(meridian_convergence(*places))


def _joined_flags(one: Dataset, flags: list[str]) -> np.ndarray:
    """Flags of the rows with the bits of the whole."""
    before = one.frame["flags"].to_numpy()
    result = np.zeros_like(before)
    for bit, name in enumerate(one.metadata.get("flags", [])):
        result |= ((before >> bit) & 1) << flags.index(name)
    return result


def _joined_metadata(
    datasets: Mapping[Path, Dataset],
    names: Mapping[Path, Mapping[str, str]],
    flags: list[str],
    clock: str,
    columns: list[str],
) -> dict[str, Any]:
    first = next(iter(datasets.values())).metadata
    vessel = next((one.metadata["vessel"] for one in datasets.values() if one.metadata.get("vessel")), None)
    result: dict[str, Any] = {
        "vessel": vessel,
        "source": {"joined": ", ".join(f"{file.name} ({one.digest})" for file, one in datasets.items())},
        "parts": [
            {
                "file": file.name,
                "digest": one.digest,
                "source": one.metadata.get("source"),
                "mapping": one.metadata.get("mapping"),
            }
            for file, one in datasets.items()
        ],
        "rows": sum(int(one.metadata.get("rows", len(one.frame))) for one in datasets.values()),
        "clock": clock,
        "units": units_of_columns(columns),
        "flags": flags,
        "repairs": [
            {**row, "note": f"{file.name}: {row.get('note', '')}"}
            for file, one in datasets.items()
            for row in one.metadata.get("repairs", [])
        ],
    }
    kinds = {
        names[file][run]: kind
        for file, one in datasets.items()
        for run, kind in one.metadata.get("manoeuvres", {}).items()
        if run in names[file]
    }
    return (
        result | ({"origin": first["origin"]} if first.get("origin") else {}) | ({"manoeuvres": kinds} if kinds else {})
    )
