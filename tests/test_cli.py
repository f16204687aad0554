"""The command line: every command once, and a user's mistake is one line on stderr."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import shipid
from shipid.cli import app
from shipid.data.dataset import read_dataset, write_dataset
from shipid.document import bundled, bundled_folder
from shipid.errors import ShipidError
from shipid.study.store import DATASET, read_rows
from shipid.vessel.load import load_vessel
from tests.logs.simulated import as_bridge, si_log
from tests.study.tiny import TINY

BAD = Path(__file__).parent / "bad"


def said(*arguments: object) -> str:
    """Output of a command that must succeed."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def shell(*arguments: object, code: str = "from shipid.cli import main; main()") -> subprocess.CompletedProcess[str]:
    """Run the command as a user would, in a process of its own."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The tiny study in a folder of its own, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "tiny.toml"
    file.write_text(TINY.read_text())
    return file


def test_help_and_version_are_light() -> None:
    """Nobody waits for PyTorch to read a help page."""
    heavy = {"torch", "casadi", "pandas", "optuna", "numpy", "dask", "plotly", "pyarrow"}
    code = (
        "import sys\nfrom shipid.cli import main\ntry:\n    main()\nexcept SystemExit as end:\n"
        f"    print(end.code, sorted({heavy!r} & set(sys.modules)))"
    )
    for arguments in (["--help"], ["--version"], ["study", "run", "--help"], ["vessel"]):
        result = shell(*arguments, code=code)
        assert re.search(r"(0|2|None) \[\]$", result.stdout.strip()), (arguments, result)
    assert shipid.__version__ in shell("--version").stdout


def test_help_names_every_command() -> None:
    for group, commands in (
        ([], ("vessel", "data", "study", "predict", "simulate", "manoeuvre", "identify")),
        (["vessel"], ("list", "show", "new")),
        (["data"], ("import", "check", "fetch", "segment", "measures")),
        (["study"], ("list", "variants", "screen", "run", "resume", "report")),
    ):
        text = said(*group, "--help")
        assert all(re.search(rf"\b{name}\b", text) for name in commands), group


def test_manoeuvre_measures_what_it_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Table, page, CSV and log of one run; the log measures the same."""
    monkeypatch.chdir(tmp_path)
    text = said("manoeuvre", "gunnerus-28.9", "zigzag", 20, 10, "--csv", "z.csv", "--log", "z.parquet", "--speed", 4)
    assert "approach at 4 m/s" in text
    assert "zigzag 20/10, first to starboard" in text
    assert Path("gunnerus-28.9-zigzag.html").is_file()
    table = pd.read_csv("z.csv").set_index("measure")
    assert table.loc["execute heading", "value"] == pytest.approx(10)
    assert f"{table.loc['overshoot 1', 'value']:.3g}" in text
    text = said("data", "measures", "z.parquet", "--length", 28.9, "--csv", "again.csv")
    assert "1 runs measured, 0 not" in text
    again = pd.read_csv("again.csv").set_index("measure")
    pd.testing.assert_series_equal(again["value"], table["value"])


def test_manoeuvres_that_cannot_be() -> None:
    for arguments, expected in (
        (("manoeuvre", "gunnerus-28.9", "zigzak"), "error: NAME: no manoeuvre is called 'zigzak'"),
        (("manoeuvre", "gunnerus-28.9", "turning", "--log", "x.csv"), "error: x.csv: a dataset is a Parquet file"),
    ):
        result = shell(*arguments)
        assert result.returncode == 1
        assert result.stderr.startswith(expected)
        assert result.stderr.count("\n") == 1


def test_vessels() -> None:
    text = said("vessel", "list")
    for name in bundled("models"):
        assert f" {name} " in text
    ship = load_vessel("gunnerus-28.9")
    text = said("vessel", "show", "gunnerus-28.9")
    assert ship.digest in text
    columns = {
        stem: re.search(rf"^\s*{stem}\.0 \.\.\. \.18 +(.+?)\s+-\s*$", text, re.MULTILINE)
        for stem in ("wind.C_X", "wind.C_Y")
    }
    for stem, shown in columns.items():
        assert shown, stem
        assert [float(number) for number in shown[1].split()] == [ship.parameters[f"{stem}.{i}"] for i in range(19)]
    for path, value in ship.parameters.items():
        if re.fullmatch(r"wind\.\w+\.\d+", path):
            continue
        shown = re.search(rf"^\s*{re.escape(path)} +(\S+)", text, re.MULTILINE)
        assert shown, path
        assert float(shown[1]) == pytest.approx(value, rel=1e-9)
    schema = json.loads(said("vessel", "show", "--schema"))
    assert "hull" in schema["properties"]


