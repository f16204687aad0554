from dataclasses import FrozenInstanceError

import pytest

from shipid.report import ReportContent


def test_every_frame_but_cells_and_models_may_be_absent(full_scale):
    content = ReportContent("Question?", "bare", [], [], full_scale.cells, full_scale.naive, full_scale.models)
    for name in ("horizon", "over_time", "commands", "tracks", "envelope", "factors", "trials", "repairs"):
        assert len(getattr(content, name)) == 0
        assert set(getattr(full_scale, name).columns) >= set(getattr(content, name).columns)
    assert content.frames == {}
    with pytest.raises(FrozenInstanceError):
        content.title = "Another?"
