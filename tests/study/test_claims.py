"""Claims: one run at a time works on a unit; what is no longer renewed is taken over."""

from __future__ import annotations

import errno
import os
import time
from pathlib import Path

import pytest

from shipid.study import claims
from shipid.study.claims import Claims, held


def test_a_unit_is_claimed_once(tmp_path: Path) -> None:
    with Claims(tmp_path) as one, Claims(tmp_path) as other:
        assert one.take("a")
        assert not other.take("a")
        assert other.take("b")
        assert held(tmp_path) == ["a", "b"]
        one.give_back("a")
        assert other.take("a")
    assert held(tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def test_a_claim_of_a_process_that_is_gone_is_taken_over(tmp_path: Path) -> None:
    process = os.fork()
    if not process:
        Claims(tmp_path).take("a")
        os._exit(0)
    os.waitpid(process, 0)
    assert held(tmp_path) == ["a"]
    with Claims(tmp_path) as other:
        assert other.take("a")


def test_a_claim_that_was_left_on_a_finished_unit_is_removed(tmp_path: Path) -> None:
    process = os.fork()
    if not process:
        Claims(tmp_path).take("a")
        os._exit(0)
    os.waitpid(process, 0)
    with Claims(tmp_path) as other:
        assert other.take("b")
    assert list(tmp_path.iterdir()) == []


def test_a_claim_of_another_machine_is_taken_over_when_it_is_late(tmp_path: Path) -> None:
    (tmp_path / "claims").mkdir()
    claim = tmp_path / "claims" / "a"
    claim.write_text("elsewhere 1\n")
    with Claims(tmp_path) as mine:
        assert not mine.take("a")
        late = time.time() - claims.LATE - 5
        os.utime(claim, (late, late))
        assert mine.take("a")


def test_a_claim_is_renewed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claims, "RENEWED", 0.01)
    with Claims(tmp_path) as mine:
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
    with Claims(tmp_path) as one, Claims(tmp_path) as other:
        assert one.take("a")
        assert not other.take("a")


def test_rubbish_is_no_claim_of_anyone_until_it_is_late(tmp_path: Path) -> None:
    (tmp_path / "claims").mkdir()
    (tmp_path / "claims" / "a").write_bytes(b"\xff\xfe")
    with Claims(tmp_path) as mine:
        assert not mine.take("a")
        os.utime(tmp_path / "claims" / "a", (1.0, 1.0))
