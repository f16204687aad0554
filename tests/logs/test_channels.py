"""Channels with different clocks, delays and frames become one dataset, equal to the motion that made them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.checks import check_dataset
from shipid.data.dataset import Dataset
from shipid.errors import DataError, DocumentError
from shipid.logs.importing import import_log, log_digest, read_mapping
from tests.logs.conftest import PLAIN, as_log, import_written, mapping_with, turning

T = np.arange(0.0, 120.0, 0.5)
STATES = ["north", "east", "psi", "u", "v", "r"]


def logged(frame: pd.DataFrame, folder: Path) -> Path:
    return as_log(frame, folder / "log.csv")


def without(columns: set[str], more: str, folder: Path) -> Path:
    """The plain mapping without some columns and with more TOML behind it."""
    head, *blocks = PLAIN.read_text().split("[columns.")
    kept = [f"[columns.{block}" for block in blocks if block.partition("]")[0] not in columns]
    (folder / "mapping.toml").write_text(head + "".join(kept) + "\n" + more)
    return folder / "mapping.toml"


GAP = ('from = "time"', 'from = "time"\nmax_gap = 3.0')


def test_irregular_clocks_and_latencies(tmp_path: Path) -> None:
    """GPS of 1 s and compass of 0.3 to 0.7 s in separate files, each with another delay."""
    random = np.random.default_rng(0)
    dense = turning(np.arange(0.0, 125.0, 0.01))
    gps = dense.iloc[::100]
    compass = dense.iloc[np.cumsum(random.integers(30, 70, 240))]
    late = {"gps": 0.8, "compass": 0.25}
    pd.DataFrame({"ms": (gps["t"] + late["gps"]) * 1e3, "x": gps["north"], "y": gps["east"]}).to_csv(
        tmp_path / "gps.txt", sep=";", index=False
    )
    heading = np.degrees(compass["psi"]) % 360.0
    pd.DataFrame({"t": compass["t"] + late["compass"], "hdg": heading}).to_parquet(tmp_path / "compass.parquet")
    blocks = f"""
