"""An installed package adds to shipid without an edit; a broken one is one line and harms nothing; so is a file."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shipid
from shipid import plugins
from shipid.data.dataset import is_command
from shipid.errors import ShipidError
from shipid.hybrid.alone import Alone
from shipid.hybrid.method import fit_all
from shipid.hybrid.methods import METHODS, method_kind, method_of
from shipid.logs.guess.layout import guess_format
from shipid.logs.mapping import read_mapping
from shipid.logs.readers import READERS, read_log_table
from shipid.physics import TERMS
from shipid.plugins import (
    REGISTRIES,
    code_digest,
    error_location,
    import_files,
    installed_entries,
    is_user_code,
    locate_errors,
    unwrap_callable,
    users_code,
)
from shipid.predictor import Predictor
from shipid.study.results import read_results
from shipid.vessel.load import check_document, load_vessel
from tests.faults.clusters import a_cluster
from tests.study.tiny import TINY, command

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "tests" / "plugin_example"
JETS = {"main": {"kind": "jet", "x": -13.0, "F_max": 6e4}}
SHIP = 'extends = "gunnerus-28.9"\n[thruster.main]\nkind = "jet"\nx = -13.0\nF_max = 6e4\n'
MINE = 'method=[{name = "mine", kind = "mean-error"}, {name = "alone", kind = "alone"}]'
BROKEN = {  # group: name -> what it is
    "shipid.methods": {"absent": "nowhere:Mine", "ends": "broken:ends", "odd": "broken:ODD", "kernel": "broken:ODD"},
    "shipid.terms": {"hull.odd": "broken:ODD", "hull.unit": "broken:UNIT", "unit": "broken:UNIT"},
    "shipid.readers": {"odd": "broken:ODD", "raises": "broken:RAISES"},
    "shipid.signals": {"throttle": "broken:ODD"},
}
MODULE = """
import sys
from shipid.logs.formats import Format
from shipid.logs.readers import LogReader
from shipid.physics import Term

ODD = 3
UNIT = Term(lambda nu_r, *, C: nu_r)
RAISES = LogReader(Format, lambda *_: 1 / 0, lambda *_: 1 / 0)
def __getattr__(name):
    sys.exit("at the import")
