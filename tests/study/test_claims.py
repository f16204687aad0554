"""Claims: one run at a time works on a unit; what is no longer renewed is taken over."""

from __future__ import annotations

import errno
import json
import math
import os
import pickle
import random
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from shipid.study import claims
from shipid.study.claims import TakenOver, UnitClaims, held


def test_a_unit_is_claimed_once(tmp_path: Path) -> None:
    with UnitClaims(tmp_path) as one, UnitClaims(tmp_path) as other:
        assert one.take("a")
        assert not other.take("a")
        assert other.take("b")
        assert held(tmp_path) == ["a", "b"]
        one.give_back("a")
        assert other.take("a")
    assert held(tmp_path) == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="no limit of the size of a file")
def test_a_full_disk_leaves_no_sign_of_a_process(tmp_path: Path) -> None:
    """An empty one was taken for a living process for a minute, and stayed for good."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught, UnitClaims(tmp_path):
            pass
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert Path(caught.value.filename).parent == tmp_path / "claims", "before, the error named no file"
    assert not list(tmp_path.rglob(".*"))
    with UnitClaims(tmp_path) as here:
        assert not here.others()


def test_a_claim_of_a_process_that_is_gone_is_taken_over(tmp_path: Path) -> None:
    process = os.fork()
    if not process:
        UnitClaims(tmp_path).take("a")
        os._exit(0)
    os.waitpid(process, 0)
    assert held(tmp_path) == ["a"]
    with UnitClaims(tmp_path) as other:
        assert other.take("a")


def test_a_claim_that_was_left_on_a_finished_unit_is_removed(tmp_path: Path) -> None:
    process = os.fork()
    if not process:
        UnitClaims(tmp_path).take("a")
        os._exit(0)
    os.waitpid(process, 0)
    with UnitClaims(tmp_path) as other:
        assert other.take("b")
    assert list(tmp_path.iterdir()) == []


def test_a_claim_of_another_machine_is_taken_over_when_it_is_late(tmp_path: Path) -> None:
    (tmp_path / "claims").mkdir()
    claim = tmp_path / "claims" / "a"
    claim.write_text("elsewhere 1\n")
    with UnitClaims(tmp_path) as mine:
        assert not mine.take("a")
        late = time.time() - claims.LATE - 5
        os.utime(claim, (late, late))
        assert mine.take("a")


def test_a_claim_of_before_the_clock_was_set_back_is_taken_over_when_nobody_renews_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A machine with a wrong clock was switched off: its claim lies a year ahead, and is watched instead."""
    clock = [1000.0]
    monkeypatch.setattr(claims.time, "monotonic", lambda: clock[0])
    (tmp_path / "claims").mkdir()
    claim = tmp_path / "claims" / "a"
    claim.write_text("elsewhere 1\n")
    ahead = time.time() + 3e7
    with UnitClaims(tmp_path) as mine:
        for later in (0.0, 10.0):  # the second is renewed, by a clock that is still wrong
            os.utime(claim, (ahead + later, ahead + later))
            assert not mine.take("a")
            clock[0] += claims.LATE - 5
            assert not mine.take("a")
        clock[0] += 10.0
        assert mine.take("a")


def test_a_claim_that_only_its_owner_may_read_is_taken_over_when_nobody_renews_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of a killed run of a colleague with a closed umask: others waited for it without end."""
    claim = tmp_path / "claims" / "a"
    claim.parent.mkdir()
    claim.write_text("{}")
    really = Path.read_text

    def closed(file: Path, *how: Any, **named: Any) -> str:
        if file == claim:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(file))
        return really(file, *how, **named)

    monkeypatch.setattr(Path, "read_text", closed)
    with UnitClaims(tmp_path) as mine:
        assert not mine.take("a")
        late = time.time() - claims.LATE - 5
        os.utime(claim, (late, late))
        monkeypatch.setattr(mine, "_set", -math.inf)
        assert mine.take("a")


def test_a_claim_is_not_taken_over_because_the_clock_was_set_forward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after the sleep of a computer: who renews first sees the others late by hours, and watches them instead."""
    clock = [1000.0]
    monkeypatch.setattr(claims.time, "monotonic", lambda: clock[0])
    utime = os.utime
    with UnitClaims(tmp_path) as slow, UnitClaims(tmp_path) as mine:
        assert slow.take("a")
        monkeypatch.setattr(os, "utime", lambda file: utime(file, (time.time() + 7200, time.time() + 7200)))
        clock[0] += claims.RENEWED
        mine._renew_all()
        for _ in range(3):
            assert not mine.take("a")
            clock[0] += claims.LATE - 5
            slow._renew_all()
        mine._renew_all()
        later = time.time() + 7200 + claims.LATE + 5
        monkeypatch.setattr(os, "utime", lambda file: utime(file, (later, later)))
        clock[0] += claims.LATE + 5
        mine._renew_all()
        assert mine.take("a"), "it is renewed no more"


