"""The site builds without a warning and fetches nothing; pages quote what records hold; notebooks run as stored."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote, urldefrag, urlsplit

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
FIGURES = ("image/svg+xml", "application/vnd.plotly.v1+json")
CODE_NAME = re.compile(
    r"\b(?!(?:aboard|make|mariner|tab|test)_)(?:[A-Z][a-z]+[A-Z]\w*|[a-z]\w*_[a-z]{2,}\w*|[a-z]\w+(?=\())"
)
"""Names of code within a sentence; those of exported code, of test files and of examples are not the package's."""


class Page(HTMLParser):
    """Names that a page defines, pages that it links to, and files that a browser loads with it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.equations = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.names.add(given.get("id", ""))
        self.equations += tag == "math"
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in ("script", "img", "iframe", "source"):
            self.loaded.append(given.get("src", ""))
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loaded.append(given["href"])


def load(file: Path) -> ModuleType:
    spec = spec_from_file_location(file.stem, file)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def figures(notebook: dict) -> list[str]:
    """Kind of every figure that a notebook holds."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ())]
    return [kind for output in outputs for kind in output.get("data", {}) if kind in FIGURES]


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_its_links_lead_somewhere(tmp_path: Path) -> None:
    pytest.importorskip("myst_nb", reason="`make docs` installs what builds the site")
    site = tmp_path / "site"
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", str(tmp_path / "trees"), "docs"]
    environment = {**os.environ, "http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}  # no network
    built = subprocess.run([*command, str(site)], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    pages = {file: Page(file.read_text(encoding="utf-8")) for file in site.rglob("*.html")}
    assert {file.stem for file in DOCS.glob("*.md")} <= {file.stem for file in pages}
    assert pages[site / "theory.html"].equations > 50
    broken = []
    for file, page in pages.items():
        for link in page.links:
            if urlsplit(link).scheme or not link:
                continue
            path, name = urldefrag(link)
            target = (file.parent / unquote(path)).resolve() if path else file
            if not target.is_file() or (name and target in pages and unquote(name) not in pages[target].names):
                broken.append(f"{file.relative_to(site)}: {link}")
        loaded = [link.partition("?")[0] for link in page.loaded if link and not link.startswith("data:")]
        broken += [f"{file.relative_to(site)} loads {link}" for link in loaded if not (file.parent / link).is_file()]
    assert not broken, "\n".join(broken)
    styles = [file for file in site.rglob("*.css") if "url(http" in file.read_text(encoding="utf-8")]
    assert not styles


@pytest.mark.slow
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_runs(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("nbclient", reason="`make docs` installs what runs notebooks")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    done = load(DOCS / "notebooks" / "execute.py").executed(file, tmp_path)
    assert len(figures(done)) == len(figures(json.loads(file.read_text(encoding="utf-8"))))


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_is_stored_with_its_figures_and_light(file: Path) -> None:
    notebook = json.loads(file.read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert "image/svg+xml" in figures(notebook)
    outputs = [output for cell in code for output in cell["outputs"]]
    assert not [one for one in outputs if one["output_type"] == "error" or one.get("name") == "stderr"]
    assert file.stat().st_size < 300_000


@pytest.fixture
def records() -> ModuleType:
    return load(DOCS / "records.py")


def test_names_in_sentences_are_those_of_the_code() -> None:
    """A tool that renames reads code and blocks of code, not `words` in a sentence."""
    sources = [file for folder in ("shipid", "tests", "docs") for file in (ROOT / folder).rglob("*.py")]
    words = set(re.findall(r"\w+", "".join(file.read_text(encoding="utf-8") for file in sources)))
    missing = []
    for page in [ROOT / "README.md", *DOCS.glob("*.md")]:
        text = re.sub(r"^(`{3,}).*?^\1 *$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        spans = re.findall(r"`([^`\n]+)`", text)
        missing += [f"{page.name}: {name}" for span in spans for name in CODE_NAME.findall(span) if name not in words]
        files = {file for span in spans for file in re.findall(r"shipid/[\w/]+\.py", span)}
        missing += [f"{page.name}: {file}" for file in files if not (ROOT / file).is_file()]
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize("page", [ROOT / "README.md", *sorted(DOCS.glob("*.md"))], ids=lambda file: file.stem)
def test_a_page_quotes_what_its_records_hold(page: Path, records: ModuleType) -> None:
    assert not records.unsupported(page.read_text(encoding="utf-8"))


def test_a_wrong_number_is_seen(records: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "sea.md").write_text("H is 0.68 m with 1,000 windows, A 2.43 m.")
    right = "With 1000 windows H is 0.68 m ([record](records/sea.md)).\n\nElsewhere 9 of `quick-99`."
    assert not records.unsupported(right, tmp_path)
    (fault,) = records.unsupported(right.replace("0.68", "0.67"), tmp_path)
    assert "0.67 is not in the record sea" in fault
    table = "| a ([record](records/sea.md)) | b |\n| --- | --- |\n| 2.43 | 2.44 |"
    assert len(records.unsupported(table, tmp_path)) == 1
    assert records.unsupported("([record](records/land.md))", tmp_path) == ["there is no record land"]


def test_every_record_says_its_origin(records: ModuleType) -> None:
    for file in set((DOCS / "records").glob("*.md")) - {DOCS / "records" / "index.md"}:
        text = file.read_text(encoding="utf-8")
        assert [line.partition(":")[0] for line in re.findall(r"^- (.*)$", text, re.MULTILINE)[:4]] == [*records.HEAD]


def test_a_command_writes_its_record(records: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(records, "RECORDS", tmp_path)
    assert records.main("sum", sys.executable, "-c", "print(20 + 22)") == 0
    text = (tmp_path / "sum.md").read_text(encoding="utf-8")
    assert "\n42\n" in text
    assert all(f"\n- {key}: " in text for key in records.HEAD)
    assert records.main("none", sys.executable, "-c", "raise SystemExit(3)") == 3
    assert not (tmp_path / "none.md").exists()


def test_the_grid_of_the_paper_is_drawn_and_counted() -> None:
    """Figures 8, 9 and 10 of a grid with several amounts; sentences count what its rows say."""
    grid = load(DOCS / "paper_grid.py")
    drawn = grid.figures_page().partition("## `kernel`")[2]
    assert drawn.count("Plotly.newPlot") == 3
    errors = {("moderate-1", 10): 2.0, ("moderate-1", 30): 1.0, ("none", 10): 3.0, ("none", 30): 2.5}
    rows = [
        {"model": model, "N_D": N_D, "A": 4.0, "H": H, "H_90": 2 * H, "roughness": H / 2 if N_D == 30 else np.nan}
        for (model, N_D), H in errors.items()
    ]
    said = " ".join(grid.counts_of_findings(pd.DataFrame(rows)))
    assert "S2: H is lower at 30 runs than at 10 for 2 of 2 models." in said
    assert "S1, N_D = 30: 1 of 1 moderate models have a lower H than none." in said
    assert "S6: 1 models have a lower H with 10 runs than none with 30." in said
    assert "S7, N_D = 30: paths without physics are 1.25 times as rough as the true ones" in said
    assert "S7, N_D = 10" not in said


def test_the_readme_is_short_and_its_files_are_there() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.split()) <= 700
    names = [part.partition(")")[0] for part in text.split("](")[1:]]
    inside = [name for name in names if not urlsplit(name).scheme]
    assert sum(name.endswith(".svg") for name in inside) == 2
    assert all((ROOT / urldefrag(name)[0]).exists() for name in inside)
