"""MATLAB files up to version 7: their vectors as columns, and what is said of all else in them."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.errors import DataError
from shipid.logs.formats import MatFormat

ENOUGH_VECTORS = 4  # of one length: clock, position and heading
NUMBERS = frozenset({*range(1, 8), 9, 12, 13, 16, 17, 18})
MATRIX, PACKED = 14, 15
HOLDERS = frozenset({1, 2, 3, 16, 17})
"""Types of elements, and classes of matrices that hold others: MathWorks, MAT-File Format, tables 1-1, 1-3; scipy."""
NO_VECTOR = (
    ", not a vector of numbers: save one of it, such as by cell2mat, full, real, squeeze, .', str2double, datenum, "
    "seconds, [s.x] of structs, or table2struct(T, 'ToScalar', true)"
)
MOST_SIGNALS = 100  # columns of a matrix that has fewer rows: more are times


def read_mat(file: Path, _: MatFormat, columns: Sequence[str], *__: object) -> pd.DataFrame:
    """The vectors of a MATLAB file that are as long as the clock, else as the longest with enough, as a table.

    `attrs["other"]` says of other variables what they are, and how to make a vector; `attrs["notes"]` are sentences.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import matfile_version

    try:
        version, content = matfile_version(file)[0], file.read_bytes()
        if version > 1:  # 2 of version 7.3, which is HDF5
            message = "a MATLAB file of version 7.3: save it with save(..., '-v7')"
            raise DataError(message, file=file, path="format.kind")
        if version == 1:
            order = ">" if content[126:128] == b"MI" else "<"
            _check_elements(memoryview(content)[128:], order, NUMBERS | {MATRIX, PACKED})
        variables = loadmat(file, simplify_cells=True)
        vectors, other = dict(_numeric_vectors(variables)), dict(_no_vectors(variables))
    except (DataError, OSError, MemoryError):  # the last of the system, whatever is in the file
        raise
    except Exception as error:  # scipy defines no error class: a damaged file raises any of a dozen
        raise DataError(
            f"not a MATLAB file, or damaged ({type(error).__name__}): set [format] kind", file=file, path="format.kind"
        ) from None
    if not vectors:
        first = next(iter(other), None)
        which = f"; {first!r} is {other[first]}" if first is not None else ""
        raise DataError(f"no variable of this MATLAB file is a vector of numbers{which}", file=file)
    measure = columns[0] if columns[0] in vectors else _longest_measure(vectors)
    length = len(vectors[measure])
    short = {
        name: f"of {len(values)} values, and {measure!r} has {length}: a column has a value for every time"
        for name, values in vectors.items()
        if len(values) != length
    }
    table = pd.DataFrame({name: values for name, values in vectors.items() if name not in short})
    table.attrs["other"] = other | short
    anew = {**{name: what for name, what in other.items() if what.endswith(NO_VECTOR)}, **short}
    table.attrs["notes"] = [f"{name!r} is {what}" for name, what in anew.items()]
    return table


def _check_elements(content: memoryview, order: str, allowed: frozenset[int]) -> None:
    """Raise ValueError for an element of no allowed type, or longer than what holds it: scipy would end the process.

    order : of bytes, as of `struct`.
    """
    at = 0
    while len(content) - at >= 8:
        kind, size = struct.unpack_from(f"{order}II", content, at)
        small, begin = kind >> 16, at + 8
        if small:  # type, size and at most 4 bytes in the place of type and size
            kind, size, begin = kind & 0xFFFF, small, at + 4
        held = content[begin : begin + size]
        if kind not in allowed or len(held) < size:
            raise ValueError("an element of a type or a size that cannot be")
        if kind == PACKED:
            _check_elements(memoryview(zlib.decompress(held)), order, frozenset({MATRIX}))
        elif kind == MATRIX and size:
            matrices = held[8 if order == "<" else 11] in HOLDERS
            _check_elements(held, order, NUMBERS | {MATRIX} if matrices else NUMBERS)
        at = begin + size + (4 - size if small else 0 if kind == PACKED else -size % 8)


def _longest_measure(vectors: dict[str, np.ndarray[Any, Any]]) -> str:
    """Name of the first of the longest vectors that are enough for a log, such as those of one of two recorders."""
    counts = Counter(map(len, vectors.values()))
    longest = max([length for length in counts if counts[length] >= ENOUGH_VECTORS] or counts)
    return next(name for name in vectors if len(vectors[name]) == longest)


def _numeric_vectors(variables: dict[str, Any]) -> Iterable[tuple[str, np.ndarray[Any, Any]]]:
    """Dotted name and values of every numeric vector, structs and matrices opened."""
    for name, value in _open_structs(variables):
        if isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.number) and not np.iscomplexobj(value):
            if value.ndim == 1:
                yield name, value.astype(float)
            elif value.ndim == 2 and not _is_transposed(value):
                yield from (
                    (f"{name}.{column + 1}", value[:, column].astype(float)) for column in range(value.shape[1])
                )


def _is_sparse(value: object) -> bool:
    """Whether a value is a sparse matrix: scipy, which defines them, takes long to import."""
    return hasattr(value, "toarray")


def _is_transposed(matrix: np.ndarray[Any, Any]) -> bool:
    """Whether a matrix has a row for each signal and a column for each time."""
    rows, columns = matrix.shape
    return bool(columns > max(rows, MOST_SIGNALS))


def _open_structs(variables: dict[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Dotted name and value of every variable, structs and sparse vectors opened."""
    for key, value in variables.items():
        if key.startswith("__"):
            continue
        if isinstance(value, dict):
            yield from _open_structs(value, f"{prefix}{key}.")
        elif _is_sparse(value) and min(value.shape) == 1:
            value.check_format()  # else indices that are not in it write where they lead
            yield f"{prefix}{key}", value.toarray().squeeze()
        else:
            yield f"{prefix}{key}", value


def _no_vectors(variables: dict[str, Any]) -> Iterable[tuple[str, str]]:
    """Dotted name of every variable that is no vector of numbers, and what it is."""
    for name, value in _open_structs(variables):
        array = np.asarray(value.shape if _is_sparse(value) else value)
        if array.dtype.names:  # a datetime, a table: scipy does not open them
            about = [text.decode() if isinstance(text, bytes) else str(text) for text in array.ravel()[0]][:3]
            yield about[0], f"an object of class {about[2]}{NO_VECTOR}"
        elif _is_sparse(value):
            yield name, f"a sparse matrix{NO_VECTOR}"
        elif array.dtype == object and array.size and isinstance(array.flat[0], dict):
            yield from (
                (one, f"in an array of structs{NO_VECTOR}")
                for one in (name, *(f"{name}.{key}" for key in array.flat[0]))
            )
        elif array.dtype.kind in "OUc" or array.ndim > 2:
            what = {"O": "an array of cells", "U": "text", "c": "complex"}.get(array.dtype.kind)
            yield name, f"{what or f'an array of {array.ndim} axes'}{NO_VECTOR}"
        elif array.ndim == 0:
            yield name, "a single number, not a vector"
        elif array.ndim == 2 and _is_transposed(array):
            yield name, f"a matrix with a row for each signal{NO_VECTOR}"
        elif array.ndim == 2:
            yield name, f"a matrix: its columns are {name}.1 to {name}.{array.shape[1]}"


def is_mat(_: Path, head: bytes) -> dict[str, Any] | None:
    """Recognise a MATLAB file by its first words; one of version 7.3, too, which has a remedy. Version 4 has none."""
    return {"kind": "mat"} if head.startswith((b"MATLAB 5.0", b"MATLAB 7.3")) else None
