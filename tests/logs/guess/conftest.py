"""Logs as text, for guesses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.logs.guess.sniff import LogTable, recognise_log

T = np.arange(0.0, 10.0, 0.5)
TABLE = pd.DataFrame({"time": T, "N": 1.5 * T, "psi": 30.0 + T})
SUMMER_TIME_ENDS = [f"26.10.2025 02:{59 * (i < 10):02}:{(50 + i) % 60:02}" for i in range(len(T))]


def text(
    separator: str = ",", decimal: str = ".", above: str = "", table: pd.DataFrame = TABLE, header: bool = True
) -> str:
    return above + table.to_csv(index=False, sep=separator, decimal=decimal, header=header)


def log_of(tmp_path: Path, lines: list[str], name: str = "log.csv") -> Path:
    file = tmp_path / name
    file.write_text("\n".join(lines) + "\n")
    return file


def sniff(tmp_path: Path, table: pd.DataFrame, **written: Any) -> LogTable:
    """Recognise a table that is written as a log."""
    table.to_csv(tmp_path / "log.csv", index=False, **written)
    return recognise_log(tmp_path / "log.csv")
