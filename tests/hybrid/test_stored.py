"""Fitted objects: what is stored says what was, and what is damaged is refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shipid.errors import ResultError
from shipid.hybrid.features import Memory
from shipid.hybrid.stored import StoredData

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part(StoredData):
    names: tuple[str, ...]
    mirror: Array | None
    layers: tuple[tuple[Array, Array], ...]


@dataclass(frozen=True, eq=False)
class Whole(StoredData):
    parts: tuple[Part, ...]
    block: Mapping[str, Array]
    memory: Memory
    scale: float = 1.0


WHOLE = Whole(
    (Part(("u",), None, ((np.eye(2), np.ones(2)),)), Part((), np.ones((3, 3)), ())),
    {"w": np.arange(3)},
    Memory(error=(8.0,)),
)


def read_back(header: Any, arrays: Any) -> Whole:
    return Whole.from_arrays(json.loads(json.dumps(header)), arrays)


def test_all_fields_come_back() -> None:
    header, arrays = WHOLE.header(), WHOLE.arrays()
    assert sorted(arrays) == ["block.w", "parts.0.layers.0.0", "parts.0.layers.0.1", "parts.1.mirror"]
    again = read_back(header, arrays)
    assert again.header() == header
    assert again.parts[0].mirror is None
    assert isinstance(again.parts, tuple)
    assert again.memory == WHOLE.memory
    for name, values in again.arrays().items():
        assert values is arrays[name]


@pytest.mark.parametrize("name", WHOLE.arrays())
def test_an_array_that_is_missing_or_of_another_shape_is_named(name: str) -> None:
    arrays = WHOLE.arrays()
    with pytest.raises(ResultError, match=rf"^{name}: missing in the saved method"):
        read_back(WHOLE.header(), {key: values for key, values in arrays.items() if key != name})
    with pytest.raises(ResultError, match=rf"^{name}: the arrays of the saved method do not fit together"):
        read_back(WHOLE.header(), arrays | {name: np.zeros((1, 7))})


def test_a_header_of_another_kind_is_named() -> None:
    with pytest.raises(ResultError, match=r"^scale: must be of type float, not 'wide'"):
        read_back(WHOLE.header() | {"scale": "wide"}, WHOLE.arrays())
    with pytest.raises(ResultError, match=r"^memory: missing"):
        read_back({key: value for key, value in WHOLE.header().items() if key != "memory"}, WHOLE.arrays())
