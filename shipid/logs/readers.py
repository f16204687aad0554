"""Readers: a log as a table of columns named as in the log, from text, a sheet, Parquet, MATLAB or NMEA 0183.

A reader is a row of `READERS`. Values are as written; the mapping gives units and meaning.
"""

from __future__ import annotations

import csv
import io
import itertools
import operator
import re
import stat
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow

from shipid.errors import DataError
from shipid.files import read_arrow
from shipid.logs.dataflash import is_dataflash, read_dataflash
from shipid.logs.foreign import ENOUGH, refuse_foreign
from shipid.logs.formats import (
    LOOKED_AT,
    Format,
    MatFormat,
    NmeaFormat,
    ParquetFormat,
    SheetFormat,
    TextFormat,
    TopicsFormat,
)
from shipid.logs.mat import is_mat, read_mat
from shipid.logs.nmea import is_nmea, read_nmea
from shipid.logs.rosbag import is_bag, read_bag
from shipid.logs.topics import TopicReader, reads_topics, topic_rows
from shipid.logs.ulog import is_ulog, read_ulog
from shipid.logs.workbook import check_width, is_workbook, sheet_text, sheets_with_values
from shipid.plugins import Registry, fault_of_kind, locate_errors

LONGEST_LINE = 8_000_000  # bytes: more is no log
LARGE = 4_000_000  # bytes: a longer text is read by blocks, and only the columns that are asked for
ROWS_AT_ONCE = 2_000  # of a text, whose cells are Python's until they are a column; 50,000 take a third more time
Progress = Callable[[float], None]


def require_file(file: Path) -> int:
    """The size of a file in bytes; raises DataError where it is no file: absent, a folder, a device, a pipe."""
    try:
        state = file.stat()
        if stat.S_ISDIR(state.st_mode):
            raise DataError("cannot be read (it is a folder)", file=file)
        if not stat.S_ISREG(state.st_mode):
            raise DataError("a device or a pipe, not a file: save its output to a file first", file=file)
        return state.st_size
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None


def read_log_table(
    file: Path, form: Format, clock: str, columns: Iterable[str] = (), progress: Progress | None = None
) -> pd.DataFrame:
    """Read a log as its format says; `attrs["unreadable"]` counts the skipped lines, `attrs["notes"]` has sentences.

    `attrs["other"]` says of each column that cannot be read what it is, and the remedy.

    clock : name of the column of time. columns : names of the others that are needed.
    progress : called with the share of a large log that has been read, 0 to 1.
    Raises DataError with the log, the key of the format or the row, and what would be right.
    """
    size = require_file(file)
    if size == 0:
        raise DataError("the file is empty", file=file)
    try:
        if not (getattr(form, "skip_rows", 0) or READERS[form.kind].topics):
            refuse_foreign(file)
        table: pd.DataFrame | None = None
        if isinstance(form, TextFormat) and size > LARGE and columns:
            table = _large_text(file, form, {clock, *columns}, progress, size)
        if table is None:
            reader = READERS[form.kind]
            with locate_errors(f"the reader {form.kind!r}", reader.read, "reader"):
                table = reader.read(file, form, (clock, *columns), progress)
            if not isinstance(table, pd.DataFrame):  # of a package
                raise DataError(f"the reader {form.kind!r} gives {type(table).__name__}, no table", file=file)
    except OSError as error:
        if error.errno is None:  # of a library, not of the system
            raise DataError(
                f"no file of kind {form.kind!r}, or damaged: set [format] kind", file=file, path="format.kind"
            ) from None
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None
    if len(table) < 2:
        raise DataError(f"a header and {len(table)} rows: a log needs two rows or more", file=file)
    return table


def in_points(text: pd.Series[Any], decimal: str, thousands: str | None) -> pd.Series[Any]:
    """Numbers (N,) as text, with a point for the decimal sign and without marks of thousands between full groups."""
    if thousands is not None:
        grouped = text.str.fullmatch(grouped_number(decimal, thousands))
        whole = text.str.replace(thousands, "", regex=False).where(grouped, "no number")
        text = text.where(~text.str.contains(thousands, regex=False), whole)
    text = text.str.replace(",", ".", regex=False) if decimal == "," else text
    return text.replace("-0", "-0.0")  # degrees before minutes: a whole number has no such sign


