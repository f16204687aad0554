"""`shipid export` from the command line."""

from __future__ import annotations

from typer.testing import CliRunner

from shipid.cli import app
from tests.cli.running import output_of


def test_a_bundled_vessel_is_written(tmp_path):
    assert "ship.c" in output_of("export", "mariner", "--to", "c", "--out", tmp_path / "ship").replace("\n", "")
    assert (tmp_path / "ship" / "ship.h").is_file()


def test_a_bundled_vessel_is_written_into_a_folder_of_its_name_again_and_again(tmp_path, monkeypatch):
    """Before, the folder of the first export was taken for the results of a study."""
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        output_of("export", "mariner", "--to", "c", "--out", "mariner")


def test_a_cell_that_is_not_there_is_one_line(tmp_path):
    result = CliRunner().invoke(app, ["export", str(tmp_path / "no.npz"), "--to", "c", "--out", str(tmp_path)])
    assert result.exit_code == 1
    assert "cannot be read" in str(result.exception)
    words = ["export", str(tmp_path / "no.npz"), "--to", "c", "--out", str(tmp_path), "--integrator", "euler"]
    assert "--integrator: a predictor keeps that of its study" in str(CliRunner().invoke(app, words).exception)


def test_a_function_is_not_written_to_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["export", "mariner", "--to", "casadi", "--out", "."])
    assert "the target casadi is a file that ends in .casadi" in str(result.exception)


def test_a_folder_is_no_cell_but_has_some(tmp_path):
    result = CliRunner().invoke(app, ["export", str(tmp_path), "--to", "c", "--out", str(tmp_path / "ship")])
    assert result.exit_code == 1
    assert "name one of its cells, FOLDER/cells/NAME.npz" in str(result.exception)
