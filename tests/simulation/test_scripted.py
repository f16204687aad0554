"""Runs of any vessel by a document of manoeuvres, given."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from shipid.errors import DocumentError
from shipid.simulation.manoeuvre import Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.truth import simulate_script
from shipid.vessel.load import load_vessel

SHIP = load_vessel("mariner")
GIVEN = """
step = 0.5
[[manoeuvre]]
kind = "zigzag"
name = "zz"
n_rpm = 80
angle_deg = 10
execute_heading_deg = 5
duration = 60
[[manoeuvre]]
kind = "zigzag"
n_rpm = 80
angle_deg = 20
execute_heading_deg = 10
duration = 40
"""


def written(folder: Path, text: str) -> str:
    (folder / "runs.toml").write_text(text)
    return str(folder / "runs.toml")


def test_given_manoeuvres_are_performed_as_in_python(tmp_path: Path) -> None:
    runs = [
        Zigzag(name="zz", n_rpm=80, angle_deg=10, execute_heading_deg=5, duration=60),
        Zigzag(n_rpm=80, angle_deg=20, execute_heading_deg=10, duration=40),
    ]
    frame = simulate_script(SHIP, written(tmp_path, GIVEN))
    wanted = perform_manoeuvres(SHIP, runs, step=0.5, interval=1.0)
    pd.testing.assert_frame_equal(frame, wanted[list(frame)])
    assert list(frame["run"].unique()) == ["zz", "M002"]
    assert not [name for name in frame if str(name).startswith("actual.")]


def test_a_vessel_that_cannot_perform_a_manoeuvre_is_not_a_key_of_the_document(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="no rudder") as caught:
        simulate_script(load_vessel("otter"), written(tmp_path, GIVEN))
    assert caught.value.path == "manoeuvre.0"


@pytest.mark.parametrize(
    ("text", "path", "message"),
    [
        ("question = 'none'", "question", "unknown key"),
        (GIVEN.replace('"zigzag"', '"zigzak"', 1), "manoeuvre.0.kind", "did you mean 'zigzag'"),
        (GIVEN.replace("angle_deg = 20", "angel_deg = 20"), "manoeuvre.1.angel_deg", "unknown key"),
        (GIVEN + 'n_rmp = 7\n', "manoeuvre.1.n_rmp", "unknown key"),
        (GIVEN.replace("angle_deg = 20", "angle_deg = 400"), "manoeuvre.1.angle_deg", "must be at most 90"),
        (GIVEN.replace("heading_deg = 10", "heading_deg = 200"), "manoeuvre.1.execute_heading_deg", "at most 180"),
        (GIVEN.replace("step = 0.5", "step = -1"), "step", "must be above 0"),
        (GIVEN.replace("step = 0.5", "stride = 1"), "stride", "unknown key"),
        (GIVEN.replace("duration = 40", "duration = 4e7"), "manoeuvre", "a run of 4e\\+07 s: at most 1e\\+06 s"),
        ("[truth]\nmanoeuvres = 2", None, "is a study"),
        (GIVEN.replace("step = 0.5", "step = 1e-12"), "step", "2 runs in steps of 1e-12 s take .* GiB of memory"),
    ],
)  # fmt: skip
def test_what_cannot_be_performed_is_one_line(text: str, path: str | None, message: str, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=message) as caught:
        simulate_script(SHIP, written(tmp_path, text))
    assert caught.value.path == path
    assert str(caught.value).startswith(str(tmp_path / "runs.toml"))