def test_data_import_and_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = said("data", "import", BAD / "logs" / "plain.toml", BAD / "logs" / "good.csv")
    assert "41 rows in 1 runs -> plain.parquet" in text
    assert read_dataset("plain.parquet").runs == ["good"]
    said("data", "import", BAD / "logs" / "plain.toml", BAD / "logs" / "good.csv", "--out", "deep/other.parquet")
    assert "10 of 10 checks passed" in said("data", "check", "deep/other.parquet")
    refused = CliRunner().invoke(
        app, ["data", "import", str(BAD / "logs" / "plain.toml"), str(BAD / "logs" / "good.csv"), "--out", "a.csv"]
    )
    assert "end in .parquet" in str(refused.exception)


def test_data_check_tells_what_fails(tmp_path: Path, tiny_run: Path) -> None:
    dataset = read_dataset(tiny_run / DATASET)
    wrong = dataset.frame.assign(r=dataset.frame["r"] + 0.5)
    file = write_dataset(type(dataset)(wrong, dataset.metadata), tmp_path / "wrong.parquet")
    result = CliRunner().invoke(app, ["data", "check", str(file)])
    assert result.exit_code == 1
    assert re.search(r"M001 +heading", result.output), "failures are listed by run"


def test_data_guess_segment_and_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    as_bridge(si_log()).to_csv("trial.csv", index=False)
    text = said("data", "import", "--guess", "trial.csv")
    assert "draft -> trial.toml" in text
    assert "positive turns the ship to starboard" in text
    said("data", "import", "trial.toml", "trial.csv")
    assert "7 segments -> trial-segments.toml" in said("data", "segment", "trial.toml", "trial.csv")
    assert "checks passed" in said("data", "check", "trial.parquet", "--html", "deep/page.html")
    assert Path("deep/page.html").stat().st_size > 1_000_000
    for arguments, remedy in {
        ("import", "--guess", "trial.csv"): "not written over",
        ("import", "trial.toml", "--guess", "trial.csv"): "give neither mapping nor repairs",
        ("import",): "draft one with --guess",
        ("check", "trial.parquet", "--html", "page.pdf"): "end in .html",
    }.items():
        assert remedy in str(CliRunner().invoke(app, ["data", *arguments]).exception)


