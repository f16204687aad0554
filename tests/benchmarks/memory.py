"""Peak memory of a process by size of its work: windows, members of a family, rows of a log."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from shipid.data.windows import cut_windows
from shipid.hybrid.physics import Physics
from shipid.study.prepare import obtain_runs, prepare
from shipid.vessel.load import load_vessel
from tests.study.tiny import logged, tiny_plan

SIZES = {
    "windows": (125_000, 250_000, 500_000, 1_000_000),
    "members": (1000, 3000, 10_000),
    "rows": (500_000, 1_000_000, 5_000_000),
}
RUNS, HORIZON = 50, 30
MAPPING = Path(__file__).parents[1] / "bad" / "logs" / "plain.toml"


def run() -> dict[str, Any]:
    """Peak [MB] above that of the smallest work there is, and by how much it grows faster than the work."""
    figures: dict[str, Any] = {}
    for name, sizes in SIZES.items():
        peaks = {size: peak(name, size) for size in (2 * RUNS, *sizes)}
        least = peaks.pop(2 * RUNS)
        for size, megabytes in peaks.items():
            figures[f"{size:,} {name}: peak [MB]"] = round(megabytes)
        few, many = sizes[-2:]
        growth = (peaks[many] - least) / (peaks[few] - least) * few / many
        figures[f"{name}: peak per unit, {many:,} / {few:,}, without {least:.0f} MB"] = round(growth, 3)
    return figures


def peak(name: str, size: int) -> float:
    """Peak of the resident memory [MB] of a new process that does the work."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", __spec__.name, name, str(size)]
        if name == "rows":
            command = [
                sys.executable,
                "-m",
                "shipid",
                "data",
                "import",
                str(MAPPING),
                str(write_log(Path(folder), size)),
            ]
            command += ["--out", f"{folder}/log.parquet"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env={**os.environ, "OMP_NUM_THREADS": "1"})
        _, status, used = os.wait4(process.pid, 0)
        if status:
            raise RuntimeError(f"{size} {name}: ends with {os.waitstatus_to_exitcode(status)}")
        return used.ru_maxrss / 1024


def write_log(folder: Path, rows: int) -> Path:
    """A text log of a ship that turns slowly, 10 Hz."""
    with (folder / "log.csv").open("w") as file:
        file.write("time,N,E,heading,u,v,rot,rpm\n")
        for first in range(0, rows, 50_000):
            t = 0.1 * np.arange(first, min(first + 50_000, rows))
            psi = 0.01 * t
            columns = [t, 500 * np.sin(psi), 500 * (1 - np.cos(psi)), np.degrees(psi) % 360]
            columns += [np.full(len(t), value) for value in (5.0, 0.0, np.degrees(0.01) * 60, 120.0)]
            np.savetxt(file, np.stack(columns, axis=1), "%.4f", ",")
    return folder / "log.csv"


def windows(count: int) -> None:
    """Cut windows from runs, and roll the physics out on each."""
    rows = count // RUNS + HORIZON
    t = np.arange(rows, dtype=float)
    steady = {"u": 5.0, "north": 5.0 * t, "port.n": 2.0, "starboard.n": 2.0, "V_w": 0.0, "beta_w": 0.0}
    data = logged({f"R{number:02d}": steady for number in range(RUNS)}, t, clock="run")
    cut = cut_windows(data, horizon=HORIZON, step=1.0, interval=1.0)
    assert len(cut) >= count, len(cut)
    Physics(load_vessel("gunnerus-28.9"), HORIZON, 1.0).paths(cut.instants())


def members(count: int) -> None:
    """Plan and prepare a study with a family of so many members: each of them is rolled out."""
    with tempfile.TemporaryDirectory() as folder:
        plan = tiny_plan(Path(folder), {"family.1.members": count})
        prepare(plan, obtain_runs(plan))


if __name__ == "__main__":
    {"windows": windows, "members": members}[sys.argv[1]](int(sys.argv[2]))
