"""`run` and `events`: the words of the command line, as functions."""

from __future__ import annotations

import logging
from pathlib import Path

import pandas as pd
import pytest

from shipid.answer.start import events, run
from shipid.errors import ShipidError
from shipid.study.plan import default_folder, read_plan
from tests.study.tiny import TINY


def test_run_logs_its_progress_and_returns_results(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(logging.getLogger("shipid"), "handlers", [])  # a command run before leaves its own
    out = tmp_path / "run"
    with caplog.at_level(logging.INFO, logger="shipid"):
        results = run(TINY, set={"grid.N_D": [4]}, out=out, workers=1)
    assert results.complete
    assert set(results.cells["N_D"]) == {4}
    assert results.folder == out
    assert (out / "report.html").is_file()
    lines = [record.getMessage() for record in caplog.records if record.name == "shipid.answer.start"]
    assert "4 of 4 cells to do" in lines
    assert sum(line.startswith("[4/4] ") for line in lines) == 1
    assert capfd.readouterr() == ("", ""), "the library prints nothing"

    happened = list(events(TINY, {"grid.N_D": [4]}, out, 1))
    assert [event.kind for event in happened if event.kind != "note"] == ["start", "end"], "nothing is run again"
    assert happened[-1].text == str(out)
    pd.testing.assert_frame_equal(run(TINY, {"grid.N_D": [4]}, out, 1).cells, results.cells)


def test_the_folder_is_named_after_the_study() -> None:
    plan = read_plan(TINY)
    assert default_folder(plan) == Path("results") / f"plain-{plan.digest[:8]}"


def test_a_mistake_is_an_error_of_shipid() -> None:
    with pytest.raises(ShipidError, match="did you mean 'quick'"):
        run("quik")
    with pytest.raises(ShipidError, match=r"grid\.M_D"):
        next(events(TINY, {"grid.M_D": [4]}))
    with pytest.raises(ShipidError, match="out must be a path, a text or a Path, not 3"):
        next(events(TINY, out=3))  # type: ignore[arg-type]
