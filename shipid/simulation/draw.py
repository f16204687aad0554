"""Random manoeuvres: a `[[truth.manoeuvre]]` block with ranges, and the manoeuvre drawn from it for one run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from shipid.checked import CheckedModel
from shipid.document import requirement_words, taken_for_numbers
from shipid.errors import suggest_name
from shipid.simulation.manoeuvre import KINDS, Manoeuvre

At = Callable[[str], float]
"""Name of a quantity -> where in its range it lies, in [0, 1)."""

SHARED = ("name", "duration")  # keys of a kind that [truth] sets for all runs
SEEDS = 2**31  # number of different seeds that may be drawn
COURSE = "course_deg"


class ManoeuvreDraw(CheckedModel, BaseModel):
    """`[[truth.manoeuvre]]`: a kind of manoeuvre, its share of the runs, and the keys of the kind.

    A number is a fixed value. A pair [low, high] in place of a number is a range; each run draws from it uniformly.
    From a list of texts each run draws one with equal probability. `course_deg` and `seed` are drawn if absent. In
    kinds with `orders`, every other key is an order to commands: `n_rpm`, `alpha_deg`, `bow.n_rpm`.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    kind: str = "turning"
    share: Annotated[FiniteFloat, Field(gt=0, description="weight among all blocks")] = 1.0

    @model_validator(mode="after")
    def _fits(self) -> ManoeuvreDraw:
        if self.kind not in KINDS:
            raise ValueError(f"{self.kind!r} is no kind of manoeuvre: {suggest_name(self.kind, KINDS)}")
        for place in (0.0, 1.0):  # valid at both ends of every range: valid between them
            self.manoeuvre(1.0, lambda _, place=place: place)  # type: ignore[misc]
        return self

    def manoeuvre(self, duration: float, at: At) -> Manoeuvre:
        """Return the manoeuvre of one run.

        duration : length of the log [s].
        at : quantity -> position in its range, in [0, 1). A quantity is a key without its unit (`n`, `angle`), or `psi`
            for the course.

        Raises
        ------
        ValueError : a key that the kind does not have, or an invalid value.
        """
        kind = KINDS[self.kind]
        fields = {name: field.annotation for name, field in kind.model_fields.items() if name not in SHARED}
        given: dict[str, Any] = {}
        orders: dict[str, Any] = {}
        level = get_args(fields["orders"])[1] if "orders" in fields else None
        for key, value in _flatten_keys(self.model_extra or {}):
            if key in fields and key != "orders":
                given[key] = value if is_collection_type(fields[key]) else _draw_value(key, value, at)
            elif level is not None and key not in SHARED:
                orders[key] = range_limits(key, value) if is_collection_type(level) else _draw_value(key, value, at)
            else:
                remedy = "[truth] gives it for all runs" if key in SHARED else suggest_name(key, fields)
                raise ValueError(f"{key}: no key of {self.kind}: {remedy}")
        if level is not None:
            given["orders"] = orders
        if "seed" in fields:
            given.setdefault("seed", int(at("seed") * SEEDS))
        if "duration" in kind.model_fields:
            given["duration"] = duration
        given.setdefault(COURSE, 360.0 * at("psi"))
        try:
            manoeuvre: Manoeuvre = kind.__pydantic_validator__.validate_python(given)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key = ".".join(str(part) for part in first["loc"] if part != "orders")
            raise ValueError(f"{key or self.kind}: {requirement_words(first)}") from None
        for key, value in taken_for_numbers(given, manoeuvre):
            raise ValueError(f"{key}: {value!r}: must be a number")
        return manoeuvre


def _flatten_keys(given: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Pairs of key and value; a key in a table becomes `table.key`, because `bow.n_rpm = 0` is a table in TOML."""
    return [
        (f"{key}.{inner}" if inner else key, one)
        for key, value in given.items()
        for inner, one in (value.items() if isinstance(value, Mapping) else [("", value)])
    ]


def is_collection_type(annotation: Any) -> bool:
    """Whether the type of a field is a tuple, list or table, so that a list is its value and not a range."""
    if get_origin(annotation) is Annotated:
        return is_collection_type(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return any(map(is_collection_type, get_args(annotation)))
    return get_origin(annotation) in (tuple, list, dict)


def _draw_value(key: str, value: Any, at: At) -> Any:
    """The value itself, a number from the range [low, high], or one of several texts."""
    if not isinstance(value, list | tuple):
        return value
    if value and all(isinstance(one, str) for one in value):
        return value[min(int(at(key) * len(value)), len(value) - 1)]
    low, high = range_limits(key, value)
    quantity = "psi" if key == COURSE else key.removesuffix("_rpm").removesuffix("_deg")
    return low + (high - low) * at(quantity)


def range_limits(key: str, value: Any) -> tuple[float, float]:
    """(low, high) of a pair; (x, x) of a number x; ValueError for anything else."""
    pair = value if isinstance(value, list | tuple) else [value, value]
    if len(pair) != 2 or not all(isinstance(one, int | float) and not isinstance(one, bool) for one in pair):
        raise ValueError(f"{key}: give a number or [low, high], not {value!r}")
    low, high = pair
    if low > high:
        raise ValueError(f"{key} has low > high: give [low, high], not [{low:g}, {high:g}]")
    return low, high
