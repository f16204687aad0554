"""Digests of the files in a folder of results, so that damage is mended and an edit is never taken for a result.

`seals/NAME.sha256` holds a comment with the digest of the study and a line per file, as the tool `sha256sum` writes: in
the folder of a run, `sha256sum -c seals/*` checks it too. A unit of work counts as done when its seal is there, which
is written last.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from shipid.data.dataset import read_dataset
from shipid.errors import ResultError, ShipidError
from shipid.files import read_arrays, read_table, write_text

FOLDER, PROVENANCE = "seals", "provenance.json"
STUDY = "# study "  # begins the comment
FIRST = {"dataset": "dataset.parquet", "common": "test.npz", "results": "results.parquet"}
"""Name of a seal that is not of a unit of work -> the first file in it."""
WORDS = {
    **dict.fromkeys(("missing", "damaged"), "missing or damaged: continue with `shipid study resume`"),
    "edited": "was changed after it was written: put it back, or delete it and continue with `shipid study resume`",
    "foreign": "is of another study: delete it and {}, and continue with `shipid study resume`",
}


@dataclass(frozen=True)
class Fault:
    """A file that is not what was written: `missing`, `damaged` (no whole file of its kind) or `edited`.

    `foreign`: of another study, copied into this folder with its seal; `reason` names what belongs to it.
    """

    seal: str
    file: str
    kind: str
    reason: str = ""

    @property
    def words(self) -> str:
        """What is wrong, and what helps."""
        return WORDS[self.kind].format(self.reason)


def seal_file(folder: Path, name: str) -> Path:
    """Where the seal of a name is."""
    return folder / FOLDER / f"{name}.sha256"


def is_sealed(folder: Path, name: str) -> bool:
    """Whether there is a seal of this name."""
    return seal_file(folder, name).is_file()


def seal_names(folder: Path) -> set[str]:
    """Names of all seals; 10,000 take some milliseconds."""
    try:
        return {Path(entry).stem for entry in os.scandir(folder / FOLDER) if entry.name.endswith(".sha256")}
    except (FileNotFoundError, NotADirectoryError):
        return set()


def write_seal(folder: Path, name: str, files: Iterable[Path]) -> None:
    """Note the digests of files in the folder, which are on the disk already, under a name."""
    lines = [f"{STUDY}{_study(folder)}\n"]
    lines += [f"{_digest(file)}  {file.relative_to(folder).as_posix()}\n" for file in files]
    write_text(seal_file(folder, name), "".join(lines))


def remove_seal(folder: Path, name: str) -> None:
    """Remove a seal, before files that it names are written anew."""
    seal_file(folder, name).unlink(missing_ok=True)


def named_files(folder: Path, name: str) -> list[str]:
    """The files of a seal, by their paths in the folder; ValueError for a seal that is damaged."""
    return [path for _, path in _read(seal_file(folder, name))[1]]


def sealed_faults(folder: Path, among: str = "", names: Collection[str] = ()) -> list[Fault]:
    """Every sealed file that is not as it was written; a seal that is damaged itself is one.

    among : how the paths in the folder of the files begin that are looked at. names : of the seals; by default all.
    """
    wanted = sorted(name for name in seal_names(folder) if not names or name in names)
    return [fault for name in wanted for fault in _faults(folder, seal_file(folder, name), among)]


def check_seals(folder: Path, among: str = "") -> None:
    """Raise ResultError for the first of the `sealed_faults` of a folder; nothing is mended."""
    for fault in sealed_faults(folder, among):
        raise fault_error(folder, fault)


def fault_error(folder: Path, fault: Fault) -> ResultError:
    """The error for a file that is not as it was written."""
    return ResultError(fault.words, file=folder / fault.file)


def remove_damaged(folder: Path) -> list[str]:
    """Remove the seals of files that are missing or damaged, so that they are computed again; a sentence each.

    Raises ResultError, before anything is removed, for a file that can be read and is not what was written, and OSError
    for one that the system does not give: on a file server, or of another user, it may be whole.
    """
    damaged, sentences = sealed_faults(folder), []
    for fault in damaged:
        if fault.kind in ("edited", "foreign"):
            raise fault_error(folder, fault)
        if (folder / fault.file).is_dir():
            raise ResultError("is a folder where a file belongs: remove it and resume", file=folder / fault.file)
    for name in dict.fromkeys(fault.seal for fault in damaged):
        these = [fault for fault in damaged if fault.seal == name]
        for fault in these:
            (folder / fault.file).unlink(missing_ok=True)
        remove_seal(folder, name)
        sentences.append(f"{', '.join(f'{fault.file} {fault.kind}' for fault in these)}: computed again")
    return sentences


def _read(seal: Path) -> tuple[str, list[tuple[str, str]]]:
    """Digest of the study, and digests and paths of files, of a seal; ValueError where it is not whole."""
    name, (first, *lines) = seal.stem, seal.read_text(encoding="utf-8").splitlines() or [""]
    known = [(digest, path) for digest, path in (line.split("  ", 1) for line in lines)]
    inside = all(path and not Path(path).is_absolute() and ".." not in Path(path).parts for _, path in known)
    if not (first.startswith(STUDY) and known and inside and all(len(digest) == 64 for digest, _ in known)):
        raise ValueError("no seal")
    if known[0][1] != FIRST.get(name, f"batches/{name}.json"):
        raise ValueError("of another name")
    return first.removeprefix(STUDY), known


def _faults(folder: Path, seal: Path, among: str) -> Iterator[Fault]:
    name, place = seal.stem, f"{FOLDER}/{seal.name}"
    try:
        study, known = _read(seal)
    except (FileNotFoundError, ValueError):
        yield Fault(name, place, "damaged")
        return
    for number, (digest, path) in enumerate(known):
        if not path.startswith(among):
            continue
        try:
            if _digest(folder / path) != digest:
                yield Fault(name, path, "edited" if _readable(folder / path) else "damaged")
            elif number == 0 and study != (_study(folder) or study):
                yield Fault(name, path, "foreign", place if name in FIRST else f"trials/{name}.log")
        except (FileNotFoundError, NotADirectoryError):
            yield Fault(name, path, "missing")
        except IsADirectoryError:
            yield Fault(name, path, "damaged")


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _study(folder: Path) -> str | None:
    """Digest of the study of a folder, by its provenance; None where it does not say so, which others report."""
    try:
        return str(json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["digest"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


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
