"""What one imports: public names, their types, and what an installed shipid takes along."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import shipid
from shipid.document import bundled_documents_folder
from shipid.errors import ShipidError
from shipid.study.plan import default_folder
from tests.documented import code
from tests.study.tiny import TINY, command, without_workers

ROOT = Path(__file__).parents[1]
QUICK = f'"{default_folder(shipid.read_plan("quick"))}"'  # as a page of the documentation names it


def test_what_is_installed_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid import document

    (tmp_path / "site" / "shipid" / "_bundled" / "models").mkdir(parents=True)
    (tmp_path / "site" / "models").mkdir()
    monkeypatch.setattr(document, "__file__", str(tmp_path / "site" / "shipid" / "document.py"))
    assert bundled_documents_folder("models") == tmp_path / "site" / "shipid" / "_bundled" / "models"
    assert bundled_documents_folder("studies") == tmp_path / "site" / "studies"


def test_public_names_load() -> None:
    for name in shipid.__all__:
        assert getattr(shipid, name) is not None
    with pytest.raises(AttributeError, match="public names: "):
        _ = shipid.nothing


def test_the_library_says_nothing_unasked() -> None:
    code = "import shipid, logging; logging.getLogger('shipid.study').warning('a note')"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (result.stdout, result.stderr) == ("", "")


def test_importing_is_light() -> None:
    code = "import sys, shipid; dir(shipid); print(sorted({'numpy', 'torch', 'casadi', 'plotly'} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"


def test_a_study_is_prepared_and_reported_without_pytorch() -> None:
    """PyTorch takes two seconds to import: the workers do that meanwhile. Nothing else that is slow is imported."""
    code = (
        "import sys, shipid.study.run, shipid.answer.pages, shipid.identification.solve; "
        "print(sorted({'torch', 'scipy.stats', 'sklearn', 'distributed'} & set(sys.modules)))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"


def blocks(page: str) -> list[str]:
    """Blocks of Python of a page of the documentation, or of `../README.md`."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def test_the_main_job_of_the_documentation_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As printed, with two foundations instead of four and few steps: data lower the error of every foundation."""
    monkeypatch.chdir(tmp_path)
    main_job = blocks("python.md")[0]
    assert main_job.count("\n") <= 26
    assert "Kernel()" in main_job
    assert '"members": 4' in main_job
    space: dict[str, Any] = {}
    exec(main_job.replace("Kernel()", "Kernel(trials=2, steps=2)").replace('"members": 4', '"members": 2'), space)
    cells = pd.DataFrame(space["rows"])
    assert [*zip(cells["model"], cells["N_D"], strict=True)] == [(f"wrong-{i}", n) for i in (1, 2) for n in (4, 8)]
    assert (cells["H"] < cells["A"]).all()
    assert space["predictor"].method == "kernel"
    assert set(space["predictor"].limits) == {"u", "v", "r", *space["runs"].commands, "V_w"}
    assert "wrong-2" in Path("map.html").read_text(encoding="utf-8")


