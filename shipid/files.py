"""Files that appear whole or not at all: text, JSON and tables, and a place to write any other kind."""

from __future__ import annotations

import errno
import json
import math
import os
import shlex
import shutil
import socket
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from shipid.errors import DataError, ResultError

if TYPE_CHECKING:
    import numpy as np
    from pandas import DataFrame
    from pyarrow import Table

TEMPORARY = ".shipid-"
"""Beginning of the names of temporary folders."""
TABLES = (".parquet", ".csv")
"""Endings of the files that `write_table` writes."""
_SWEPT: set[Path] = set()  # folders that this process has looked through: one of 10,000 files takes milliseconds
_KNOWN: set[Path] = set()  # folders in which this process has written


@contextmanager
def replace_whole(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path with the target's name: after the block it replaces the target; on an error it is removed.

    The path is alone in its folder, which is removed with all that the block makes there, and lies in that of the
    target, which is made if it is absent. A power cut leaves the old file or the new one. What a killed process leaves
    is removed by the next one that writes there. A link stays, and the file that it leads to is replaced. The new file
    has the permissions of the old one. OSError where the place cannot be written, and for a device or a pipe.
    """
    name, target = Path(target).name, Path(os.path.realpath(target))
    if target.exists() and not (target.is_file() or target.is_dir()):
        raise OSError(errno.EINVAL, "a device or a pipe: name a file to write", str(target))
    try:
        make_folder(target.parent)
        mode = stat.S_IMODE(target.stat().st_mode) if target.is_file() else None
        with temporary_folder(target.parent) as folder:
            temporary = folder / name
            yield temporary
            sync_to_disk(temporary)
            if mode is not None:
                with suppress(OSError):  # a file system without permissions
                    temporary.chmod(mode)
            os.replace(temporary, target)
        sync_to_disk(target.parent)
    except OSError as error:
        if error.errno is not None and TEMPORARY in str(error.filename or TEMPORARY):
            error.filename = str(target)  # a write that fails, as on a full disk, names no file, or the temporary one
        raise


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, synced to disk; OSError for one that was there, and has been moved away."""
    if not folder.is_dir():
        if Path(os.path.realpath(folder)) in _KNOWN:
            raise FileNotFoundError(errno.ENOENT, "the folder has gone: it was moved or removed", str(folder))
        make_folder(folder.parent)
        folder.mkdir(exist_ok=True)
        sync_to_disk(folder.parent)
    _KNOWN.add(Path(os.path.realpath(folder)))


def forget_folder(folder: Path) -> None:
    """Let a folder that is made anew, where one was moved away, be written to again."""
    whole = Path(os.path.realpath(folder))
    _KNOWN.difference_update([one for one in _KNOWN if whole in (one, *one.parents)])


def sync_to_disk(place: Path) -> None:
    """Wait until a file, or the entries of a folder, are on the disk; folders only where the system can."""
    try:
        handle = os.open(place, os.O_RDONLY if place.is_dir() else os.O_RDWR)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        # a folder that one may write into and not list, or a file system that does not sync folders
        if not place.is_dir() or error.errno not in (errno.EACCES, errno.EINVAL, errno.ENOTSUP):
            raise


@contextmanager
def temporary_folder(parent: Path) -> Iterator[Path]:
    """Give a folder for files that are not whole yet; the first of a process removes those that killed ones left."""
    if parent not in _SWEPT:
        _SWEPT.add(parent)
        sweep_temporary(parent)
    with tempfile.TemporaryDirectory(dir=parent, prefix=f"{TEMPORARY}{socket.gethostname()}-{os.getpid()}-") as folder:
        yield Path(folder)


def sweep_temporary(folder: Path) -> None:
    """Remove the temporary folders in a folder whose process is gone, or that are older than a day."""
    for place in folder.glob(f"{TEMPORARY}*"):
        words = place.name.removeprefix(TEMPORARY).rsplit("-", 2)
        with suppress(OSError):
            old = time.time() - place.stat().st_mtime > 86400
            here = len(words) == 3 and words[0] == socket.gethostname() and words[1].isdecimal()
            if old or (here and not is_alive(int(words[1]))):
                shutil.rmtree(place, ignore_errors=True)


def is_alive(process: int) -> bool:
    """Whether a process of this machine runs, or may run."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # one of another user
        pass
    return True


def quote_argument(file: str | os.PathLike[str]) -> str:
    """The path as one types it in a command: quoted where a shell needs it, and never taken for an option."""
    path = str(file)
    return shlex.quote(f"./{path}" if path.startswith("-") else path)


def write_text(file: Path, text: str) -> None:
    """Write a UTF-8 text file; bytes of a name of a file that are not UTF-8 are written out, as escapes."""
    with replace_whole(file) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def write_new(text: str, file: Path) -> Path:
    """Write a TOML document whole; DataError for another ending, and for one that exists."""
    if file.suffix != ".toml":
        raise DataError("is a TOML file: let the name end in .toml", file=file)
    if file.exists():
        raise DataError("exists already and is not written over: name another file to write", file=file)
    write_text(file, text)
    return file


def write_set(texts: Mapping[Path, str]) -> list[Path]:
    """Write text files of one folder that belong together, whole.

    A process that is killed leaves the old set, the new one or a set with files missing, never files of both.
    """
    with ExitStack() as replaced:
        for file, text in texts.items():
            temporary = replaced.enter_context(replace_whole(file))
            temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
            sync_to_disk(temporary)
        for file in texts:
            Path(os.path.realpath(file)).unlink(missing_ok=True)
        sync_to_disk(next(iter(texts)).parent)
    return list(texts)


def write_json(file: Path, content: Any) -> None:
    """Write plain data as JSON; a number that is not finite becomes null."""
    write_text(file, json_text(content))


def json_text(content: Any) -> str:
    """Write plain data, NumPy's numbers and paths among them, as the text of JSON; what is not finite is null."""
    return json.dumps(_json_values(content), indent=1)


def _json_values(value: Any) -> Any:
    """Content of JSON: mappings, lists and scalars of Python."""
    if isinstance(value, Mapping):
        return {str(key): _json_values(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_json_values(entry) for entry in value]
    if hasattr(value, "tolist"):  # of NumPy
        return _json_values(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def read_json(file: Path) -> Any:
    """Read JSON; ResultError if the file is missing, damaged or cannot be read."""
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultError(f"cannot be read ({error.strerror}): is this the folder of a run?", file=file) from None
    except (ValueError, RecursionError):
        raise ResultError("damaged: run the study again into a new folder", file=file) from None


def check_table(file: Path) -> None:
    """Raise DataError for a file ending that `write_table` does not write; call it before the work for the table."""
    if file.suffix not in TABLES:
        raise DataError(f"{file.suffix or 'no ending'}: write to a file ending in {' or '.join(TABLES)}", file=file)


def write_table(file: Path, frame: DataFrame) -> None:
    """Write a frame as Parquet or CSV, by the ending of the file."""
    check_table(file)
    with replace_whole(file) as temporary:
        if file.suffix == ".csv":
            frame.to_csv(temporary, index=False)
        else:
            with temporary.open("wb") as stream:  # Arrow takes no name that is not UTF-8
                frame.to_parquet(stream, index=False)


def read_arrow(source: Path | BinaryIO, columns: Sequence[str] | None = None) -> Table:
    """Read a Parquet file, or those of its columns that it has, in this thread alone.

    PyArrow would wait without end where no other may be started.
    """
    import pyarrow.parquet

    return pyarrow.parquet.ParquetFile(source, pre_buffer=False).read(columns, use_threads=False)


def write_arrays(file: Path, arrays: Mapping[str, np.ndarray], *, compressed: bool = False) -> None:
    """Write arrays by name as one `.npz` without pickles."""
    import numpy as np

    with replace_whole(file) as temporary, temporary.open("wb") as stream:
        (np.savez_compressed if compressed else np.savez)(stream, allow_pickle=False, **arrays)


def open_file(file: str | os.PathLike[str]) -> BinaryIO:
    """Open a file to be read; OSError for a device or a pipe, too, which might never give anything."""
    if Path(file).exists() and not (Path(file).is_file() or Path(file).is_dir()):
        raise OSError(errno.EINVAL, "a device or a pipe, not a file", str(file))
    return Path(file).open("rb")


def read_arrays(file: str | os.PathLike[str], *beginnings: str) -> dict[str, np.ndarray]:
    """Read the arrays of a `.npz`, or those whose names begin so; never a pickle.

    OSError if it cannot be opened, ValueError for anything else.
    """
    import numpy as np

    with open_file(file) as stream:
        try:
            with np.load(stream, allow_pickle=False) as stored:
                return {name: stored[name] for name in stored.files if name.startswith(beginnings or "")}
        except Exception as error:  # of the archive, its compression or the header of an array: any of a dozen
            raise ValueError(f"{file} is not a whole .npz: {error}") from error


def arrays_with_prefix(arrays: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """Arrays whose names begin with a prefix, by their names without it."""
    return {name.removeprefix(prefix): values for name, values in arrays.items() if name.startswith(prefix)}