def test_the_number_of_a_process_says_nothing_on_another_system(tmp_path: Path) -> None:
    """A container may have the name of this host and other numbers: its claim is late before it is taken over."""
    process = os.fork()
    if not process:
        os._exit(0)
    os.waitpid(process, 0)
    (tmp_path / "claims").mkdir()
    claim = tmp_path / "claims" / "a"
    with UnitClaims(tmp_path) as mine:
        gone = {**json.loads(mine.holder.words), "process": process}
        claim.write_text(json.dumps(gone | {"system": f"{gone['system']} other"}))
        assert not mine.take("a")
        claim.write_text(json.dumps(gone | {"host": "other"}))
        assert not mine.take("a")
        claim.write_text(json.dumps(gone))
        assert mine.take("a")


def test_a_claim_is_renewed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claims, "RENEWED", 0.01)
    with UnitClaims(tmp_path) as mine:
        mine.take("a")
        claim = tmp_path / "claims" / "a"
        os.utime(claim, (1.0, 1.0))
        for _ in range(500):
            if claim.stat().st_mtime > 1.0:
                break
            time.sleep(0.01)
        assert claim.stat().st_mtime > 1.0


def test_a_file_system_without_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", refused)
    with UnitClaims(tmp_path) as one, UnitClaims(tmp_path) as other:
        assert one.take("a")
        assert not other.take("a")


def test_rubbish_is_no_claim_of_anyone_until_it_is_late(tmp_path: Path) -> None:
    (tmp_path / "claims").mkdir()
    (tmp_path / "claims" / "a").write_bytes(b"\xff\xfe")
    with UnitClaims(tmp_path) as mine:
        assert not mine.take("a")
        os.utime(tmp_path / "claims" / "a", (1.0, 1.0))


def free(mine: UnitClaims, units: list[str], finished: set[str]) -> Iterator[str]:
    return mine.free(units, lambda: finished, finished.__contains__)


def test_one_process_takes_units_in_their_order(tmp_path: Path) -> None:
    units = [f"u{k}" for k in range(30)]
    with UnitClaims(tmp_path) as mine:
        assert list(free(mine, units, {"u3", "u7"})) == [unit for unit in units if unit not in ("u3", "u7")]
        assert list(free(mine, units, set())) == ["u3", "u7"]  # it is at work on the others


@pytest.mark.parametrize("seed", range(4))
def test_every_unit_is_done_once_by_workers_that_die_and_join(tmp_path: Path, seed: int) -> None:
    """Many workers in turns: some die with a claim, others join; what the dead had is done by others, nothing twice."""
    rng = random.Random(seed)
    units = [f"u{k}" for k in range(rng.randrange(1, 200))]
    finished: set[str] = set()
    done: list[str] = []
    with ExitStack() as stack:

        def joined() -> tuple[UnitClaims, Iterator[str]]:
            mine = stack.enter_context(UnitClaims(tmp_path))
            return mine, free(mine, units, finished)

        workers = [joined() for _ in range(rng.randrange(1, 20))]
        die = rng.randrange(5)
        while len(finished) < len(units):
            place = rng.randrange(len(workers))
            mine, left = workers[place]
            unit = next(left, None)
            if unit is None:
                workers[place] = mine, free(mine, units, finished)
            elif die:
                die -= 1
                _gone(tmp_path, mine, unit)
                workers[place] = joined()
            else:
                done.append(unit)
                finished.add(unit)
                mine.give_back(unit)
    assert sorted(done) == sorted(units)
    assert list(tmp_path.iterdir()) == []


