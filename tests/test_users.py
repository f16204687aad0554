"""What a user wrote is known, and its mistakes have a place."""

from __future__ import annotations

import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import shipid
from shipid.errors import ShipidError
from shipid.hybrid.alone import Alone
from shipid.hybrid.method import fit_all
from shipid.physics import TERMS
from shipid.users import code_digest, error_location, is_user_code, locate_errors, unwrap_callable, users_code


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
    words = "from shipid.users import code_digest; print(code_digest())"
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
