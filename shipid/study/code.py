"""Which code of shipid runs: two commits of a copy may have one version. Imports little: workers are asked for it."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path


@cache
def code_digest() -> str:
    """Digest (8 hex digits) of the names and contents of all source files of shipid, as this process found them."""
    package = Path(__file__).parents[1]
    files = sorted((file.relative_to(package).as_posix(), file) for file in package.rglob("*.py"))
    lines = (f"{name} {hashlib.sha256(file.read_bytes()).hexdigest()}\n" for name, file in files)
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:8]