def _gone(folder: Path, mine: UnitClaims, unit: str) -> None:
    """A claim of a process of another machine, not renewed any more."""
    (folder / "claims" / unit).unlink()
    (folder / "claims" / unit).write_text('{"host": "elsewhere", "process": 1, "system": ""}')
    os.utime(folder / "claims" / unit, (1.0, 1.0))
    mine._mine.discard(unit)


def test_a_claim_says_who_works_and_since_when(tmp_path: Path) -> None:
    with UnitClaims(tmp_path) as mine:
        mine.take("a")
        words = json.loads((tmp_path / "claims" / "a").read_text())
    assert words["host"] == socket.gethostname()
    assert words["process"] == os.getpid()
    assert words["owner"]
    assert datetime.fromisoformat(words["since"]).tzinfo is not None


def test_what_one_process_has_lost_it_does_not_give_back(tmp_path: Path) -> None:
    """A process that was held up for long: its claim is another one's now."""
    with UnitClaims(tmp_path) as slow, UnitClaims(tmp_path) as other:
        assert slow.take("a")
        (tmp_path / "claims" / "a").unlink()
        assert other.take("a")
        slow.give_back("a")
        assert held(tmp_path) == ["a"]


@pytest.mark.parametrize("links", [True, False])
def test_a_worker_sees_that_the_claim_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    """What says who holds the claims travels to workers; it names who has taken a unit over, or that it is gone."""

    def refused(*_: object) -> None:
        raise OSError(errno.EPERM, "no links here")

    if not links:
        monkeypatch.setattr(os, "link", refused)
    with UnitClaims(tmp_path) as slow, UnitClaims(tmp_path) as other:
        assert slow.take("a")
        holder = pickle.loads(pickle.dumps(slow.holder))
        holder.check("a")
        (tmp_path / "claims" / "a").unlink()
        with pytest.raises(TakenOver, match="a: no longer claimed"):
            holder.check("a")
        assert other.take("a")
        with pytest.raises(TakenOver, match=f"a: process {os.getpid()} on {socket.gethostname()} has taken it over"):
            holder.check("a")
        other.holder.check("a")


def test_once_waits_for_the_one_that_took_over(tmp_path: Path) -> None:
    """A process that was held up while it made a thing takes what the other one makes."""
    made: list[str] = []
    with UnitClaims(tmp_path) as slow, UnitClaims(tmp_path) as other:

        def held_up() -> None:
            (tmp_path / "claims" / "thing").unlink()
            assert other.take("thing")
            made.append("other")
            slow.holder.check("thing")

        slow.once("thing", lambda: bool(made), held_up)
        assert made == ["other"]
        assert held(tmp_path) == ["thing"]


def test_once_is_once(tmp_path: Path) -> None:
    """Of several that need a thing at the same time one makes it, the others wait; none makes what is there."""
    made: list[int] = []

    def make() -> None:
        time.sleep(0.1)
        made.append(1)

    def work() -> None:
        with UnitClaims(tmp_path) as mine:
            mine.once("thing", lambda: bool(made), make)
            assert made == [1]

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == [1]
    with UnitClaims(tmp_path) as mine:
        mine.once("thing", lambda: bool(made), make)
    assert made == [1]


def test_alone_keeps_others_out(tmp_path: Path) -> None:
    inside: list[int] = []

    def work() -> None:
        with UnitClaims(tmp_path) as mine, mine.alone("record"):
            inside.append(1)
            time.sleep(0.02)
            assert inside == [1]
            inside.clear()

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not inside
    assert list(tmp_path.iterdir()) == []


def test_others_are_those_that_live(tmp_path: Path) -> None:
    with UnitClaims(tmp_path) as one:
        assert not one.others()
        with UnitClaims(tmp_path):
            assert one.others()
        process = os.fork()
        if not process:
            UnitClaims(tmp_path).take("a")
            os._exit(0)
        os.waitpid(process, 0)
        assert not one.others()


def test_a_process_that_ends_meanwhile_is_no_other(tmp_path: Path) -> None:
    with UnitClaims(tmp_path) as one:
        (tmp_path / claims.FOLDER / ".ended").symlink_to("nowhere")  # listed, and gone when it is looked at
        assert not one.others()
    assert list(tmp_path.iterdir()) == []


def test_waits_grow() -> None:
    assert claims.pause(0.0) == 0.0
    assert claims.pause(0.001) == pytest.approx(0.0015)
