"""Files that are no log as they are: what they are, known by their first bytes, and how to make a log of them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from shipid.errors import DataError
from shipid.logs.workbook import is_workbook

ENOUGH = 4096  # first bytes that tell
UNPACK = "unpack it"
SHEET = "save its sheet as CSV (one header line, one row for each time)"
OFFICE = "export it as .xlsx, or its sheet as CSV"
TOPICS = "export the topics as CSV with one clock, or each with its own clock ([file.<name>] of a mapping)"


FIELDS = "a row for each time and a column for each field"
FRAME = rb"[0-9A-F]{3,8}"


@dataclass(frozen=True)
class Foreign:
    """One kind of file. starts : regular expression of its first bytes. name : what it is. remedy : what to do."""

    starts: bytes
    name: str
    remedy: str

    @property
    def sentence(self) -> str:
        """What it is and what to do, for a message."""
        return f"{self.name}: {self.remedy}"


FOREIGN = (
    Foreign(
        rb"PK\x03\x04.{26}[^/\0]{1,80}\.npy", "arrays of NumPy (.npz)", "write them as columns of a CSV or Parquet file"
    ),
    Foreign(
        rb"PK\x03\x04(?:.{26}mimetypeapplication/vnd\.oasis|.{0,4000}?(?:word|ppt|visio)/[A-Za-z_])",
        "a text document, presentation or drawing of an office program (.docx, .odt, .pptx)",
        "copy its table into a workbook and save that as .xlsx or CSV",
    ),
    Foreign(rb"PK\x03\x04.{26}(?:Index/|Index\.zip|preview)", "a document of Apple's Numbers (.numbers)", OFFICE),
    Foreign(rb"PK\x03\x04", "a ZIP archive", UNPACK),
    Foreign(
        rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "an old Excel workbook (.xls) or Word document (.doc), or one with a password",
        "save it as .xlsx without a password, or its sheet as CSV",
    ),
    Foreign(rb"\{\\rtf", "a text document (.rtf)", "save it as plain text"),
    Foreign(rb".{4}Standard (?:Jet|ACE) DB\0", "a data base of Access (.mdb, .accdb)", "export its table as CSV"),
    Foreign(rb"\x1f\x8b", "packed by gzip", UNPACK),
    Foreign(rb"BZh[1-9]1AY&SY", "packed by bzip2", UNPACK),
    Foreign(rb"\xfd7zXZ\0", "packed by xz", UNPACK),
    Foreign(rb"\x28\xb5\x2f\xfd", "packed by zstd", UNPACK),
    Foreign(rb"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    Foreign(rb"Rar!\x1a\x07", "a RAR archive", UNPACK),
    Foreign(rb".{257}ustar", "a tar archive", UNPACK),
    Foreign(
        rb"SQLite format 3\0",
        "a data base of SQLite (.sqlite)",
        "write its table as CSV; a recording of ROS 2 ends in .db3",
    ),
    Foreign(rb"TDS[mh]", "a file of LabVIEW (.tdms)", "export its channels as CSV, or .mat"),
    Foreign(rb"MDF     ", "a measurement file of ASAM (.mdf, .mf4)", "export its channels as CSV, or .mat"),
    Foreign(rb"\x89HDF\r\n\x1a\n", "an HDF5 file (.h5)", "write its vectors as columns of a CSV or Parquet file"),
    Foreign(rb"CDF[\x01\x02\x05]", "a netCDF file (.nc)", "write its vectors as columns of a CSV or Parquet file"),
    Foreign(rb"ARROW1\0", "a Feather or Arrow file", "write it as Parquet, with pandas.read_feather and to_parquet"),
    Foreign(rb"\x93NUMPY", "an array of NumPy (.npy)", "write it as CSV with a header line"),
    Foreign(rb"\x80[\x02-\x05][\x95}\]c(]", "a pickle of Python (.pkl)", "write the table as CSV or Parquet"),
    Foreign(rb"\xb5\x62", "raw messages of a GNSS receiver (UBX)", "log NMEA 0183, or export the solution as CSV"),
    Foreign(rb"(?:\xd4\xc3\xb2\xa1|\xa1\xb2\xc3\xd4|\x0a\x0d\x0d\x0a)", "a recording of a network (.pcap)", TOPICS),
    Foreign(rb"%PDF-", "a PDF", "export the table itself as CSV"),
    Foreign(
        rb"\s*<(?:!doctype html|html|table|meta|head)\b", "a page (HTML)", f"if it shows the log, open it and {SHEET}"
    ),
    Foreign(rb"\s*<\?xml[^>]*>.{0,2000}?<(?:gpx|kml)\b", "a track (GPX, KML)", "export it as CSV or NMEA 0183"),
    Foreign(rb"\s*<\?xml\b", "XML", "export the table as CSV"),
    Foreign(
        rb"\s*(?:\(\d+\.\d+\)\s+[a-z]\w*\s+" + FRAME + rb"(?:#|\s+\[\d)"  # candump
        rb"|\d{4}-\d\d-\d\d[T-]\d\d:\d\d:\d\d[.\d]*Z?(?:,\d+){5}(?:,[0-9A-F]{2})+\s"  # canboat
        rb"|A\d{6}\.\d{3} [0-9A-F]{5} [0-9A-F]{5} [0-9A-F]+\s"  # Actisense
        rb"|\d\d:\d\d:\d\d\.\d{3} [RT] " + FRAME + rb"(?: [0-9A-F]{2})+\s)",  # Yacht Devices
        "raw frames of a CAN bus or of NMEA 2000",
        f"decode them, such as with the analyzer of canboat, and write a CSV with {FIELDS}",
    ),
    Foreign(
        rb"\s*\{.{0,2000}?\"pgn\"\s*:",
        "messages of NMEA 2000 as JSON",
        f"write a CSV with {FIELDS}, such as with pandas.read_json(lines=True), json_normalize and pivot_table",
    ),
    Foreign(
        rb"!boat,utc,[^\r\n]*[\r\n]+!boat,\d",
        "a log of Expedition with pairs of number and value",
        f"export it as CSV with {FIELDS}",
    ),
    Foreign(
        rb"(?:#(?:group|datatype|default)\b.{0,3000}?)?,?[\w,]*,_value,_field\b",
        "a table of InfluxDB with a row for each value",
        f"pivot it by _time, _field and _value, so that it has {FIELDS}",
    ),
    Foreign(
        rb"\s*(?:\{\s*\"|\[\s*[\[{])", "JSON", "write it as CSV, such as with pandas.read_json and to_csv(index=False)"
    ),
)
"""Kinds of files that a log is not, the more special first. To add one: a row here."""


def foreign_format(head: bytes) -> Foreign | None:
    """What kind of file begins with these bytes, where it is one that no reader reads; else None."""
    start = head[:ENOUGH].removeprefix(b"\xef\xbb\xbf")
    if is_workbook(start):
        return None
    return next((one for one in FOREIGN if re.match(one.starts, start, re.DOTALL | re.IGNORECASE)), None)


def refuse_foreign(file: Path) -> None:
    """Raise DataError with the remedy where a file is of a kind that no reader reads."""
    with file.open("rb") as stream:
        other = foreign_format(stream.read(ENOUGH))
    if other is not None:
        raise DataError(other.sentence, file=file, path="format.kind")
