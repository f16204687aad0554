"""Devices, pipes and headers of very many columns are refused at once."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from shipid.errors import DataError
from shipid.logs.admit import MOST_COLUMNS, check_log

GOOD = Path(__file__).parents[1] / "bad" / "logs" / "good.csv"


def test_a_log_and_a_missing_one_are_left_to_the_reader(tmp_path: Path) -> None:
    check_log(GOOD)
    check_log(tmp_path / "gone.csv")
    check_log(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_what_has_no_end_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for file in (tmp_path / "pipe", Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(DataError, match="a device or a pipe"):
            check_log(file)


@pytest.mark.parametrize("separator", [b",", b";", b"\t"])
@pytest.mark.parametrize(("count", "refused"), [(MOST_COLUMNS, False), (MOST_COLUMNS + 2, True), (10**6, True)])
def test_very_many_columns(separator: bytes, count: int, refused: bool, tmp_path: Path) -> None:
    file = tmp_path / "x.csv"
    file.write_bytes(separator.join([b"a"] * count) + b"\n1\n")
    if refused:
        with pytest.raises(DataError, match="columns in the first line"):
            check_log(file)
    else:
        check_log(file)
