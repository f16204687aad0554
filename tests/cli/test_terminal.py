"""Tables, numbers and progress."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest


def test_a_table_prints_text_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    """Rich would take brackets for markup."""
    from shipid.cli.terminal import print_table, text_table

    print_table(text_table(["speed [m/s]"], [["[bold]4"]]))
    out = capsys.readouterr().out
    assert "speed [m/s]" in out
    assert "[bold]4" in out


def test_without_a_terminal_a_row_is_one_line_and_columns_stay_in_line(capsys: pytest.CaptureFixture[str]) -> None:
    """A search for a name finds the whole row; a sign of Chinese takes two places."""
    from shipid.cli.terminal import print_table, text_table

    print_table(text_table(["ship", "H [m]"], [["\u8239", 1.5], ["a", "x" * 300]]))
    first, heading, rule, *rows, last = capsys.readouterr().out.splitlines()
    assert (first, heading, last) == ("", "  ship   H [m]", "")
    assert rows == ["  \u8239     1.5", f"  a      {'x' * 300}"]
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


class Still:
    """A watch that sees two searches of which one moves, to its second trial."""

    looks = 0

    def look(self) -> list[Any]:
        from shipid.study.progress import SearchProgress

        self.looks += 1
        return [SearchProgress("a[b]-N0004-s0", min(self.looks, 2), 50, 0.25), SearchProgress("c-N0004-s0", 1, 50, 1.0)]


def test_long_cells_are_no_silence(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a terminal there is a line when nothing was printed for a while; on one, a second bar."""
    import io

    import rich.console

    from shipid.cli import terminal
    from shipid.study.run import Event

    monkeypatch.setattr(terminal, "SILENCE", 0.02)
    monkeypatch.setattr(terminal, "LOOK", 0.02)

    def slow(watch: Still) -> Iterator[Event]:
        yield Event("start", done=0, total=2)
        while watch.looks < 5:
            time.sleep(0.01)
        yield Event("end", text="folder")

    watch = Still()
    terminal.draw_events(slow(watch), watch)  # type: ignore[arg-type]
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [
        "2 of 2 cells to do",
        "... a[b]-N0004-s0: trial 1/50, best so far 0.5 m rms (2 searches are running)",
    ]
    assert len(lines) == 3, "it is still at the second trial"
    screen = io.StringIO()
    made = rich.console.Console
    monkeypatch.setattr(
        rich.console, "Console", lambda **given: made(file=screen, force_terminal=True, width=150, **given)
    )
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    watch = Still()
    terminal.draw_events(slow(watch), watch)  # type: ignore[arg-type]
    assert "a[b]-N0004-s0: trial " in screen.getvalue()


def test_events_are_one_line_each_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.terminal import draw_events
    from shipid.study.run import Event

    good = {"cell": "a-N0004-s0", "status": "ok", "H": 1.0, "H_90": 2.0, "seconds": 0.5}
    bad = {"cell": "b-N0004-s0", "status": "diverged", "sentence": "it left the sea", "seconds": 0.1}
    events = [
        Event("note", text="rolling out the models"),
        Event("start", done=0, total=2),
        Event("cell", done=1, total=2, row=good),
        Event("cell", done=2, total=2, row=bad),
        Event("end", text="folder"),
    ]
    draw_events(events, Still())  # type: ignore[arg-type]
    assert capsys.readouterr().out.splitlines() == [
        "rolling out the models",
        "2 of 2 cells to do",
        "[1/2] a-N0004-s0: H 1.000 m, H_90 2.000 m, 0.5 s",
        "[2/2] b-N0004-s0: diverged: it left the sea, 0.1 s",
    ]


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
