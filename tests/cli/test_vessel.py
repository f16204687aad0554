"""`shipid vessel`."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import tomlkit

from shipid.data.dataset import Dataset, write_dataset
from shipid.document import bundled_documents
from shipid.simulation.manoeuvre import Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.load import load_vessel
from tests.cli.running import ended, output_of


def test_vessels() -> None:
    text = output_of("vessel", "list")
    for name in bundled_documents("models"):
        assert f" {name} " in text
    ship = load_vessel("gunnerus-28.9")
    text = output_of("vessel", "show", "gunnerus-28.9")
    assert ship.digest in text
    for path, value in ship.parameters.items():
        shown = re.search(rf"^\s*{re.escape(path)} +(\S+)", text, re.MULTILINE)
        assert shown, path
        assert float(shown[1]) == pytest.approx(value, rel=1e-9)


def test_a_new_vessel_from_main_particulars(tmp_path: Path) -> None:
    file = tmp_path / "my-ship.toml"
    order = ("vessel", "new", "--length", 33.9, "--beam", 9.6, "--draught", 2.6, "--block", 0.61, "--out", file)
    text = output_of(*order, "--propulsor", "azimuth", "--ship-type", "research", "--speed", 5)
    assert "none of them measured" in text
    assert "rpm hold 5 m/s" in text
    assert "course-stable" in text
    assert load_vessel(str(file)).parameters["thruster.port.y"] == pytest.approx(-2.688)
    assert "First guess, 33.9 m" in output_of("vessel", "show", file)
    written = file.read_text()
    status, _, err = ended(*order)
    assert (status, err) == (
        1,
        f"error: {file}: --out: exists already and is not written over: name another file to write\n",
    )
    assert file.read_text() == written


USV = ("vessel", "new", "--kind", "usv", "--length", 2, "--beam", 1.08)


def test_a_new_craft_from_its_thrusters(tmp_path: Path) -> None:
    places = ("--thruster", "-0.8,-0.4", "--thruster", "-0.8,0.4", "--out", tmp_path / "craft.toml")
    text = output_of(*USV, "--mass", 80, "--speed", 3, *places, "--thrust", 100)
    assert "49 N of each thruster hold 2.1 m/s" in text  # 100 N at 3 m/s, and the square of 0.7 of it
    assert "course-stable" in text
    assert load_vessel(str(tmp_path / "craft.toml")).parameters["thruster.port.actuator.force.high"] == 100.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--speed", 3, "--thruster", "-0.8,0.4"), "--mass: missing: a usv needs it"),
        (("--mass", 80, "--speed", 3), "--thruster: missing: a usv needs it"),
        (("--mass", 80, "--speed", 3, "--thruster", "aft"), "'aft': write the place as X,Y in m"),
        (("--mass", 80, "--speed", 3, "--thruster", "-1,1", "--rpm", 90), "--rpm: is for a ship: leave it out"),
        (("--kind", "ship", "--mass", 80, "--draught", 1, "--block", 0.5), "--mass: is for a usv: leave it out"),
        (("--kind", "ship", "--block", 0.5), "--draught: missing: a ship needs it"),
        (("--mass", 80, "--speed", 3, "--thruster", "-1,1", "--ship-type", "tanker"), "--ship-type: is for a ship"),
        (("--mass", 80, "--speed", 3, "--thruster", "-1,1", "--propulsor", "azimuth"), "--propulsor: is for a ship"),
        (("--mass", 80, "--speed", 3, "--thruster", "-1,1", "--tunnel-thruster"), "--tunnel-thruster: is for a ship"),
    ],
)
def test_options_of_another_kind_of_vessel_are_one_line(options: tuple[Any, ...], message: str, tmp_path: Path) -> None:
    status, _, err = ended(*USV, *options, "--out", tmp_path / "x.toml")
    assert (status, err.count("\n")) == (1, 1)
    assert message in err


def test_a_vessel_beyond_the_formulae_is_one_line(tmp_path: Path) -> None:
    sizes = ("--length", 100, "--beam", 5, "--draught", 2, "--block", 0.6)
    status, _, err = ended("vessel", "new", *sizes, "--out", tmp_path / "ship.toml")
    assert status == 1
    assert err == (
        "error: length / beam = 20: the formulae hold for 2 to 9: for another ship, take a similar vessel and change "
        "it (`shipid vessel list`)\n"
    )


@pytest.mark.parametrize("name", ["\x1b[31mred", "del \x7f"])
def test_a_name_that_no_document_may_hold_is_refused(name: str, tmp_path: Path) -> None:
    given = ("--length", 30, "--beam", 8, "--draught", 2.8, "--block", 0.55, "--out", tmp_path / "x.toml")
    assert "text with a control character" in ended("vessel", "new", *given, "--name", name)[2]
    assert not (tmp_path / "x.toml").exists()


SIMILAR = ("vessel", "similar", "--length", 320, "--beam", 50, "--draught", 19, "--block", 0.82)


def test_similar_ships_are_written_and_load(tmp_path: Path) -> None:
    text = output_of(*SIMILAR, "--number", 1, "--out", tmp_path)
    assert "esso-190k scaled; friction by ITTC-57" in text
    assert load_vessel(tmp_path / "esso-190k.toml").length == pytest.approx(320)
    assert ended(*SIMILAR, "--number", 1, "--out", tmp_path)[2].endswith("name another file to write\n")


def test_a_log_ranks_similar_ships_by_their_error(tmp_path: Path) -> None:
    """The log is that of one of them: no other ship errs as little."""
    log, mine = tmp_path / "log.parquet", tmp_path / "mine.toml"
    kinds = [Zigzag(name=f"zz {angle}", n_rpm=627, angle_deg=angle, duration=60, execute_at=5) for angle in (10, 20)]
    frame = perform_manoeuvres(load_vessel("kvlcc2-l7"), kinds, step=0.1)
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]].astype({"run": "str"})
    write_dataset(Dataset(frame, {"clock": "run", "flags": []}), log)
    mine.write_text(tomlkit.dumps(load_vessel("kvlcc2-hsva").document))
    found = json.loads(output_of("vessel", "similar", "--vessel", mine, "--data", log, "--json"))
    errors = [row["error [m]"] for row in found["ships"]]
    assert found["ships"][0]["ship"] == "kvlcc2-l7"
    assert errors == sorted(errors)
    assert errors[1] > 2 * errors[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--beam", 3), "error: --length: missing: give it, or a --vessel with particulars.L_pp"),
        (("--length", 3, "--data", "log.parquet"), "error: --vessel: missing: give it, whose screws"),
        (("--length", -3), "error: Invalid value for '--length': Input should be greater"),
        (("--length", 30, "--block", 7), "error: Invalid value for '--block': Input should be less"),
        (("--length", 1e308), "error: Invalid value for '--length': Input should be less"),
        (("--length", 30, "--beam", 90), "error: --beam: 90 m: must be below the length, 30 m"),
        (("--length", 30, "--from", "nowhere"), "error: nowhere: no vessel in the TOML files of this folder"),
    ],
)
def test_similar_ships_of_nothing_are_one_line(options: tuple[Any, ...], message: str) -> None:
    status, _, err = ended("vessel", "similar", *options)
    assert status in (1, 2)
    assert err.startswith(message)
    assert err.count("\n") == 1
