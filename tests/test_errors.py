from __future__ import annotations

import os
import pickle

import pytest

from shipid.errors import (
    DataError,
    DivergenceError,
    DocumentError,
    ResultError,
    ShipidError,
    escape_unprintable,
    is_utf_8,
    suggest_name,
)

ERRORS = pytest.mark.parametrize("error", [ShipidError, DocumentError, DivergenceError, DataError, ResultError])


@ERRORS
def test_one_line_with_file_path_and_message(error: type[ShipidError]) -> None:
    raised = error("first\n  second", file="a.toml", path="hull.x")
    assert str(raised) == "a.toml: hull.x: first second"
    assert str(error("only this")) == "only this"
    assert isinstance(raised, ShipidError)
    assert str(error(ValueError("of a user\nwho wraps another"))) == "of a user who wraps another"  # type: ignore[arg-type]


@ERRORS
def test_errors_come_home_from_workers(error: type[ShipidError]) -> None:
    raised = pickle.loads(pickle.dumps(error("message", file="a.toml", path="hull.x")))
    assert type(raised) is error
    assert (raised.message, raised.file, raised.path) == ("message", "a.toml", "hull.x")


def test_choices_suggest_what_is_close() -> None:
    assert suggest_name("derivativs", ["derivatives", "crossflow"]) == "did you mean 'derivatives'?"
    assert suggest_name("KIND", ["behind", "kind"]) == "did you mean 'kind'?"
    assert suggest_name("X_h", ["X_hh", "x_H"]) == "did you mean 'x_H'?"


def test_a_retired_name_says_what_to_do_unless_a_valid_name_is_nearly_the_same() -> None:
    assert suggest_name("path-drawn", ["path-trained", "kernel"]) == "it is retired, take kernel"
    assert suggest_name("units", ["kind", "memory"]) == "a key of former methods: delete it"
    assert suggest_name("units", ["unit", "from"]) == "did you mean 'unit'?"
    assert "units" not in suggest_name("unit", ["kind", "memory"])
    assert suggest_name("period", ["T_p", "H_s"]) == "valid: H_s, T_p"  # a word of other documents, too


def test_choices_list_what_is_valid() -> None:
    assert suggest_name("zzz", ["beta", "alpha"]) == "valid: alpha, beta"
    assert suggest_name("zzz", (f"n{i:02}" for i in range(20))).endswith("n11, ...")
    assert suggest_name("zzz", []) == "nothing is defined there"
    assert suggest_name(None, ["alpha"]) == suggest_name([], ["alpha"]) == "valid: alpha"


@pytest.mark.parametrize("name", ["\x1b[2J\x1b[31m", "\u202eabc", "a\rb", "\x00", "\x07"])
def test_control_characters_are_made_visible(name: str) -> None:
    assert escape_unprintable(f"ship {name}\nsea").replace("\n", "").isprintable()
    assert escape_unprintable("R/V Gunnerus, 28.9 m ä 船\n") == "R/V Gunnerus, 28.9 m ä 船\n"


def test_names_with_bytes_that_are_not_utf_8_are_told_from_others() -> None:
    assert is_utf_8("Fahrt \u00e4\u6d77\U0001f6a2.csv")
    assert not is_utf_8(os.fsdecode(b"fahrt \xe4.csv"))
