"""Folders of results: one writer, and digests of their files, so that what was changed is never taken for a result.

`seals/NAME.sha256` holds a comment with the digest of the study and a line per file, as the tool `sha256sum` writes: in
the folder of a run, `sha256sum -c seals/*` checks it too. A unit of work counts as done when its seal is there, which
is written last. The lock of the writer is the operating system's: it ends with its process, whatever ends that.
"""

from __future__ import annotations

import errno
import hashlib
import json
import logging
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock, Timeout

from shipid.errors import ResultError
from shipid.files import write_text

FOLDER, PROVENANCE = "seals", "provenance.json"
STUDY = "# study "  # begins the comment
FIRST = {"dataset": "dataset.parquet", "common": "test.npz", "results": "results.parquet"}
"""Name of a seal that is not of a unit of work -> the first file in it."""
WORDS = {
    "missing": "missing: `shipid study resume` computes it again",
    "changed": (
        "was changed after it was written, is damaged, or is of another study: put it back, or delete it and continue "
        "with `shipid study resume`"
    ),
}


@dataclass(frozen=True)
class Fault:
    """A file that is `missing`, or `changed`: not what was written, or of another study."""

    seal: str
    file: str
    kind: str

    @property
    def words(self) -> str:
        """What is wrong, and what helps."""
        return WORDS[self.kind]


def seal_file(folder: Path, name: str) -> Path:
    """Where the seal of a name is."""
    return folder / FOLDER / f"{name}.sha256"


def is_sealed(folder: Path, name: str) -> bool:
    """Whether there is a seal of this name."""
    return seal_file(folder, name).is_file()


def seal_names(folder: Path) -> set[str]:
    """Names of all seals."""
    return {file.stem for file in (folder / FOLDER).glob("*.sha256")}


def write_seal(folder: Path, name: str, files: Iterable[Path]) -> None:
    """Note the digests of files in the folder, which are on the disk already, under a name."""
    lines = [f"{STUDY}{study_digest(folder)}\n"]
    lines += [f"{_digest(file)}  {file.relative_to(folder).as_posix()}\n" for file in files]
    write_text(seal_file(folder, name), "".join(lines))


def remove_seal(folder: Path, name: str) -> None:
    """Remove a seal, before files that it names are written anew."""
    seal_file(folder, name).unlink(missing_ok=True)


def named_files(folder: Path, name: str) -> list[str]:
    """The files of a seal, by their paths in the folder; ValueError for a seal that is damaged."""
    return [path for _, path in _read(seal_file(folder, name))[1]]


def sealed_faults(folder: Path, among: str = "", names: Collection[str] = ()) -> list[Fault]:
    """Every sealed file that is not as it was written, and every seal; OSError for one that cannot be read.

    among : how the paths in the folder begin that are looked at. names : of the seals; by default all.
    """
    digest = study_digest(folder)
    return [fault for name in sorted(names or seal_names(folder)) for fault in _faults(folder, name, among, digest)]


def check_seals(folder: Path, among: str = "", names: Collection[str] = ()) -> None:
    """Raise ResultError for the first of the `sealed_faults` of a folder."""
    for fault in sealed_faults(folder, among, names):
        raise fault_error(folder, fault)


def fault_error(folder: Path, fault: Fault) -> ResultError:
    """The error for a file that is not as it was written."""
    return ResultError(fault.words, file=folder / fault.file)


def unseal_missing(folder: Path) -> list[str]:
    """Remove the seals of files that are missing, so that they are computed again; a sentence each.

    Raises ResultError, before anything is removed, for a file that is not what was written.
    """
    faults = sealed_faults(folder)
    for fault in faults:
        if fault.kind != "missing":
            raise fault_error(folder, fault)
    for fault in faults:
        (folder / fault.file).unlink(missing_ok=True)  # a link that leads nowhere
        remove_seal(folder, fault.seal)
    return [f"{fault.file} missing: computed again" for fault in faults]


def _read(seal: Path) -> tuple[str, list[tuple[str, str]]]:
    """Digest of the study, and digests and paths of files, of a seal; ValueError where it is not whole."""
    name, (first, *lines) = seal.stem, seal.read_text(encoding="utf-8").splitlines() or [""]
    known = [(digest, path) for digest, path in (line.split("  ", 1) for line in lines)]
    inside = all(path and not Path(path).is_absolute() and ".." not in Path(path).parts for _, path in known)
    begins = known[:1] and known[0][1] == FIRST.get(name, f"batches/{name}.json")
    if not (first.startswith(STUDY) and begins and inside):
        raise ValueError("no seal, or of another name")
    return first.removeprefix(STUDY), known


def _faults(folder: Path, name: str, among: str, digest_of_study: str | None) -> Iterator[Fault]:
    seal = seal_file(folder, name)
    try:
        study, known = _read(seal)
    except (FileNotFoundError, ValueError):
        yield Fault(name, f"{FOLDER}/{seal.name}", "changed")
        return
    foreign = study != (digest_of_study or study)
    for digest, path in known:
        if path.startswith(among):
            try:
                if _digest(folder / path) != digest or (foreign and path == known[0][1]):
                    yield Fault(name, path, "changed")
            except (FileNotFoundError, NotADirectoryError):
                yield Fault(name, path, "missing")
            except IsADirectoryError:
                yield Fault(name, path, "changed")


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def study_digest(folder: Path) -> str | None:
    """Digest of the study of a folder, by its provenance; None where it does not say so, which others report."""
    try:
        return str(json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["digest"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


WRITER, PAGES = "writer", "pages"  # locks: on all that a run computes, and on its tables and pages
NO_LOCKS = (errno.ENOSYS, errno.ENOTSUP, errno.ENOLCK)  # what a file system says that has none

log = logging.getLogger(__name__)


@contextmanager
def sole_writer(folder: Path, name: str = WRITER, *, wait: bool = False) -> Iterator[None]:
    """Keep other processes out of a folder, or wait until they have left it.

    Where the file system has no locks there is a warning, and nobody is kept out.

    Raises ResultError where another process is in the folder.
    """
    lock = FileLock(folder / f".{name}.lock", blocking=wait, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        raise ResultError("another process works in it: wait until it has ended, or end it", file=folder) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        log.warning("%s is on a file system without locks: let one process at a time work in it", folder)
    try:
        yield
    finally:
        lock.release()


def has_writer(folder: Path) -> bool:
    """Whether a process works in a folder; False where the folder cannot be locked, such as one that is read only."""
    try:
        with FileLock(folder / f".{WRITER}.lock", blocking=False, fallback_to_soft=False):
            return False
    except Timeout:
        return True
    except OSError:
        return False