def grouped_number(decimal: str, thousands: str) -> str:
    """A regular expression of a number with such marks of thousands."""
    mark, point = re.escape(thousands), re.escape(decimal)
    return rf"[+-]?[1-9]\d{{0,2}}(?:{mark}\d{{3}})+(?:{point}\d*)?"


def has_nul(content: bytes, form: TextFormat) -> bool:
    """Whether the bytes of a file have NUL bytes that no character of its encoding has."""
    return b"\0" in content and not form.encoding.startswith(("utf-16", "utf-32"))


def _read_text(file: Path, form: TextFormat, columns: Sequence[str], *_: object) -> pd.DataFrame:
    """Read a delimited text log as columns of text, named by its header, by `form.names` or by number."""
    content = file.read_bytes()
    if has_nul(content, form):
        kind = next((name for name, one in READERS.items() if one.detect and one.detect(file, content[:ENOUGH])), None)
        if kind is not None:
            raise DataError(f"is no text: set [format] kind = {kind!r}", file=file, path="format.kind")
        message = (
            "holds NUL bytes: binary, UTF-16 text, or a power cut; export it as text, set the encoding or remove them"
        )
        raise DataError(message, file=file, path="format.encoding")
    try:
        text = io.TextIOWrapper(io.BytesIO(content), encoding=form.encoding, newline="")
        return parse_text(text, form, file, columns if len(columns) > 1 else ())
    except UnicodeDecodeError as error:
        message = (
            f"not {form.encoding} text (byte {error.start} of a block): set the encoding it was saved in, often cp1252"
        )
        raise DataError(message, file=file, path="format.encoding") from None


