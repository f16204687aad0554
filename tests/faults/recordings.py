"""Rows of the campaign: damaged recordings of every format, read and guessed as a user would."""

from __future__ import annotations

import io
import itertools
import random
import struct
import tempfile
import time
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pandas as pd
from scipy.io import savemat

from shipid.logs.formats import Format, MatFormat, NmeaFormat, ParquetFormat, SheetFormat, TopicsFormat
from shipid.logs.guess.columns import guess
from shipid.logs.guess.draft import draft_mapping
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.logs.readers import list_topics, read_log_table
from tests.faults.documents import BAD
from tests.faults.trials import Failure
from tests.logs.conftest import T, as_log, turning
from tests.logs.test_dataflash import written_dataflash
from tests.logs.test_nmea import bridge_log
from tests.logs.test_rosbag import written_bag
from tests.logs.test_ulog import written_ulog

LINKED: list[tuple[str, str, Callable[..., None]]] = [
    *(("text", "csv", pd.DataFrame.to_csv), ("parquet", "parquet", pd.DataFrame.to_parquet)),
    ("sheet", "xlsx", pd.DataFrame.to_excel),
]
GUESSED = 5  # every so many trials a mapping is guessed, too, which takes most of the time
PACKED = {"xlsx", "ods"}  # whose parts are damaged inside, too: a checksum finds every other fault
SOUND: dict[str, tuple[Callable[[Path], Path], Format]] = {
    # ending -> how a sound one is written into a folder, and its format
    "bag": (lambda folder: written_bag("bag", folder), TopicsFormat(kind="rosbag")),
    "mcap": (lambda folder: written_bag("MCAP", folder), TopicsFormat(kind="rosbag")),
    "db3": (lambda folder: written_bag("SQLITE3", folder), TopicsFormat(kind="rosbag")),
    "ulg": (lambda folder: written_ulog(folder / "log.ulg", turning(T)), TopicsFormat(kind="ulog")),
    "bin": (lambda folder: written_dataflash(folder / "log.bin", turning(T)), TopicsFormat(kind="dataflash")),
    "nmea": (lambda folder: _saved_nmea(folder / "log.nmea"), NmeaFormat(kind="nmea")),
    "mat": (lambda folder: _saved_mat(folder / "log.mat"), MatFormat(kind="mat")),
    "xlsx": (lambda folder: _saved_sheet(folder / "log.xlsx"), SheetFormat(kind="sheet")),
    "ods": (lambda folder: _saved_sheet(folder / "log.ods"), SheetFormat(kind="sheet")),
    "parquet": (lambda folder: _saved_parquet(folder / "log.parquet"), ParquetFormat(kind="parquet")),
}


def recording(ending: str) -> Callable[[int], None]:
    """The trial of a format: a damaged recording is read, its topics listed, and sometimes its mapping guessed."""

    def trial(seed: int) -> None:
        rng = random.Random(f"{ending} {seed}")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"log.{ending}"
            file.write_bytes(damaged(content_of(ending), rng, ending in PACKED))
            form = SOUND[ending][1]
            if isinstance(form, TopicsFormat) and seed % 2:
                list_topics(file)
            if seed % GUESSED:
                read_log_table(file, form, "time")
                return
            mapping = Path(folder) / "mapping.toml"
            mapping.write_text(draft_mapping(guess(file)))
            read_mapping(mapping)

    return trial


@cache
def content_of(ending: str) -> bytes:
    """The bytes of a sound recording."""
    with tempfile.TemporaryDirectory() as folder:
        return SOUND[ending][0](Path(folder)).read_bytes()


def _saved_nmea(file: Path) -> Path:
    file.write_text(bridge_log("", 43200.0, turning(T))[0])
    return file


def _frame() -> pd.DataFrame:
    with tempfile.TemporaryDirectory() as folder:
        return pd.read_csv(as_log(turning(T), Path(folder) / "log.csv"))


def _saved_mat(file: Path) -> Path:
    log = _frame()
    savemat(file, {"log": {name: log[name].to_numpy() for name in list(log)[3:]}, **{n: log[n] for n in list(log)[:3]}})
    return file


def _saved_sheet(file: Path) -> Path:
    _frame().to_excel(str(file), index=False)  # a path would be a workbook of Excel
    return file


def _saved_parquet(file: Path) -> Path:
    _frame().to_parquet(file)
    return file


