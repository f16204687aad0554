"""Tables, numbers and progress."""

from __future__ import annotations

import threading

import pytest


def test_without_a_terminal_a_row_is_one_line_and_columns_stay_in_line(capsys: pytest.CaptureFixture[str]) -> None:
    """A search for a name finds the whole row."""
    from shipid.cli.terminal import print_table

    print_table(["ship", "H [m]"], [["b", "[bold]4"], ["a", "x" * 300]])
    first, heading, rule, *rows, last = capsys.readouterr().out.splitlines()
    assert (first, heading, last) == ("", "  ship   H [m]", "")
    assert rows == ["  b      [bold]4", f"  a      {'x' * 300}"]
    assert set(rule.strip()) == {"\u2500"}


def test_digits() -> None:
    from shipid.cli.terminal import four_digits

    assert [four_digits(value) for value in (1.23456, -0.00001, float("nan"), 1.6e9)] == [
        "1.235",
        "0",
        "-",
        "1600000000.0",
    ]


def test_a_table_of_measures_has_no_minus_zero(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.answer import Answer
    from shipid.cli.terminal import MEASURE_FORMATS, MEASURES

    row = {"measure": "lateral deviation", "value": -1e-7, "unit": "m", "lengths": -3e-9, "note": ""}
    Answer(False).records("measures", [row], MEASURES, MEASURE_FORMATS)
    out = capsys.readouterr().out
    assert "0.00" in out
    assert "-" not in out


def test_long_cells_are_no_silence(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid.cli import terminal

    monkeypatch.setattr(terminal, "SILENCE", 0.02)
    looks, done = iter(["", "trial 1", "trial 2", "trial 2"]), threading.Event()

    def look() -> str:
        if (word := next(looks, None)) is None:
            done.set()
        return "trial 2" if word is None else word

    with terminal.show_steps(look=look):
        assert done.wait(60)
    assert capsys.readouterr().err.splitlines() == ["trial 1", "trial 2"], "each once"


def test_an_interruption_says_what_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.terminal import end_on_interrupt

    with pytest.raises(SystemExit) as end, end_on_interrupt("what is finished is kept"):
        raise KeyboardInterrupt
    assert end.value.code == 130
    assert capsys.readouterr().err == "what is finished is kept\n"
