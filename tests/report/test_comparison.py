from pathlib import Path

import pytest

from shipid.errors import ResultError
from shipid.report.comparison import write_comparison
from tests.report.test_methods import content, frame


def test_the_same_frame_gives_the_same_page_and_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    first, again = (write_comparison(content(frame(1)), tmp_path / f"{k}.html").read_bytes() for k in range(2))
    assert first == again
    with pytest.raises(ResultError, match="cannot be written"):
        write_comparison(content(frame(1)), tmp_path / "0.html" / "report.html")
