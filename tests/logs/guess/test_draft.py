"""A draft is a mapping that imports, says why, and lists the manoeuvres of the log."""

from pathlib import Path

import numpy as np
import pytest

from shipid.data.checks import check_dataset
from shipid.errors import DataError
from shipid.files import write_new
from shipid.logs.guess.columns import guess
from shipid.logs.guess.draft import draft_mapping, draft_text, segment_log
from shipid.logs.importing import import_log, read_mapping
from tests.logs.conftest import import_written
from tests.logs.simulated import KNOT, SCHEDULE, as_bridge, guess_of, si_log
from tests.logs.test_nmea import bridge_log


def test_the_draft_of_a_clean_log_imports_to_the_motion(tmp_path: Path) -> None:
    log = tmp_path / "trial.csv"
    as_bridge(si_log()).to_csv(log, index=False)
    mapping = write_new(draft_mapping(guess(log)), tmp_path / "draft.toml")
    dataset = import_log(read_mapping(mapping), log)
    assert check_dataset(dataset)["ok"].all()
    whole = import_log(read_mapping(mapping).model_copy(update={"segment": ()}), log).frame
    for name, tolerance in {"north": 1e-9, "psi": 1e-9, "u": 1e-9, "v": 1e-9, "r": 1e-9}.items():
        np.testing.assert_allclose(whole[name], si_log()[name], atol=tolerance, err_msg=name)
    text = mapping.read_text()
    assert "99 %" in text
    assert "lever_arm" in text  # the questions that no log answers
    assert "Is the wind" not in text  # which this log does not have


def test_the_draft_mends_what_was_broken(tmp_path: Path) -> None:
    """A log with four defects passes all checks once imported by its draft; by the plain mapping it does not."""
    log = as_bridge(si_log())
    log = log.assign(
        u=log["u"] / KNOT, v=log["v"] / KNOT, rudder=-log["rudder"], N=log["N"] + 150.0 * (log["time"] > 700)
    )
    proposal = guess_of(tmp_path, log.rename(columns={"r": "p"}))
    assert proposal.kinds == {"other unit", "other sign", "position jumps", "other name"}
    dataset = import_log(read_mapping(write_new(draft_mapping(proposal), tmp_path / "draft.toml")), proposal.file)
    assert check_dataset(dataset)["ok"].all()
    assert np.corrcoef(dataset.frame["rudder.delta"], dataset.frame["r"])[0, 1] > 0.8


def test_orders_that_are_written_where_they_change_are_held(tmp_path: Path) -> None:
    """Before, the draft could not be imported: every row had a gap longer than max_gap."""
    log = as_bridge(si_log()).round({"rudder": 1, "rpm": 0})
    written = log.assign(**{name: log[name].where(log[name].diff() != 0) for name in ("rudder", "rpm")})
    text = draft_text(guess_of(tmp_path, written))
    frame = import_written(text, written, tmp_path).frame
    assert len(frame) == len(log)
    np.testing.assert_allclose(np.degrees(frame["rudder.delta"]), log["rudder"], atol=1e-9)
    np.testing.assert_allclose(60 * frame["propeller.n"], log["rpm"], atol=1e-9)
    lines = [line for line in text.split("\n") if not line.startswith(("step", "sha256"))]
    with pytest.raises(DataError, match=r"rows of 'propeller\.n' for one: orders .* are held with \[clock\] step"):
        import_written("\n".join(lines), written.assign(rpm=written["rpm"][:1]), tmp_path)


def test_segments_are_the_schedule(tmp_path: Path) -> None:
    """Turnings and the zigzag begin with their first order, less the lead, and end with their last."""
    as_bridge(si_log()).to_csv(tmp_path / "trial.csv", index=False)
    mapping = write_new(draft_mapping(guess(tmp_path / "trial.csv")), tmp_path / "draft.toml")
    segments = read_mapping(mapping).segment
    names = ["transit 1", "zigzag 1", "transit 2", "turning 1", "transit 3", "turning 2", "speed run 1"]
    assert [segment.run for segment in segments] == names
    ends = np.cumsum([seconds for seconds, _, _ in SCHEDULE])
    expected = {"zigzag 1": (ends[0], ends[6]), "turning 1": (ends[7], ends[8]), "turning 2": (ends[9], ends[10])}
    for segment in segments:
        if segment.run in expected:
            start, end = expected[segment.run]
            assert start - 12 <= segment.start <= start
            assert end <= segment.end <= end + 12  # the helm takes up to 10 s to come back
    dataset = import_log(read_mapping(mapping), tmp_path / "trial.csv")
    assert dataset.metadata["manoeuvres"]["zigzag 1"] == "zigzag"


def test_segments_of_gunnerus_are_its_zigzags_and_circles(gunnerus_log: Path) -> None:
    """Each zigzag and turning circle of the trial's log is detected within its span, and no other but the rescue's."""
    mapping = read_mapping("gunnerus-2022")
    segments = segment_log(mapping, gunnerus_log)
    for word, kind in (("ZZ", "zigzag"), ("TC", "turning")):
        mine = [segment for segment in segments if segment.manoeuvre == kind]
        spans = [(s.start, s.end) for s in mapping.segment if s.run.startswith(word)]
        for start, end in spans:
            inside = [max(0.0, min(end, s.end) - max(start, s.start)) for s in mine]
            assert sum(inside) > 0.35 * (end - start)
        elsewhere = [s for s in mine if not any(a < (s.start + s.end) / 2 < b for a, b in spans)]
        assert [6005.0 <= s.start <= 6200.0 for s in elsewhere] == [True] * (kind == "turning")


@pytest.mark.parametrize("name", ["u\n[[segment]]\nrun = 1", "x]"])
def test_hostile_names_stay_in_their_strings(name: str, tmp_path: Path) -> None:
    log = as_bridge(si_log()).rename(columns={"rpm": f"rpm {name}", "u": "u"})
    log.to_parquet(tmp_path / "log.parquet")
    mapping = write_new(draft_mapping(guess(tmp_path / "log.parquet")), tmp_path / "draft.toml")
    assert len(import_log(read_mapping(mapping), tmp_path / "log.parquet").frame) > 2000


def test_sentences_of_nmea(tmp_path: Path) -> None:
    """A bridge log is known by itself: its draft imports, with steps of its fixes and true wind."""
    text, motion = bridge_log("fix", 0.0, si_log(0, 10))
    (tmp_path / "bridge.nmea").write_text(text)
    proposal = guess(tmp_path / "bridge.nmea")
    assert proposal.findings == ()
    mapping = write_new(draft_mapping(proposal), tmp_path / "draft.toml")
    frame = import_log(read_mapping(mapping).model_copy(update={"segment": ()}), tmp_path / "bridge.nmea").frame
    assert len(frame) == len(motion)
    np.testing.assert_allclose(frame["u"], motion["u"], atol=1e-4)
    np.testing.assert_allclose(frame["V_w"], 8.0, atol=1e-3)
