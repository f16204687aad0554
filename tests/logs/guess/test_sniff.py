"""Formats of text logs are recognised, and their clock and columns read as numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from pymap3d import ned2geodetic
from scipy.io import savemat

from shipid.errors import DataError
from shipid.logs.guess.layout import split_cells
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.importing import read_mapping
from shipid.logs.mat import NO_VECTOR
from tests.logs.guess.conftest import SUMMER_TIME_ENDS, TABLE, T, log_of, sniff, text
from tests.logs.simulated import as_bridge, drafted, si_log


def test_cells_of_a_matlab_file_are_left_out_with_a_note(tmp_path: Path) -> None:
    file = tmp_path / "log.mat"
    savemat(
        file, {**{name: TABLE[name].to_numpy() for name in TABLE}, "rpm": TABLE["N"].to_numpy(dtype=object), "m": 3}
    )
    sniffed = recognise_log(file)
    assert list(sniffed.columns) == ["N", "psi"]
    assert sniffed.notes == (f"'rpm' is an array of cells{NO_VECTOR}",)


def test_words_and_empty_columns_are_left_out_with_a_note(tmp_path: Path) -> None:
    sniffed = sniff(tmp_path, TABLE.assign(mode="auto", spare=np.nan, N=TABLE["N"].where(T != 2.0)))
    assert list(sniffed.columns) == ["N", "psi"]
    assert sniffed.notes == ("column 'mode' holds words, not numbers", "column 'spare' is empty")
    assert np.flatnonzero(np.isnan(sniffed.columns["N"])).tolist() == [4]
    assert not sniffed.scattered


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"\x00\x01\x02 binary", "a binary file of unknown format"),
        (b"a letter\nto the captain\nwith no numbers\n", "no table of numbers with any separator"),
        (
            text(table=TABLE.assign(time=np.minimum(T, 8.0), N=1.0, psi=1.0)).encode(),
            "'time' in row 18: the time 8 s appears twice",
        ),
        (
            text(table=TABLE.assign(time=np.abs(T - 2.0), N=1.0, psi=1.0)).encode(),
            "'time' in row 2: time goes back from 2 s to 1.5 s",
        ),
        (
            text(table=TABLE.assign(time=SUMMER_TIME_ENDS)).encode(),
            "in row 11: time goes back from 2025-10-26 02:59:59 UTC to 2025-10-26 02:00:00 UTC",
        ),
        (
            text(table=TABLE.assign(time=TABLE["time"].where(T != 1.0), N=1.0, psi=1.0)).encode(),
            "'time' in row 3: no time here",
        ),
        (text(table=TABLE.assign(time=1.0, N=1.0, psi=1.0).rename(columns={"time": "x"})).encode(), "none rises"),
    ],
)
def test_what_is_no_log_is_one_sentence(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(content)
    with pytest.raises(DataError, match=rf"log\.csv.*{message}"):
        recognise_log(tmp_path / "log.csv")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"cannot be read \(No such file"):
        recognise_log(tmp_path / "gone.csv")


def test_cells_and_names() -> None:
    assert split_cells('1, "a b" ,', ",") == ["1", "a b", ""]
    assert split_cells(" 1   2\t3", "whitespace") == ["1", "2", "3"]


@pytest.mark.parametrize("word", ["-999", "9999", "-99.0"])
def test_a_number_for_missing_values_is_reported_and_not_taken(tmp_path: Path, word: str) -> None:
    rows = [f"{k},{np.sin(k):.3f},{360 * ((0.01 * k) % 1):.1f}" for k in range(80)]
    rows[40] = f"40,{word},{word if word != '-99.0' else '144.0'}"
    sniffed = recognise_log(log_of(tmp_path, ["time,x,heading", *rows]))
    assert "missing" not in sniffed.form
    assert sniffed.fillers["x"] == [float(word)]
    assert np.isnan(sniffed.columns["x"][40])
    assert np.nanmax(np.abs(sniffed.columns["heading"])) <= 360


@pytest.mark.parametrize("word", ["---", "#N/A", "-1.#IND", "inf"])
def test_a_word_for_nothing_is_declared_as_a_missing_value(tmp_path: Path, word: str) -> None:
    """Before, the draft could not be imported: this word is no number."""
    rows = [f"{k};{str(np.sin(k)).replace('.', ',')};{k % 360}" for k in range(80)]
    rows[40] = f"40;{word};{word}"
    sniffed = recognise_log(log_of(tmp_path, ["time;x;heading", *rows]))
    assert sniffed.form["missing"] == ["", "nan", "NaN", word]
    assert f"{word!r} stands for a value that is missing" in sniffed.notes
    assert all(np.flatnonzero(np.isnan(values)).tolist() == [40] for values in sniffed.columns.values())


@pytest.mark.parametrize(("name", "value"), [("heading", 511), ("SOG [kn]", 102.3), ("lat", 91), ("Longitude", 181)])
def test_what_ais_writes_for_nothing_is_a_missing_value(tmp_path: Path, name: str, value: float) -> None:
    """Before, a speed over ground was taken for one with a factor of 0.64."""
    held = [f"{12 + 5 * np.sin(k / 9):.1f}" if k % 20 else str(value) for k in range(80)]
    sniffed = recognise_log(
        log_of(tmp_path, [f"time,{name},rpm", *(f"{k},{one},{k % 3}" for k, one in enumerate(held))])
    )
    assert sniffed.fillers == {name: [value]}
    assert np.isnan(sniffed.columns[name]).sum() == 4


@pytest.mark.parametrize(
    ("value", "others", "row", "lost"),
    [
        ("4095", [7.201, 6.12], 3, True),  # a counter of 12 bits at its end
        ("409.5", [*np.round(np.linspace(8.0, 12.0, 41), 1)], 3, True),
        ("409.5", [*np.round(np.linspace(108.0, 312.0, 41), 1)], 3, False),
        ("1023", [*np.round(np.linspace(0.0, 0.5, 41) ** 4, 4)], 3, True),  # a helm in rad, mostly amidships
        ("80", [0.0], 3, False),  # a thruster that is switched on
        ("80", [5.0], 3, False),
        ("80", [*np.round(np.linspace(0.0, 5.0, 41), 1)], 79, False),  # once
    ],
)
def test_a_number_far_beyond_all_others_again_and_again_is_a_missing_value(
    value: str, others: list[float], row: int, lost: bool, tmp_path: Path
) -> None:
    rows = [
        f"{k / 2},{k % 7},{value if k % 20 == row % 20 and k >= row else others[k % len(others)]}" for k in range(80)
    ]
    sniffed = recognise_log(log_of(tmp_path, ["time,psi,n", *rows]))
    assert np.isnan(sniffed.columns["n"]).any() == lost
    assert sniffed.fillers == ({"n": [float(value)]} if lost else {})
    rows[9] = f"4.5,{value},{others[0]}"  # of another column it is a value
    assert np.isfinite(recognise_log(log_of(tmp_path, ["time,psi,n", *rows])).columns["psi"]).all()


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("MMSI", ("219001234", "219009999"), "holds 2 ships ('MMSI' is 219001234, 219009999)"),
        ("mmsi", ("219001234", "219001234"), ""),
        ("IMO", ("9123456", "Unknown"), ""),
        ("Callsign", ("OXYZ", "OABC"), "holds 2 ships"),
        ("Ship name", ("Anna", "Berta"), "holds 2 ships ('Ship name' is Anna, Berta)"),
        ("ShipID", ("1", "2"), "holds 2 ships ('ShipID' is 1, 2)"),
        ("Schiffsname", ("Anna", "Berta"), "holds 2 ships"),
        ("fartyg_nr", ("1", "2"), "holds 2 ships"),
        ("Vessel ID Number", ("1", "2"), "holds 2 ships"),
        ("vessel_name", ("Anna", "ANNA"), ""),
        ("Ship", ("Anna", ""), ""),
        ("Ship state", ("under way", "moored"), ""),
        ("Ship run", ("Z_10_1", "Z_10_2"), ""),
        ("Vessel speed", ("5", "6"), ""),
    ],
)
def test_a_log_of_several_ships_is_refused(name: str, values: tuple[str, str], words: str, tmp_path: Path) -> None:
    rows = [f"{k},{values[k % 2]},{10 + k % 2},{np.sin(k):.3f}" for k in range(80)]
    log = log_of(tmp_path, [f"time,{name},lat,heading", *rows])
    if not words:
        assert "lat" in recognise_log(log).columns
        return
    remedy = "write the rows of each ship to a separate log, or take the column out of the log if it is one ship$"
    with pytest.raises(DataError, match=f"{re.escape(words)}.*: {remedy}"):
        recognise_log(log)


@pytest.mark.parametrize("others", [(98,), (0,), (60, 99), (0, 55)])
def test_a_shaft_speed_of_99_rpm_is_no_missing_value(others: tuple[int, ...], tmp_path: Path) -> None:
    """Before, every row of 99 was taken out where the rest was 98, or stood."""
    speeds = np.repeat([*others, 99], 40)
    sniffed = recognise_log(
        log_of(tmp_path, ["time,heading,rpm", *(f"{k},{k % 360}.5,{n}" for k, n in enumerate(speeds))])
    )
    assert sniffed.fillers == {}
    assert sniffed.columns["rpm"].tolist() == speeds.tolist()


@pytest.mark.parametrize("name", ["log.csv.xz", "log.zip"])
def test_a_packed_log_is_named_as_one(name: str, tmp_path: Path) -> None:
    TABLE.to_csv(tmp_path / name, index=False)
    with pytest.raises(DataError, match=r"packed by|a ZIP archive") as caught:
        recognise_log(tmp_path / name)
    assert "unpack it" in caught.value.message


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (("Lat deg", "Lat min"), {"Lat deg + Lat min": ("Lat deg", "Lat min")}),
        (("Latitude (deg)", "Latitude (')", 'Latitude (")'), {}),
        (("LatD", "LatM", "LatS"), {}),
        (("Lat 1", "Lat 2"), None),
    ],
)
def test_degrees_and_minutes_in_columns(
    names: tuple[str, ...], columns: dict[str, tuple[str, ...]] | None, tmp_path: Path
) -> None:
    """Not two latitudes of two receivers."""
    size = 33.3 + 1e-4 * T
    parts = [-np.floor(size), np.floor(size % 1 * 60), size % 1 * 60 % 1 * 60]
    parts = [parts[0], size % 1 * 60] if len(names) == 2 else parts
    parts = [-size, -size] if columns is None else parts
    sniffed = sniff(tmp_path, TABLE.assign(**dict(zip(names, parts, strict=True))))
    assert sniffed.in_parts == (columns or {} if columns is None else columns or {" + ".join(names): names})
    if columns is not None:
        np.testing.assert_allclose(sniffed.columns[" + ".join(names)], -size)
        assert not set(names) & set(sniffed.columns)


@pytest.mark.parametrize(
    ("names", "made"),
    [
        (("Latitude", "Longitude"), {}),
        (("Position",), {"Position latitude": ("Position",), "Position longitude": ("Position",)}),
        (("Latitude", "remark"), {"remark longitude": ("remark",)}),  # by its letters
    ],
)
@pytest.mark.parametrize("nothing", ["", "---"])
def test_positions_as_text(
    names: tuple[str, ...], made: dict[str, tuple[str, ...]], nothing: str, tmp_path: Path
) -> None:
    degrees = -33.3 + 1e-4 * T
    south = [f"{-one:.0f}°{-one % 1 * 60:.5f}'S" for one in degrees]
    texts = [south, [f"010°{one % 1 * 60:.5f}'E" for one in degrees]]
    texts = [[f"{one} {other}" for one, other in zip(*texts, strict=True)]] if len(names) == 1 else texts
    texts[0][3] = nothing
    sniffed = sniff(tmp_path, TABLE.assign(**dict(zip(names, texts, strict=True))))
    assert sniffed.in_parts == made
    assert sniffed.sides == {"S", "E"}
    latitude = sniffed.columns["Position latitude" if len(names) == 1 else "Latitude"]
    np.testing.assert_allclose(np.delete(latitude, 3), np.delete(degrees, 3), atol=1e-7)
    assert np.isnan(latitude[3])
    assert not any("Latitude" in note or "Position" in note for note in sniffed.notes)


@pytest.mark.parametrize("value", ["1e39", "-1e300"])
def test_a_number_that_no_ship_has_is_none(value: str, tmp_path: Path) -> None:
    """Before, a search among velocities ended in an overflow."""
    table = TABLE.assign(rudder=np.sin(T)).astype(object)
    table.loc[4, "rudder"] = value
    assert np.flatnonzero(np.isnan(sniff(tmp_path, table).columns["rudder"])).tolist() == [4]


@pytest.mark.parametrize("value", ["32767", "-999.25", "9.96921e+36", "327.67"])
def test_what_recorders_write_for_no_value_is_missing(value: str, tmp_path: Path) -> None:
    """The largest number of an integer of 16 or 32 bits, perhaps in tenths, and what netCDF and well logs have."""
    table = TABLE.assign(rudder=np.sin(T)).astype(object)
    table.loc[4:7, "rudder"] = value
    sniffed = sniff(tmp_path, table)
    assert sniffed.fillers["rudder"] == [float(value)]
    assert np.flatnonzero(np.isnan(sniffed.columns["rudder"])).tolist() == [4, 5, 6, 7]


@pytest.mark.parametrize("east", [89.9, 90.95])
def test_a_number_for_none_belongs_to_its_column(east: float, tmp_path: Path) -> None:
    """Before, a longitude of 91 vanished where the receiver wrote a latitude of 91 for no fix."""
    log = si_log(4)
    latitude, longitude, _ = ned2geodetic(log["north"], log["east"], 0.0, 12.0, east, 0.0)
    frame = as_bridge(log).round(4).drop(columns=["N", "E"])
    frame = frame.assign(Lat=latitude.round(6), Lon=longitude.round(6))
    frame.loc[1000, "Lon"] = 91.0
    frame.loc[[400, 401, 1500], "Lat"] = 91.0
    proposal, dataset = drafted(frame, tmp_path)
    assert proposal.source.sniffed.fillers == {"Lat": [91.0]}
    assert "missing" not in proposal.source.sniffed.form
    mapping = read_mapping(tmp_path / "draft.toml")
    assert mapping.columns["latitude"].missing == (91.0,)
    assert mapping.columns["longitude"].missing == ()
    if east > 90.0:  # a true place: no row of it is lost
        assert np.isin(log["t"].to_numpy()[[999, 1000, 1001]], dataset.frame["t"]).all()
