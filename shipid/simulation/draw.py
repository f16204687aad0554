"""Manoeuvres drawn from ranges: a block of a study's truth, and the manoeuvre that it gives a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from shipid.errors import choices
from shipid.simulation.manoeuvre import KINDS, Manoeuvre

At = Callable[[str], float]
"""Name of a quantity -> where in its range it lies, in [0, 1)."""

SHARED = ("name", "duration")  # of a kind: given for all runs of a truth
UNITS = ("_rpm", "_deg")
SEEDS = 2**31  # as many seeds a manoeuvre may draw
COURSE = "course_deg"


class Draw(BaseModel):
    """`[[truth.manoeuvre]]`: a kind of manoeuvre, its share of the runs, and the keys of the kind.

    A number is fixed. Where the kind takes a number, a pair [low, high] is a range, drawn uniformly once a run. A list
    of texts is drawn with equal chances. `course_deg` and `seed` are drawn where they are absent. In kinds with
    `orders`, every key that is none of the kind orders commands: `n_rpm`, `alpha_deg`, `bow.n_rpm`.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    kind: str = "turning"
    share: Annotated[FiniteFloat, Field(gt=0, description="weight among all blocks")] = 1.0

    @model_validator(mode="after")
    def _fits(self) -> Draw:
        if self.kind not in KINDS:
            raise ValueError(f"{self.kind!r} is no kind of manoeuvre: {choices(self.kind, KINDS)}")
        for place in (0.0, 1.0):  # what holds at both ends of every range holds between
            self.manoeuvre(1.0, lambda _, place=place: place)  # type: ignore[misc]
        return self

    def manoeuvre(self, duration: float, at: At) -> Manoeuvre:
        """Return the manoeuvre of one run.

        Parameters
        ----------
        duration : of its log [s].
        at : where in its range each quantity lies: a key without its unit (`n`, `angle`), `psi` for the course.

        Raises
        ------
        ValueError : a key that the kind has not, or a value that it refuses.
        """
        kind = KINDS[self.kind]
        fields = {name: field.annotation for name, field in kind.model_fields.items() if name not in SHARED}
        given: dict[str, Any] = {}
        orders: dict[str, Any] = {}
        level = get_args(fields["orders"])[1] if "orders" in fields else None
        for key, value in _flat(self.model_extra or {}):
            if key in fields and key != "orders":
                given[key] = value if _takes_many(fields[key]) else _drawn(key, value, at)
            elif level is not None and key not in SHARED:
                orders[key] = _range(key, value) if _takes_many(level) else _drawn(key, value, at)
            else:
                remedy = "[truth] gives it for all runs" if key in SHARED else choices(key, fields)
                raise ValueError(f"{key}: no key of {self.kind}: {remedy}")
        if level is not None:
            given["orders"] = orders
        if "seed" in fields:
            given.setdefault("seed", int(at("seed") * SEEDS))
        if "duration" in kind.model_fields:
            given["duration"] = duration
        given.setdefault(COURSE, _between(0.0, 360.0, at("psi")))
        try:
            return kind.model_validate(given)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            message = first["msg"].removeprefix("Value error, ")
            raise ValueError(f"{'.'.join(map(str, first['loc'])) or self.kind}: {message}") from None


def _flat(given: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Keys and values, those of a table as `table.key`: `bow.n_rpm = 0` is a table in TOML."""
    found: list[tuple[str, Any]] = []
    for key, value in given.items():
        found += (
            [(f"{key}.{inner}", one) for inner, one in value.items()] if isinstance(value, Mapping) else [(key, value)]
        )
    return found


def _takes_many(annotation: Any) -> bool:
    """Whether a field takes a list as it is: a tuple, list or table."""
    if get_origin(annotation) is Annotated:
        return _takes_many(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return any(map(_takes_many, get_args(annotation)))
    return get_origin(annotation) in (tuple, list, dict)


def _drawn(key: str, value: Any, at: At) -> Any:
    """A value as it is, a number between the two of a pair, or one of several texts."""
    if not isinstance(value, list | tuple):
        return value
    if value and all(isinstance(one, str) for one in value):
        return value[min(int(at(key) * len(value)), len(value) - 1)]
    low, high = _range(key, value)
    return _between(low, high, at("psi" if key == COURSE else _quantity(key)))


def _quantity(key: str) -> str:
    """A key without its unit."""
    return next((key.removesuffix(unit) for unit in UNITS if key.endswith(unit)), key)


def _between(low: float, high: float, place: float) -> float:
    return low + (high - low) * place


def _range(key: str, value: Any) -> tuple[float, float]:
    """Least and greatest of a pair, or a number as both; ValueError for anything else."""
    pair = value if isinstance(value, list | tuple) else [value, value]
    if len(pair) != 2 or not all(isinstance(one, int | float) and not isinstance(one, bool) for one in pair):
        raise ValueError(f"{key}: give a number or [low, high], found {value!r}")
    low, high = pair
    if low > high:
        raise ValueError(f"{key} runs backwards: give [low, high], found [{low:g}, {high:g}]")
    return low, high
