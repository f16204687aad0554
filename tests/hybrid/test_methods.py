"""Laws of all methods: names, one seed one result, company, what is saved, and failures that are values."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shipid.data.windows import cut_windows
from shipid.errors import DocumentError
from shipid.hybrid.method import Case, Fitted, Method, Task
from shipid.hybrid.methods import METHODS, kind_of, method_of
from shipid.hybrid.physics import Physics
from shipid.vessel.load import load_vessel
from tests.study.test_whole import EVERYTHING, SMALL, windy

SHIP = load_vessel("gunnerus-28.9")
Make = Callable[..., Task]


@pytest.fixture(scope="module")
def make() -> Make:
    """A task with foundations of some derivatives, `slow={"N_ur": -3e5}`, or without physics, `none=None`."""
    windows = cut_windows(windy("abc"), horizon=4, interval=3.0, past=6)
    folds = [(np.flatnonzero(windows.run != run), np.flatnonzero(windows.run == run)) for run in windows.spans]
    commands = tuple(name for name in windows.columns if "." in name)

    def made(seed: int = 1, **foundations: Mapping[str, float] | None) -> Task:
        cases = {}
        for name, values in foundations.items():
            changed = {f"hull.derivatives.{key}": value for key, value in (values or {}).items()}
            physics = Physics(None if values is None else SHIP.with_values(changed), 4, 1.0)
            cases[name] = Case(physics, physics.paths(windows.instants()))
        return Task(cases, windows, folds, commands, seed=seed)

    return made


@pytest.fixture(params=list(METHODS))
def method(request: pytest.FixtureRequest) -> Method:
    """Every method in turn, cheap, with all the memory that it can have."""
    kind = request.param
    memory = {"memory": EVERYTHING} if "memory" in METHODS[kind].model_fields else {}
    return method_of(kind, {**SMALL.get(kind, {}), **memory})


SLOW, OTHER = {"N_ur": -3e5}, {"N_uv": -2e5}


def same(one: Fitted, other: Fitted) -> bool:
    """Whether two results hold the very same numbers."""
    assert one.corrector is not None
    assert other.corrector is not None
    arrays, others = one.corrector.arrays(), other.corrector.arrays()
    equal = all(np.array_equal(values, others[name]) for name, values in arrays.items())
    return one.corrector.header() == other.corrector.header() and arrays.keys() == others.keys() and equal


def predicted(task: Task, name: str, found: Fitted) -> Any:
    """Paths of a result on the windows of its task."""
    assert found.corrector is not None
    return found.corrector.predict(task.cases[name].physics, task.instants(name), task.cases[name].paths)


def test_a_name_and_its_class(method: Method) -> None:
    assert type(method_of(kind_of(method), method.model_dump())) is type(method)
    assert method_of(kind_of(method), method.model_dump()) == method


def test_an_unknown_kind_is_told_the_names() -> None:
    with pytest.raises(DocumentError, match="did you mean 'path-drawn'") as caught:
        method_of("path-draw", {}, "method.2")
    assert caught.value.path == "method.2.kind"


def test_the_same_seed_gives_the_same_numbers(make: Make, method: Method) -> None:
    first, again = (method.fit(make(slow=SLOW))["slow"] for _ in range(2))
    assert same(first, again)
    if first.trials:  # what has nothing to draw has no use for a seed
        assert [row["value"] for row in first.trials] == [row["value"] for row in again.trials]
        assert not same(first, method.fit(make(seed=2, slow=SLOW))["slow"])


def test_a_foundation_does_not_notice_its_company(make: Make, method: Method) -> None:
    none = {"none": None} if method.meets_none else {}
    together, alone = make(slow=SLOW, other=OTHER, **none), make(slow=SLOW)
    found, single = method.fit(together), method.fit(alone)
    assert list(found) == ["slow", "other", *none]
    one, other = predicted(together, "slow", found["slow"]), predicted(alone, "slow", single["slow"])
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-4)  # networks that train together round otherwise


def test_what_is_saved_is_what_is_rebuilt(make: Make, method: Method) -> None:
    task = make(slow=SLOW)
    found = method.fit(task)["slow"]
    assert found.corrector is not None
    header = json.loads(json.dumps(found.corrector.header()))
    again = type(method).corrector.from_arrays(header, dict(found.corrector.arrays()))
    assert isinstance(found.corrector, type(method).corrector)
    assert again.past == found.corrector.past <= method.past
    np.testing.assert_array_equal(
        predicted(task, "slow", replace(found, corrector=again)), predicted(task, "slow", found)
    )


def test_paths_that_are_no_numbers_are_a_value_and_harm_nobody(make: Make, method: Method) -> None:
    task = make(slow=SLOW, other=OTHER)
    lost = Case(task.cases["other"].physics, np.full_like(task.cases["other"].paths, np.nan))
    found = method.fit(replace(task, cases={**task.cases, "other": lost}))
    if method.compensates:
        assert found["other"].corrector is None
        assert {row["state"] for row in found["other"].trials} == {"diverged"}
    single = method.fit(make(slow=SLOW))["slow"]
    one, other = predicted(task, "slow", found["slow"]), predicted(task, "slow", single)
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-4)


def test_every_trial_is_a_row(make: Make, method: Method) -> None:
    calls: list[tuple[int, int]] = []
    task = replace(make(slow=SLOW), on_trial=lambda done, total: calls.append((done, total)))
    found = method.fit(task)["slow"]
    count = len(found.trials)
    assert calls == [(number, count) for number in range(1, count + 1)]
    assert [row["number"] for row in found.trials] == list(range(count))
    for row in found.trials:
        assert row.keys() == {"number", "params", "value", "seconds", "epochs", "state"}
        assert set(method.varied()) <= row["params"].keys()
        assert row["state"] == "complete"
    if found.trials:
        assert found.corrector is not None
        best = min(found.trials, key=lambda row: row["value"])
        assert found.corrector.hyperparameters == best["params"]
    assert bool(found.trials) == method.compensates
