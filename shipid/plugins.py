"""What packages installed beside shipid, and files that a user tries, add to its registries.

A package names its members in its metadata, such as `[project.entry-points."shipid.terms"]` with
`"thruster.jet" = "shipid_jet:JET"`. Names are known without an import; a member is loaded when a document names it.

Also which code runs, of shipid and of a user: its digest, and where in a user's file a mistake arose.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any, Self, TypeVar

from shipid.errors import ShipidError

Member = TypeVar("Member")
REGISTRIES: dict[str, Registry[Any]] = {}
"""Group of entry points -> the registry that they add to."""
TRIED_FILES: list[Path] = []
"""Files that this process has run by `import_files`, the first one first."""


class Registry(dict[str, Member]):
    """Members by name: those of shipid, those put in since, and those of installed packages that were named.

    Iteration is over what is loaded; `in`, `get` and `[...]` know the names of installed packages, too.

    group : of the entry points. fault : what an object lacks to be a member, one sentence; empty for nothing.
    check : raises ShipidError for the name of a member of a package that cannot be used.
    """

    def __init__(self, group: str, fault: Callable[[Any], str]) -> None:
        super().__init__()
        self.group, self.fault = group, fault
        self.check: Callable[[str], object] = str
        self.added: set[str] = set()
        REGISTRIES[group] = self

    def __setitem__(self, name: str, member: Member) -> None:
        if fault := self.fault(member):
            raise ShipidError(f"{name!r} in {self.group}: {fault}")
        self.added.add(name)
        super().__setitem__(name, member)

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in self.offers

    def __missing__(self, name: str) -> Member:
        """Load what a package offers by this name; KeyError where none does, ShipidError where it cannot be used."""
        entry, *others = self.offers[name]
        fault = f"the package {others[0].dist.name} has the name, too: uninstall one" if others else ""
        try:
            member: Any = fault or entry.load()
            fault = fault or self.fault(member)
            super().__setitem__(name, member)
            _ = fault or self.check(name)
        except (Exception, SystemExit) as error:  # whatever the code of a package does
            fault = describe_error(error)
        if fault:
            self.pop(name, None)
            raise ShipidError(_fault_words(entry, fault))
        return super().__getitem__(name)

    @cached_property
    def offers(self) -> dict[str, list[Any]]:
        """Name -> entry points of installed packages; a name that shipid has stays its own, with a warning."""
        found: dict[str, list[Any]] = {}
        for entry in installed_entries().select(group=self.group):
            if super().__contains__(entry.name):
                log_warning(_fault_words(entry, "the name is taken"))
            else:
                found.setdefault(entry.name, []).append(entry)
        return found

    @property
    def names(self) -> list[str]:
        """Every name, of what is loaded and of what is not."""
        return list(dict.fromkeys([*self, *self.offers]))

    def get(self, name: str, default: Any = None) -> Member | None:  # type: ignore[override]
        """The member of a name, or the default."""
        return self[name] if name in self else default  # noqa: SIM401 - `dict.get` loads nothing

    def load_all(self) -> Self:
        """The registry with all that packages offer; a warning, once, for each that cannot be used."""
        for name in self.names:
            try:
                self[name]
            except ShipidError as error:
                log_warning(str(error))
        return self

    def name_of(self, member: Member) -> str | None:
        """Name of a member; None for an object that is none."""
        here = [name for name, one in self.items() if one is member]
        return next(iter(here or [name for name, one in self.load_all().items() if one is member]), None)


@cache
def installed_entries() -> Any:
    """Entry points of all packages that this process can import, read once."""
    from importlib.metadata import entry_points  # takes longer than all else here

    return entry_points()


@cache
def log_warning(words: str) -> None:
    """Log a warning at its first call with these words."""
    logging.getLogger(__name__).warning("%s", words)


def _fault_words(entry: Any, fault: str) -> str:
    where = f"{entry.value} of the package {entry.dist.name} {entry.dist.version}"
    return f"{entry.name!r} in {entry.group}, {where}, is left out: {fault}"


def describe_error(error: BaseException) -> str:
    """An error of code that is not shipid's, on one line."""
    kind = "" if isinstance(error, ShipidError) else f"{type(error).__name__}: "
    return kind + " ".join(str(error).split())


def fault_of_kind(kind: Any, member: object) -> str:
    """What an object lacks to be of a class, one sentence; empty for nothing."""
    return "" if isinstance(member, kind) else f"must be a {kind.__name__} of {kind.__module__}, not {member!r}"


@cache
def import_user_module(name: str, file: str = "") -> ModuleType:
    """A module of a file, which may import its neighbours, or one that Python finds; ShipidError where it raises.

    A file that has the name of another module is run, and does not take its place.
    """
    try:
        sys.path[:0] = [str(Path(file).parent)] if file else []
        module = import_module(name)
        if file and Path(getattr(module, "__file__", None) or "").resolve() != Path(file).resolve():
            spec: Any = spec_from_file_location(name, file)
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever the user wrote
        remedy = "" if file else f"; write {name}.py beside the document, or install its package"
        words = f"cannot be imported: {describe_error(error)}{line_in_file(error, file)}{remedy}"
        raise ShipidError(words, file=file or name) from None
    return module


def import_files(files: Iterable[Path]) -> None:
    """Run files that put members into registries, each as a module of its name; workers then run them, too.

    ShipidError, one line, for one that is not there, has the name of another module, or raises.
    """
    for file in files:
        path = file.resolve()
        if not path.is_file():
            raise ShipidError("no such file: on a cluster each machine needs it", file=file, path="--with")
        if import_user_module(path.stem, str(path)) is not sys.modules[path.stem]:
            raise ShipidError(f"{path.stem!r} is the name of another module: rename it", file=file, path="--with")
        TRIED_FILES.extend({path} - {*TRIED_FILES})


def added_members() -> list[bytes]:
    """What was put into registries of this process, for `add_members` of a worker; without what cannot be sent."""
    found = []
    for group, registry in REGISTRIES.items():
        for name in registry.added.intersection(registry):
            with suppress(Exception):  # a function in a function, for example
                found.append(pickle.dumps((group, name, registry[name])))
    return found


def add_members(members: Iterable[bytes]) -> None:
    """Put what another process has added into the registries of this one; without what cannot be imported here."""
    for one in members:
        with suppress(Exception):  # a function of a cell, for example: an error names it when it is needed
            group, name, member = pickle.loads(one)
            REGISTRIES[group][name] = member


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