[file.gps]
path = "gps.txt"
clock = {{ from = "ms", unit = "ms" }}
format = {{ separator = ";" }}
[file.compass]
path = "compass.parquet"
clock = {{ from = "t" }}
format = {{ kind = "parquet" }}
[columns.north]
file = "gps"
from = "x"
unit = "m"
latency = {late["gps"]}
[columns.east]
file = "gps"
from = "y"
unit = "m"
latency = {late["gps"]}
[columns.psi]
file = "compass"
from = "hdg"
unit = "deg"
wrap = true
latency = {late["compass"]}
"""
    mapping = without({"north", "east", "psi"}, blocks, tmp_path)
    mapping.write_text(mapping.read_text().replace(*GAP))
    log = logged(turning(T), tmp_path)
    dataset = import_log(read_mapping(mapping), log)
    truth = turning(dataset.frame["t"].to_numpy())
    assert len(dataset.frame) > 200
    sag = 4.03 * 0.05 / 8.0  # a chord of 1 s leaves the arc by U r dt^2 / 8
    for name in STATES:
        tolerance = 1.1 * sag if name in ("north", "east") else 1e-9
        np.testing.assert_allclose(dataset.frame[name], truth[name], atol=tolerance, err_msg=name)
    np.testing.assert_array_equal(dataset.frame["propeller.n"], truth["port.n"])
    one = log_digest(read_mapping(mapping), log)
    (tmp_path / "gps.txt").write_text((tmp_path / "gps.txt").read_text() + "\n")
    assert log_digest(read_mapping(mapping), log) != one  # the digest covers every file


def test_a_step_of_the_mapping_holds_orders_and_passes_north(tmp_path: Path) -> None:
    mapping = mapping_with(tmp_path, "", ('from = "time"', 'from = "time"\nmax_gap = 3.0\nstep = 0.2'))
    frame = import_log(read_mapping(mapping), logged(turning(T), tmp_path)).frame
    np.testing.assert_allclose(np.diff(frame["t"]), 0.2)
    np.testing.assert_allclose(frame["psi"], turning(frame["t"].to_numpy())["psi"], atol=1e-9)
    assert set(frame["propeller.n"]) <= set(turning(T)["port.n"])


def test_channels_that_share_no_time(tmp_path: Path) -> None:
    mapping = mapping_with(tmp_path, "", GAP, ('from = "rpm"', 'from = "rpm"\nlatency = 1000.0'))
    with pytest.raises(DataError, match="share no time"):
        import_log(read_mapping(mapping), logged(turning(T), tmp_path))


@pytest.mark.parametrize(
    ("change", "path", "remedy"),
    [
        (('from = "N"', 'from = "N"\nlatency = 1.0'), "clock.max_gap", "set the longest gap"),
        (('from = "N"', 'from = "N"\nfile = "gps"'), "columns.north.file", "nothing is defined there"),
        (('from = "N"', 'from = "N"\ninterpolation = "linear"'), "columns.north.interpolation", "set .clock. step"),
        (('from = "N"', 'from = "N"\nrelative = true'), "columns.north.relative", "only beta_w"),
        (
            ('from = "N"', 'from = "N"\ninterpolation = "angle"'),
            "columns.north.interpolation",
            "only a column in rad or deg",
        ),
        (("[columns.v]", "[columns.speed]"), "columns.u", "remove one of them"),
        (
            ('v]\nfrom = "v"\nunit = "m/s"', 'latitude]\nfrom = "v"\nunit = "deg"'),
            "columns.north",
            "remove one of them",
        ),
        (("[columns.v]", "[columns.std_v]"), "columns.std_v", "unknown column"),
        (('[columns.v]\nfrom = "v"\nunit = "m/s"', ""), "columns.v", "or .estimate."),
        (("[columns.r]", "[columns.q]"), "columns.r", "or .estimate."),
    ],
)
def test_mistakes_in_a_mapping(change: tuple[str, str], path: str, remedy: str, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=remedy) as caught:
        read_mapping(mapping_with(tmp_path, "", change))
    assert caught.value.path == path


def test_one_run_a_file(tmp_path: Path) -> None:
    mapping = mapping_with(tmp_path, "", ('name = "plain"', 'name = "plain"\n[source]\nruns = "Z_*.csv"'))
    for run, rate in (("10_10", 0.05), ("20_20", -0.03)):
        as_log(turning(T, r=rate), tmp_path / f"Z_{run}.csv")
    dataset = import_log(read_mapping(mapping), tmp_path)
    assert dataset.runs == ["10_10", "20_20"]
    assert dataset.metadata["clock"] == "run"
    assert dataset.metadata["rows"] == 2 * len(T)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(DataError, match="no file 'Z_"):
        import_log(read_mapping(mapping), empty)
    with pytest.raises(DataError, match=r"elsewhere.*no such folder.*Z_"):
        import_log(read_mapping(mapping), tmp_path / "elsewhere")
    with pytest.raises(DataError, match=r"Z_10_10\.csv.*is a file.*takes a folder of runs"):
        import_log(read_mapping(mapping), tmp_path / "Z_10_10.csv")


def test_missing_velocities_are_estimated(tmp_path: Path) -> None:
    estimate = "[estimate]\nposition = 0.02\nheading_deg = 0.01\nacceleration = 0.02\nangular_acceleration_deg = 0.05\n"
    mapping = without({"u", "v", "r"}, estimate, tmp_path)
    dataset = import_log(read_mapping(mapping), logged(turning(T), tmp_path))
    inside = dataset.frame.iloc[10:-10]
    for name, value in {"u": 4.0, "v": -0.5, "r": 0.05}.items():
        np.testing.assert_allclose(inside[name], value, atol=0.01)
        assert inside[f"std_{name}"].between(1e-6, 0.1).all()
    assert dataset.metadata["repairs"][-1]["column"] == "u, v, r"
    assert check_dataset(dataset)["ok"].all()


def test_every_zigzag_passes_the_checks(hsva: Dataset) -> None:
    """Facts of the published files, from the description that comes with them."""
    dataset = hsva
    assert len(dataset.runs) == 13
    assert len(dataset.frame) == 42413
    assert check_dataset(dataset)["ok"].all()
    assert np.corrcoef(dataset.frame["rudder.delta"], dataset.frame["r"])[0, 1] > 0.3  # positive to starboard
    first = dataset.frame.groupby("run")["u"].first()
    assert first.between(1.15, 1.20).all()  # U0 = 1.179 m/s
    overshoots = {"10_10_P": (9.73, 17.77), "10_10_S": (9.69, 20.54)}
    for run, expected in overshoots.items():
        psi = np.degrees(dataset.frame.loc[dataset.frame["run"] == run, "psi"])
        ends = sorted([-psi.min() - 10.0, psi.max() - 10.0])
        np.testing.assert_allclose(ends, sorted(expected), atol=0.05)


@pytest.mark.parametrize(("convention", "way"), [(180.0, 1.0), (360.0, -1.0)])
def test_a_longitude_goes_on_the_short_way_where_it_begins_anew(convention: float, way: float, tmp_path: Path) -> None:
    longitude = convention + way * 1e-5 * (T - 60.2)
    longitude = np.where(longitude > convention, longitude - 360.0, longitude)
    log = pd.DataFrame({"t": T, "lat": -17.5, "lon": longitude, "psi": way * np.pi / 2, "u": 2.13, "v": 0.0, "r": 0.0})
    units = {"latitude": ("lat", "deg"), "longitude": ("lon", "deg"), "psi": ("psi", "rad")}
    units |= {name: (name, "rad/s" if name == "r" else "m/s") for name in ("u", "v", "r")}
    text = 'name = "m"\n[clock]\nfrom = "t"\nstep = 0.13\nmax_gap = 3\n'
    text += "".join(f'[columns.{name}]\nfrom = "{a}"\nunit = "{unit}"\n' for name, (a, unit) in units.items())
    frame = import_written(text, log, tmp_path).frame
    metre = way * 1e-5 * np.radians(1.0) * 6378137.0 * np.cos(np.radians(17.5))
    np.testing.assert_allclose(frame["east"], metre * frame["t"], rtol=1e-3, atol=0.01)
