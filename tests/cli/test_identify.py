"""`shipid identify`: what its options mean; tests/identification/test_command.py runs it."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner

from shipid.cli import app


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
