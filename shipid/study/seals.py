"""Digests of the files in a folder of results, so that damage is mended and an edit is never taken for a result.

`seals/NAME.sha256` holds a comment with the digest of the study and a line per file, as the tool `sha256sum` writes: in
the folder of a run, `sha256sum -c seals/*` checks it too. A batch counts as done when its seal is there, which is
written last.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from shipid.data.dataset import read_dataset
from shipid.errors import ResultError, ShipidError
from shipid.files import read_arrays, read_table, write_text

FOLDER, PROVENANCE = "seals", "provenance.json"
STUDY = "# study "  # begins the comment
TRIES = 10  # looks at files that other processes may write at the same time
FIRST = {"dataset": "dataset.parquet", "common": "test.npz", "results": "results.parquet"}
"""Name of a seal that is not of a batch -> the first file in it."""


@dataclass(frozen=True)
class Fault:
    """A file that is not what was written: `missing`, `damaged` (no whole file of its kind) or `edited`.

    `foreign`: of another study, copied into this folder with its seal; `reason` names what belongs to it.
    `unreadable`: the system does not let this user read it, or the disk fails; it may be whole, and `reason` says why.
    """

    seal: str
    file: str
    kind: str
    reason: str = ""


def seal_file(folder: Path, name: str) -> Path:
    """Where the seal of a name is."""
    return folder / FOLDER / f"{name}.sha256"


def is_sealed(folder: Path, name: str) -> bool:
    """Whether there is a seal of this name."""
    return seal_file(folder, name).is_file()


def sealed(folder: Path) -> set[str]:
    """Names of all seals."""
    try:
        return {entry.name.removesuffix(".sha256") for entry in os.scandir(folder / FOLDER)}
    except FileNotFoundError:
        return set()


def write_seal(folder: Path, name: str, files: Iterable[Path]) -> None:
    """Note the digests of files in the folder, which are on the disk already, under a name.

    They are compared once more: a process that was held up may have written the same files meanwhile. Raises
    ResultError where they go on changing, or the first file is not the one that the name asks for.
    """
    files = list(files)
    for _ in range(TRIES):
        lines = [f"{STUDY}{study}\n"] if (study := _study(folder)) else []
        lines += [f"{_digest(file)}  {file.relative_to(folder).as_posix()}\n" for file in files]
        write_text(seal_file(folder, name), "".join(lines))
        if not any(_faults(folder, seal_file(folder, name))):
            return
    remove(folder, name)
    raise ResultError("changes while it is stored: end the program that writes to it, then resume", file=files[0])


def remove(folder: Path, name: str) -> None:
    """Remove a seal, before files that it names are written anew."""
    seal_file(folder, name).unlink(missing_ok=True)


def faults(folder: Path, among: str = "") -> list[Fault]:
    """Every sealed file that is not as it was written; a seal that is damaged itself is one.

    among : how the paths in the folder of the files begin that are looked at, by default of all.
    """
    return [fault for file in sorted((folder / FOLDER).glob("*.sha256")) for fault in _faults(folder, file, among)]


def check(folder: Path, among: str = "") -> None:
    """Raise ResultError for the first of the `faults` of a folder; nothing is mended."""
    for fault in faults(folder, among):
        raise wrong(folder, fault)


def wrong(folder: Path, fault: Fault) -> ResultError:
    """The error for a file that is not as it was written."""
    if fault.kind == "unreadable":
        remedy = "let this user read it, or delete it and continue with `shipid study resume`"
        return ResultError(f"cannot be read ({fault.reason}): {remedy}", file=folder / fault.file)
    if fault.kind == "foreign":
        message = f"is of another study: delete it and {fault.reason}, and continue with `shipid study resume`"
        return ResultError(message, file=folder / fault.file)
    if fault.kind != "edited":
        return ResultError("missing or damaged: continue with `shipid study resume`", file=folder / fault.file)
    message = "was changed after it was written: put it back, or delete it and continue with `shipid study resume`"
    return ResultError(message, file=folder / fault.file)


def mend(folder: Path) -> Iterator[str]:
    """Remove the seals of files that are missing or damaged, so that they are computed again; yield a sentence each.

    Raises ResultError, before anything is removed, for a file that can be read and is not what was written, and for one
    that cannot be read: on a file server, or of another user, it may be whole.
    """
    if damaged := faults(folder):
        again = faults(folder)  # another process may just have written some of these files
        damaged = [fault for fault in damaged if fault in again]
    for fault in damaged:
        if fault.kind in ("edited", "unreadable", "foreign"):
            raise wrong(folder, fault)
        if (folder / fault.file).is_dir():
            raise ResultError("is a folder where a file belongs: remove it and resume", file=folder / fault.file)
    for name in dict.fromkeys(fault.seal for fault in damaged):
        these = [fault for fault in damaged if fault.seal == name]
        for fault in these:
            (folder / fault.file).unlink(missing_ok=True)
        remove(folder, name)
        words = ", ".join(f"{fault.file} {fault.kind}" for fault in these)
        yield f"{words}: computed again"


def _faults(folder: Path, seal: Path, among: str = "") -> Iterator[Fault]:
    name, study = seal.name.removesuffix(".sha256"), None
    try:
        lines = seal.read_text(encoding="utf-8").splitlines()
        if lines and lines[0].startswith(STUDY):
            study = lines.pop(0).removeprefix(STUDY)
        known = [(digest, path) for digest, path in (line.split("  ", 1) for line in lines)]
        whole = known and all(len(digest) == 64 and _inside(path) for digest, path in known)
        whole = whole and known[0][1] == FIRST.get(name, f"batches/{name}.json")
    except (FileNotFoundError, ValueError):
        known, whole = [], False
    except OSError as error:
        yield Fault(name, f"{FOLDER}/{seal.name}", "unreadable", error.strerror or str(error))
        return
    if not whole:
        yield Fault(name, f"{FOLDER}/{seal.name}", "damaged")
        return
    first = known[0][1]
    for digest, path in known:
        if not path.startswith(among):
            continue
        try:
            if _digest(folder / path) != digest:
                yield Fault(name, path, "edited" if _readable(folder / path) else "damaged")
            elif path == first and study not in (None, _study(folder) or study):
                yield Fault(name, path, "foreign", f"{FOLDER}/{seal.name}" if name in FIRST else f"trials/{name}.log")
            elif study is None and path.startswith("cells/") and _is_foreign(folder, folder / path):
                yield Fault(name, path, "foreign", f"trials/{name}.log")
        except (FileNotFoundError, NotADirectoryError):
            yield Fault(name, path, "missing")
        except OSError as error:
            if os.path.isdir(folder / path):
                yield Fault(name, path, "damaged")
            else:
                yield Fault(name, path, "unreadable", error.strerror or str(error))


def _inside(path: str) -> bool:
    return bool(path) and not Path(path).is_absolute() and ".." not in Path(path).parts


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _study(folder: Path) -> str | None:
    """Digest of the study of a folder, by its provenance; None where it does not say so."""
    try:
        return str(json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["digest"])
    except (OSError, ValueError, KeyError, TypeError):
        return None  # said elsewhere


def _is_foreign(folder: Path, cell: Path) -> bool:
    """Whether a predictor, whose seal is of an earlier version, names another study; one that names none does not."""
    try:
        header = json.loads(str(read_arrays(cell, "header")["header"]))
        return header["provenance"].get("digest") not in (None, _study(folder))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False  # said elsewhere


def _readable(file: Path) -> bool:
    """Whether a file is a whole one of its kind, so that another digest is an edit and no damage."""
    try:
        _READERS.get(file.suffix, Path.read_text)(file)
    except (OSError, ValueError, RecursionError, ShipidError):
        return False
    return True


_READERS: dict[str, Callable[[Path], object]] = {
    ".json": lambda file: json.loads(file.read_text(encoding="utf-8")),
    ".npz": read_arrays,
    ".parquet": lambda file: read_dataset(file) if file.name == "dataset.parquet" else read_table(file),
}
