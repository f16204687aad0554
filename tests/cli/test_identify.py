"""`shipid identify`: what its options mean; tests/identification/test_command.py runs it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.data.dataset import write_dataset
from shipid.vessel.load import load_vessel
from tests.identification.trials import trials


def test_options_are_read_before_anything_is_loaded(tmp_path: Path) -> None:
    """A mistake in an option is reported before a dataset is read, in one line."""
    for arguments, remedy in (
        (["--prior", "hull.derivatives.*"], "--prior: 'hull.derivatives.*': write paths=0.3"),
        (["--bounds", "hull.derivatives.*=[0.5"], "--bounds: 'hull.derivatives.*=[0.5': write paths=[0.5,2]"),
        (["--html", "page.pdf"], "page.pdf: --html: let the name end in .html"),
        (["--folds", "2"], "--folds: goes with --structures"),
    ):
        out = ["--out", str(tmp_path / "patch.toml")]
        result = CliRunner().invoke(app, ["identify", "gunnerus-28.9", "gone.parquet", *out, *arguments])
        assert remedy in str(result.exception)


@pytest.mark.parametrize(
    ("arguments", "remedy"),
    [
        (["mgm"], "structures: 'mgm' is no structure: did you mean 'mmg'?"),
        (["mmg,modulus", "--folds", "1"], "folds: 1 folds of 3 runs: give 2 or more"),
        (["mmg,modulus", "--runs", "M01"], "runs: only one run"),
        (["mmg,modulus", "--ahead", "-3"], "ahead: a free run of -3 s"),
    ],
)
def test_a_mistake_in_a_comparison_is_refused_before_the_look(
    arguments: list[str], remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from shipid.cli import identify

    monkeypatch.setattr(identify, "_diagnose_first", lambda *_: pytest.fail("it was compared with the log before"))
    log = write_dataset(trials(load_vessel("gunnerus-28.9"), runs=3, steps=30), tmp_path / "log.parquet")
    given = ["identify", "gunnerus-28.9", str(log), "--out", str(tmp_path / "a.toml"), "--structures", *arguments]
    assert remedy in str(CliRunner().invoke(app, given).exception)


def test_the_answer_of_a_comparison_for_programs_has_all_that_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.answer import Answer
    from shipid.cli.identify import _show_structures

    table = pd.DataFrame(
        [{"structure": "mmg", "numbers": 3, **dict.fromkeys(("u", "v", "r", "position", "more", "low", "high"), 0.1)}]
    ).assign(test=0.1, note="")
    diverges = {"structure": "mmg", "manoeuvre": "turning 35 to port", "measure": "", "note": "diverges"}
    spread = {"manoeuvre": "turning 35 to port", "measure": "advance", "spread": 2.0, "width": 1.0}
    compared = SimpleNamespace(
        vessel=load_vessel("gunnerus-28.9"), runs=("a", "b"), ahead=20.0, table=table, sentences=["best"],
        manoeuvres=pd.DataFrame([diverges]), spread=pd.DataFrame([spread]), shared=("shared",), chosen="mmg",
        fits={"mmg": SimpleNamespace(caution="wide")},
    )  # fmt: skip
    answer = Answer(True)
    _show_structures(compared, answer)  # type: ignore[arg-type]
    said = ["shared", "intervals of mmg: wide", "mmg, turning 35 to port: diverges"]
    assert answer.contents["warnings"] == said
    assert answer.contents["spread"] == [spread]
    assert capsys.readouterr().err.splitlines() == [f"warning: {one}" for one in said]