def parse_text(source: str | io.TextIOBase, form: TextFormat, file: Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read text as a table of text; `file` is the log that errors name. Lines without any value are left out.

    columns : those that are needed; all where one of them is not there, which an error has to say.

    A line of another length than the header is an error, or counted in `attrs["ragged"]` if `form.ragged` says so.
    """
    rows = _filled_rows(io.StringIO(source, newline="") if isinstance(source, str) else source, form, file)
    head = list(itertools.islice(rows, LOOKED_AT))
    if not head:
        if form.skip_rows:
            message = f"no line is left after {form.skip_rows} skipped lines: lower skip_rows"
            raise DataError(message, file=file, path="format.skip_rows")
        raise DataError("holds no line with values", file=file)
    names = _column_names([row for _, row in head], form, file)
    width = max((place + 1 for place, name in enumerate(names) if name), default=1)
    headed = form.header and form.names is None
    said = _bare_names(names) if headed or form.names else None
    places = [place for place in range(width) if names[place] in columns] if {*columns} <= {*names} else []
    places = places or [*range(width)]
    pick = operator.itemgetter(*places) if len(places) > 1 else operator.itemgetter(slice(places[0], places[0] + 1))
    blocks: list[pd.DataFrame] = []
    again: list[int] = []
    ragged: dict[int, int] = {}  # line -> its cells
    rows = itertools.chain(head[headed:], rows)
    while block := list(itertools.islice(rows, ROWS_AT_ONCE)):
        kept: list[str] = []
        for line, row in block:
            if len(row) < width or (len(row) > width and any(map(str.strip, row[width:]))):
                ragged[line] = max(
                    len(row) if len(row) < width else 0, *(k + 1 for k, one in enumerate(row) if one.strip())
                )
            elif said is not None and _bare_names(row[:1]) == said[:1] and _bare_names(row[:width]) == said[:width]:
                again.append(line)
            else:
                kept += pick(row)
        blocks.append(pd.DataFrame({k: kept[k :: len(places)] for k in range(len(places))}, dtype="str"))
    table = pd.concat(blocks, ignore_index=True) if blocks else pd.DataFrame(columns=range(len(places)), dtype="str")
    _refuse_wrong_lines(again, ragged, len(table), width, form, file)
    table.columns = pd.Index([names[place] for place in places])
    table.attrs["ragged"] = sorted([*again, *ragged])
    return table


def _bare_names(cells: Sequence[str]) -> list[str]:
    """Names without the units in brackets behind them, which may stand in a line of their own."""
    return [cell.partition(" [")[0].strip() for cell in cells]


def _filled_rows(text: io.TextIOBase, form: TextFormat, file: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield number of the line, from 1, and cells of each row that has any. DataError where quotes never close."""
    blanks, before = form.separator == "whitespace", form.skip_rows
    lines: Iterator[str] = itertools.islice(text, form.skip_rows, None)
    if form.comment is not None:
        mark = form.comment
        lines = ("" if line.startswith(mark) else line for line in lines)
    if blanks:
        lines = (line.replace("\t", " ").strip() for line in lines)
    reader = csv.reader(lines, delimiter=" " if blanks else form.separator, skipinitialspace=blanks)
    try:
        for row in reader:
            if any(map(str.strip, row)):
                check_width(len(row), file)
                yield before + 1, row
            before = form.skip_rows + reader.line_num
    except csv.Error as error:
        message = f"a cell without an end ({error}): is its closing quote lacking?"
        raise DataError(message, file=file, path=f"line {before + 1}") from None


def _column_names(head: list[list[str]], form: TextFormat, file: Path) -> list[str]:
    """A name for every column by the first rows, empty where the header has none."""
    if form.header and form.names is None:
        return [name.strip() for name in head[0]]
    width = max(place + 1 for row in head for place, cell in enumerate(row) if cell.strip())
    if form.names is None:
        return [str(number + 1) for number in range(width)]
    if len(form.names) not in (width, max(map(len, head))):
        message = f"{len(form.names)} names for the {width} columns of the log"
        raise DataError(message, file=file, path="format.names")
    return list(form.names)


def _refuse_wrong_lines(
    again: list[int], ragged: dict[int, int], rows: int, width: int, form: TextFormat, file: Path
) -> None:
    """Raise DataError for lines that repeat the header, or have another number of cells, and are not to be dropped.

    ragged : line -> its cells. rows : of the others.
    """
    if len(ragged) > rows:
        raise DataError(
            f"not a table with this separator: {len(ragged)} of {rows + len(ragged)} lines have another number of "
            "cells than the header: check separator and skip_rows",
            file=file,
            path="format.separator",
        )
    for lines, what in ((again, "repeats the header"), ([*ragged], "{} cells, where the header has {}")):
        if lines and form.ragged == "refuse":
            first = what.format(ragged.get(lines[0]), width)
            more = f" ({len(lines)} such lines)" if len(lines) > 1 else ""
            remedy = "remove the line, split the log there" if lines is again else "correct the line"
            message = f"{first}{more}: {remedy}, or set [format] ragged = 'drop'"
            raise DataError(message, file=file, path=f"line {lines[0]}")


def _large_text(
    file: Path, form: TextFormat, wanted: set[str], progress: Progress | None, size: int
) -> pd.DataFrame | None:
    """Read only the wanted columns of a text log, block by block, as numbers; None where that cannot be done."""
    if form.comment is not None or form.ragged == "drop":
        return None
    source: Path | io.BytesIO = file
    with file.open("rb") as stream:
        head = stream.read(1_000_000)
    if form.separator == "whitespace":
        if form.encoding.startswith(("utf-16", "utf-32")):
            return None
        content = b"\n".join(b"\t".join(line.split()) for line in file.read_bytes().splitlines())
        source, form, head = io.BytesIO(content), form.model_copy(update={"separator": "\t"}), content[:1_000_000]
    if has_nul(head, form):
        return None
    text = head.decode(form.encoding, "replace").rpartition("\n")[0]
    if not text:  # lines end with a carriage return alone
        return None
    try:
        first = parse_text(text, form.model_copy(update={"ragged": "drop"}), file)
    except DataError:  # such as where the last line ends between quotes
        return None
    names = [str(name) for name in first.columns]
    places = [index for index, name in enumerate(names) if name in wanted]
    if {names[index] for index in places} != wanted or len(places) != len(wanted):
        return None
    plain = {
        index: bool(
            pd.to_numeric(column.str.replace(",", ".") if form.decimal == "," else column, errors="coerce")
            .notna()
            .any()
        )
        for index in places
        for column in [first.iloc[:, index]]
    }
    try:
        cells = text.split("\n", form.skip_rows + 1)[form.skip_rows].count(form.separator) + 1  # some without a name
        reader = _read_blocks(source, form, max(len(names), cells), plain)
        about = size * max(1, len(first)) / len(text)  # rows
        columns = _columns_of_blocks(reader, plain, about, progress)
    except (pyarrow.ArrowException, UnicodeError, ValueError):
        return None
    if columns is None:
        return None
    table = pd.DataFrame({names[place]: values for place, values in columns.items()}, copy=False)
    blank = np.ones(len(table), dtype=bool)
    for name in table:
        blank &= table[name].isna().to_numpy()
    return None if blank.any() else table  # whether such a line is empty, only all its cells tell


def _read_blocks(
    source: Path | io.BytesIO, form: TextFormat, width: int, plain: dict[int, bool]
) -> Iterator[pyarrow.RecordBatch]:
    """The columns of a text log at some places, block by block; `plain` says which of them are numbers."""
    import pyarrow.csv as arrow

    pyarrow.set_io_thread_count(1)
    _start_threads(2)
    blocks: Iterator[pyarrow.RecordBatch] = arrow.open_csv(
        source,
        arrow.ReadOptions(
            column_names=[str(i) for i in range(width)],
            skip_rows=form.skip_rows + int(form.header and form.names is None),
            encoding=form.encoding,
            block_size=1_000_000,
            use_threads=False,
        ),
        arrow.ParseOptions(delimiter=form.separator, ignore_empty_lines=True),
        arrow.ConvertOptions(
            include_columns=[str(index) for index in plain],
            column_types={str(i): pyarrow.float64() if plain[i] else pyarrow.string() for i in plain},
            null_values=list(form.missing),
            strings_can_be_null=True,
            decimal_point=form.decimal,
        ),
    )
    return blocks


def _columns_of_blocks(
    blocks: Iterable[pyarrow.RecordBatch], plain: dict[int, bool], about: float, progress: Progress | None
) -> dict[int, np.ndarray[Any, Any]] | None:
    """Whole columns by their place, of a log with `about` so many rows; None where a word stands among the numbers."""
    expected = int(1.02 * about) + 1000  # rows: what is not filled takes no memory
    numbers = {place: np.empty(expected) for place, of_numbers in plain.items() if of_numbers}
    texts: dict[int, list[Any]] = {place: [] for place in plain if place not in numbers}
    rows = 0
    for batch in blocks:
        before, rows = rows, rows + batch.num_rows
        for place, column in zip(plain, batch.columns, strict=True):
            values = column.to_numpy(zero_copy_only=False)
            if place in texts:
                texts[place].append(values)
                continue
            if np.count_nonzero(np.isnan(values)) > column.null_count:  # a word that this mapping does not declare
                return None
            if rows > len(numbers[place]):
                more = np.empty(max(rows - len(numbers[place]), len(numbers[place]) // 4))
                numbers[place] = np.concatenate([numbers[place], more])
            numbers[place][before:rows] = values
        if progress is not None and rows:
            progress(min(1.0, rows / about))
    return {
        place: numbers[place][:rows] if of_numbers else np.concatenate([np.empty(0, object), *texts[place]])
        for place, of_numbers in plain.items()
    }


def _start_threads(count: int) -> None:
    """Start some threads at once, and end them; raises RuntimeError where this user may not: PyArrow would wait."""
    end = threading.Event()
    threads = [threading.Thread(target=end.wait) for _ in range(count)]
    try:
        for thread in threads:
            thread.start()
    finally:
        end.set()
        for thread in threads:
            if thread.ident is not None:
                thread.join()


def _read_sheet(file: Path, form: SheetFormat, *_: object) -> pd.DataFrame:
    name = sheets_with_values(file)[0] if form.sheet is None else form.sheet
    return parse_text(sheet_text(file, name), form.text(), file)


def _read_parquet(file: Path, _: object, columns: Sequence[str], *__: object) -> pd.DataFrame:
    try:
        stored = read_arrow(file, columns) if len(columns) > 1 else None
        if stored is None or not {*columns} <= {*stored.column_names}:  # an error says which there are
            stored = read_arrow(file)
        nested = {field.name: field.type for field in stored.schema if pyarrow.types.is_nested(field.type)}
        plain = [place for place, field in enumerate(stored.schema) if field.name not in nested]
        # an index is a column
        table: pd.DataFrame = stored.select(plain).to_pandas(ignore_metadata=True, use_threads=False)
    except (pyarrow.ArrowException, ValueError):
        raise DataError("not a Parquet file, or damaged: set [format] kind", file=file, path="format.kind") from None
    table.attrs["other"] = {
        name: f"nested ({str(kind)[:60]}): write each of its values as a column of numbers"
        for name, kind in nested.items()
    }
    table.attrs["notes"] = [f"{name!r} is {what}" for name, what in table.attrs["other"].items()]
    return table


@dataclass(frozen=True)
class LogReader:
    """One format of logs.

    options : model of the keys of [format] in a mapping.
    read : (file, options, columns as of `read_log_table`, that of time first, progress) -> table; raises DataError.
    detect : (file, its first bytes) -> keys of [format] where it is of this format, else None; without it, no guess.
    scattered : whether rows are single sentences or messages that do not say everything: empty cells are no defect.
    topics : the reader of the topics of a recording.
    """

    options: type[Format]
    read: Callable[[Path, Any, Sequence[str], Progress | None], pd.DataFrame]
    detect: Callable[[Path, bytes], dict[str, Any] | None] | None = None
    scattered: bool = False
    topics: TopicReader | None = None


def _is_sheet(_: Path, head: bytes) -> dict[str, Any] | None:
    return {"kind": "sheet"} if is_workbook(head[:ENOUGH]) else None


def _is_parquet(_: Path, head: bytes) -> dict[str, Any] | None:
    return {"kind": "parquet"} if head.startswith(b"PAR1") else None


READERS: Registry[LogReader] = Registry("shipid.readers", partial(fault_of_kind, LogReader))
READERS |= {
    "text": LogReader(TextFormat, _read_text),  # no signature: a guess takes every other file for text
    "sheet": LogReader(SheetFormat, _read_sheet, _is_sheet),
    "parquet": LogReader(ParquetFormat, _read_parquet, _is_parquet),
    "mat": LogReader(MatFormat, read_mat, is_mat),
    "nmea": LogReader(NmeaFormat, read_nmea, is_nmea, scattered=True),
    "rosbag": LogReader(TopicsFormat, reads_topics(read_bag), is_bag, True, read_bag),
    "ulog": LogReader(TopicsFormat, reads_topics(read_ulog), is_ulog, True, read_ulog),
    "dataflash": LogReader(TopicsFormat, reads_topics(read_dataflash), is_dataflash, True, read_dataflash),
}
"""Kind, as in [format] of a mapping -> reader. To add a format: its options, its two functions, a row here."""


def list_topics(file: Path) -> list[dict[str, Any]]:
    """The topics of a recording: name, count of messages, their rate [Hz], and names of their fields.

    Raises DataError where the file is no recording of topics.
    """
    require_file(file)
    with file.open("rb") as stream:
        head = stream.read(ENOUGH)
    every = READERS.load_all().values()
    read = next((one.topics for one in every if one.topics and one.detect and one.detect(file, head)), None)
    if read is None:
        kinds = ", ".join(name for name, one in READERS.items() if one.topics)
        raise DataError(f"has no topics: recordings of these kinds have them: {kinds}", file=file)
    return topic_rows(read(file, lambda _: True))
