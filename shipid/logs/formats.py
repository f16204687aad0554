"""Keys of [format] in a mapping, a model for each kind."""

from __future__ import annotations

import codecs
from typing import Literal

from pydantic import Field, ValidationInfo, field_validator

from shipid.logs.repairs import StrictPart
from shipid.logs.workbook import SEPARATOR

LOOKED_AT = 300  # lines that a guess at the format looks at


class Format(StrictPart):
    """Field of every format: its kind."""

    kind: str = "text"


class TableFormat(Format):
    """Keys of a table of text; `names`, or `header = false` and the numbers 1, 2, ..., where it has no header line."""

    decimal: Literal[".", ","] = "."
    thousands: Literal[",", ".", "'", "’", " ", "\u00a0", "\u202f"] | None = None  # between groups of three digits
    skip_rows: int = Field(default=0, ge=0)
    header: bool = True
    names: tuple[str, ...] | None = Field(default=None, min_length=1)
    missing: tuple[str, ...] = ("", "nan", "NaN")
    ragged: Literal["refuse", "drop"] = "refuse"  # lines with more or fewer cells than the header, or its names again

    def text(self) -> TextFormat:
        """How the lines of the table are read."""
        return TextFormat(separator=SEPARATOR, **{name: getattr(self, name) for name in TableFormat.model_fields})

    @field_validator("thousands")
    @classmethod
    def _other(cls, thousands: str | None, values: ValidationInfo) -> str | None:
        if thousands is not None and thousands == values.data.get("decimal"):
            raise ValueError("must be another sign than decimal")
        return thousands


class TextFormat(TableFormat):
    """Text with one separator."""

    separator: str = Field(default=",", min_length=1)  # one character, or "whitespace"
    encoding: str = "utf-8"
    comment: str | None = Field(default=None, min_length=1, max_length=1)

    def text(self) -> TextFormat:
        """The format."""
        return self

    @field_validator("separator")
    @classmethod
    def _single(cls, separator: str) -> str:
        # pandas would take a longer one for a regular expression
        if separator != "whitespace" and (len(separator) > 1 or not separator.isascii() or separator in '"\r\n\0'):
            raise ValueError("must be one ASCII character but a quote or a line's end, or the word 'whitespace'")
        return separator

    @field_validator("encoding")
    @classmethod
    def _known(cls, encoding: str) -> str:
        try:
            "a".encode(encoding)  # base64 and the like are codecs, too, but not of text
            return codecs.lookup(encoding).name
        except (LookupError, UnicodeError):
            raise ValueError("no such encoding of text; for example utf-8, cp1252, latin-1, utf-16") from None


class SheetFormat(TableFormat):
    """A sheet of a workbook (.xlsx, .ods): that of this name, or the one with most cells."""

    sheet: str | None = None


class ParquetFormat(Format):
    """A Parquet file; its columns have names and types."""


class MatFormat(Format):
    """A MATLAB file up to version 7: fields of structs are `struct.field`, columns of a matrix `name.1`, `name.2`."""


class NmeaFormat(Format):
    """NMEA 0183 sentences; `time` is of the last fix, or a number or ISO date before each sentence (`"line"`)."""

    time: Literal["fix", "line"] = "fix"


class TopicsFormat(Format):
    """A recording of topics or messages; `topics` are those that are read, by default all of the mapped columns."""

    topics: tuple[str, ...] = ()
