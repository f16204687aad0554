"""Ctrl-C during a block is held back, and raised when the block ends."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress

import pytest

from shipid import interrupts
from shipid.interrupts import hold_interrupts, raise_interrupts


@pytest.fixture(autouse=True)
def handler() -> Iterator[object]:
    """The handler of SIGINT, which every test must leave as it was."""
    before = signal.getsignal(signal.SIGINT)
    yield before
    assert signal.getsignal(signal.SIGINT) is before


def press() -> None:
    signal.raise_signal(signal.SIGINT)


def test_it_is_raised_at_the_end_of_the_block() -> None:
    steps: list[str] = []

    def work() -> None:
        with hold_interrupts() as held:
            press()
            assert held == [signal.SIGINT]
            steps.append("end of the block")
        steps.append("behind the block")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert steps == ["end of the block"]


def test_the_outermost_block_holds() -> None:
    reached: list[int] = []

    def work() -> None:
        with hold_interrupts() as outer:
            with hold_interrupts() as inner:
                press()
                assert inner is outer
            reached.append(len(outer))

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == [1]


def test_it_is_raised_where_the_block_failed() -> None:
    def work() -> None:
        with hold_interrupts():
            press()
            raise ValueError("wrong arguments")

    with pytest.raises(KeyboardInterrupt) as caught:
        work()
    assert isinstance(caught.value.__context__, ValueError)


def test_another_thread_changes_no_handler(handler: object) -> None:
    seen: list[object] = []

    def work() -> None:
        with hold_interrupts() as held:
            seen.extend([signal.getsignal(signal.SIGINT), list(held)])

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [handler, []]


def test_an_error_behind_ctrl_c_is_ctrl_c() -> None:
    def work(press: Callable[[], object]) -> None:
        with raise_interrupts():
            with suppress(KeyboardInterrupt):
                press()
            raise SystemError("returned a result with an exception set")

    with pytest.raises(KeyboardInterrupt):
        work(press)
    with pytest.raises(SystemError):
        work(int)


def test_where_it_is_ignored_it_stays_so() -> None:
    """A worker, which ignores Ctrl-C, printed a traceback where it was pressed during a call into compiled code."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with hold_interrupts() as held:
            press()
        assert held == []
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("inside", [False, True])
def test_a_double_press_breaks_off_no_end(inside: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second one arose while workers were stopped, with a traceback; a later one is answered again."""
    now = [10.0]
    monkeypatch.setattr(interrupts.time, "monotonic", lambda: now[0])
    steps: list[str] = []

    def work() -> None:
        with raise_interrupts():
            try:
                with hold_interrupts() if inside else nullcontext():
                    press()
            finally:
                press()
                steps.append("ended")
                now[0] += interrupts.DOUBLE
                with pytest.raises(KeyboardInterrupt):
                    press()
                steps.append("later")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert steps == ["ended", "later"]
