"""The journal of trials: a write that was cut off harms nothing; and what Optuna opens."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

from shipid.errors import ResultError
from shipid.hybrid.journal import open_journal
from shipid.hybrid.trials import write_searches

SPACE: dict[str, Any] = {
    "scale": FloatDistribution(1.0, 16.0, log=True),
    "layers": IntDistribution(1, 3),
    "mirror": CategoricalDistribution((0.0, 1.0)),
}


def rows(count: int, seed: int = 0, first: int = 0) -> list[dict[str, Any]]:
    """Trials drawn by a seed: some diverged, some at the end of their span, with one fixed setting."""
    rng = np.random.default_rng(seed)
    trials = []
    for number in range(first, first + count):
        bad = rng.random() < 0.2
        params = {"scale": float(np.exp(rng.uniform(0, np.log(16)))), "layers": int(rng.integers(1, 4))}
        if rng.random() < 0.2:
            params["scale"] = 16.0
        params |= {"mirror": float(rng.integers(0, 2)), "offset": 1.5}
        params = {name: params[name] for name in rng.permutation(list(params)).tolist()}
        trials.append(
            {"number": number, "params": params, "value": math.nan if bad else float(rng.lognormal(0, 5)),
             "seconds": float(rng.random()), "epochs": int(rng.integers(0, 9)),
             "state": "diverged" if bad else "complete"}
        )  # fmt: skip
    return trials


def test_trials_come_back_to_the_digit(tmp_path: Path) -> None:
    written = {"a+drawn-N0010-s0": rows(9, 1), "b": rows(4, 101), "c": []}
    open_journal(tmp_path / "t.log").add(written)
    read = open_journal(tmp_path / "t.log")
    for cell, mine in written.items():
        assert repr(read.rows(cell)) == repr(mine)
    read.add({"b": rows(3, 1, first=4)})
    assert repr(open_journal(tmp_path / "t.log").rows("b")) == repr(written["b"] + rows(3, 1, first=4))
    assert open_journal(tmp_path / "t.log").rows("unknown") == []


def test_a_journal_of_another_study_is_refused(tmp_path: Path) -> None:
    """Where folders were merged, an interrupted search went on with trials of another world, without a word."""
    file = tmp_path / "t.log"
    open_journal(file, study="one").add({"a": rows(3, 1)})
    assert len(open_journal(file, study="one").rows("a")) == len(open_journal(file).rows("a")) == 3
    with pytest.raises(ResultError, match=r"t\.log: the trials of a are of another study; take the journal away"):
        open_journal(file, study="other").rows("a")


def test_a_trial_that_comes_twice_counts_once(tmp_path: Path) -> None:
    """Two workers of a cluster of which one was thought dead."""
    journal = open_journal(tmp_path / "t.log")
    for first, count in ((0, 2), (1, 1), (2, 2)):
        journal.add({"a": rows(5, 1)[first : first + count]})
    assert repr(open_journal(tmp_path / "t.log").rows("a")) == repr(rows(5, 1)[:4])


def test_optuna_opens_the_file_as_it_is(tmp_path: Path) -> None:
    """What its dashboard does: a journal storage on the path, with its lock and its reader."""
    mine, other = rows(12, 3), rows(5, 4)
    mine[0] |= {"state": "stopped", "value": 2.0, "epochs": 7}
    write_searches(tmp_path / "t.log", [("a", mine, SPACE), ("b", other, {})])
    storage = JournalStorage(JournalFileBackend(str(tmp_path / "t.log")))
    study = optuna.load_study(study_name="a", storage=storage)
    assert [trial.user_attrs["row"]["params"] for trial in study.trials] == [row["params"] for row in mine]
    assert study.trials[0].intermediate_values == {7: 2.0}
    assert study.best_value == min(row["value"] for row in mine if row["state"] == "complete")
    assert set(study.best_params) == set(SPACE)
    assert len(optuna.load_study(study_name="b", storage=storage).trials) == 5
    study.enqueue_trial({"scale": 2.0})  # and writes to it


def test_a_write_that_was_cut_off_anywhere_loses_its_last_trial_at_most(tmp_path: Path) -> None:
    """After each whole line and within it, the first one too: a search of a study goes on."""
    file, written = tmp_path / "t.log", rows(3, 1)
    open_journal(file, study="one").add({"a": written})
    whole = file.read_bytes()
    ends = np.cumsum([0, *map(len, whole.splitlines(keepends=True))])
    assert len(ends) == 4
    for cut in [*ends, *(ends[1:] - 7)]:
        file.write_bytes(whole[:cut])
        again = open_journal(file, study="one")
        kept = len(again.rows("a"))
        assert kept == np.searchsorted(ends, cut, side="right") - 1
        assert repr(again.rows("a")) == repr(written[:kept])
        again.add({"a": written[kept:], "b": rows(2, 4)})
        last = open_journal(file, study="one")
        assert repr(last.rows("a")) == repr(written)
        assert repr(last.rows("b")) == repr(rows(2, 4))


@pytest.mark.parametrize("seed", range(20))
def test_damage_anywhere_is_said_or_loses_trials_and_never_changes_one(tmp_path: Path, seed: int) -> None:
    """One bit, or some bytes; what is lost is added again."""
    file, written = tmp_path / "t.log", {"a": rows(5, seed), "b": rows(3, seed + 1)}
    open_journal(file).add(written)
    rng, content = np.random.default_rng(seed), bytearray(file.read_bytes())
    place = int(rng.integers(len(content)))
    if seed % 3 == 0:
        place = len(content) - 1 - place % len(content.splitlines()[-1])  # the last line
    if rng.random() < 0.5:
        content[place] ^= 1 << int(rng.integers(8))
    else:
        content[place : place + int(rng.integers(1, 9))] = rng.bytes(int(rng.integers(0, 5)))
    file.write_bytes(content)
    said, read = "", dict[str, Any]()
    try:
        journal = open_journal(file)
        read = {cell: journal.rows(cell) for cell in written}
    except ResultError as error:
        said = str(error)
    assert bool(read) != ("damaged" in said)
    assert "\n" not in said
    for cell in read:
        mine, kept = written[cell], len(read[cell])
        assert repr(read[cell]) == repr(mine[:kept])
        journal.add({cell: mine[kept:]})
        assert repr(open_journal(file).rows(cell)) == repr(mine)


def test_the_number_of_trials_comes_back(tmp_path: Path) -> None:
    journal = open_journal(tmp_path / "t.log")
    journal.add({"a": rows(2, 1)})
    assert journal.count("a") is None
    journal.add({"a": [7], "b": [7]})
    assert open_journal(tmp_path / "t.log").count("a") == journal.count("b") == 7
    assert repr(open_journal(tmp_path / "t.log").rows("a")) == repr(rows(2, 1))


def test_who_may_not_write_any_more_writes_nothing(tmp_path: Path) -> None:
    """A search whose claim another process has taken stops at its next write: the file stays as it was."""
    held = [True]

    def check() -> None:
        if not held[0]:
            raise ResultError("taken over")

    slow = open_journal(tmp_path / "t.log", check)
    slow.add({"a": rows(2, 1)})
    held[0] = False
    before = (tmp_path / "t.log").read_bytes()
    for write in (
        lambda: slow.add({"a": rows(1, 2, first=2)}),
        lambda: slow.add({"b": rows(1, 2)}),
        lambda: slow.add({"a": [9]}),
    ):
        with pytest.raises(ResultError, match="taken over"):
            write()
    assert (tmp_path / "t.log").read_bytes() == before


def test_a_file_that_is_no_journal_is_one_line(tmp_path: Path) -> None:
    for number, content in enumerate((b"hello\nworld\n", b"[1]\n[2]\n", b'{"op_code": 4}\n{"op_code": 4}\n')):
        file = tmp_path / f"{number}.log"
        file.write_bytes(content)
        with pytest.raises(ResultError, match="damaged"):
            open_journal(file)
