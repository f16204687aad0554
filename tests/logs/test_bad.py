"""Broken logs and mappings: each one ends in an error that names the file, the place and the remedy."""

from pathlib import Path

import pytest

from shipid.errors import DataError, DocumentError
from shipid.logs.importing import import_log, read_mapping

BAD = Path(__file__).parents[1] / "bad"

LOGS = {  # file -> (place, remedy)
    "empty.csv": ("", "the file is empty"),
    "header_only.csv": ("", "needs two rows or more"),
    "missing_column.csv": ("columns.u.from", "valid: E, N, heading"),
    "column_twice.csv": ("columns.u.from", "appears twice in the log: rename one"),
    "text_in_number_column.csv": ("row 8", "'stopped' is no number (column 'u'; 1 such rows): correct it"),
    "nan_stretch.csv": ("row 11, clock.max_gap", "set max_gap to interpolate"),
    "time_backwards.csv": ("row 12", "time goes back from 5.5 s to 5 s: sort or split"),
    "time_twice.csv": ("row 11", "the time 4.5 s appears twice: remove one"),
    "time_missing.csv": ("row 11", "no time here: remove the row"),
    "semicolons.csv": ("clock.from", "is the separator right?"),
    "decimal_comma.csv": ("format.separator", "check separator and skip_rows"),
    "ragged.csv": ("line 7", "11 cells, where the header has 8"),
    "binary.csv": ("format.encoding", "export it as text"),
    "utf16.csv": ("format.encoding", "set the encoding"),
    "cp1252.csv": ("format.encoding", "often cp1252"),
    "absent.csv": ("", "No such file"),
}

MAPPINGS = {
    "unknown_unit": ("columns.r.unit", "valid here: rad/s, deg/s, deg/min"),
    "unknown_key": ("columns.psi.wraps", "did you mean 'wrap'?"),
    "unknown_column": ("columns.surge", "valid: V_w, beta_w"),
    "missing_required": ("columns.r", "a dataset needs north, east, psi, u, v, r"),
    "missing_clock": ("clock", "missing"),
    "column_mapped_twice": ("", "not valid TOML"),
    "two_frames": ("columns.v.frame", "both 'body' or both 'earth'"),
    "wind_without_direction": ("columns.beta_w.direction", "must be 'towards' or 'from'"),
    "wind_without_angle": ("columns", "needs both V_w and beta_w"),
    "unknown_repair": ("repair.0.kind", "did you mean 'despike'?"),
    "unknown_repair_key": ("repair.0.enable", "did you mean 'enabled'?"),
    "repair_without_reason": ("repair.0.reason", "missing"),
    "repair_of_no_column": ("repair.0.columns", "valid: east, north"),
    "repair_in_wrong_unit": ("repair.0.unit", "valid here: rad, deg"),
    "wrap_repair_of_no_angle": ("repair.0.columns", "write wrap = true"),
    "run_twice": ("segment.1.run", "add ' (2)'"),
    "segment_backwards": ("segment.0", "must lie before end"),
    "unknown_encoding": ("format.encoding", "for example utf-8"),
    "encoding_of_bytes": ("format.encoding", "no such encoding of text"),
    "encoding_of_letters": ("format.encoding", "no such encoding of text"),
    "separator_of_two": ("format.separator", "one ASCII character"),
    "separator_of_a_pattern": ("format.separator", "or the word 'whitespace'"),
    "break_of_a_column": ("repair.0.columns", "unknown key: valid: enabled, intervals, kind, reason"),
    "heading_offset_of_a_column": ("repair.0.columns", "unknown key: valid: enabled, kind, offset, reason, unit"),
    "lever_arm_of_a_column": ("repair.0.columns", "unknown key: valid: enabled, kind, moves, reason, x, y"),
    "not_toml": ("", "not valid TOML"),
    "absent": ("", "no such file"),
}

AGAINST_LOG = {
    "not_in_log": ("columns.propeller.n.from", "did you mean 'rpm'?"),
    "segment_outside_log": ("segment.1", "is not in the log, which has 0 to 20 s"),
    "wrong_names": ("format.names", "2 names for the 8 columns"),
    "other_file": ("source.sha256", "fetch that file"),
    "skips_everything": ("format.skip_rows", "no line is left after 100 skipped lines"),
}


def test_every_broken_document_is_tested() -> None:
    assert {file.name for file in (BAD / "logs").glob("*.csv")} - {"good.csv"} == set(LOGS) - {"absent.csv"}
    assert {file.stem for file in (BAD / "mappings").glob("*.toml")} == (set(MAPPINGS) | set(AGAINST_LOG)) - {"absent"}


def test_good_log_is_imported() -> None:
    dataset = import_log(read_mapping(BAD / "logs" / "plain.toml"), BAD / "logs" / "good.csv")
    assert dataset.runs == ["good"]
    assert len(dataset.frame) == 41


@pytest.mark.parametrize("name", LOGS)
def test_broken_log(name: str) -> None:
    place, remedy = LOGS[name]
    with pytest.raises(DataError) as caught:
        import_log(read_mapping(BAD / "logs" / "plain.toml"), BAD / "logs" / name)
    _assert_says(caught.value, name, place, remedy)


@pytest.mark.parametrize("name", MAPPINGS)
def test_broken_mapping(name: str) -> None:
    place, remedy = MAPPINGS[name]
    with pytest.raises(DocumentError) as caught:
        read_mapping(BAD / "mappings" / f"{name}.toml")
    _assert_says(caught.value, f"{name}.toml", place, remedy)


@pytest.mark.parametrize("name", AGAINST_LOG)
def test_mapping_of_another_log(name: str) -> None:
    place, remedy = AGAINST_LOG[name]
    with pytest.raises(DataError) as caught:
        import_log(read_mapping(BAD / "mappings" / f"{name}.toml"), BAD / "logs" / "good.csv")
    _assert_says(caught.value, "good.csv", place, remedy)


def _assert_says(error: DataError | DocumentError, file: str, place: str, remedy: str) -> None:
    assert file in str(error.file)
    assert (error.path or "") == place
    assert remedy in error.message
