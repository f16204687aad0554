"""Lapses of commands are drafted with what mends them, or asked about where they may be orders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shipid.data.checks import check_dataset
from tests.logs.simulated import globe, guess_of, import_draft, si_log


def test_lapses_of_commands_are_drafted_mended_and_checked(tmp_path: Path) -> None:
    """Before, a shaft that is 0 for two seconds, and a rudder of 90 deg in one row, came into the dataset silently."""
    clean = globe(0)
    frame = clean.copy()
    for place in (300, 1200, 2000):
        frame.loc[place : place + 3, "rpm"] = 0.0
        frame.loc[place + 20, "rudder"] = 90.0
    expected, proposal = guess_of(tmp_path, clean), guess_of(tmp_path, frame)
    assert "lapses of a command" not in expected.kinds
    found = {one.columns: one for one in proposal.findings if one.kind == "lapses of a command"}
    assert set(found) == {("rpm",), ("rudder",)}
    assert "is 0 in 12 rows at 3 places" in found["rpm",].sentence
    assert f"t = {clean['time'][300]:g}" in found["rpm",].sentence
    table = check_dataset(import_draft(tmp_path, proposal, without=("despike",)))
    failed = table[~table["ok"] & table["check"].str.startswith("lapses")]
    assert dict(zip(failed["check"], failed["value"], strict=True)).keys() == {
        f"lapses {one.name}" for one in proposal.columns if one.source in ("rpm", "rudder")
    }
    assert all("despike or a break" in sentence for sentence in failed["sentence"])
    log, mended = si_log(0), import_draft(tmp_path, proposal)
    assert not check_dataset(mended)["check"].str.startswith("lapses").any()
    shaft = next(one.name for one in proposal.columns if one.source == "rpm")
    truth = np.interp(mended.frame["t"], log["t"], log["n"])
    assert mended.frame[shaft].to_numpy() == pytest.approx(truth, abs=0.05)
