"""Checks of what a caller from Python passes: one line names the argument, its value and what would be right."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipid.errors import ShipidError, suggest_name

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Kind = type[ShipidError]
MULTIPLE = 1e-6  # of a step: by so much less or more a time is still a multiple


def check_whole_number(name: str, value: Any, least: int = 0, error: Kind = ShipidError) -> int:
    """Return a whole number, of any type, 10.0 too; raise `error` for anything else."""
    import numpy as np

    try:
        number = int(value) if isinstance(value, float | np.floating) and value == int(value) else operator.index(value)
    except (TypeError, ValueError, OverflowError):
        number = least - 1
    if number < least or isinstance(value, bool | np.bool_):
        raise error(f"{name} must be a whole number, {least} or more, not {value!r}")
    return number


def check_number(name: str, value: Any, error: Kind = ShipidError) -> float:
    """Return a number of any type as a float; raise `error` for anything else."""
    import numpy as np

    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or np.iscomplexobj(value):
        raise error(f"{name} must be a number, not {value!r}")
    return float(value)


def check_positive(name: str, value: Any, error: Kind = ShipidError) -> float:
    """Return a finite number above 0 as a float; raise `error` for anything else."""
    number = check_number(name, value, error)
    if not 0 < number < math.inf:
        raise error(f"{name} must be a number above 0 and finite, not {value!r}")
    return number


def whole_steps(time: float, step: float) -> int:
    """Number of steps [s] that a time [s] consists of; 0 where it is no multiple of the step."""
    ratio = time / step
    count = round(ratio) if math.isfinite(ratio) else 0
    return count if abs(ratio - count) <= MULTIPLE * count else 0


def check_choice(name: str, value: Any, valid: Iterable[str], error: Kind = ShipidError) -> None:
    """Raise `error` for a value that is none of the valid names."""
    names = list(valid)
    if not isinstance(value, str) or value not in names:
        raise error(f"{name} {value!r} is not known: {suggest_name(value, names)}")


def as_names(name: str, value: Any, error: Kind = ShipidError) -> tuple[str, ...]:
    """Return one name or several as a tuple of texts; raise `error` for what is neither."""
    if isinstance(value, bytes) or not isinstance(value, Iterable):
        raise error(f"{name} must be a name, or several names, not {value!r}")
    return (value,) if isinstance(value, str) else tuple(str(one) for one in value)


def check_function_or_none(name: str, value: Any) -> None:
    """Raise ShipidError for a value that is neither a function nor None."""
    if value is not None and not callable(value):
        raise ShipidError(f"{name} must be a function, or None, not {value!r}")


def check_class(name: str, value: Any, kind: type, remedy: str, error: Kind = ShipidError) -> None:
    """Raise `error` for a value of another class; the remedy says where such a value comes from."""
    if not isinstance(value, kind):
        shown = repr(value) if isinstance(value, str | type) else type(value).__name__
        article = "an" if kind.__name__[0] in "AEIO" else "a"
        raise error(f"{name} must be {article} {kind.__name__}, {remedy}, not {shown}")


def check_mapping(name: str, value: Any, what: str, error: Kind = ShipidError) -> None:
    """Raise `error` for a value that is no mapping; `what` says of what to what, such as `a name to an array`."""
    if not isinstance(value, Mapping) and not hasattr(value, "keys"):  # a table has keys, too
        raise error(f"{name} must be a dict, of {what}, not {type(value).__name__}")


def as_path(name: str, value: Any, error: Kind = ShipidError) -> Path:
    """Return the path of a file or folder, given as a text or a Path; raise `error` for anything else."""
    if not isinstance(value, str | os.PathLike):
        raise error(f"{name} must be a path, a text or a Path, not {value!r}")
    return Path(value)


def as_float_array(name: str, values: Any, error: Kind = ShipidError) -> NDArray[np.float64]:
    """Return an array of floats, of a list, a series, a tensor or an array of any real type; masked values are NaN.

    An array of floats is not copied. Raises `error` for text, complex numbers and whatever else holds no real numbers.
    """
    import numpy as np

    try:
        if isinstance(values, np.ma.MaskedArray):
            values = np.ma.filled(values.astype(float), np.nan)
        array = np.asarray(values)
        if array.dtype.kind not in "fiubO":
            raise TypeError(f"{array.dtype}")
        return array.astype(float, copy=False)
    except (TypeError, ValueError, RuntimeError) as reason:
        raise error(f"{name} must be an array of numbers, not {type(values).__name__} ({reason})") from None
