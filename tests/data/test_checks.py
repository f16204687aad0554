"""A clean log passes every check; each defect put into it fails the check for it."""

import re
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from shipid.data import checks
from shipid.data.checks import check_dataset, white_noise_of
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
        (lambda f: f.assign(r=-f["r"]), {"heading scale", "heading error"}),
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


@pytest.mark.parametrize("seed", [1])
def test_uneven_times_fail_where_the_motion_contradicts_them(seed: int) -> None:
    """Steps of 0.95 and 1.04 s, as days with six decimals have, failed whatever the noise of the positions."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 300.0)
    uneven = t + random.uniform(-0.2, 0.2, len(t))

    def logged(of: np.ndarray, times: np.ndarray, noise: float) -> set[str]:
        frame, sizes = (
            turning(of).assign(t=times, **{"port.n": 2.0}),
            {"north": noise, "east": noise, "psi": 0.01 * noise},
        )
        return failed(
            frame.assign(**{name: frame[name] + random.normal(0, std, len(t)) for name, std in sizes.items()})
        )

    assert logged(uneven, uneven, 0.1) == set()  # sampled at these times
    assert logged(t, uneven, 0.1) == {"jitter"}  # sampled each second
    assert logged(t, 0.0864 * np.round(t / 0.0864), 0.5) == set()


def test_shared_rows_are_reported() -> None:
    assert "overlap" in failed(turning(T), turning(T + 10.0))
    table = check_dataset(as_dataset(turning(T), turning(T)))
    assert table.loc[table["check"].eq("overlap"), "sentence"].str.startswith("100 % of the rows belong").all()


def test_straight_run_is_not_judged_by_its_heading() -> None:
    still = turning(T).assign(psi=1.0, r=0.0, u=5.0, v=0.0, north=5 * np.cos(1.0) * T, east=5 * np.sin(1.0) * T)
    table = check_dataset(as_dataset(still))
    assert table["ok"].all()
    assert table.set_index("check").loc["heading scale", "sentence"] == "too straight to compare heading and rate"


def test_stretches_between_breaks_are_judged_alone() -> None:
    jumped = turning(T).assign(flags=np.where(T == 60.0, 1, 0))
    jumped.loc[T >= 60.0, ["north", "psi"]] += [300.0, 1.0]
    assert "path" in failed(jumped.assign(flags=0))
    turned = jumped.assign(psi=turning(T)["psi"])
    assert failed(turned) == set()


def noisy(seed: int) -> pd.DataFrame:
    """A run in good order with the noise of drawn sensors: a ship that weaves or turns."""
    random = np.random.default_rng(seed)
    step = random.choice([0.1, 0.5, 1.0])
    t = np.arange(0.0, 240.0, step)
    rate = random.uniform(0.01, 0.05) * np.sin(2 * np.pi * t / random.uniform(40, 150) + random.uniform(0, 6))
    psi = np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * step))
    way = 5.0 * np.exp(1j * psi)
    place = np.append(0.0, np.cumsum((way[1:] + way[:-1]) / 2 * step))
    noise = {"north": 0.5, "east": 0.5, "psi": np.radians(0.3), "u": 0.1, "v": 0.1, "r": np.radians(0.3)}
    frame = pd.DataFrame({"t": t, "north": place.real, "east": place.imag, "psi": psi, "u": 5.0, "v": 0.0, "r": rate})
    frame["port.n"] = 2.0
    scale = random.uniform(0, 2)
    return frame.assign(**{name: frame[name] + random.normal(0, scale * std, len(t)) for name, std in noise.items()})


def weaving(t: np.ndarray) -> np.ndarray:
    """Path north + i east [m] of a ship that weaves."""
    psi = 0.8 * np.sin(2 * np.pi * t / 90.0)
    velocity = (4.0 + 0.5j * np.sin(2 * np.pi * t / 70.0)) * np.exp(1j * psi)
    return np.append(0.0, np.cumsum((velocity[1:] + velocity[:-1]) / 2 * np.diff(t)))


@pytest.mark.parametrize("scale", [1.0, 0.51])
@pytest.mark.parametrize("delay", [-1.5, 0.0, 2.0])
def test_a_delay_is_measured_whatever_the_scale_and_beside_spikes(delay: float, scale: float) -> None:
    t = np.arange(0.0, 600.0, 0.5)
    path = weaving(t)
    late = scale * (np.interp(t - delay, t, path.real) + 1j * np.interp(t - delay, t, path.imag))
    late[[100, 400, 800]] += 500.0
    measured = checks.measure_delay([(t[:700], late[:700], path[:700]), (t[700:] + 50.0, late[700:], path[700:])])
    assert measured is not None
    assert measured.seconds == pytest.approx(delay, abs=0.26)
    assert measured.explained > 0.9 or delay == 0.0
    assert measured.limit == pytest.approx(0.375)
    late_one = {-1.5: "velocity", 0.0: "position", 2.0: "position"}[delay]
    assert measured.said("position", "velocity")[0] == late_one


def test_noise_is_no_delay_and_few_windows_say_nothing() -> None:
    t = np.arange(0.0, 300.0, 1.0)
    for seed in range(20):
        random = np.random.default_rng(seed)
        total = 0.3 * np.cumsum(0.01 * random.normal(size=len(t)))
        measured = checks.measure_delay([(t, total + random.normal(size=len(t)) + 0j, total + 0j)])
        assert measured is not None
        assert measured.seconds == 0.0, seed
    assert checks.measure_delay([(t[:20], t[:20] + 0j, t[:20] + 0j)]) is None
    assert checks.measure_delay([]) is None


@pytest.mark.slow
def test_noise_alone_is_no_finding() -> None:
    """Of a hundred clean runs with noise fewer than 2 % have a finding."""
    assert sum(bool(failed(noisy(seed))) for seed in range(100)) < 2


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("defect", "caught"),
    [
        (lambda f: f.assign(r=-f["r"]), "heading scale"),
        (lambda f: f.assign(r=np.degrees(f["r"])), "heading scale"),
        (lambda f: f.assign(u=f["u"] * 1.3), "path"),
        (lambda f: f.assign(psi=np.interp(f["t"] - 2.0, f["t"], f["psi"])), "latency"),
    ],
)
def test_a_defect_is_detected_in_noise(seed: int, defect: Callable[[pd.DataFrame], pd.DataFrame], caught: str) -> None:
    assert any(caught in check for check in failed(defect(noisy(seed))))


def test_a_run_contained_in_another_is_detected_on_another_clock() -> None:
    whole = noisy(1)
    part = whole.iloc[len(whole) // 3 : len(whole) // 2].assign(t=lambda f: f["t"] - f["t"].iloc[0])
    part = part.reset_index(drop=True)
    table = check_dataset(as_dataset(whole, part, clock="run"))
    row = table[(table["check"] == "overlap") & (table["run"] == "b")].iloc[0]
    assert not row["ok"]
    assert "'a'" in row["sentence"]
    assert table[(table["check"] == "overlap") & (table["run"] == "a")].iloc[0]["ok"]


def test_the_noise_of_a_straight_signal_is_that_put_into_it() -> None:
    line = 3.0 + 0.2 * np.arange(4000)
    noise = np.random.default_rng(0).normal(0, 0.5, len(line))
    assert white_noise_of(line + noise) == pytest.approx(0.5, rel=0.05)
    assert white_noise_of(line) < 1e-9
    assert white_noise_of(noise[:4]) == 0.0  # too few to say


@pytest.mark.parametrize(("of_heading", "of_rate"), [(0.01, 0.0), (0.0, 0.02), (0.01, 0.02)])
def test_the_heading_leaves_the_rate_by_its_noise(of_heading: float, of_rate: float) -> None:
    t, random = np.arange(0.0, 4000.0, 0.5), np.random.default_rng(1)
    log = turning(t)
    log["psi"] += random.normal(0, of_heading, len(t))
    log["r"] += random.normal(0, of_rate, len(t))
    row = check_dataset(as_dataset(log)).set_index("check").loc["heading error"]
    seen, by_noise = map(float, re.findall(r"([\d.]+) deg \(RMS\), ([\d.]+) by noise", str(row["sentence"]))[0])
    assert by_noise == pytest.approx(seen, rel=0.15)
    assert row["ok"]