def test_a_study_from_the_documentation_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As printed; only the study is the smallest there is."""
    monkeypatch.chdir(tmp_path)
    study = blocks("python.md")[1]
    assert '"quick"' in study
    space: dict[str, Any] = {"__name__": "__main__", "shipid": shipid}
    with without_workers():
        exec(study.replace('"quick"', repr(str(TINY))).replace("[10]", "[4]"), space)
    assert set(space["results"].cells["N_D"]) == {4}
    assert Path("results/mine/report.html").is_file()
    assert Path("gain.html").is_file()


@pytest.mark.slow
def test_a_method_in_a_file_that_is_tried_is_known_to_every_command(tmp_path: Path) -> None:
    """The class of the notebook, with two workers: processes, which must know it too; in this process to the digit."""
    notebook = json.loads((ROOT / "docs" / "notebooks" / "own-method.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    listed = "".join(cells[1].partition("MeanError\n")[:2])
    (tmp_path / "my_method.py").write_text(f"{cells[0]}\n\n{listed}")
    mine = 'method=[{name = "mine", kind = "mean-error"}, {name = "alone", kind = "alone"}]'
    for name, workers in {"one": 2, "two": 0}.items():
        more = ("--set", mine, "--workers", workers, "--out", name, "--with", "my_method.py")
        command("study", "run", TINY, *more, folder=tmp_path)
    tried = ("--with", "my_method.py")
    compared = json.loads(command(*tried, "study", "compare", "one", "two", "--json", folder=tmp_path))
    assert {row["verdict"] for row in compared["errors"]} == {"identical"}
    page = (tmp_path / "two" / "report.html").read_text(encoding="utf-8")
    assert f'aria-label="Command">shipid --with {tmp_path}/my_method.py study run {TINY} --set' in page
    with pytest.raises(
        ShipidError, match=r"'mean-error' is no kind of method.*`shipid --with .*my_method\.py study rep"
    ):
        shipid.read_cells(tmp_path / "one")


@pytest.mark.slow
def test_a_term_in_a_file_that_is_tried_is_known_to_every_command(tmp_path: Path) -> None:
    """The file of the page, with two workers; after an edit a resumed study says so."""
    (tmp_path / "skeg.py").write_text(code("A term")[1])
    (tmp_path / "ship.toml").write_text(
        'extends = "gunnerus-28.9"\n[hull.skeg]\nx = -10.0\nA = 6.0\nC = 1.8\nsource = "-"\n'
    )
    (tmp_path / "study.toml").write_text(TINY.read_text().replace('"gunnerus-28.9"', '"ship.toml"'))
    tried = ("--with", "skeg.py", "study")
    command(*tried, "run", "study.toml", "--workers", 2, "--out", "one", folder=tmp_path)
    assert "otherwise" not in command(*tried, "resume", "one", folder=tmp_path)
    (tmp_path / "skeg.py").write_text(code("A term")[1].replace("-rho / 2", "-rho * 5"))
    assert "computed otherwise: code of the term.hull.skeg was" in command(*tried, "resume", "one", folder=tmp_path)


def test_results_of_the_how_to_become_a_table_and_a_figure(
    tiny_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    [block] = [one for one in blocks("howto.md") if "gain.html" in one]
    exec(block.replace(QUICK, repr(str(tiny_run))), {})
    assert Path("gain.html").is_file()


@pytest.mark.parametrize("page", ["python.md", "howto.md", "reference-commands.md"])
def test_a_block_that_is_copied_alone_knows_its_names(page: str) -> None:
    for block in blocks(page):
        assert "shipid." not in block or "import shipid" in block or "from shipid" in block, block


def test_folders_of_quick_in_the_documentation_are_those_that_the_command_makes() -> None:
    """A reader copies these lines: another digest would be a folder that is not there."""
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    any_run = {"results/quick-1a2b3c4d"}  # stands for any digest
    assert set(re.findall(r"results/quick-[0-9a-f]{8}", text)) - any_run == {QUICK.strip('"')}


@pytest.mark.slow
def test_the_page_of_manoeuvres_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its blocks go on from each other; the helmsman of the last one keeps the heading that its comment says."""
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {}
    for block in blocks("manoeuvres.md"):
        exec(block, space)
    assert shipid.read_dataset("manoeuvres.parquet").runs == ["starboard first", "port first"]
    assert space["path"]["psi"][-1].item() == pytest.approx(0.5, abs=0.01)


def test_the_chain_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As printed; only the study is the smallest there is."""
    monkeypatch.chdir(tmp_path)
    [chain] = blocks("../README.md")
    for printed, small in (
        ('"quick"', repr(str(TINY))),
        ('"high"', '"wrong"'),
        ('"high-1"', '"wrong-1"'),
        ("[10, 30]", "[4, 6]"),
    ):
        assert printed in chain
        chain = chain.replace(printed, small)
    space: dict[str, Any] = {"__name__": "__main__"}
    with without_workers():
        exec(chain, space)
    assert space["residual"].shape[::2] == (5, 2)
    assert np.isfinite(space["results"].cells["H"]).all()
    assert Path("map.html").is_file()
    assert Path("spread.html").is_file()


def test_frames_of_the_documentation_are_drawn() -> None:
    space: dict[str, Any] = {}
    exec(blocks("python.md")[2], space)
    assert space["figure"].layout.yaxis.type == "log"


@pytest.mark.slow
def test_a_users_script_passes_strict_type_checks(tmp_path: Path) -> None:
    """The documented lines as a script: strict, with shipid's modules read as an installed package's are."""
    script = tmp_path / "mine.py"
    script.write_text(
        "".join(blocks("python.md")) + "reveal_type(results.cells)\nreveal_type(wrong[0])\nreveal_type(predictor)\n"
    )
    (tmp_path / "mypy.ini").write_text(
        "[mypy]\nstrict = true\nfollow_imports = silent\npython_version = 3.12\n"
        "[mypy-plotly.*,casadi.*,torch.*,dask.*,distributed.*,pooch.*,optuna.*,scipy.*,pyarrow.*]\n"
        "ignore_missing_imports = true\nfollow_imports = skip\n"
    )
    cache = ROOT / ".mypy_cache" / "user"
    command = [sys.executable, "-m", "mypy", "--config-file", "mypy.ini", "--cache-dir", str(cache), "mine.py"]
    where = os.environ | {"MYPYPATH": str(ROOT)}
    result = subprocess.run(command, cwd=tmp_path, env=where, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stdout
    assert 'Revealed type is "pandas' in result.stdout
    assert "shipid.vessel.load.Vessel" in result.stdout
    assert "shipid.predictor.Predictor" in result.stdout
