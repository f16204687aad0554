"""`shipid identify`: what its options mean; tests/identification/test_command.py runs it."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.vessel.load import load_vessel
from tests.identification.trials import trials


def test_options_are_read_before_anything_is_loaded(tmp_path: Path) -> None:
    """A mistake in an option is reported before a dataset is read, in one line."""
    for arguments, remedy in (
        (["--prior", "hull.derivatives.*"], "--prior: 'hull.derivatives.*': write paths=0.3"),
        (["--bounds", "hull.derivatives.*=[0.5"], "--bounds: 'hull.derivatives.*=[0.5': write paths=[0.5,2]"),
        (["--html", "page.pdf"], "page.pdf: a page is an HTML file"),
        (["--folds", "2"], "--folds: goes with --structures"),
    ):
        out = ["--out", str(tmp_path / "patch.toml")]
        result = CliRunner().invoke(app, ["identify", "gunnerus-28.9", "gone.parquet", *out, *arguments])
        assert remedy in str(result.exception)


def test_widths_of_nuisances() -> None:
    from shipid.cli.identify import _widths
    from shipid.identification.settings import WIDE

    assert _widths(["current", "heading_bias"]) == ["current", "heading_bias"]
    assert _widths(["current=0.3", "heading_bias"]) == {"current": 0.3, "heading_bias": WIDE.get("heading_bias", 1.0)}


def test_the_look_before_the_fit_says_what_it_does_when_it_takes_long(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from shipid.cli import identify, terminal
    from shipid.cli.answer import Answer
    from shipid.errors import DataError
    from shipid.study import first_look, new

    def slow(*_: object, **__: object) -> None:
        time.sleep(0.3)
        raise DataError("enough")

    monkeypatch.setattr(terminal, "SILENCE", 0.02)
    monkeypatch.setattr(new, "proposed_horizon", lambda *_: (30.0, 1.0))
    monkeypatch.setattr(first_look, "first_look", slow)
    dataset = trials(load_vessel("gunnerus-28.9"), runs=2, steps=30)
    identify._look(load_vessel("gunnerus-28.9"), dataset, (), (), Answer(False))
    assert "comparing the vessel as she is with the runs, before the fit" in capsys.readouterr().err
