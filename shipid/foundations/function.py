"""A simulator that is a function of Python: states at instants, orders and weather ahead -> states ahead."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar, Self, cast

import numpy as np

from shipid.arguments import as_float_array
from shipid.data.windows import Instants, Windows
from shipid.errors import DataError, DocumentError, suggest_name
from shipid.foundations.faults import PLACES, doubt_of_motion, errors_at_steps, path_of_places
from shipid.hybrid.physics import Needs
from shipid.hybrid.simulated import Array, NamedSimulator
from shipid.observer import MEASURED_MOTION
from shipid.physics.signals import measurable_signals
from shipid.plugins import Registry, fault_of_kind, import_user_module, locate_errors, users_code

SimulateFunction = Callable[..., Any]
FUNCTIONS: Registry[SimulateFunction] = Registry("shipid.foundations", partial(fault_of_kind, Callable))
"""Name, as after `function = ` in a document -> function, of Python or an installed package: it needs no trust."""
ARGUMENTS = ("states", "orders", "weather", "step")
LOOKED_AT = 50  # training windows on which signs of orders are tried
OTHER_WAY = 0.5  # times the error at the horizon as it is: an order with another sign that leaves less has it
BATCH = 1000  # instants of a call: 300 steps of 20 columns are 48 MB


@dataclass(frozen=True)
class SimulatorFunction(NamedSimulator):
    """A function `simulate(states, orders, weather, step, **parameters)` -> states (S, K, 6) after 1..K steps.

    states : (S, 6), north, east [m], psi [rad], u, v [m/s], r [rad/s]. orders, weather : name -> (S, K) in SI units,
    in force from step k-1 to k. step : [s]. A state that is no number means that it diverged there.

    key : `module:function` or a name in `FUNCTIONS`. file : of the module; empty where Python finds it.
    parameters : keyword numbers and their values.
    """

    key: str
    digest: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    file: str = ""
    trust: bool = field(default=False, compare=False)
    given: SimulateFunction | None = field(default=None, repr=False)
    gives: tuple[Needs, ...] = ("path", "motion", "steps")

    kind: ClassVar[str] = "function"

    @classmethod
    def read(cls, value: Any, folder: Path, trust: bool) -> Sequence[Self]:
        """Return the function that a document in a folder names; DocumentError where it may or can not be used."""
        module = value.partition(":")[0]
        beside = [place / f"{module}.py" for place in (folder, Path())]
        file = next((str(place.absolute()) for place in beside if place.is_file()), "")
        one = cls(value, file=file, trust=trust, given=FUNCTIONS.get(value))
        return [replace(one, digest=users_code((one.function,)), parameters=keyword_numbers(one.function, value))]

    @classmethod
    def from_header(cls, header: Mapping[str, Any], folder: Path, trust: bool) -> Self:  # noqa: ARG003
        """Return the function of a stored study; its code is not needed until it is called."""
        return cls(
            header["key"], header["digest"], header["parameters"], header["file"], trust, FUNCTIONS.get(header["key"])
        )

    def header(self) -> dict[str, Any]:
        """Return its name, the digest of its code, its parameters and its file."""
        return {
            **{name: getattr(self, name) for name in ("kind", "key", "digest", "file")},
            "parameters": dict(self.parameters),
        }

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the function with other parameters."""
        super().with_values({name: value for name, value in values.items() if name not in self.parameters})
        return replace(self, parameters={**self.parameters, **values})

    @cached_property
    def function(self) -> SimulateFunction:
        """The function itself; DocumentError where it may not be run, or is not there."""
        if self.given is not None:
            return self.given
        if ":" not in self.key:
            words = f"{self.key!r}: write 'module:function', or a name that Python put into FUNCTIONS"
            raise DocumentError(f"{words}: {suggest_name(self.key, FUNCTIONS.names)}")
        self.require_trust()
        module, _, name = self.key.partition(":")
        found = getattr(held := import_user_module(module, self.file), name, None)
        if not callable(found):
            raise DocumentError(f"{self.key!r}: {module} has no function {name!r}: {suggest_name(name, vars(held))}")
        return cast(SimulateFunction, found)

    def require_trust(self) -> None:
        """Raise DocumentError where the code that a document names may not be run."""
        if not self.trust:
            words = f"{self.key} is code that this document names: read it"
            raise DocumentError(f"{words}, and add --trust to run it (in Python: `read_plan(..., trust=True)`)")

    @property
    def code_digest(self) -> str:
        """Digest of its code as it is now; as it was when the study was read, where it may not be run."""
        return users_code((self.function,)) if self.trust or self.given is not None else self.digest

    def __getstate__(self) -> dict[str, Any]:
        """Leave a function of a file out: another process imports it anew."""
        return {name: value for name, value in vars(self).items() if name != "function"}

    def arguments_of(self, instants: Instants, horizon: int) -> tuple[Array, dict[str, Array], dict[str, Array]]:
        """States (S, 6), orders and weather, name -> (S, K), of instants."""
        columns, zero = instants.columns, np.zeros(len(instants))
        begun = np.stack([np.asarray(columns.get(name, zero), float) for name in MEASURED_MOTION], axis=-1)
        held = {name: values for name, values in columns.items() if "." in name}
        orders = {name: np.tile(values[:, None], horizon) for name, values in held.items()}
        orders |= {name: np.asarray(values)[:horizon].T for name, values in (instants.planned or {}).items()}
        weather = {name: np.tile(columns[name][:, None], horizon) for name in measurable_signals(columns)}
        return begun, orders, weather

    def check(self, training: Windows, test: Windows, before: Collection[int], remedy: str) -> Sequence[str]:  # noqa: ARG002
        """DataError, with a remedy, where sign, unit or frame of its orders or its motion seem to be wrong."""
        some = training.select(np.arange(0, len(training), max(len(training) // LOOKED_AT, 1)))
        states = self.states(some.instants(known=True), some.horizon, some.step)
        sound = np.asarray(np.isfinite([*states.values()]).all(axis=(0, 1)))
        if remedy and sound.any():
            some, states = some.select(sound), {name: values[:, sound] for name, values in states.items()}
            if doubt := self._doubt_of_orders(some) or doubt_of_motion(states, some):
                raise DataError(f"{doubt}; {remedy}", file=self.file)
        return ()

    def _doubt_of_orders(self, some: Windows) -> str:
        """Say which order moves the ship as in the runs with the other sign; empty: none."""
        given, errors = some.instants(known=True), dict[str, float]()
        for name in ("", *(planned := given.planned or {})):  # as it is, and with each order the other way
            turned = {key: -values if key == name else values for key, values in planned.items()}
            states = self.states(replace(given, planned=turned), some.horizon, some.step)
            path = path_of_places(np.stack([states[key] for key in PLACES], axis=-1), some)
            errors[name] = float(errors_at_steps(path, some)[-1])
        least = min(errors, key=errors.__getitem__)
        words = f"{least} acts the other way in the runs: check its sign (scale) and frame"
        return words if errors[least] < OTHER_WAY * errors[""] else ""

    def states(self, instants: Instants, horizon: int, step: float) -> Mapping[str, Array]:
        """Return the states that the function gives, name -> (T, S); it is called with `BATCH` instants at most."""
        (begun, *inputs), parts = self.arguments_of(instants, horizon), []
        for first in range(0, len(instants), BATCH):
            some = slice(first, first + BATCH)
            tables = ({name: values[some] for name, values in table.items()} for table in inputs)
            with locate_errors(self.key, self.function, "function"):
                given = self.function(begun[some], *tables, step, **self.parameters)
            parts.append(as_float_array(f"states of {self.key}", given, DataError))
            if parts[-1].shape != (wanted := (len(begun[some]), horizon, len(MEASURED_MOTION))):
                raise DataError(
                    f"{self.key} must give states {wanted}, {', '.join(MEASURED_MOTION)}, not {parts[-1].shape}"
                )
        every = np.concatenate(parts) if parts else np.empty((0, horizon, len(MEASURED_MOTION)))
        return {name: every[..., place].T for place, name in enumerate(MEASURED_MOTION)}


def keyword_numbers(function: SimulateFunction, key: str) -> dict[str, float]:
    """Keyword parameters of a function and their numbers; DocumentError where it does not take what it is given."""
    try:
        taken = inspect.signature(function)
        given = taken.bind(*ARGUMENTS).arguments
    except (TypeError, ValueError) as error:
        words = f"{key} must take ({', '.join(ARGUMENTS)}), and numbers by keyword with a value, such as m=1.0"
        raise DocumentError(f"{words}: {error}") from None
    return {
        name: float(one.default)
        for name, one in taken.parameters.items()
        if name not in given and isinstance(one.default, int | float) and not isinstance(one.default, bool)
    }
