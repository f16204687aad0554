"""The check of names finds what it is for; that of this package is part of `make check`."""

from pathlib import Path

import pytest

from tests.names import MOST_PROTOCOLS, PROTOCOL, name_faults


def package(folder: Path, **modules: str) -> Path:
    """A package of modules with these texts."""
    for name, text in modules.items():
        file = folder / "ship" / f"{name}.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    return folder / "ship"


def test_good_names_pass(tmp_path: Path) -> None:
    root = package(tmp_path, a="def read_clock(): ...\nclass Windows: ...\n", b="def speed(): ...\nLIMIT = 1\n")
    assert name_faults(root) == []


def test_a_name_in_two_modules_is_named_with_both(tmp_path: Path) -> None:
    root = package(tmp_path, a="def read_clock(): ...\n", b="\nclass read_clock: ...\n")
    (fault,) = name_faults(root)
    assert "ship/a.py:1: read_clock" in fault
    assert "ship/b.py:2" in fault


def test_a_constant_in_two_modules_is_named_unless_so_many_may_be(tmp_path: Path) -> None:
    root = package(tmp_path, a="NEAR, FAR = 1, 2\n", b="FAR: float = 3.0\nlog = 1\n", c="log = 1\n")
    (fault,) = name_faults(root)
    assert fault == "ship/a.py:1: FAR stands in 2 modules, too in ship/b.py:1"
    assert name_faults(root, most_shared=1) == []


def test_what_is_inside_a_class_or_defined_twice_in_one_module_is_free(tmp_path: Path) -> None:
    inside = "class A:\n    def judged(self): ...\n"
    root = package(tmp_path, a=inside, b="if True:\n    def one(): ...\ndef two(): ...\ndef two(): ...\n")
    assert name_faults(root) == []


@pytest.mark.parametrize(
    "name", ["judged", "Judged", "_shown_rows", "looping", "chosen", "plain", "values_here", "beside", "she_turns"]
)
def test_a_wrong_word_is_refused(tmp_path: Path, name: str) -> None:
    (fault,) = name_faults(package(tmp_path, a=f"def {name}(): ...\n"))
    assert fault.startswith(f"ship/a.py:1: {name}: ")


def test_protocol_names_are_few() -> None:
    assert len(PROTOCOL) <= MOST_PROTOCOLS