def damaged(content: bytes, rng: random.Random, packed: bool = False) -> bytes:
    """Bytes cut off, changed, zeroed, doubled, gone, or with a number too large; in a part of an archive, too."""
    if packed and rng.random() < 0.7:
        return _repacked(content, rng)
    changed = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 5])):
        place, size = rng.randrange(len(changed) + 1), rng.choice([1, 4, 60, 2000])
        kind = rng.randrange(7)
        if kind == 0:
            del changed[place:]
        elif kind == 1:
            del changed[place : place + size]
        elif kind == 2:
            changed[place:place] = changed[place : place + size]
        elif kind == 3:
            changed[place : place + size] = rng.randbytes(size)
        elif kind == 4:
            changed[place : place + size] = bytes(size)
        elif kind == 5:
            number = rng.choice([2**31 - 1, 2**32 - 1, 2**63 - 1, 2**40, 255])
            changed[place : place + 8] = struct.pack("<Q", number)
        else:
            for _ in range(rng.choice([1, 5, 50]) if changed else 0):
                changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _repacked(content: bytes, rng: random.Random) -> bytes:
    """An archive with a part damaged, or with sizes in its directory that are false."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice([one for one in parts if "sheet" in one or one == "content.xml"] * 3 + [*parts])
    forged = rng.random() < 0.4
    if not forged:
        parts[name] = damaged(parts[name], rng)
    elif rng.random() < 0.5:  # more than its directory says
        parts[name] = parts[name] + b" " * rng.choice([10**6, 10**8])
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for one, data in parts.items():
            archive.writestr(one, data, zipfile.ZIP_STORED if one == "mimetype" else None)
    packed = bytearray(out.getvalue())
    if forged:  # file size and size in the archive: PK 03 04 at +22 and +18, PK 01 02 at +24 and +20
        size = struct.pack("<I", rng.choice([0, 1, 1000, 2**31 - 1, 2**32 - 2]))
        for mark, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
            found = packed.find(name.encode(), packed.find(mark))
            place = packed.rfind(mark, 0, found)
            while mark == b"PK\x01\x02" and found >= 0 and packed[place : place + 4] != mark:
                found = packed.find(name.encode(), found + 1)
                place = packed.rfind(mark, 0, found)
            if rng.random() < 0.8:
                packed[place + at : place + at + 4] = size
    return bytes(packed)


def exchanged(seed: int) -> None:
    """A log whose link leads elsewhere at some moments of its import, and back: one of the two, or refused."""
    rng = random.Random(f"exchanged {seed}")
    kind, ending, save = rng.choice(LINKED)
    with tempfile.TemporaryDirectory() as name:
        folder, whole = Path(name), rng.random() < 0.3
        logs = [folder / f"{speed}" / f"log.{ending}" for speed in (3, 6)]
        for speed, log in zip((3.0, 6.0), logs, strict=True):
            log.parent.mkdir()
            save(pd.read_csv(as_log(turning(T, u=speed), folder / "text.csv")), str(log), index=False)
        link = folder / "link" if whole else folder / logs[0].name  # of a folder, or of a file
        leads, plain = [log.parent if whole else log for log in logs], folder / "mapping.toml"
        plain.write_text(f'{(BAD / "logs" / "plain.toml").read_text()}[format]\nkind = "{kind}"\n')
        link.symlink_to(leads[0])
        asked = link / logs[0].name if whole else link
        time.sleep(0.02)  # more than a tick of a file system
        moments, now, opened = rng.sample(range(8), rng.choice([1, 2, 2, 2])), itertools.count(), io.open

        def exchange() -> None:
            if next(now) in moments:
                (folder / "new").symlink_to(leads[link.readlink() == leads[0]])
                (folder / "new").replace(link)

        def open_log(file: object, *arguments: Any, **named: Any) -> object:
            if str(file) != str(asked):
                return opened(file, *arguments, **named)  # type: ignore[call-overload]
            exchange()
            stream = opened(asked, *arguments, **named)
            exchange()
            return stream

        with patch("io.open", open_log), patch("builtins.open", open_log):
            data = import_log(read_mapping(plain), asked)
        speeds = {round(value) for value in data.frame["u"]}
        digests = [import_log(read_mapping(plain), log).metadata["source"]["sha256"] for log in logs]
        if speeds != {3 if data.metadata["source"]["sha256"] == digests[0] else 6}:
            raise Failure("mixed", f"{ending}, moments {moments}, u {speeds} under the digest of another file")