def test_data_fetch_from_the_folder(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHIPID_DATA", str(shared_data))
    file = Path(said("data", "fetch", "gunnerus-2022").strip())
    assert file.is_file()
    assert shared_data in file.parents


def test_studies_and_variants(study: Path) -> None:
    text = said("study", "list")
    assert all(f" {name} " in text for name in bundled("studies"))
    text = said("study", "variants", study, "--save", "patches")
    accuracy = re.findall(r"^ *(right|wrong-1|wrong-2|none) +(\S+)", text, re.MULTILINE)
    assert [name for name, _ in accuracy] == ["right", "wrong-1", "wrong-2", "none"]
    assert [value == "-" for _, value in accuracy] == [False, False, False, True]
    assert "3 patches -> patches" in text
    assert load_vessel("./patches/wrong-2.toml").name == "wrong-2"
    text = said("study", "variants", study, "--no-accuracy", "--set", "family.1.members=3")
    assert re.search(r"^ *wrong-3 +- ", text, re.MULTILINE)


def test_screen_writes_a_row_per_member(study: Path) -> None:
    text = said("study", "screen", study, "--members", "6")
    frame = pd.read_csv("tiny-screen.csv")
    assert list(frame["member"]) == [f"wrong-{k}" for k in range(1, 7)]
    shown = re.search(r"^ *wrong +6 +0 +([\d. ]+)$", text, re.MULTILINE)
    assert shown
    expected = np.quantile(frame["A"], [0.05, 0.25, 0.5, 0.75, 0.95])
    np.testing.assert_allclose([float(word) for word in shown[1].split()], expected, atol=0.005)
    assert len(re.findall(r"^ *wrong +hull\.derivatives\.\S+ +[+-]\d\.\d\d +[+-]\d\.\d\d *$", text, re.MULTILINE)) == 5
    said("study", "screen", study, "wrong", "--members", "2", "--out", "new/rows.parquet")
    pd.testing.assert_frame_equal(pd.read_parquet("new/rows.parquet"), frame[:2], rtol=1e-12)
    for arguments, remedy in (
        (["right"], "'right' draws no factor from a range"),
        (["--out", "rows.txt"], "ending in .parquet or .csv"),
    ):
        with pytest.raises(ShipidError, match=re.escape(remedy)):
            said("study", "screen", study, *arguments)


def test_variants_shows_the_accuracy_that_the_run_has(study: Path, tiny_run: Path) -> None:
    text = said("study", "variants", study)
    rows = read_rows(tiny_run).drop_duplicates("model").set_index("model")
    for name in ("right", "wrong-1", "wrong-2"):
        shown = re.search(rf"^ *{name} +(\S+)", text, re.MULTILINE)
        assert shown
        assert float(shown[1]) == pytest.approx(rows.loc[name, "A"], abs=0.005)


def test_run_report_resume_and_predict(study: Path, tiny_run: Path) -> None:
    """The whole way on one worker, as a user goes it."""
    text = said("study", "run", study, "--workers", "1")
    folder = next(Path("results").iterdir())
    assert re.fullmatch(r"tiny-[0-9a-f]{8}", folder.name)
    assert "8 of 8 cells to do" in text
    assert re.search(r"^\[8/8\] \S+: H \d+\.\d{3} m, H_90 \d+\.\d{3} m, ", text, re.MULTILINE)
    assert text.rstrip().endswith(f"report: {folder / 'report.html'}")
    answer = (folder / "answer.txt").read_text().splitlines()
    assert all(f"  {line}" in text for line in answer)
    assert len(answer) >= 4
    assert read_rows(folder)["H"].tolist() == read_rows(tiny_run)["H"].tolist()

    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Does the whole chain hold together?" in page
    assert re.search(r"shipid study run \S+tiny\.toml", page)
    assert "Does the whole chain hold together?" in (folder / "summary.md").read_text()

    (folder / "report.html").unlink()
    assert said("study", "report", folder).strip() == str(folder / "report.html")
    assert (folder / "report.html").is_file()
    next((folder / "batches").iterdir()).unlink()
    assert "4 of 8 cells to do" in said("study", "resume", folder, "--workers", "1")

    text = said("predict", folder, folder / DATASET, "--cell", "none-N0004-s0")
    assert f"{12 * 21} instants, {12 * 21 * 5} points -> none-N0004-s0.parquet" in text
    assert len(pd.read_parquet("none-N0004-s0.parquet")) == 12 * 21 * 5
    assert "outside what the cell was trained on" in text


def test_predict_on_a_raw_log(tmp_path: Path, tiny_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A log with other commands than the ship's is one line."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ShipidError, match=r"takes this command; the data have propeller\.n"):
        said(
            *("predict", tiny_run, BAD / "logs" / "good.csv", "--cell", "right-N0004-s0"),
            *("--mapping", BAD / "logs" / "plain.toml"),
        )


def test_an_incomplete_folder_has_a_provisional_report(tmp_path: Path, tiny_run: Path) -> None:
    import shutil

    folder = tmp_path / "run"
    shutil.copytree(tiny_run, folder)
    (folder / "batches" / "N0004-s0.json").unlink()
    said("study", "report", folder)
    assert (folder / "answer.txt").read_text().startswith("4 of 8 cells are not finished")
    assert len(pd.read_parquet(folder / "results.parquet")["cell"].unique()) == 4


MISTAKES = {
    "unknown vessel": (["vessel", "show", "gunerus-28.9"], "did you mean 'gunnerus-28.9'?"),
    "no vessel": (["vessel", "show"], "name a vessel"),
    "unknown study": (["study", "run", "quik"], "did you mean 'quick'?"),
    "broken study": (["study", "run", BAD / "studies" / "no-question.toml"], "no-question.toml: question: missing"),
    "no --set path": (["study", "run", "quick", "--set", "grid.N_D"], "write --set path=value"),
    "bad --set value": (["study", "run", "quick", "--set", "grid.N_D=[1000]"], "less 20 test runs leave 100"),
    "no folder": (["study", "resume", "nowhere"], "nowhere: is not the folder of a run"),
    "foreign folder": (["study", "report", BAD], "holds no study.toml"),
    "broken mapping": (["data", "import", BAD / "mappings" / "unknown_unit.toml", "x.csv"], "valid here: rad/s"),
    "no dataset": (["data", "check", "gone.parquet"], "gone.parquet: cannot be read"),
    "no public log": (["data", "fetch", "gunnerus-2021"], "did you mean 'gunnerus-2022'?"),
    "no cells": (["predict", BAD, "x.parquet", "--cell", "a"], "holds no finished cells"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(
    mistake: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from shipid.cli import main

    arguments, remedy = MISTAKES[mistake]
    monkeypatch.setattr(sys, "argv", ["shipid", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        main()
    out, err = capfd.readouterr()
    assert (end.value.code, out) == (1, "")
    assert re.fullmatch(r"error: [^\n]*\n", err)
    assert remedy in err


def test_mistakes_in_a_process_of_their_own(tmp_path: Path, tiny_run: Path) -> None:
    """No traceback, no warning, exit 1: another study's folder, a damaged one, a file where a folder should be."""
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / "study.toml").write_text("[[")
    (damaged / "provenance.json").write_text((tiny_run / "provenance.json").read_text())
    for arguments, remedy in (
        (["study", "run", TINY, "--out", tiny_run, "--set", "truth.seed=8"], "another study"),
        (["study", "resume", damaged], "damaged"),
        (["study", "variants", TINY, "--no-accuracy", "--save", TINY], "plain.toml: File exists"),
    ):
        result = shell(*arguments)
        assert result.returncode == 1
        assert re.fullmatch(r"error: [^\n]*\n", result.stderr), result.stderr
        assert remedy in result.stderr


def test_wrong_usage_is_not_a_traceback() -> None:
    for arguments in (["study", "run"], ["nonsense"], ["study", "run", "quick", "--workers", "0"]):
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 2
        assert isinstance(result.exception, SystemExit)


def test_interruption_says_how_to_go_on(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid.study import run

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "run_study", interrupted)
    result = CliRunner().invoke(app, ["study", "run", str(study), "--out", "mine"])
    assert result.exit_code == 130
    assert "Continue with: shipid study resume mine" in result.stderr


# What an installed shipid takes along.


def test_the_wheel_takes_models_and_studies_along() -> None:
    """pyproject maps both folders to where `bundled_folder` looks first."""
    build = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    assert build["targets"]["wheel"]["force-include"] == {
        "models": "shipid/_bundled/models",
        "studies": "shipid/_bundled/studies",
    }


def test_what_is_installed_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid import document

    (tmp_path / "site" / "shipid" / "_bundled" / "models").mkdir(parents=True)
    (tmp_path / "site" / "models").mkdir()
    monkeypatch.setattr(document, "__file__", str(tmp_path / "site" / "shipid" / "document.py"))
    assert bundled_folder("models") == tmp_path / "site" / "shipid" / "_bundled" / "models"
    assert bundled_folder("studies") == tmp_path / "site" / "studies"


def test_public_names_load() -> None:
    for name in shipid.__all__:
        assert getattr(shipid, name) is not None
    with pytest.raises(AttributeError, match="public names: "):
        _ = shipid.nothing
    assert np.isfinite(len(shipid.__all__))


def test_a_new_vessel_from_main_particulars(tmp_path: Path) -> None:
    file = tmp_path / "my-ship.toml"
    order = ("vessel", "new", "--length", 33.9, "--beam", 9.6, "--draught", 2.6, "--block", 0.61, "--out", file)
    text = said(*order, "--propulsor", "azimuth", "--ship-type", "research", "--speed", 5)
    assert "none of them measured" in text
    assert "rpm hold 5 m/s" in text
    assert "course-stable" in text
    assert load_vessel(str(file)).parameters["thruster.port.y"] == pytest.approx(-2.688)
    assert "First guess, 33.9 m" in said("vessel", "show", file)
    written = file.read_text()
    again = shell(*order)
    assert (again.returncode, again.stderr) == (1, f"error: {file}: is there already: choose another name\n")
    assert file.read_text() == written


def test_a_vessel_beyond_the_formulae_is_one_line(tmp_path: Path) -> None:
    sizes = ("--length", 100, "--beam", 5, "--draught", 2, "--block", 0.6)
    found = shell("vessel", "new", *sizes, "--out", tmp_path / "ship.toml")
    assert found.returncode == 1
    assert found.stderr == "error: length / beam = 20: the formulae hold for 3 to 9\n"
