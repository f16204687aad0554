"""Which code of shipid runs: two commits of a copy may have one version. Imports little: workers are asked for it."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path


@cache
def code_digest() -> str:
    """Digest (8 hex digits) of the names and contents of all source files of shipid, as this process found them."""
    package = Path(__file__).parents[1]
    files = sorted((file.relative_to(package).as_posix(), file) for file in package.rglob("*.py"))
    lines = (f"{name} {hashlib.sha256(file.read_bytes()).hexdigest()}\n" for name, file in files)
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:8]


def of_users(kind: type) -> bool:
    """Whether a class is none of shipid's: somebody wrote it."""
    return kind.__module__.partition(".")[0] != "shipid"


def users_code(kinds: Iterable[type]) -> str:
    """Digest (8 hex digits) of the files that classes of a user are in; those of a notebook have none."""
    files = set()
    for kind in filter(of_users, kinds):
        with suppress(OSError, TypeError):  # a class of a notebook
            files.add(Path(inspect.getfile(kind)))
    texts = [file.read_bytes() for file in sorted(files) if file.is_file()]
    return hashlib.sha256(b"\n".join(texts)).hexdigest()[:8] if texts else "unknown"
