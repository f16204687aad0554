"""What no log can be, found before it is read: devices and pipes, and headers of very many columns."""

from __future__ import annotations

from pathlib import Path

from shipid.errors import DataError

MOST_COLUMNS = 10_000
LOOKED_AT = 2**20  # bytes in which the first line ends
SEPARATORS = (b",", b";", b"\t", b"|", b" ")


def check_log(file: Path) -> None:
    """Raise DataError for a device, a pipe or a socket, and for a first line of more than `MOST_COLUMNS` columns.

    A file that is missing or cannot be opened is left to its reader, which says so.
    """
    if file.exists() and not file.is_file() and not file.is_dir():
        raise DataError("is a device or a pipe, which has no end: write it to a file first", file=file)
    try:
        with file.open("rb") as stream:
            line = stream.read(LOOKED_AT).split(b"\n", 1)[0]
    except OSError:
        return
    if line.startswith((b"PAR1", b"MATLAB")):
        return
    most = max(line.count(separator) for separator in SEPARATORS)
    if most > MOST_COLUMNS:
        message = f"more than {MOST_COLUMNS:,} columns in the first line: write the columns that are needed to a file"
        raise DataError(message, file=file)
