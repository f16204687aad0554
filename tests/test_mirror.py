"""Every source file has a test file of the same name in the mirrored folder."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = sorted(path.relative_to(ROOT / "shipid") for path in (ROOT / "shipid").rglob("*.py"))
#: sources that other test files cover, with these
ELSEWHERE = {
    "__init__.py": "test_shipid.py",
    "cli/__init__.py": "cli/test_cli.py",
    "physics/__init__.py": "test_laws.py",
    "measures/__init__.py": "measures/test_laws.py",
    "report/__init__.py": "report/test_page.py",
    "foundations/__init__.py": "foundations/test_foundations.py",
    "foundations/faults.py": "study/test_score.py",
    "hybrid/simulated.py": "foundations/test_foundations.py",
    "study/apply.py": "study/test_whole.py",
    "study/cells.py": "study/test_run.py",
    # the parts of one graph: what is written from them equals Python, for every method
    **{
        f"export/{part}.py": "export/test_c.py"
        for part in ("c_predictor", "c_vessel", "equations", "known", "model", "recorder")
    },
    "export/fmu_c.py": "export/test_fmu.py",
    "engine/fmu_process.py": "foundations/test_fmu.py",
    "version.py": "test_package.py",
}


def mirrored(source: Path) -> Path:
    """Path of the test file of a source, in `tests`."""
    return source.with_name(f"test_{source.name}")


def is_tested(source: Path) -> bool:
    """Whether the file that tests a source has tests; one line of words needs none."""
    if source.name == "__init__.py" and len((ROOT / "shipid" / source).read_text().splitlines()) == 1:
        return True
    file = ROOT / "tests" / ELSEWHERE.get(source.as_posix(), mirrored(source).as_posix())
    return file.is_file() and "def test_" in file.read_text()


def test_every_source_has_its_tests() -> None:
    assert [source for source in SOURCES if not is_tested(source)] == []


def test_what_is_covered_elsewhere_is_there_and_has_no_tests_of_its_name() -> None:
    for source in ELSEWHERE:
        assert Path(source) in SOURCES
        assert not (ROOT / "tests" / mirrored(Path(source))).exists(), source
