"""Which code runs, of shipid and of a user: its digest, and where in a user's file a mistake arose."""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from traceback import extract_tb
from typing import Any

from shipid.errors import ShipidError

UNKNOWN = "unknown"  # digest of what is in no file


@cache
def code_digest() -> str:
    """Digest (8 hex digits) of the names and contents of all source files of shipid, at the first call of a process."""
    package = Path(__file__).parent
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


READ_ONLY = ": what a method is given cannot be written to, make a new array: `paths + shift`, not `paths += shift`"


def is_user_code(kind: Callable[..., Any]) -> bool:
    """Whether a class or a function is none of shipid's: somebody wrote it."""
    module = _module_name(kind)
    return bool(module) and module.partition(".")[0] != "shipid"


def _module_name(kind: Callable[..., Any]) -> str:
    """Name of the module of a class or function; empty for what has none, such as `str.upper`."""
    return getattr(unwrap_callable(kind), "__module__", None) or ""


def unwrap_callable(kind: Callable[..., Any]) -> Callable[..., Any]:
    """The class or function as it stands in a file: that of a `partial`, or the class of an object that is called."""
    kind = getattr(kind, "func", kind)
    return kind if hasattr(kind, "__qualname__") else type(kind)


@contextmanager
def locate_errors(where: str, kind: Callable[..., Any], what: str = "method") -> Iterator[None]:
    """Raise ShipidError, one line with its place, for a mistake in a user's class or function, or a call of `sys.exit`.

    Errors that arise elsewhere pass. where : what is called. what : the word for what the user wrote.
    """
    try:
        yield
    except SystemExit as error:
        words = (f" ({error.code})" if isinstance(error.code, str) else "") + error_location(error, kind)
        remedy = f"a {what} may not end the process, raise DataError instead"
        raise ShipidError(f"{where} calls sys.exit{words}: {remedy}") from None
    except (ShipidError, MemoryError):
        raise
    except Exception as error:
        place = error_location(error, kind)
        if not place:
            raise
        said = f": {error}" if str(error) else ""
        remedy = READ_ONLY if isinstance(error, ValueError) and "read-only" in said else ""
        raise ShipidError(f"{where}: {type(error).__name__}{said}{place}{remedy}") from error


def error_location(error: BaseException, kind: Callable[..., Any]) -> str:
    """Where in the file of a user's class or function an error arose, ` in FILE, line N`; empty if it did not there."""
    return line_in_file(error, definition_file(kind)) if is_user_code(kind) else ""


def line_in_file(error: BaseException, file: str) -> str:
    """Where in a file an error arose, ` in FILE, line N`; empty if it did not there."""
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == file]
    return f" in {file}, line {lines[-1]}" if lines else ""


def definition_location(function: Callable[..., Any]) -> str:
    """Where a user's function begins, ` in FILE, line N`; empty for one of shipid, and for what has no lines."""
    file, line = _file_and_line(function)
    return f" in {file}, line {line}" if line and is_user_code(function) else ""


def definition_file(kind: Callable[..., Any]) -> str:
    """File of a class or function; empty where there is none, as in a notebook."""
    return _file_and_line(kind)[0] or ""


def _file_and_line(kind: Callable[..., Any]) -> tuple[str | None, int]:
    """File of a class or function, and the first line of a function; no file where there is none, else 0."""
    kind = inspect.unwrap(unwrap_callable(kind))
    code = getattr(kind, "__code__", None)
    if code is not None:
        return code.co_filename, code.co_firstlineno
    return getattr(sys.modules.get(_module_name(kind)), "__file__", None), 0
