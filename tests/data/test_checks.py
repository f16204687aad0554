"""A clean log passes every check; each defect put into it fails its own check."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from shipid.data.checks import check_dataset
from tests.logs.conftest import as_dataset, turning

T = np.arange(0.0, 120.0, 0.5)


def failed(*frames: pd.DataFrame) -> set[str]:
    table = check_dataset(as_dataset(*frames))
    return set(table.loc[~table["ok"], "check"])


def test_clean_log_passes() -> None:
    table = check_dataset(as_dataset(turning(T), turning(T, r=-0.03).assign(t=T + 500.0)))
    assert table["ok"].all()
    assert list(table.columns) == ["check", "run", "value", "unit", "limit", "ok", "sentence"]
    assert not table.duplicated(["check", "run"]).any()
    scale = table[table["check"] == "heading scale"]["value"]
    np.testing.assert_allclose(scale, 1.0, atol=1e-9)
    assert table.loc[table["check"] == "path", "value"].max() < 0.05


@pytest.mark.parametrize(
    ("defect", "caught"),
    [
        (lambda f: f.drop(index=range(50, 60)).reset_index(drop=True), {"gap", "jitter"}),
        (lambda f: f.assign(t=f["t"] + np.random.default_rng(0).uniform(-0.1, 0.1, len(f))), {"jitter"}),
        (lambda f: f.assign(r=np.degrees(f["r"])), {"range r", "heading scale", "heading error"}),
        (lambda f: f.assign(r=-f["r"]), {"heading rate", "heading scale", "heading error"}),
        (lambda f: f.assign(u=f["u"] / 0.5144), {"path"}),
        (lambda f: f.assign(psi=f["psi"] + 0.3), {"path"}),
        (lambda f: f.assign(**{"port.n": f["port.n"] * 60}), {"range port.n"}),
        (lambda f: f.iloc[np.repeat(np.arange(0, 240, 2), 2)].reset_index(drop=True).assign(t=T), {"frozen"}),
    ],
)
def test_defect_fails_its_check(defect: Callable[[pd.DataFrame], pd.DataFrame], caught: set[str]) -> None:
    frame = turning(T)
    wobble = 0.02 * np.sin(0.1 * T)  # a rate that varies, so that correlation means something
    frame["r"] += wobble
    frame["psi"] += 0.2 * (1 - np.cos(0.1 * T))
    rates = [np.cos(frame["psi"]) * 4 + np.sin(frame["psi"]) / 2, np.sin(frame["psi"]) * 4 - np.cos(frame["psi"]) / 2]
    for name, rate in zip(("north", "east"), rates, strict=True):
        frame[name] = np.append(0.0, np.cumsum((rate[1:].to_numpy() + rate[:-1].to_numpy()) / 2 * 0.5))
    assert failed(frame) == set()
    assert caught <= failed(defect(frame))


def test_shared_rows_are_told() -> None:
    assert "overlap" in failed(turning(T), turning(T + 10.0))


def test_straight_run_is_not_judged_by_its_heading() -> None:
    still = turning(T).assign(psi=1.0, r=0.0, u=5.0, v=0.0, north=5 * np.cos(1.0) * T, east=5 * np.sin(1.0) * T)
    table = check_dataset(as_dataset(still))
    assert table["ok"].all()
    assert table.set_index("check").loc["heading rate", "sentence"] == "too straight to compare heading and rate"


def test_stretches_between_breaks_are_judged_alone() -> None:
    jumped = turning(T).assign(flags=np.where(T == 60.0, 1, 0))
    jumped.loc[T >= 60.0, ["north", "psi"]] += [300.0, 1.0]
    assert "path" in failed(jumped.assign(flags=0))
    turned = jumped.assign(psi=turning(T)["psi"])
    assert failed(turned) == set()
