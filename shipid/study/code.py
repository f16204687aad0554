"""Which code of shipid runs: two commits of a copy may have one version. Imports little: workers are asked for it."""

from __future__ import annotations

import ast
import hashlib
import inspect
import pickle
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from shipid.users import is_user_code, unwrap_callable

UNKNOWN = "unknown"  # digest of what is in no file
INSTALLED = ("site-packages", "dist-packages")


@cache
def code_digest() -> str:
    """Digest (8 hex digits) of the names and contents of all source files of shipid, at the first call of a process."""
    package = Path(__file__).parents[1]
    files = sorted((file.relative_to(package).as_posix(), file) for file in package.rglob("*.py"))
    lines = (f"{name} {hashlib.sha256(file.read_bytes()).hexdigest()}\n" for name, file in files)
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:8]


def code_and_fault(packed: bytes) -> tuple[str, str]:
    """What a worker is asked: `code_digest`, and why it cannot read what is packed; empty where it can."""
    try:
        pickle.loads(packed)
    except Exception as error:
        return code_digest(), str(error).partition("\n")[0] or type(error).__name__
    return code_digest(), ""


@cache
def users_code(kinds: tuple[Callable[..., Any], ...]) -> str:
    """Digest (8 hex digits) of the files that a user's classes and functions are in, and what they import beside them.

    Those of a notebook have none. As `code_digest`: the files at the first call in this process.
    """
    files: set[Path] = set()
    for kind in map(unwrap_callable, filter(is_user_code, kinds)):
        with suppress(OSError, TypeError):  # of a notebook
            files |= _with_imported(Path(inspect.getfile(inspect.unwrap(kind))).resolve(), kind.__module__.count("."))
    texts = [file.read_bytes() for file in sorted(files)]
    return hashlib.sha256(b"\n".join(texts)).hexdigest()[:8] if texts else UNKNOWN


def _with_imported(file: Path, depth: int) -> set[Path]:
    """A file and those from beside it that it imports, and that these import in turn.

    Beside it is its folder, and those above it to the one that holds its package; `depth` folders above at least. Of
    installed packages only its own counts: the versions of others are noted elsewhere.
    """
    depth = min(depth, len(file.parents) - 1)
    while (file.parents[depth] / "__init__.py").is_file():
        depth += 1
    top, files, left = file.parents[depth], set[Path](), {file}
    whole = top / file.relative_to(top).parts[0] if top.name in INSTALLED else top
    while left:
        one = left.pop()
        if one.is_file() and one not in files:
            files.add(one)
            folders = [folder for folder in one.parents if folder.is_relative_to(top)]
            places = {
                place for name in _imported_names(one, top) for folder in folders for place in _places(folder, name)
            }
            left |= {place for place in places if place.is_relative_to(whole)}
    return files


def _imported_names(file: Path, top: Path) -> Iterator[str]:
    """Dotted names that a file may import as modules; a relative one is completed, as seen from the folder `top`."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, RecursionError):  # nobody can have imported it
        return
    here = file.relative_to(top).parts
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = here[: max(len(here) - node.level, 0)] if node.level else ()
            parts = [*above, *filter(None, [node.module])]
            names = [".".join([*parts, alias.name]) for alias in node.names]  # or a name in the module of `parts`
        else:
            continue
        yield from (name for name in names if name.partition(".")[0] != "shipid")


def _places(folder: Path, name: str) -> Iterator[Path]:
    """Where the module of a dotted name, and the packages that it is in, would be in a folder."""
    place = folder
    for part in name.split("."):
        place /= part
        yield from (place.with_name(f"{part}.py"), place / "__init__.py")
