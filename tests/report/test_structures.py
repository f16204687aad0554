"""The page of a comparison of structures, from frames alone."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from shipid.report.structures import StructuresContent, write_structures

ROW = {"numbers": 18, "u": 0.01, "v": 0.01, "r": 0.001, "position": 0.1, "test": float("nan"), "note": ""}


def content() -> StructuresContent:
    table = pd.DataFrame(
        [
            {"structure": "a <b>", **ROW, "more": 0.0, "low": float("nan"), "high": float("nan"), "equal": True},
            {"structure": "b", **ROW, "more": 0.1, "low": 0.05, "high": 0.2, "equal": False},
        ]
    )
    errors = pd.DataFrame(
        [{"structure": "a <b>", "set": "folds", "run": run, "position": 0.1} for run in ("all", "R1")]
    )
    measures = [{"structure": name, "value": value} for name, value in (("a <b>", 20.0), ("b", 24.0))]
    same = {"manoeuvre": "turning 35 to port", "measure": "advance", "unit": "m"}
    manoeuvres = pd.DataFrame([{**same, **one, "low": 19.0, "high": 21.0, "note": ""} for one in measures])
    spread = pd.DataFrame([{**same, "least": 20.0, "greatest": 20.0, "spread": 0.0, "width": 2.0}])
    return StructuresContent(
        title="a ship", name="ship", sentences=["a is best"], table=table, errors=errors, manoeuvres=manoeuvres,
        spread=spread,
        chosen="a <b>", cautions={"b": "short horizon"}, ahead=30.0, level=0.95,
    )  # fmt: skip


def test_the_page_shows_all_and_escapes_names(tmp_path: Path) -> None:
    text = write_structures(content(), tmp_path / "page.html").read_text()
    for word in ("A is best.", "a &lt;b&gt;", "20.00 (19.00 … 21.00)", "short horizon", "0.05 to 0.20"):
        assert word in text
    assert "a <b>" not in text.replace("a <b>ship", "")
