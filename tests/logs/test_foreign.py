"""Files that are no log as they are: each is named, with what to do, by the draft and by the import."""

from __future__ import annotations

import gzip
import io
import sqlite3
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.foreign import foreign_format
from shipid.logs.formats import MatFormat, NmeaFormat, ParquetFormat, TextFormat
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.readers import read_log_table

TABLE = pd.DataFrame({"time": np.arange(30.0), "north": 2.0 * np.arange(30.0), "heading": 0.1})
TEXT = TABLE.to_csv(index=False).encode()
BINARY = bytes(range(256)) * 40


def zipped(**files: bytes) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return held.getvalue()


def saved(write: str) -> bytes:
    held = io.BytesIO()
    np.save(held, TABLE.to_numpy()) if write == "npy" else np.savez(held, north=TABLE["north"])
    return held.getvalue()


FILES = {
    "log.xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + BINARY, "old Excel workbook", "save it as .xlsx"),
    "page.xls": (TABLE.to_html().encode(), "a page", "save its sheet as CSV"),
    "log.csv.gz": (gzip.compress(TEXT), "packed by gzip", "unpack it"),
    "log.zip": (zipped(**{"log.csv": TEXT}), "a ZIP archive", "unpack it"),
    "log.docx": (zipped(**{"[Content_Types].xml": b"<x/>", "word/document.xml": b"<x/>"}), "a text document", "CSV"),
    "log.numbers": (zipped(**{"Index/Document.iwa": BINARY}), "Apple's Numbers", "export it as .xlsx"),
    "log.npy": (saved("npy"), "an array of NumPy", "CSV"),
    "records.json": (TABLE.to_json(orient="records").encode(), "JSON", "CSV"),
    "log.xml": (b'<?xml version="1.0"?>\n<log><row>1</row></log>', "XML", "CSV"),
    "log.gpx": (b'<?xml version="1.0"?>\n<gpx version="1.1"><trk></trk></gpx>', "a track", "CSV or NMEA"),
    "log.tdms": (b"TDSm" + BINARY, "LabVIEW", "CSV"),
    "log.h5": (b"\x89HDF\r\n\x1a\n" + BINARY, "HDF5", "CSV or Parquet"),
    "log.nc": (b"CDF\x01" + BINARY, "netCDF", "CSV or Parquet"),
    "candump.log": (b"(1715673600.250000) can0 09F112CC#01FFFF0A7FFF7FFD\n", "NMEA 2000", "analyzer of canboat"),
    "actisense.txt": (b"A173321.107 23FF7 1F513 012F3070002F30709F\n", "NMEA 2000", "a row for each time"),
    "n2k.json": (
        b'{"version":"5.0.2","units":"std"}\n{"timestamp":"2024-05-14","prio":2,"pgn":127250,"fields":{}}\n',
        "NMEA 2000 as JSON",
        "a column for each field",
    ),
    "expedition.csv": (
        b"!Boat,Utc,BSP\r\n!boat,0,1\r\n!v12\r\n0,45455.3,1,7.2\r\n",
        "Expedition",
        "a column for each field",
    ),
    "influx.csv": (
        b"#group,false,false\n#datatype,string,long\n#default,_result,\n"
        b",result,table,_start,_stop,_time,_value,_field,_measurement\n",
        "InfluxDB",
        "pivot it by _time",
    ),
    "log.pdf": (b"%PDF-1.7\n" + BINARY, "a PDF", "CSV"),
}


@pytest.mark.parametrize("name", FILES)
def test_the_line_names_the_kind_and_what_to_do(name: str, tmp_path: Path) -> None:
    content, kind, remedy = FILES[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError) as drafted:
        recognise_log(tmp_path / name)
    said = [drafted.value.message]
    for form in (TextFormat(), ParquetFormat(kind="parquet"), MatFormat(kind="mat"), NmeaFormat(kind="nmea")):
        with pytest.raises(DataError) as read:
            read_log_table(tmp_path / name, form, "time")
        said.append(read.value.message)
    for message in said:
        assert kind in message
        assert remedy in message
        assert "\n" not in message


def test_a_data_base_is_named(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "log.sqlite") as base:
        TABLE.to_sql("log", base, index=False)
    base.close()
    with pytest.raises(DataError, match="SQLite"):
        recognise_log(tmp_path / "log.sqlite")


@pytest.mark.parametrize(
    "head",
    [
        TEXT,
        b"\xef\xbb\xbf" + TEXT,
        b"[s],[m]\n1,2\n",
        b"PAR1",
        b"MATLAB 5.0 MAT-file",
        b"$GPGGA,",
        b"#group,false\n#datatype,dateTime\n,result,table,_time,sog,cog\n",
        b"2024-05-14T08:00:00.250Z,2,127250,204,255,8,9.5\n",
        b"MDF,x\n1,2\n",
        b"",
    ],
)
def test_what_a_reader_reads_is_not_foreign(head: bytes) -> None:
    assert foreign_format(head) is None
