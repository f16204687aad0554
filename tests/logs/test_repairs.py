"""A defect is put into an exact motion; its repair finds it, heals it, flags it, and can be switched off."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import BREAK, Dataset, flag_bit, stretches_of_runs
from shipid.errors import DataError
from shipid.logs.importing import import_log, read_mapping
from shipid.logs.repairs import FLAGS, Despike, Latency, apply_repairs, remove_spikes
from tests.drawn import seeds
from tests.logs.conftest import as_log, turning

T = np.arange(0.0, 240.0, 0.5)
MOTION = turning(T)


def lever(frame: pd.DataFrame, x: float, y: float) -> pd.DataFrame:
    """What a sensor x forward and y to starboard of the origin measures on a rigid body."""
    c, s = np.cos(frame["psi"]), np.sin(frame["psi"])
    return frame.assign(
        north=frame["north"] + x * c - y * s,
        east=frame["east"] + x * s + y * c,
        u=frame["u"] - y * frame["r"],
        v=frame["v"] + x * frame["r"],
    )


def low_heading(frame: pd.DataFrame, offset: float) -> pd.DataFrame:
    """What is logged when the compass reads low and ground velocity is resolved along its heading."""
    psi = frame["psi"] - offset
    north = frame["u"] * np.cos(frame["psi"]) - frame["v"] * np.sin(frame["psi"])
    east = frame["u"] * np.sin(frame["psi"]) + frame["v"] * np.cos(frame["psi"])
    return frame.assign(psi=psi, u=north * np.cos(psi) + east * np.sin(psi), v=east * np.cos(psi) - north * np.sin(psi))


def spiked(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(north=frame["north"] + np.where(np.isin(frame["t"], [60.0, 60.5, 150.0]), 40.0, 0.0))


CASES = {
    "scale": (
        'columns = ["u", "v"]\nfactor = 1.0204',
        lambda f: f.assign(u=f["u"] / 1.0204, v=f["v"] / 1.0204),
        480,
        1e-9,
    ),
    "heading_offset": ('offset = 2.3\nunit = "deg"', lambda f: low_heading(f, np.radians(2.3)), 480, 1e-9),
    "lever_arm": ("x = 2.1\ny = -1.4", lambda f: lever(f, 2.1, -1.4), 480, 1e-9),
    "despike": ('columns = ["north"]\nwindow = 6\nthreshold = 10\nunit = "m"', spiked, 3, 0.15),
}


@pytest.mark.parametrize("kind", CASES)
def test_defect_is_healed(kind: str, plain_mapping: Callable[..., Path], tmp_path: Path) -> None:
    parameters, spoil, count, tolerance = CASES[kind]
    mapping = read_mapping(plain_mapping(f'\n[[repair]]\nkind = "{kind}"\nreason = "a test"\n{parameters}\n'))
    log = as_log(spoil(MOTION), tmp_path / "log.csv")
    healed, left = import_log(mapping, log), import_log(mapping, log, without=(kind,))
    names = ["north", "east", "psi", "u", "v", "r"]
    difference = (healed.frame[names] - MOTION[names]).abs()
    assert difference.max().max() < tolerance
    assert (left.frame[names] - MOTION[names]).abs().max().max() > 0.03
    assert healed.metadata["repairs"][0]["count"] == count
    assert flagged(healed, kind).sum() == count
    assert (left.metadata["repairs"][0]["count"], left.metadata["repairs"][0]["note"]) == (0, "switched off")
    assert not flagged(left, kind).any()


def flagged(dataset: Dataset, kind: str) -> pd.Series:
    return dataset.frame["flags"] & flag_bit(dataset.metadata, kind) != 0


def wrapped_and_interpolated(tmp_path: Path, early: float) -> tuple[Path, int]:
    """A log whose 0..360 heading was interpolated linearly to 0.5 s from every 1.5 s, and how often it wraps."""
    coarse = np.arange(0.0, 240.0, 1.5) - early
    heading = np.degrees(np.interp(coarse, T, MOTION["psi"])) % 360.0
    wraps = int((np.abs(np.diff(heading)) > 180).sum())
    log = as_log(MOTION, tmp_path / "log.csv")
    frame = pd.read_csv(log)
    frame["heading"] = np.interp(T, coarse, heading)
    frame.to_csv(log, index=False)
    return log, wraps


@pytest.mark.parametrize("early", [-0.02, 0.0, 0.02])  # 0.02 s: an outer false sample is only 5 deg wrong
def test_interpolated_wraps_are_detected_and_repaired(
    early: float, plain_mapping: Callable[..., Path], tmp_path: Path
) -> None:
    log, wraps = wrapped_and_interpolated(tmp_path, early)
    repair = '\n[[repair]]\nkind = "wrap_interpolation"\ncolumns = ["psi"]\nthreshold = 20.0\nunit = "deg"\n'
    mapping = read_mapping(plain_mapping(repair + 'reason = "a test"\n'))
    dataset = import_log(mapping, log)
    inside = (T >= 1.5) & (T < 238.0)  # where the coarse clock brackets the fine one
    assert dataset.metadata["repairs"][0]["count"] == 3 * wraps > 0  # three steps of 0.5 s over each
    np.testing.assert_allclose(dataset.frame["psi"][inside], MOTION["psi"][inside], atol=1e-9)
    spoiled = import_log(mapping, log, without=("wrap_interpolation",))
    assert np.abs(spoiled.frame["psi"] - MOTION["psi"])[inside].max() > 0.5


def test_disabled_in_the_file(plain_mapping: Callable[..., Path], tmp_path: Path) -> None:
    repair = '\n[[repair]]\nkind = "scale"\ncolumns = ["u"]\nfactor = 2.0\nreason = "a test"\nenabled = false\n'
    dataset = import_log(read_mapping(plain_mapping(repair)), as_log(MOTION, tmp_path / "log.csv"))
    np.testing.assert_allclose(dataset.frame["u"], MOTION["u"])


def test_break_removes_what_lies_between_and_despike_does_not_reach_over(
    plain_mapping: Callable[..., Path], tmp_path: Path
) -> None:
    jumped = MOTION.assign(north=MOTION["north"] + np.where(T >= 100.0, 300.0, 0.0))
    repairs = '\n[[repair]]\nkind = "break"\nintervals = [[99.0, 101.0]]\nreason = "a test"\n'
    repairs += '[[repair]]\nkind = "despike"\ncolumns = ["north"]\nwindow = 6\nthreshold = 10\nreason = "a test"\n'
    dataset = import_log(read_mapping(plain_mapping(repairs)), as_log(jumped, tmp_path / "log.csv"))
    ends = [(rows["t"].iloc[0], rows["t"].iloc[-1]) for _, rows in stretches_of_runs(dataset)]
    assert ends == [(0.0, 99.0), (101.0, 239.5)]
    assert [record["count"] for record in dataset.metadata["repairs"]] == [1, 0]


@pytest.mark.parametrize("seed", seeds(3, 5))
def test_a_spike_is_mended_by_its_own_stretch(seed: int) -> None:
    """Wherever it is, and wherever the ship was before and after the break: on a line the mended value is the true."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(30, 60))
    slopes, begins = rng.uniform(-8, 8, 3), rng.uniform(-1e4, 1e4, 3)
    true = np.concatenate([begin + slope * np.arange(size) for begin, slope in zip(begins, slopes, strict=True)])
    t = np.concatenate([1000.0 * k + np.arange(size) for k in range(3)])
    flags = np.zeros(3 * size, dtype=np.int64)
    flags[[size, 2 * size]] = 1 << FLAGS.index(BREAK)
    ends = [size - 1, size, 2 * size - 1, 2 * size]
    wrong = true.copy()
    spikes = np.unique([*rng.choice(ends, 2, replace=False), *rng.choice(3 * size, 3, replace=False)])
    wrong[spikes] += rng.choice([-500.0, 500.0], len(spikes))
    repair = Despike(kind="despike", reason="a test", columns=("north",), window=10.0, threshold=50.0)
    outcome = remove_spikes(pd.DataFrame({"t": t, "north": wrong, "flags": flags}), repair)
    assert np.flatnonzero(outcome.touched).tolist() == spikes.tolist()
    np.testing.assert_allclose(outcome.rows["north"], true, atol=1e-6)


