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

from shipid.errors import DataError, choices

if TYPE_CHECKING:
    from python_calamine import CalamineSheet, CalamineWorkbook

SEPARATOR = "\t"
WIDEST = 10_000  # cells of a line: more is no log
LARGEST = 2_000_000_000  # bytes of a workbook once unpacked: some twenty million cells
FIRST_YEAR = 1904  # of dates of a workbook, 1900 or 1904: no log has one
_STARTS = re.compile(
    rb"PK\x03\x04(?:.{26}mimetypeapplication/vnd\.oasis|.{0,4000}?(?:\[Content_Types\]\.xml|xl/))", re.DOTALL
)


def is_workbook(head: bytes) -> bool:
    """Whether a file with these first bytes is a workbook of Excel or OpenDocument."""
    return _STARTS.match(head) is not None


def check_width(cells: int, file: Path) -> None:
    """Raise DataError where a line has more cells than that of any log."""
    if cells > WIDEST:
        raise DataError(
            f"a line of {cells} cells: a log has {WIDEST} columns at most; is the table transposed?", file=file
        )


def sheets_of(file: Path) -> list[str]:
    """Return the names of the sheets of a workbook that have values, the one with most cells first; hidden ones last.

    Raises
    ------
    DataError : no sheet has any, not a workbook or a damaged one, or python-calamine is not installed.
    """
    book = _opened(file)
    cells = {name: sheet.height * sheet.width for name in book.sheet_names for sheet in [_sheet(book, name, file)]}
    hidden = {one.name: not str(one.visible).endswith(".Visible") for one in book.sheets_metadata}
    names = sorted((name for name in cells if cells[name]), key=lambda name: (hidden[name], -cells[name]))
    if not names:
        raise DataError("no sheet of this workbook has a cell with a value", file=file)
    return names


def sheet_text(file: Path, name: str) -> str:
    """Return a sheet as lines of cells with a tab between them; line k is row k.

    Columns without a value on the left are left out. Numbers have all digits. Dates are written as in ISO 8601,
    durations in seconds; a cell of several lines is one line.

    Raises
    ------
    DataError : no sheet has this name; else as of `sheets_of`.
    """
    book = _opened(file)
    if name not in book.sheet_names:
        raise DataError(f"no sheet {name!r}: {choices(name, book.sheet_names)}", file=file, path="format.sheet")
    sheet = _sheet(book, name, file)
    check_width(sheet.width, file)
    first = sheet.start[1] if sheet.start is not None else 0
    lines = io.StringIO()
    writer = csv.writer(lines, delimiter=SEPARATOR, lineterminator="\n")
    for row in sheet.to_python(skip_empty_area=False):
        writer.writerow([_written(cell) for cell in row[first:]])
    return lines.getvalue()


def _opened(file: Path) -> CalamineWorkbook:
    try:
        from python_calamine import CalamineError, CalamineWorkbook
    except ImportError:
        message = "a workbook needs python-calamine: pip install 'shipid[sheet]', or save its sheet as CSV"
        raise DataError(message, file=file, path="format.kind") from None
    try:
        with zipfile.ZipFile(file) as packed:
            size = sum(part.file_size for part in packed.infolist())
        if size > LARGEST:
            message = f"a workbook of {size / 1e9:.1f} GB once unpacked: save its sheet as CSV, which is read by parts"
            raise DataError(message, file=file)
        return CalamineWorkbook.from_filelike(io.BytesIO(file.read_bytes()))  # by content, whatever its name is
    except (CalamineError, zipfile.BadZipFile, ValueError) as error:
        raise _damaged(error, file) from None


def _sheet(book: CalamineWorkbook, name: str, file: Path) -> CalamineSheet:
    from python_calamine import CalamineError

    try:
        return book.get_sheet_by_name(name)
    except CalamineError as error:
        raise _damaged(error, file) from None


def _damaged(error: Exception, file: Path) -> DataError:
    message = f"not a workbook (.xlsx, .ods), or damaged ({type(error).__name__}): set [format] kind"
    return DataError(message, file=file, path="format.kind")


def _written(cell: Any) -> str:
    """Return a cell as text."""
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
