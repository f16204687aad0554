"""The code of docs/extending.md, as its reader would write it down."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"


def code(heading: str) -> list[str]:
    """The blocks of Python in a section of the page."""
    section = PAGE.read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    return [block.partition("```")[0] for block in section.split("```python\n")[1:]]


def module(heading: str, name: str, monkeypatch: pytest.MonkeyPatch, number: int = 0) -> ModuleType:
    """One of these blocks as a module."""
    made = ModuleType(name)
    monkeypatch.setitem(sys.modules, name, made)
    exec(compile(code(heading)[number], str(PAGE), "exec"), made.__dict__)
    return made
