"""Numbers with their unit behind them in a cell are read; a column with several units is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.files import write_new
from shipid.logs.amounts import split_amounts, without_prefix
from shipid.logs.guess.columns import guess
from shipid.logs.guess.draft import draft_text
from shipid.logs.importing import import_log, read_mapping
from tests.logs.conftest import import_written
from tests.logs.simulated import KNOT, as_bridge, guess_of, si_log

LOG = si_log()
GROUND = (LOG["u"] + 1j * LOG["v"]) * np.exp(1j * LOG["psi"])
BRIDGE = as_bridge(LOG).drop(columns=["u", "v"]).round(4)
BRIDGE["sog"] = (np.abs(GROUND) / KNOT).round(3)
BRIDGE["cog"] = (np.degrees(np.angle(GROUND)) % 360.0).round(2)
UNITS = {"psi": " T", "r": " °/s", "rpm": " U/min", "rudder": "°", "sog": " kn", "cog": "°T", "N": " m", "E": "m"}


def written(decimal: str = ".") -> pd.DataFrame:
    """The log with a unit in every cell but those of the clock."""
    texts = BRIDGE.astype(str)
    texts = texts.assign(**{name: texts[name] + unit for name, unit in UNITS.items()})
    return pd.DataFrame({name: texts[name].str.replace(".", decimal) for name in texts})


@pytest.mark.parametrize(("decimal", "separator"), [(",", ";")])
def test_units_in_cells_are_those_of_their_columns(decimal: str, separator: str, tmp_path: Path) -> None:
    """Such a log was refused as no table of numbers."""
    file = tmp_path / "log.csv"
    frame = written(decimal)
    frame.loc[[7, 8, 9], "sog"] = "---"
    frame.to_csv(file, index=False, sep=separator, encoding="utf-8")
    proposal = guess(file)
    assert {one.name: one.unit for one in proposal.columns if one.name in ("speed", "psi", "r")} == {
        "speed": "kn",
        "psi": "deg",
        "r": "deg/s",
    }
    rows = import_log(read_mapping(write_new(draft_text(proposal), tmp_path / "draft.toml")), file).frame
    np.testing.assert_allclose(rows["north"], LOG["north"], atol=1e-3)
    np.testing.assert_allclose(rows["u"].drop([7, 8, 9]), LOG["u"].drop([7, 8, 9]), atol=0.01)
    np.testing.assert_allclose(rows["r"], LOG["r"], atol=1e-5)


@pytest.mark.parametrize(("first", "second"), [("°M", "°T"), (" deg true", " mag")])
def test_true_and_magnetic_north_in_a_column_are_refused(first: str, second: str, tmp_path: Path) -> None:
    """Both are degrees, but in places 20 deg apart: headings of a half of the log were wrong."""
    frame = written()
    mapping = draft_text(guess_of(tmp_path, frame)).replace("sha256", "# sha256")
    frame["psi"] = BRIDGE["psi"].astype(str) + np.where(BRIDGE.index < 300, first, second)
    with pytest.raises(DataError, match=r"no column can be the heading: 'psi' holds .*, and other units: write one"):
        guess_of(tmp_path, frame)
    kind = "magnetic" if "M" in first else "true"
    said = rf"row 301: .* is not of {kind} north, as .* \(column 'psi'; {len(frame) - 300} such rows\): write one north"
    with pytest.raises(DataError, match=said):
        import_written(mapping, frame, tmp_path)


@pytest.mark.parametrize(
    ("text", "number", "unit"),
    [
        ("12.3 kn", "12.3", "kn"),
        ("-45.2°", "-45.2", "°"),
        ("1.5e-3 rad/s", "1.5e-3", "rad/s"),
        ("12,5 rpm", "12,5", "rpm"),
        ("308.21 T", "308.21", "deg T"),
        ("308.21°M", "308.21", "deg M"),
        ("12.5 m", "12.5", "m"),
        ("85 %", "85", "%"),
        ("54.3 N", "54.3 N", ""),  # a latitude
        ("7.0 S", "7.0 S", ""),  # to starboard
        ("2 auto", "2 auto", ""),
        ("P12.5", "P12.5", ""),
        ("59°26'12.3\"N", "59°26'12.3\"N", ""),
        ("12.3", "12.3", ""),
        ("---", "---", ""),
    ],
)
def test_a_number_and_its_unit(text: str, number: str, unit: str) -> None:
    bare, units = split_amounts(pd.Series([text]))
    assert [*bare, *units] == [number, unit]


@pytest.mark.parametrize(
    ("text", "unit", "factor"),
    [
        ("krpm", "rpm", 1e3),
        ("mrad", "rad", 1e-3),
        ("mrad/s", "rad/s", 1e-3),
        ("millidegrees", "degrees", 1e-3),
        ("cdeg", "deg", 0.01),
        ("ddeg/min", "deg/min", 0.1),
        *((unit, unit, 1.0) for unit in ("deg", "dpm", "kn", "cm/s", "mm/s", "ms", "mph", "kg", "mV", "dB", "m°", "")),
    ],
)
def test_a_prefix_is_that_of_a_unit_of_an_angle_or_a_shaft(text: str, unit: str, factor: float) -> None:
    assert without_prefix(text) == (unit, factor)
