"""Fitted objects as plain data and arrays: the fields of a dataclass say what is stored and how it is read back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import repeat
from types import UnionType
from typing import Any, Self, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from shipid.errors import ResultError

Arrays = Mapping[str, NDArray[Any]]
field_kinds = cache(get_type_hints)
"""Dataclass -> kind of each field; resolved once, for a report reads a thousand objects."""


class StoredData:
    """Base of frozen dataclasses that are written as plain JSON and arrays, and rebuilt from them.

    Fields may be numbers, texts, arrays, pydantic models, other such dataclasses, and tuples, mappings and `| None` of
    these. An array is called by its dotted path, such as `networks.0.normaliser.mean`.
    """

    def header(self) -> dict[str, Any]:
        """Return all fields as plain JSON, with the shape of each array."""
        return dict(_split_arrays(self, "", {}))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by path."""
        arrays: dict[str, NDArray[Any]] = {}
        _split_arrays(self, "", arrays)
        return arrays

    @classmethod
    def from_arrays(cls, header: Mapping[str, Any], arrays: Arrays) -> Self:
        """Rebuild what `header` and `arrays` gave; ResultError with the path of what is missing or does not fit."""
        try:
            made: Self = _rebuild_value(cls, header, arrays, "")
        except KeyError as error:
            raise ResultError(
                "missing in the saved method: another version wrote it, so run the study again", path=str(error.args[0])
            ) from None
        return made


def _split_arrays(value: Any, path: str, arrays: dict[str, NDArray[Any]]) -> Any:
    """A value as plain JSON; its arrays are added to `arrays`. A path begins with a dot."""
    if isinstance(value, np.ndarray):
        arrays[path[1:]] = value
        return list(value.shape)
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, tuple):
        return [_split_arrays(entry, f"{path}.{place}", arrays) for place, entry in enumerate(value)]
    table = vars(value) if is_dataclass(value) else value
    if isinstance(table, Mapping):
        return {name: _split_arrays(entry, f"{path}.{name}", arrays) for name, entry in table.items()}
    return value


def _rebuild_value(kind: Any, plain: Any, arrays: Arrays, path: str) -> Any:
    """A value of an annotated kind from its JSON and the arrays below its path."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin is UnionType:  # with None
        return None if plain is None else _rebuild_value(inner[0], plain, arrays, path)
    if origin is np.ndarray:
        if list(arrays[path[1:]].shape) != plain:
            raise ResultError("the arrays of the saved method do not fit together", path=path[1:])
        return arrays[path[1:]]
    if origin is tuple:
        kinds = zip(repeat(inner[0]) if inner[-1] is Ellipsis else inner, plain, strict=False)
        return tuple(_rebuild_value(*pair, arrays, f"{path}.{place}") for place, pair in enumerate(kinds))
    if origin is not None:  # a mapping
        return {name: _rebuild_value(inner[1], entry, arrays, f"{path}.{name}") for name, entry in plain.items()}
    if is_dataclass(kind):
        hints = field_kinds(kind)  # type: ignore[arg-type]
        parts = {f.name: _rebuild_value(hints[f.name], plain[f.name], arrays, f"{path}.{f.name}") for f in fields(kind)}
        return kind(**parts)  # type: ignore[operator]
    if issubclass(kind, BaseModel):
        return kind(**plain)
    if not isinstance(plain, int | float if kind is float else kind):
        raise ResultError(f"must be of type {kind.__name__}, not {plain!r}", path=path[1:])
    return plain
