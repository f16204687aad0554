"""Tables, numbers and progress."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest


def test_a_table_prints_text_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.terminal import print_table, text_table

    print_table(text_table(["speed [m/s]"], [["[bold]4"]]))
    out = capsys.readouterr().out
    assert "speed [m/s]" in out
    assert "[bold]4" in out


def test_without_a_terminal_a_row_is_one_line_and_columns_stay_in_line(capsys: pytest.CaptureFixture[str]) -> None:
    """A search for a name finds the whole row."""
    from shipid.cli.terminal import print_table, text_table

    print_table(text_table(["ship", "H [m]"], [["b", 1.5], ["a", "x" * 300]]))
    first, heading, rule, *rows, last = capsys.readouterr().out.splitlines()
    assert (first, heading, last) == ("", "  ship   H [m]", "")
    assert rows == ["  b      1.5", f"  a      {'x' * 300}"]
    assert set(rule.strip()) == {"\u2500"}
    print_table(text_table([], []))


def test_digits() -> None:
    from shipid.cli.terminal import four_digits

    assert [four_digits(value) for value in (1.23456, -0.00001, float("nan"), 1.6e9)] == [
        "1.235",
        "0",
        "-",
        "1600000000.0",
    ]


def test_a_table_of_measures_has_no_minus_zero(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.terminal import measure_table, print_table

    row = {"measure": "lateral deviation", "value": -1e-7, "unit": "m", "lengths": -3e-9, "note": ""}
    print_table(measure_table([row], []))
    out = capsys.readouterr().out
    assert "0.00" in out
    assert "-" not in out


def test_long_cells_are_no_silence(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid.cli import terminal

    monkeypatch.setattr(terminal, "SILENCE", 0.02)
    looks = iter(["", "trial 1", "trial 2"])
    with terminal.show_steps(look=lambda: next(looks, "trial 2")):
        time.sleep(0.3)
    assert capsys.readouterr().err.splitlines() == ["trial 1", "trial 2"], "each once"


def test_an_interruption_says_what_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.terminal import count_blocks

    def blocks() -> Iterator[list[int]]:
        yield [1]
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as end:
        list(count_blocks(blocks(), 3, "cells", "what is finished is kept"))
    assert end.value.code == 130
    assert capsys.readouterr().err == "what is finished is kept\n"


def test_where_there_is_no_terminal_counted_says_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rotation of an hour whose output goes to a file is not silent, also before its first cell."""
    from shipid.cli import terminal
    from shipid.cli.terminal import count_blocks

    monkeypatch.setattr(terminal, "SILENCE", 0.02)

    def slowly() -> Iterator[list[int]]:
        for block in ([1, 2], [3]):
            time.sleep(0.1)
            yield block

    assert list(count_blocks(slowly(), 3, "cells")) == [[1, 2], [3]]
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0 of 3 cells"
    assert any(line.startswith("2 of 3 cells") for line in lines)
