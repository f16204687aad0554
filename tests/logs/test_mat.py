"""What a MATLAB file may hold beside vectors, and how it is read or named."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix

from shipid.errors import DataError
from shipid.logs.formats import MatFormat
from shipid.logs.importing import import_log, read_mapping
from shipid.logs.mat import is_mat
from shipid.logs.readers import read_log_table
from tests.logs.conftest import NAMES, T, assert_is_the_motion, mapping_with


def test_matlab_structs_and_matrices(log: pd.DataFrame, tmp_path: Path) -> None:
    log_struct = {"t": log["time"].to_numpy(), "xy": log[["N", "E"]].to_numpy(), "note": "sea state 2", "scale": 3.0}
    others = {name: log[name].to_numpy() for name in NAMES[3:]}
    savemat(tmp_path / "log.mat", {"log": log_struct, "gps": np.arange(7.0), **others})
    changes = [('"time"', '"log.t"'), ('"N"', '"log.xy.1"'), ('"E"', '"log.xy.2"')]
    assert_is_the_motion(mapping_with(tmp_path, 'kind = "mat"', *changes), tmp_path / "log.mat")


def cells(values: np.ndarray) -> np.ndarray:
    array = np.empty(len(values), dtype=object)
    array[:] = list(values)
    return array


AMONG = np.empty(2, dtype=object)
AMONG[:] = [{"a": 1.0}, T[:3]]
NO_VECTORS: dict[str, tuple[Any, str]] = {
    "cells": (cells(T), r"'rpm' is an array of cells, not a vector of numbers: save one of it, such as by cell2mat"),
    "cells with a struct": (AMONG, "'rpm' is in an array of structs, not a vector of numbers"),
    "text": ("120 rpm", "'rpm' is text, not a vector of numbers"),
    "complex": (T + 1j, "'rpm' is complex, not a vector of numbers"),
    "of another length": (T[:7], "'rpm' is of 7 values, and 'time' has 120"),
    "a single number": (2.0, "'rpm' is a single number, not a vector"),
    "a matrix": (np.stack([T, T], axis=1), r"'rpm' is a matrix: its columns are rpm\.1 to rpm\.2"),
    "a row for each signal": (np.zeros((2, 120)), "'rpm' is a matrix with a row for each signal, not a vector"),
    "sparse": (csc_matrix(np.stack([T, T], axis=1)), "'rpm' is a sparse matrix, not a vector of numbers"),
    "of three axes": (np.zeros((120, 2, 2)), "'rpm' is an array of 3 axes, not a vector"),
}


@pytest.mark.parametrize("name", NO_VECTORS)
def test_a_matlab_variable_that_is_no_vector_is_named(name: str, log: pd.DataFrame, tmp_path: Path) -> None:
    value, message = NO_VECTORS[name]
    savemat(tmp_path / "log.mat", {**{name: log[name].to_numpy() for name in log}, "rpm": value})
    with pytest.raises(DataError, match=message) as caught:
        import_log(read_mapping(mapping_with(tmp_path, 'kind = "mat"')), tmp_path / "log.mat")
    assert caught.value.path == "columns.propeller.n.from"


@pytest.mark.parametrize("kind", [0, 8, 10, 14, 15, 19, 200])
@pytest.mark.parametrize("packed", [False, True])
def test_data_of_a_type_that_there_is_not_is_refused(kind: int, packed: bool, tmp_path: Path) -> None:
    """Before, the process ended, in scipy."""
    file, tag = tmp_path / "log.mat", struct.pack("<II", 9, T.nbytes)
    savemat(file, {"time": T})
    content = file.read_bytes()
    assert content.count(tag) == 1
    content = content.replace(tag, struct.pack("<II", kind, T.nbytes))
    inner = zlib.compress(content[128:])
    file.write_bytes(content[:128] + struct.pack("<II", 15, len(inner)) + inner if packed else content)
    with pytest.raises(DataError, match="or damaged"):
        read_log_table(file, MatFormat(kind="mat"), "time")


def test_a_sparse_vector_with_an_index_outside_it_is_refused(tmp_path: Path) -> None:
    vector = csc_matrix(T[:, None])
    vector.indices[3] = 10**9
    savemat(tmp_path / "log.mat", {"time": vector})
    with pytest.raises(DataError, match="or damaged"):
        read_log_table(tmp_path / "log.mat", MatFormat(kind="mat"), "time")


def test_a_matlab_file_of_version_7_3_has_its_remedy(tmp_path: Path) -> None:
    """As MATLAB writes its first 128 bytes: text, no subsystem, version 0x0200, byte order; HDF5 follows."""
    (tmp_path / "log.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM" + bytes(600))
    with pytest.raises(DataError, match=r"a MATLAB file of version 7\.3: save it with") as caught:
        import_log(read_mapping(mapping_with(tmp_path, 'kind = "mat"')), tmp_path / "log.mat")
    assert caught.value.path == "format.kind"


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_file_of_matlab_4_is_read_where_its_kind_is_said(order: str, log: pd.DataFrame, tmp_path: Path) -> None:
    """It begins with no word, but with five integers: type, rows, columns, whether complex, length of the name."""
    content = b""
    for name in log:
        sizes = [1000 * (order == ">"), len(log), 1, 0, len(name) + 1]
        content += np.array(sizes, f"{order}i4").tobytes() + name.encode() + b"\0"
        content += log[name].to_numpy().astype(f"{order}f8").tobytes()
    (tmp_path / "log.mat").write_bytes(content)
    assert is_mat(tmp_path / "log.mat", content) is None
    assert_is_the_motion(mapping_with(tmp_path, 'kind = "mat"'), tmp_path / "log.mat")