"""


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of packages that has the example, installed from its wheel."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copytree(EXAMPLE, folder / "source")
    build = ["hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run([sys.executable, "-m", *build], cwd=folder / "source", check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    shutil.unpack_archive(wheel, folder / "packages", "zip")
    return folder / "packages"


@pytest.fixture
def enter(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Path], None]]:
    """Have this process look at the packages of a folder; afterwards it forgets them."""
    before = {group: dict(registry) for group, registry in REGISTRIES.items()}

    def forget() -> None:
        for cached in (installed_entries, plugins.log_warning):
            cached.cache_clear()
        for registry in REGISTRIES.values():
            registry.__dict__.pop("offers", None)

    def look(folder: Path) -> None:
        monkeypatch.syspath_prepend(str(folder))
        forget()

    yield look
    monkeypatch.undo()
    forget()
    for group, registry in REGISTRIES.items():
        registry.clear()
        registry.update(before[group])


def study_with_jets(folder: Path) -> Path:
    """A study of a ship with a jet, which the example adds to shipid."""
    (folder / "ship.toml").write_text(SHIP)
    text = TINY.read_text().replace('"gunnerus-28.9"', '"./ship.toml"')
    file = folder / "study.toml"
    text = text.replace("start_speed =", "throttle = [0.2, 0.8]\nstart_speed =")
    file.write_text(f'{text}\n[[family]]\nname = "straight"\nfunction = "straight"\n')
    return file


def test_names_are_known_without_an_import(site: Path, enter: Callable[[Path], None]) -> None:
    enter(site)
    sys.modules.pop("shipid_jet", None)
    assert "thruster.jet" in TERMS.names
    assert {"mean-error"} == {*METHODS.names} - {*METHODS}
    with pytest.raises(ShipidError, match="did you mean 'mean-error'"):
        method_of("mean-erorr", {})
    load_vessel("gunnerus-28.9")
    assert "shipid_jet" not in sys.modules


def test_each_is_loaded_when_a_document_names_it(site: Path, enter: Callable[[Path], None], tmp_path: Path) -> None:
    enter(site)
    assert is_command("main.throttle")
    document = load_vessel("gunnerus-28.9").document
    vessel = check_document({**document, "thruster": JETS}, "under jets")
    assert vessel.units["thruster.main.F_max"] == "N"
    method = method_of("mean-error", {})
    METHODS.pop("mean-error")
    assert method_kind(method) == "mean-error"  # of a class that Python has imported by itself
    log = tmp_path / "log.toy"
    log.write_text("TOY\ntime: 0 1 2\nu: 3 4 5\n")
    assert guess_format(log.read_bytes(), log, ()) == {"kind": "toy"}
    table = read_log_table(log, READERS["toy"].options(kind="toy"), "time")
    assert table["u"].tolist() == ["3", "4", "5"]
    mapping = tmp_path / "mapping.toml"
    mapping.write_text('[format]\nkind = "toi"\n')
    with pytest.raises(ShipidError, match=r"unknown kind 'toi': did you mean 'toy'"):
        read_mapping(mapping)


def test_a_page_of_keys_has_it(site: Path, enter: Callable[[Path], None]) -> None:
    enter(site)
    assert METHODS["mean-error"].model_json_schema()["description"].startswith("Takes the mean error")


def broken_package(folder: Path, name: str = "broken") -> Path:
    """A package whose members cannot be used, installed in a folder."""
    place = folder / f"{name}-1.0.dist-info"
    place.mkdir()
    (place / "METADATA").write_text(f"Name: {name}\nVersion: 1.0\n")
    blocks = (f"[{group}]\n" + "".join(f"{n} = {what}\n" for n, what in of.items()) for group, of in BROKEN.items())
    (place / "entry_points.txt").write_text("\n".join(blocks))
    (folder / "broken.py").write_text(MODULE)
    return folder


def test_a_broken_package_is_one_line_and_harms_nothing_else(
    enter: Callable[[Path], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    enter(broken_package(tmp_path))
    document = load_vessel("gunnerus-28.9").document
    faults: dict[str, Callable[[], Any]] = {
        r"'absent' in shipid.methods, nowhere:Mine of .* broken 1\.0, is left out: ModuleNotFoundError: No module": (
            lambda: method_of("absent", {})
        ),
        r"'ends' in .*: SystemExit: at the import$": lambda: method_of("ends", {}),
        r"'odd' in .*: must be a class of Method with `fit`": lambda: method_of("odd", {}),
        r"'hull.odd' in .*: must be a Term of shipid\.physics, not 3$": lambda: TERMS["hull.odd"],
        r"'hull.unit' in .*: hull.unit: its parameter 'C' has no unit": lambda: check_document(
            {**document, "hull": {**document["hull"], "unit": {"C": 1.0}}}, "a ship"
        ),
        r"'odd' in shipid.readers, .*: must be a LogReader of": lambda: READERS["odd"],
        r"'throttle' in .*: must be a Signal of": lambda: is_command("main.throttle"),
        r"the reader 'raises': ZeroDivisionError: division by zero in .*broken\.py, line 9$": lambda: read_log_table(
            tmp_path / "broken.py", READERS["raises"].options(kind="raises"), "t"
        ),
    }
    for match, use in faults.items():
        with pytest.raises(ShipidError, match=match):
            use()
    assert METHODS["kernel"].__module__ == "shipid.hybrid.kernel"
    assert load_vessel("gunnerus-28.9").document == document
    assert "hull.resistance" in TERMS.load_all()
    assert guess_format(b"time,u\n0,1\n1,2\n", tmp_path / "log.csv", ())["separator"] == ","
    for words in (
        "'kernel' in shipid.methods, broken:ODD of the package broken 1.0, is left out: the name is taken",
        "'unit' in shipid.terms",
        "the reader 'raises' is left out: ZeroDivisionError",
    ):
        assert sum(words in line for line in caplog.messages) == 1


def test_a_name_of_two_packages_is_one_line(enter: Callable[[Path], None], tmp_path: Path) -> None:
    broken_package(tmp_path, "other")
    enter(broken_package(tmp_path))
    with pytest.raises(ShipidError, match="has the name, too: uninstall one"):
        method_of("absent", {})


@pytest.mark.slow
def test_a_package_goes_through_a_whole_study(site: Path, tmp_path: Path, enter: Callable[[Path], None]) -> None:
    """By the command, with two workers, and on a cluster: to the same digits, to a report and to exports."""
    study = study_with_jets(tmp_path)
    words = ("study", "run", study, "--set", MINE, "--set", "grid.N_D=[4]")
    command(*words, "--workers", 2, "--out", "local", folder=tmp_path, site=site)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(site)]))
        with a_cluster(tmp_path) as (address, _):
            command(*words, "--scheduler", address, "--out", "cluster", folder=tmp_path, site=site)
    assert 'aria-label="Command">shipid study run ' in (tmp_path / "local" / "report.html").read_text()
    cell = "cells/right+mine-N0004-s0.npz"
    command("export", f"local/{cell}", "--to", "casadi", "--out", "mine.casadi", folder=tmp_path, site=site)
    enter(site)
    one, other = (Predictor.load(tmp_path / name / cell) for name in ("local", "cluster"))
    assert np.array_equal(one.corrector.shift, other.corrector.shift)  # type: ignore[attr-defined]
    results = read_results(tmp_path / "local")
    ahead = np.arange(1, 6)[:, None] * results.test.columns["u"]
    np.testing.assert_allclose(results.physics["straight"][..., 0], ahead, atol=1e-9)
    assert one.vessel.units["thruster.main.F_max"] == "N"


def test_a_file_that_is_tried_is_a_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "TRIED_FILES", [])
    monkeypatch.setattr(sys, "path", [*sys.path])
    file = tmp_path / "tried_here.py"
    file.write_text("from shipid.physics import TERMS, Term\nTERMS['hull.tried'] = Term(abs)\n")
    with monkeypatch.context() as patch:
        patch.setitem(TERMS, "hull.tried", TERMS["hull.mmg"])
        import_files([file, file])
        assert TERMS["hull.tried"].function is abs
    assert [file] == plugins.TRIED_FILES


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        (
            "tried_raises.py",
            "\n1 / 0\n",
            r"tried_raises\.py: cannot be imported: ZeroDivisionError: division by zero in .*, line 2$",
        ),
        ("tried_ends.py", "import sys\nsys.exit('no')\n", r"SystemExit: no in .*tried_ends\.py, line 2$"),
        ("tried_odd.py", "def f(:\n", r"SyntaxError: .*tried_odd\.py, line 1"),
        ("queue.py", "", r"'queue' is the name of another module: rename it$"),
        (
            "tried_wrong.py",
            "from shipid.physics import TERMS\nTERMS['hull.a'] = 3\n",
            "'hull.a' in .* must be a Term of",
        ),
    ],
)
def test_a_file_that_cannot_be_tried_is_one_line(
    name: str, text: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / name).write_text(text)
    with pytest.raises(ShipidError, match=words):
        import_files([tmp_path / name])
    with pytest.raises(ShipidError, match="no such file"):
        import_files([tmp_path / "absent.py"])


class Called:
    """An object that is called."""

    def __call__(self) -> None:
        raise ValueError("mine")


def plain() -> None:
    raise ValueError("mine")


BEGIN = plain.__code__.co_firstlineno


def test_functions_and_classes_of_a_user_are_known_in_any_dress() -> None:
    """A term may hold a plain function, a part of one, or an object that is called."""
    assert all(map(is_user_code, (plain, partial(plain), Called(), Called, lambda: None)))
    assert not any(map(is_user_code, (fit_all, partial(fit_all), Alone, *TERMS["radiation.roll"].functions)))
    assert not any(map(is_user_code, (str.upper, np.ndarray.sum)))
    assert unwrap_callable(partial(plain)) is plain
    assert unwrap_callable(Called()) is Called


@pytest.mark.parametrize("kind", [plain, Called])
def test_an_error_in_the_file_of_a_user_has_a_place(kind: type) -> None:
    words = rf"^mine: ValueError: mine in {__file__}, line {BEGIN + 1}$"
    with pytest.raises(ShipidError, match=words), locate_errors("mine", kind, "term"):
        plain()
    with pytest.raises(ValueError, match="mine") as caught, locate_errors("mine", fit_all):
        plain()
    assert error_location(caught.value, fit_all) == ""


def test_ends_of_the_process_and_right_errors() -> None:
    words = r"^mine calls sys\.exit \(no\): a term may not end the process"
    with pytest.raises(ShipidError, match=words), locate_errors("mine", fit_all, "term"):
        sys.exit("no")
    error = ShipidError("right")
    with pytest.raises(ShipidError) as caught, locate_errors("mine", plain):
        raise error
    assert caught.value is error


def digest_of(copy: Path) -> str:
    """What a process says that runs a copy of the package."""
    words = "from shipid.plugins import code_digest; print(code_digest())"
    command = [sys.executable, "-B", "-c", f"import sys; sys.path.insert(0, {str(copy)!r}); {words}"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_another_commit_of_the_same_version_has_another_digest(tmp_path: Path) -> None:
    package = Path(shipid.__file__).parent
    shutil.copytree(package, tmp_path / "shipid", ignore=shutil.ignore_patterns("__pycache__"))
    assert digest_of(tmp_path) == code_digest()
    file = tmp_path / "shipid" / "metrics.py"
    file.write_text(file.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    changed = digest_of(tmp_path)
    assert changed != code_digest()
    file.rename(file.with_name("measure.py"))
    assert digest_of(tmp_path) not in (changed, code_digest())


@pytest.mark.parametrize(
    ("module", "file", "beside", "elsewhere"),
    [
        ("mine", "mine.py", "helper.py", "folder/other.py"),
        ("pack.mine", "pack/mine.py", "pack/inner/helper.py", "other.py"),
    ],
)
def test_files_beside_that_of_a_method_are_part_of_its_code(
    module: str, file: str, beside: str, elsewhere: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a helper that changed left the digest as it was, so that cells of two methods were mixed."""
    for name in (file, beside, elsewhere):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x = 1")
    monkeypatch.setattr("inspect.getfile", lambda _: str(tmp_path / file))
    digests = []
    for name in (file, elsewhere, beside, file):
        digests.append(users_code((type("Mine", (), {"__module__": module}),)))
        (tmp_path / name).write_text(f"x = {len(digests)} + 1")
    assert digests[1] == digests[2]
    assert len(set(digests)) == 3


def test_functions_of_a_user_have_a_digest_in_any_dress() -> None:
    users = (plain, partial(plain), Called(), lambda: None)
    assert len({users_code((one,)) for one in users}) == 1  # all are in this file
    assert users_code(users) != "unknown"
