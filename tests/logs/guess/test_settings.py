"""The settings of the search are documented, each with its reason."""

from __future__ import annotations

import re
from dataclasses import fields

import numpy as np

from shipid.logs.guess.settings import SETTINGS, SearchSettings
from tests.benchmarks.retune import Racer, keep_results, race


def test_every_setting_has_its_reason() -> None:
    said = re.findall(r"(\w+(?:, \w+)*) :", SearchSettings.__doc__ or "")
    assert sorted(name for names in said for name in names.split(", ")) == sorted(
        one.name for one in fields(SearchSettings)
    )


def test_a_setting_that_reads_a_log_wrong_is_out_of_the_race_and_the_others_stay() -> None:
    usual, racers = SearchSettings(), [Racer({"odd": 0.0}), Racer({"close": 1.6})]
    base = race(racers, range(32700002, 32700003))
    assert [racer.out for racer in racers] == [True, False]
    assert (base.seen, base.wrong, racers[1].other) == (1, (0, 0), 0)
    assert usual == SETTINGS


def test_results_are_kept_by_the_values_of_arguments() -> None:
    calls: list[np.ndarray] = []
    kept = keep_results(lambda values: calls.append(values) or len(calls))
    assert [kept(np.zeros(3)), kept(np.zeros(3)), kept(np.ones(3))] == [1, 1, 2]
