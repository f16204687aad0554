"""The machine: its processor has a name, and memory that cannot be had is reported in GiB."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from shipid import capacity


def test_what_does_not_fit_is_reported_with_both_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(capacity, "usable_memory", lambda: 16 * 2**30)
    assert capacity.excess_memory_words(2**31) is None
    assert capacity.excess_memory_words(28 * 2**30) == "take 224 GiB of memory, and there are 16"


def test_the_limit_of_a_container_counts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(capacity, "_GROUP", tmp_path)
    whole = capacity.usable_memory()
    (tmp_path / "memory.max").write_text("max\n")
    assert capacity.usable_memory() == whole
    (tmp_path / "memory.max").write_text("1048576\n")
    assert capacity.usable_memory() == 1048576


@pytest.mark.parametrize(("limit", "cores"), [("max 100000", 64), ("150000 100000", 2), ("5000 100000", 1), ("no", 64)])
def test_cores_are_those_that_this_process_may_use(
    limit: str, cores: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A batch job with some cores of a node started a worker for each core of it."""
    monkeypatch.setattr(capacity, "_GROUP", tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
    assert capacity.usable_cores() == 64
    monkeypatch.setattr(capacity, "_GROUP", tmp_path / "limited")  # a limit is read once
    (tmp_path / "limited").mkdir()
    (tmp_path / "limited" / "cpu.max").write_text(f"{limit}\n")
    assert capacity.usable_cores() == cores
