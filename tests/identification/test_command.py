"""`shipid identify`: what it prints and writes, and that a mistake is one line which writes nothing."""

from __future__ import annotations

import json
import os
import signal
import tomllib
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.cli import identify as command
from shipid.data.dataset import Dataset, write_dataset
from shipid.errors import ShipidError
from shipid.identification import outcome
from shipid.identification.design import candidate_manoeuvres
from shipid.vessel.load import load_vessel
from tests.cli.running import ended, output_of
from tests.identification.trials import trials
from tests.report.test_page import Page

SHIP = load_vessel("gunnerus-28.9")
ONE = "hull.derivatives.N_ur"


@pytest.fixture(scope="module")
def log() -> Dataset:
    return trials(SHIP.with_values({ONE: 0.8 * SHIP.parameters[ONE]}), runs=3, steps=40)


@pytest.fixture
def file(log: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The log in a new folder, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    return write_dataset(log, tmp_path / "log.parquet")


def test_it_prints_the_estimates_and_writes_a_patch_and_a_page(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outcome, "STARBOARD_TRIALS", {"zigzag 10/10": ("zigzag", (10, 10), "starboard")})
    monkeypatch.setattr(outcome.design, "candidate_manoeuvres", lambda *_: candidate_manoeuvres(SHIP, [3.0])[8:])
    text = output_of(
        *("identify", "gunnerus-28.9", file, "--parameters", f"{ONE}, hull.derivatives.N_uv"),
        *("--prior", "hull.*[order >= 2]=0.5", "--bounds", f"{ONE}=[0.5, 2]", "--horizon", 0, "--test", "*3"),
        *("--set", "weights.u=0.05", "--set", "weights.r=0.003", "--nuisance", "current=0.1", "--ahead", 30),
        *("--profile", ONE, "--design", "--html", "page.html"),
    )
    rows = {row.split()[0]: row.split() for row in text.splitlines() if row.split()}
    assert float(rows[ONE][-5]) == pytest.approx(0.8, abs=0.01)
    assert rows[ONE][-1] == "yes"
    assert "2 fitted" in text
    assert "1 held out" in text
    assert "times its base value" in text
    assert "To run next" in text
    vessel = load_vessel("gunnerus-28.9-identified.toml")
    assert vessel.parameters[ONE] == pytest.approx(0.8 * SHIP.parameters[ONE], rel=0.01)
    page = Page(Path("page.html").read_text())
    titles = " ".join(heading for _, heading in page.all("h3"))
    for part in ("The estimates", "Correlated estimates", "Free runs", "Profile", "Candidates", "Standard manoeuvres"):
        assert part in titles
    assert vessel.name == f"{SHIP.name}, identified"


def test_settings_of_a_file_give_way_to_options(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outcome, "STARBOARD_TRIALS", {"zigzag 10/10": ("zigzag", (10, 10), "starboard")})
    monkeypatch.setattr(command, "_diagnose_first", lambda *_: None)
    Path("settings.toml").write_text(f'[identify]\nparameters = ["{ONE}"]\nhorizon = 30\nmethod = "euler"\n')
    output_of("identify", "gunnerus-28.9", file, "--settings", "settings.toml", "--horizon", 20, "--out", "a.toml")
    text = Path("a.toml").read_text()
    assert "horizon = 20" in text
    assert 'method = "euler"' in text


def test_programs_get_how_the_fit_ended_and_whose_errors_it_has(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the text says: the sentence, the residuals, and by what the standard errors are."""
    monkeypatch.setattr(outcome, "STARBOARD_TRIALS", {"zigzag 10/10": ("zigzag", (10, 10), "starboard")})
    monkeypatch.setattr(command, "_diagnose_first", lambda *_: None)
    how = ("--parameters", ONE, "--horizon", "20", "--out", "b.toml", "--json")
    said = json.loads(CliRunner().invoke(app, ["identify", "gunnerus-28.9", str(file), *how]).stdout)
    written = tomllib.loads(Path("b.toml").read_text())["provenance"]
    for key in ("status", "sentence", "residuals", "standard_errors_by"):
        assert said[key] == written[key]


MISTAKES = {
    "unknown path": (["--parameters", "hull.derivatives.N_urr"], "selects nothing: did you mean"),
    "nothing to identify": ([], "identify.parameters: missing"),
    "all fixed": (["--parameters", ONE, "--fixed", "hull.*"], "is also fixed"),
    "tied to what is fixed": (["--parameters", ONE, "--together", f"{ONE},inertia.m"], "tied but not free"),
    "unknown run": (["--parameters", ONE, "--runs", "M011"], "is no run: did you mean"),
    "no test run": (["--parameters", ONE, "--test", "ZZ*"], "'ZZ*' is no run: valid: M01"),
    "nothing to fit": (["--parameters", ONE, "--test", "*"], "every run is held out"),
    "horizon too long": (["--parameters", ONE, "--horizon", "900"], "no unbroken stretch of 450 s"),
    "endless horizon": (["--parameters", ONE, "--horizon", "inf"], "finite number"),
    "horizon too short": (["--parameters", ONE, "--horizon", "1"], "must hold two steps"),
    "free run too short": (["--parameters", ONE, "--ahead", "-5"], "must hold two steps"),
    "endless free run": (["--parameters", ONE, "--ahead", "inf"], "must be a finite number"),
    "prior without width": (["--parameters", ONE, "--prior", "hull.*"], "--prior: 'hull.*': write paths=0.3"),
    "prior of no number": (["--parameters", ONE, "--prior", "hull.*=wide"], "write paths=0.3"),
    "bounds backwards": (["--parameters", ONE, "--bounds", f"{ONE}=[2, 1]"], "no two rising numbers"),
    "unknown nuisance": (["--parameters", ONE, "--nuisance", "currents"], "did you mean 'current'?"),
    "unknown key": (["--parameters", ONE, "--set", "horizn=3"], "unknown key: did you mean 'horizon'?"),
    "profile of what is not free": (["--parameters", ONE, "--profile", "inertia.m"], "is not free in the fit"),
    "no patch": (["--parameters", ONE, "--out", "patch.json"], "let the name end in .toml"),
    "patch is there": (["--parameters", ONE, "--out", "there.toml"], "not written over"),
    "no page": (["--parameters", ONE, "--html", "page.htm"], "let the name end in .html"),
    "no settings": (["--parameters", ONE, "--settings", "none.toml"], "cannot be read"),
    "bad settings": (["--settings", "bad.toml"], "bad.toml: identify.wieghts: unknown key"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_and_writes_nothing(name: str, file: Path) -> None:
    options, message = MISTAKES[name]
    Path("there.toml").write_text("")
    Path("bad.toml").write_text(f'[identify]\nparameters = ["{ONE}"]\nwieghts = {{u = 1}}\n')
    before = set(Path().iterdir())
    with pytest.raises(ShipidError) as error:
        output_of("identify", "gunnerus-28.9", file, *options)
    assert message in str(error.value)
    assert set(Path().iterdir()) == before


@pytest.mark.parametrize(
    ("line", "path"),
    [
        ('parameters = ["hull.derivatives.N_urr"]', "identify.parameters: "),
        (f'parameters = ["{ONE}"]\nfixed = ["wind.*"]', "identify.fixed: "),
        (
            f'parameters = ["{ONE}"]\nruns = {{M99 = {{environment = {{V_w = 1}}}}}}',
            "identify.runs.M99.environment.V_w: ",
        ),
    ],
)
def test_a_mistake_in_settings_is_one_of_their_file(line: str, path: str, file: Path) -> None:
    Path("mine.toml").write_text(f"[identify]\n{line}\n")
    with pytest.raises(ShipidError) as error:
        output_of("identify", "gunnerus-28.9", file, "--settings", "mine.toml")
    assert str(error.value).startswith(f"mine.toml: {path}")


@pytest.mark.parametrize(
    ("vessel", "parameters", "message"),
    [
        ("gunnerus-33.9-template", "hull.mmg.X_vv", "is 0, which no factor changes"),
        ("mariner", "hull.*", "needs this command; the data have"),
        ("gunnerus-29", "hull.*", "no vessel of this name"),
    ],
)
def test_a_vessel_that_does_not_fit_is_one_line(vessel: str, parameters: str, message: str, file: Path) -> None:
    with pytest.raises(ShipidError, match=message):
        output_of("identify", vessel, file, "--parameters", parameters)
    assert [one.name for one in Path().iterdir()] == [file.name]


def test_ctrl_c_is_one_line_and_writes_nothing(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = outcome.identify

    def pressed(*given: Any, **more: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return real(*given, **more)

    monkeypatch.setattr(command, "_diagnose_first", lambda *_: None)
    monkeypatch.setattr(outcome, "identify", pressed)
    status, _, err = ended("identify", "gunnerus-28.9", file, "--parameters", ONE, "--html", "a.html")
    assert status == 130
    assert err.splitlines()[-1] == "interrupted: nothing was written"
    assert "Traceback" not in err
    assert [one.name for one in Path().iterdir()] == [file.name]
