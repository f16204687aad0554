"""Ctrl-C during calls into compiled code: held back until the call returns, or known again in the error it became."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

DOUBLE = 1.0
"""Seconds after Ctrl-C in which another one counts as the same press: longer than a double press."""
_holding: list[list[int]] = []  # the outermost call that holds interrupts back, if any


@contextmanager
def hold_interrupts() -> Iterator[list[int]]:
    """Hold back Ctrl-C until the block ends: inside CasADi it would become an error about arguments.

    Gives the list of signals held back so far, so that a long call can look and stop. In nested blocks the outermost
    one holds. What was held back is answered at the end of the block, also where it failed. Where Ctrl-C is ignored,
    as in workers, it stays so.
    """
    before = signal.getsignal(signal.SIGINT)
    if _holding or before is signal.SIG_IGN or threading.current_thread() is not threading.main_thread():
        yield _holding[0] if _holding else []
        return
    held: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _frame: held.append(number))
    _holding.append(held)
    try:
        yield held
    finally:
        _holding.clear()
        signal.signal(signal.SIGINT, before)
        if held:
            if callable(before):
                before(held[0], None)  # which may pass it over
            else:
                raise KeyboardInterrupt


@contextmanager
def raise_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt for any error of the block after Ctrl-C was pressed: compiled code makes others of it.

    A second press within a second is passed over. Nothing changes in a thread, or where something else answers Ctrl-C.
    """
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    pressed: list[float] = []

    def press(_number: int, _frame: object) -> None:
        if pressed and time.monotonic() - pressed[-1] < DOUBLE:
            return
        pressed.append(time.monotonic())
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, press)
    try:
        yield
    except Exception as error:
        if pressed:
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, before)
