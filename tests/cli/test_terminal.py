"""Tables, numbers and progress."""

from __future__ import annotations

import pytest


def test_a_table_prints_text_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    """Rich would take brackets for markup."""
    from shipid.cli.terminal import show, table

    show(table(["speed [m/s]"], [["[bold]4"]]))
    out = capsys.readouterr().out
    assert "speed [m/s]" in out
    assert "[bold]4" in out


def test_digits() -> None:
    from shipid.cli.terminal import digits

    assert [digits(value) for value in (1.23456, -0.00001, float("nan"), 1.6e9)] == ["1.235", "0", "-", "1600000000.0"]


def test_events_are_one_line_each_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from shipid.cli.terminal import draw
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
    draw(events)
    assert capsys.readouterr().out.splitlines() == [
        "rolling out the models",
        "2 of 2 cells to do",
        "[1/2] a-N0004-s0: H 1.000 m, H_90 2.000 m, 0.5 s",
        "[2/2] b-N0004-s0: diverged: it left the sea, 0.1 s",
    ]


def test_counted_passes_every_block_on() -> None:
    from shipid.cli.terminal import counted

    assert list(counted([[1, 2], [3]], 3)) == [[1, 2], [3]]
