"""A unit, a sign or a frame that another part of a log has is asked, with its place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from shipid.data.dataset import cumulative_integral
from shipid.logs.guess.changes import FEWEST, ask_for_changes, odd_scales
from shipid.logs.guess.columns import guess
from shipid.logs.guess.sources import PAUSE
from tests.drawn import seeds
from tests.logs.simulated import as_bridge, guess_of, si_log, state_of

CLEAN = as_bridge(si_log()).round(4)
END = float(CLEAN["time"].iloc[-1])


@pytest.mark.parametrize(
    ("columns", "factor"),
    [
        (("u", "v"), 3600 / 1852),  # knots from there on
        (("r",), np.pi / 180),
        (("rudder",), -1.0),
    ],
)
def test_a_change_of_unit_or_sign_is_asked_with_its_time(
    columns: tuple[str, ...], factor: float, tmp_path: Path
) -> None:
    after = CLEAN["time"] > 0.4 * END
    result = guess_of(
        tmp_path, CLEAN.assign(**{name: CLEAN[name].where(~after, factor * CLEAN[name]) for name in columns})
    )
    asked = [
        one.sentence
        for one in result.questions
        if "another unit or sign" in one.sentence or "to the other side" in one.sentence
    ]
    assert len(asked) == 1, asked
    assert all(repr(name) in asked[0] for name in columns)
    times = [float(text) for text in re.findall(r"t = ([\d.]+)", asked[0])]
    assert min(abs(time - 0.4 * END) for time in times) < 0.15 * END, asked[0]  # to one stretch and a half


@pytest.mark.parametrize("rate", [True, False])
@pytest.mark.parametrize("radians_first", [True, False])
def test_a_heading_that_changes_its_unit_is_asked(radians_first: bool, rate: bool, tmp_path: Path) -> None:
    """The track turns with the heading in degrees in one part, in radians in the other; a yaw rate is not blamed."""
    log = CLEAN if rate else CLEAN.drop(columns="r")
    for share in (0.55, 0.0):
        radians = (CLEAN["time"] < share * END) == radians_first
        if share == 0.0:
            radians[:] = radians_first
        result = guess_of(tmp_path, log.assign(psi=log["psi"].where(~radians, np.radians(log["psi"])).round(4)))
        asked = [one.sentence for one in result.questions]
        assert sum(sentence.startswith("from t = ") and "keeps to 'psi' in " in sentence for sentence in asked) == (
            share > 0.0
        )
        assert not [sentence for sentence in asked if "another unit or sign" in sentence]


def test_a_log_of_one_unit_is_not_asked(tmp_path: Path) -> None:
    asked = [one.sentence for one in guess_of(tmp_path, CLEAN).questions]
    assert not [sentence for sentence in asked if "another unit or sign" in sentence]


@pytest.mark.parametrize("seed", seeds(1, 3))
def test_the_parts_with_another_scale_are_found(seed: int) -> None:
    random = np.random.default_rng(seed)
    count, ratio = int(random.integers(10 * FEWEST, 1500)), float(random.choice([-1.0, 0.01, 0.5, 2.0, 60.0]))
    ran = random.normal(5, 2, count) * np.exp(1j * random.uniform(0, 7, count))
    parts = [np.isin(np.arange(count), rows) for rows in np.array_split(np.arange(count), 10)]
    first = int(random.integers(0, 7))
    inside = np.any(parts[first : first + 3], axis=0)
    seen = np.where(inside, ratio, 1.0) * ran + random.normal(0, 0.001, count)
    odd, found = odd_scales(seen, ran, parts)
    assert odd == [first, first + 1, first + 2]
    assert found == pytest.approx(ratio, rel=0.01)
    assert odd_scales(ran + random.normal(0, 0.5, count), ran, parts)[0] == []


@pytest.mark.parametrize("slow", [True, False])
@pytest.mark.parametrize("seed", seeds(1, 3))
def test_an_angle_that_turns_the_ship_otherwise_is_asked_under_way_alone(seed: int, slow: bool) -> None:
    """In station keeping thrust turns her, to any side."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 2400.0, 1.0)
    first = t < random.uniform(1000, 1400)
    angle = np.repeat(random.uniform(-0.5, 0.5, 60), 40)
    r = np.zeros(len(t))
    for row in range(1, len(t)):
        r[row] = 0.95 * r[row - 1] - (0.002 if first[row] else -0.002) * angle[row - 1] + random.normal(0, 2e-5)
    state = state_of({"azimuth": angle}, t)
    state.psi, state.r = cumulative_integral(t, r), r
    speed = np.where(first, 5.0, 0.3 if slow else 5.0)
    state.position = np.cumsum(speed * np.exp(1j * state.psi)) + random.normal(0, 0.3, len(t))
    state.columns["heading"] = state.psi
    state.suggest("psi", "heading", "rad", 0.9, "by its name")
    state.suggest("thruster.alpha", "azimuth", "rad", 0.9, "by its name")
    ask_for_changes(state, PAUSE)
    asked = [one.sentence for one in state.questions if "turns the ship to the other side" in one.sentence]
    assert len(asked) == (not slow)


ODD = {
    "heading": (2, lambda part: part.assign(psi=(part["psi"] + 90.0) % 360.0), "keeps to 'psi' in deg to "),
    "axes": (2, lambda part: part.assign(N=part["E"], E=part["N"]), "keeps to 'psi' in deg to "),
    "rudder": (0, lambda part: part.assign(rudder=-part["rudder"]), "'rudder' turns the ship to the other side"),
    "none": (0, lambda part: part, ""),
}


@pytest.mark.parametrize("kind", ODD)
def test_a_file_of_another_kind_is_named(kind: str, tmp_path: Path) -> None:
    """Before, one file of a folder with another frame or sign was imported as the others, without a word."""
    odd, change, words = ODD[kind]
    for number, rows in enumerate(np.array_split(np.arange(len(CLEAN)), 5)):
        part = CLEAN.iloc[rows]
        (change(part) if number == odd else part).to_csv(tmp_path / f"run{number}.csv", index=False)
    asked = [one.sentence for one in guess(tmp_path).questions if "in file " in one.sentence]
    assert len(asked) == (kind != "none"), asked
    assert all(f"in file {odd + 1} of 5" in sentence and words in sentence for sentence in asked)


@pytest.mark.parametrize("files", [2, 5])
def test_a_file_with_heading_and_course_exchanged_is_named(files: int, tmp_path: Path) -> None:
    """Its heading was the course, and its drift of the other sign, without a word."""
    sway = np.radians(CLEAN["psi"]) + np.arctan2(CLEAN["v"], CLEAN["u"])
    log = CLEAN.assign(cog=np.degrees(sway) % 360.0, sog=np.hypot(CLEAN["u"], CLEAN["v"])).drop(columns=["u", "v"])
    for exchanged in (False, True):
        for number, rows in enumerate(np.array_split(np.arange(len(log)), files)):
            part = log.iloc[rows]
            other = part.rename(columns={"psi": "cog", "cog": "psi"})[log.columns]
            (other if exchanged and number == files // 4 else part).to_csv(tmp_path / f"run{number}.csv", index=False)
        asked = [one.sentence for one in guess(tmp_path).questions if "are they exchanged there" in one.sentence]
        assert len(asked) == exchanged
        assert all("'psi'" in sentence and "'cog'" in sentence for sentence in asked)
