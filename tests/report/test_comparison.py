"""The page over the parts of a study: see `tests/report/test_methods.py` for what it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipid.errors import ResultError
from shipid.report.comparison import write_comparison
from tests.report.test_methods import content, frame


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultError, match="cannot be written"):
        write_comparison(content(frame(1)), tmp_path / "file" / "report.html")


def test_the_same_frame_gives_the_same_page(tmp_path: Path) -> None:
    first, again = (write_comparison(content(frame(1)), tmp_path / f"{k}.html").read_bytes() for k in range(2))
    assert first == again
