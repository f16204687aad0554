"""The code of docs/extending.md as its reader would write it: as a module, or as a commit in a copy of the tree."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"
BLOCK = re.compile(r"^```(?:python|py)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
OF_A_FILE = re.compile(r"# (shipid/[\w/]+\.py)\n")


def section(heading: str) -> str:
    """The text of a section of the page."""
    return PAGE.read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def code(heading: str) -> list[str]:
    """The blocks of Python in a section of the page that run on their own."""
    return [block.partition("```")[0] for block in section(heading).split("```python\n")[1:]]


def module(heading: str, name: str, monkeypatch: pytest.MonkeyPatch, number: int = 0) -> ModuleType:
    """One of these blocks as a module."""
    made = ModuleType(name)
    monkeypatch.setitem(sys.modules, name, made)
    exec(compile(code(heading)[number], str(PAGE), "exec"), made.__dict__)
    return made


def new_module(heading: str, name: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The new file that a section writes first, as a module."""
    block = next(block for _, block in additions(heading) if block.startswith('"""'))
    made = ModuleType(name)
    monkeypatch.setitem(sys.modules, name, made)
    exec(compile(block, str(PAGE), "exec"), made.__dict__)
    return made


def additions(heading: str) -> list[tuple[str, str]]:
    """Path and code of each block of a section that belongs into a file of shipid."""
    blocks = BLOCK.findall(section(heading))
    return [(path[1], block[path.end() :]) for block in blocks if (path := OF_A_FILE.match(block))]


def entries(heading: str, table: str) -> str:
    """The entries that the blocks of a section add to a table, as text."""
    return "".join(parse_addition(block)[2].get(table, "") for _, block in additions(heading))


def parse_addition(block: str) -> tuple[list[str], list[str], dict[str, str]]:
    """Imports, definitions, and table -> entries of a block that adds to a file."""
    imports, definitions, tables = [], [], {}
    for node in ast.parse(block).body:
        text = ast.get_source_segment(block, node) or ""
        if isinstance(node, ast.Import | ast.ImportFrom):
            imports.append(text)
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict):
            assert isinstance(node.targets[0], ast.Name)
            inside = (ast.get_source_segment(block, node.value) or "").strip()[1:-1]
            tables[node.targets[0].id] = inside.strip("\n") + "\n"
        else:
            definitions.append(text)
    return imports, definitions, tables


def commit(tree: Path, heading: str) -> list[Path]:
    """Write the blocks of a section into the files of a copy of the tree; the files."""
    files = []
    for path, block in additions(heading):
        file = tree / path
        if file.exists():
            add(file, block)
        else:
            file.write_text(block, encoding="utf-8")
            test = tree / "tests" / file.relative_to(tree / "shipid").with_name(f"test_{file.name}")
            test.write_text(f'def test_it_is_imported() -> None:\n    __import__("{dotted(path)}")\n', encoding="utf-8")
        files.append(file)
    return files


def add(file: Path, block: str) -> None:
    """Add a block to a file: imports after its imports, entries at the end of tables, definitions before these."""
    imports, definitions, tables = parse_addition(block)
    text = file.read_text(encoding="utf-8")
    own = f"from {dotted('/'.join(file.parts[file.parts.index('shipid') :]))} import"
    for table, inside in tables.items():
        begin = re.search(rf"^{table}\b[^\n]*= \{{$", text, re.MULTILINE)
        assert begin, f"{file} has no table {table}"
        end = text.index("\n}", begin.end()) + 1
        text = text[:end] + inside + text[end:]
    if definitions:
        first = re.search(r"^[A-Z]+(?:: dict\[[^\n]*| \|)= \{$", text, re.MULTILINE)
        place = first.start() if first else len(text)
        text = text[:place] + "\n\n\n".join(definitions) + "\n\n\n" + text[place:]
    if imports := [line for line in imports if file.name == "__init__.py" or not line.startswith(own)]:
        body = ast.parse(text).body
        last = max(node.end_lineno or 0 for node in body if isinstance(node, ast.Import | ast.ImportFrom))
        lines = text.splitlines(keepends=True)
        text = "".join([*lines[:last], *(f"{line}\n" for line in imports), *lines[last:]])
    file.write_text(text, encoding="utf-8")


def dotted(path: str) -> str:
    """Name of the module of a file."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
