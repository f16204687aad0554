"""Which code of shipid runs: two commits of a copy may have one version."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from shipid.users import is_user_code, unwrap_callable

UNKNOWN = "unknown"  # digest of what is in no file


@cache
def code_digest() -> str:
    """Digest (8 hex digits) of the names and contents of all source files of shipid, at the first call of a process."""
    package = Path(__file__).parents[1]
    files = sorted((file.relative_to(package).as_posix(), file) for file in package.rglob("*.py"))
    lines = (f"{name} {hashlib.sha256(file.read_bytes()).hexdigest()}\n" for name, file in files)
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:8]


@cache
def users_code(kinds: tuple[Callable[..., Any], ...]) -> str:
    """Digest (8 hex digits) of the files that a user's classes and functions are in, and of all files beside them.

    Those of a notebook have none. As `code_digest`: the files at the first call in this process.
    """
    files: set[Path] = set()
    for kind in map(unwrap_callable, filter(is_user_code, kinds)):
        with suppress(OSError, TypeError):  # of a notebook
            file, depth = Path(inspect.getfile(inspect.unwrap(kind))).resolve(), kind.__module__.count(".")
            beside = file.parents[depth - 1].rglob("*.py") if depth else file.parent.glob("*.py")
            files |= {file, *beside} if file.is_file() else set()
    texts = [file.read_bytes() for file in sorted(files)]
    return hashlib.sha256(b"\n".join(texts)).hexdigest()[:8] if texts else UNKNOWN
