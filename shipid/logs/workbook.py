"""Workbooks of Excel (.xlsx) and OpenDocument (.ods): a sheet as lines of text, which are read as those of a text log.

python-calamine reads them, `pip install 'shipid[sheet]'`.
"""

from __future__ import annotations

import csv
import io
import re
import zipfile
from datetime import date, datetime, timedelta
from datetime import time as time_of_day
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipid.errors import DataError, suggest_name

if TYPE_CHECKING:
    from python_calamine import CalamineSheet, CalamineWorkbook

SEPARATOR = "\t"
WIDEST = 10_000  # cells of a line: more is no log
LARGEST = 2_000_000_000  # bytes of a workbook once unpacked: some twenty million cells
LARGE_PART, SQUEEZED = 20_000_000, 100  # bytes of a part, and times its packed size: a sheet is squeezed 5 to 30 times
FIRST_YEAR = 1904  # of dates of a workbook, 1900 or 1904: no log has one
_STARTS = re.compile(
    rb"PK\x03\x04(?:.{26}mimetypeapplication/vnd\.oasis\.opendocument\.spreadsheet|"
    rb"(?!.{0,4000}?(?:word|ppt|visio)/[A-Za-z_]).{0,4000}?(?:\[Content_Types\]\.xml|xl/))",
    re.DOTALL,
)


def is_workbook(head: bytes) -> bool:
    """Whether a file with these first bytes is a workbook of Excel or OpenDocument."""
    return _STARTS.match(head) is not None


def check_width(cells: int, file: Path) -> None:
    """Raise DataError where a line has more cells than that of any log."""
    if cells > WIDEST:
        raise DataError(
            f"a line of more than {WIDEST} cells, more than a log has columns: is the table transposed?", file=file
        )


def sheets_with_values(file: Path) -> list[str]:
    """The names of the sheets of a workbook that have values, the one with most cells first; hidden ones last.

    Raises DataError where none has any, the file is damaged, or python-calamine is not installed.
    """
    book = _open_workbook(file)
    cells = {name: sheet.height * sheet.width for name in book.sheet_names for sheet in [_open_sheet(book, name, file)]}
    hidden = {one.name: not str(one.visible).endswith(".Visible") for one in book.sheets_metadata}
    names = sorted((name for name in cells if cells[name]), key=lambda name: (hidden[name], -cells[name]))
    if not names:
        raise DataError("no sheet of this workbook has a cell with a value", file=file)
    return names


def sheet_text(file: Path, name: str) -> str:
    """A sheet as lines of cells with a tab between them; line k is row k. Empty columns on the left are left out.

    Dates are as in ISO 8601, durations in seconds. Raises DataError where no sheet has this name.
    """
    book = _open_workbook(file)
    if name not in book.sheet_names:
        raise DataError(f"no sheet {name!r}: {suggest_name(name, book.sheet_names)}", file=file, path="format.sheet")
    sheet = _open_sheet(book, name, file)
    check_width(sheet.width, file)
    first = sheet.start[1] if sheet.start is not None else 0
    lines = io.StringIO()
    writer = csv.writer(lines, delimiter=SEPARATOR, lineterminator="\n")
    for row in sheet.to_python(skip_empty_area=False):
        writer.writerow([_cell_text(cell) for cell in row[first:]])
    return lines.getvalue()


def _open_workbook(file: Path) -> CalamineWorkbook:
    try:
        from python_calamine import CalamineError, CalamineWorkbook
    except ImportError:
        raise DataError(
            "a workbook needs python-calamine: pip install 'shipid[sheet]', or save its sheet as CSV",
            file=file,
            path="format.kind",
        ) from None
    try:
        with zipfile.ZipFile(file) as packed:
            parts = packed.infolist()
        size = sum(part.file_size for part in parts)
        if any(part.file_size > max(LARGE_PART, SQUEEZED * part.compress_size) for part in parts):
            raise DataError("a part of this workbook unpacks as no sheet does: save its sheet as CSV", file=file)
        if size > LARGEST:
            raise DataError(
                f"a workbook of {size / 1e9:.1f} GB once unpacked: save its sheet as CSV, which is read by parts",
                file=file,
            )
        return CalamineWorkbook.from_filelike(io.BytesIO(file.read_bytes()))  # by content, whatever its name is
    except (CalamineError, zipfile.BadZipFile, ValueError) as error:
        raise _damaged_workbook(error, file) from None


def _open_sheet(book: CalamineWorkbook, name: str, file: Path) -> CalamineSheet:
    from python_calamine import CalamineError

    try:
        return book.get_sheet_by_name(name)
    except CalamineError as error:
        raise _damaged_workbook(error, file) from None


def _damaged_workbook(error: Exception, file: Path) -> DataError:
    message = f"not a workbook (.xlsx, .ods), or damaged ({type(error).__name__}): set [format] kind"
    return DataError(message, file=file, path="format.kind")


def _cell_text(cell: Any) -> str:
    if isinstance(cell, bool):
        return str(cell).upper()
    if isinstance(cell, date) and cell.year <= FIRST_YEAR:  # a time of day after a midnight
        return (cell if isinstance(cell, datetime) else datetime.combine(cell, time_of_day())).time().isoformat()
    if isinstance(cell, datetime):
        return cell.isoformat(sep=" ")
    if isinstance(cell, date | time_of_day):
        return cell.isoformat()
    if isinstance(cell, timedelta):
        cell = cell.total_seconds()
    if isinstance(cell, float):
        return repr(cell).removesuffix(".0")
    return " ".join(str(cell).split())