def test_a_break_outside_the_log_is_refused(plain_mapping: Callable[..., Path], tmp_path: Path) -> None:
    """It was written for another clock; left out, it needs no row."""
    repairs = '\n[[repair]]\nkind = "break"\nintervals = [[99.0, 101.0], [86499.0, 86501.0]]\nreason = "a test"\n'
    mapping, log = read_mapping(plain_mapping(repairs)), as_log(MOTION, tmp_path / "log.csv")
    with pytest.raises(DataError, match=r"repair\.0\.intervals: 86499 to 86501 s is not in the log, which has 0 to"):
        import_log(mapping, log)
    assert len(import_log(mapping, log, without=["break"]).frame) == len(MOTION)


@pytest.mark.parametrize("signal", ["position", "velocity", "heading", "yaw rate"])
def test_what_came_late_is_taken_earlier(signal: str) -> None:
    """A signal that is 1 s late becomes what it was: a turn with changing rate, over ground."""
    t = np.arange(0.0, 60.0, 0.25)

    def motion(at: np.ndarray) -> dict[str, np.ndarray]:
        psi = 0.8 * np.sin(at / 9)
        return {"psi": psi, "r": 0.8 / 9 * np.cos(at / 9), "north": 4 * at, "east": 9 * np.sin(at / 7)} | {
            "ground": (4 + 0.5j * np.sin(at / 5)) * np.exp(1j * psi)
        }

    true, late = motion(t), motion(t - 1.0)
    names = {"position": ("north", "east"), "heading": ("psi",), "yaw rate": ("r",), "velocity": ("ground",)}[signal]
    logged = true | {name: late[name] for name in names}
    body = logged["ground"] * np.exp(-1j * logged["psi"])
    rows = pd.DataFrame({"t": t, "u": body.real, "v": body.imag, "flags": 0})
    rows = rows.assign(**{name: logged[name] for name in ("north", "east", "psi", "r")})
    repair = Latency(kind="latency", reason="seen", signal=signal, seconds=1.0, turn=True)
    mended, records = apply_repairs(rows, [repair])
    wanted = motion(mended["t"].to_numpy())
    ground = (mended["u"] + 1j * mended["v"]).to_numpy() * np.exp(1j * mended["psi"].to_numpy())
    np.testing.assert_allclose(ground, wanted["ground"], atol=2e-2)
    for name in ("north", "east", "psi", "r"):
        np.testing.assert_allclose(mended[name], wanted[name], atol=2e-2, err_msg=name)
    assert len(mended) == len(t) - 4
    assert records[0]["kind"] == "latency"


def test_a_window_of_a_single_row_is_refused(plain_mapping: Callable[..., Path], tmp_path: Path) -> None:
    """A row is its own median: the repair healed nothing, and the log of the import said that it had been done."""
    repair = '\n[[repair]]\nkind = "despike"\ncolumns = ["north"]\nwindow = 0.4\nthreshold = 10\nreason = "a test"\n'
    log = as_log(spiked(MOTION), tmp_path / "log.csv")
    with pytest.raises(DataError, match=r"holds one row, .* rows are 0\.5 s apart, give 1 s or more") as caught:
        import_log(read_mapping(plain_mapping(repair)), log)
    assert (caught.value.file, caught.value.path) == (str(log), "repair.despike")
