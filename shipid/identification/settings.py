"""Settings of an identification, the `[identify]` table: unknown parameters, fitted signals, nuisances and solver."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, field_validator, model_validator

from shipid import document as documents
from shipid.checked import CheckedModel
from shipid.data.dataset import Array
from shipid.engine.integrate import Method
from shipid.errors import DocumentError, suggest_name
from shipid.identification.plausible import plausible_factors
from shipid.identification.segments import Changes
from shipid.physics.signals import is_output, rows_of_role
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import select_paths
from shipid.vessel.schema import SHARED

Positive = Annotated[FiniteFloat, Field(gt=0)]
BLOCK = "identify"
POSITIVE = 1e-3  # least factor of a number that must not be 0: a mass, a diameter, a resistance
ENVIRONMENT = "environment"
DIMENSIONS = frozenset((*SHARED, "x_aft", "x_fwd"))  # and constants: no pattern selects them
WEIGHTED = {"u": ("u",), "v": ("v",), "r": ("r",), "psi": ("psi",), "position": ("north", "east")}
"""Name in `weights` -> columns of the data that it fits."""
NUISANCES: dict[str, dict[str, float]] = {
    "initial_state": {},
    "current": {"current_north": 0.0, "current_east": 0.0},
    "thrust_scale": {"thrust_scale": 1.0},
    "latency": {"latency": 0.0},
    "heading_bias": {"heading_bias": 0.0},
    "velocity_bias": {"velocity_bias_u": 0.0, "velocity_bias_v": 0.0},
    "velocity_scale": {"velocity_scale": 1.0},
    "rate_bias": {"rate_bias": 0.0},
    "helm_zero": {"helm_zero": 0.0},
    "lever_arm": {"lever_arm": 0.0},
}
"""Name in `nuisance` -> its scalars with their fault-free values."""
UNITS_OF_NUISANCES = {
    **dict.fromkeys(("thrust_scale", "velocity_scale"), "1"),
    **dict.fromkeys(("heading_bias", "helm_zero"), "rad"),
    **{"latency": "s", "lever_arm": "m", "rate_bias": "rad/s"},
    **dict.fromkeys(("current_north", "current_east", "velocity_bias_u", "velocity_bias_v"), "m/s"),
}
"""Scalar of a nuisance -> its unit."""
MOVING = ("current_north", "current_east", "thrust_scale", "latency", "helm_zero")
"""Scalars that change the motion; the others change only the measurement."""
WIDE = {"initial_state": 1.0, "current": 5.0, "thrust_scale": 0.1, "latency": 1.0, "lever_arm": 10.0} | {
    "heading_bias": math.radians(3.0),
    "velocity_bias": 1.0,
    "velocity_scale": 0.1,
    "rate_bias": 1.0,
    "helm_zero": math.radians(3.0),
}
"""Nuisance -> width where the settings name none; of a current and velocity_bias in typical errors of u, of a lever
arm in those of a position, of rate_bias in those of r (`shipid.identification.residuals.typical_errors`)."""
WIDTH_UNITS = {"current": "u", "velocity_bias": "u", "lever_arm": "north", "rate_bias": "r"}


class Identify(CheckedModel, BaseModel):
    """The `[identify]` table. The unknowns are factors on the base values of the vessel's parameters (dotted paths).

    weights : standard deviations of the signals [m/s, rad/s, rad, m], and of measured outputs by the names of their
    columns (`propeller.thrust` [N]). Widths of nuisances: standard deviations of the weights (initial_state), m/s
    (current, velocity_bias), rad (heading_bias, helm_zero), rad/s (rate_bias), m (lever_arm), s (latency), 1
    (thrust_scale, velocity_scale).
    """

    parameters: Annotated[list[str], Field(min_length=1)] = Field(
        description="dotted paths; * and [order >= 3] select, as in a family, but no constants and no dimensions"
    )
    fixed: list[str] = Field(default=[], description="selections taken out again")
    together: list[Annotated[list[str], Field(min_length=1)]] = Field(
        default=[], description="lists of selections that share one factor"
    )
    prior: dict[str, Positive] = Field(default={}, description="selection -> standard deviation of the factor")
    bounds: dict[str, tuple[float, float]] = Field(default={}, description="selection -> [low, high] of the factor")
    scale: dict[str, Positive] = Field(default={}, description="path -> value at factor 1, where the base value is 0")
    horizon: Annotated[FiniteFloat, Field(ge=0)] = Field(
        default=30.0, description="s of each prediction; 0: every run as a whole"
    )
    step: Positive = Field(default=1.0, description="s")
    method: Method = "rk4"
    commands: Changes = Field(
        default="held",
        description="held: a command counts from its row to the next; between: an order to an actuator changes in the "
        "middle between two rows, any other command evenly",
    )
    weights: dict[str, Positive] = Field(
        default={}, description="standard deviations; default: u, v, r by the noise of the log and the ship's speed"
    )
    loss: Literal["squared", "huber"] = "squared"
    threshold: Positive = Field(default=2.0, description="standard deviations beyond which huber counts linearly")
    nuisance: dict[str, Positive] | list[str] = Field(default=[], description="per-run unknowns, with prior widths")
    current: Literal["chosen", "none", "one", "by run"] = Field(
        default="chosen",
        description="current of the runs: none, one of all, one by run; chosen: what the residuals show",
    )
    runs: dict[str, Any] = Field(default={}, description='"<run>.<path>" -> value for that run alone')
    start: Literal["growing", "inverse", "base"] = Field(
        default="growing",
        description="where to begin: growing horizons, inverse dynamics, or the base",
    )
    discount: bool = Field(
        default=False,
        description="correlated residuals weigh as their number of independent ones, so that priors count",
    )
    ranges: bool = Field(default=False, description="numbers stay within the ranges that ships have")
    drop: Positive | None = Field(
        default=None, description="standard errors under which a factor's distance from `drop_to` is dropped"
    )
    drop_to: Literal["base", "zero"] = "base"

    @field_validator("weights", mode="before")
    @classmethod
    def _by_column(cls, given: Any) -> Any:
        """The nested table `propeller = { thrust = 500 }` as the column `propeller.thrust`."""
        return dict(documents.document_leaves(given, lists=False)) if isinstance(given, dict) else given

    @model_validator(mode="after")
    def _known(self) -> Identify:
        for name in self.weights:
            if name not in WEIGHTED and not is_output(name):
                outputs = ", ".join(rows_of_role("output"))
                raise ValueError(
                    f"weights.{name} is no valid name: {suggest_name(name, WEIGHTED)} (or a measured output, "
                    f"<component>.<signal> with a signal of {outputs})"
                )
        for name in self.nuisance:
            if name not in NUISANCES:
                raise ValueError(f"nuisance.{name} is no valid name: {suggest_name(name, NUISANCES)}")
        for path, (low, high) in self.bounds.items():
            if not low <= high:
                raise ValueError(
                    f"bounds.{path}: [{low:g}, {high:g}] are no two rising numbers: give [low, high], or inf"
                )
        if self.commands == "between" and self.outputs:
            message = "'between' is not for measured outputs, which belong to the command of their row"
            raise ValueError(f"commands: {message}: leave weights.{self.outputs[0]} out, or write 'held'")
        if self.horizon and self.horizon < 2 * self.step:
            raise ValueError(f"horizon {self.horizon:g} s must hold two steps of {self.step:g} s, or be 0")
        return self

    @property
    def widths(self) -> dict[str, float]:
        """Nuisance -> standard deviation of its prior, in the order of `NUISANCES`."""
        given = self.nuisance if isinstance(self.nuisance, Mapping) else {name: WIDE[name] for name in self.nuisance}
        given = {"current": WIDE["current"], **given} if self.current in ("one", "by run") else given
        return {
            name: given[name] for name in NUISANCES if name in given and (name, self.current) != ("current", "none")
        }

    def with_current_named(self) -> Identify:
        """Settings that choose no current: by run where a nuisance asks for it, else none.

        For fits whose vessel is used on other runs without the current that was estimated beside its numbers.
        """
        kind = "by run" if "current" in self.nuisance else "none"
        return self.model_copy(update={"current": kind}) if self.current == "chosen" else self

    def with_sizes(self, sizes: Mapping[str, float]) -> Identify:
        """Settings with numbers for the weights and widths that they do not name; sizes : of `typical_errors`."""
        named = self.nuisance if isinstance(self.nuisance, Mapping) else {}
        widths = {
            name: width * (1.0 if name in named else sizes.get(WIDTH_UNITS.get(name, ""), 1.0))
            for name, width in self.widths.items()
        }
        weights = self.weights or {name: sizes[name] for name in ("u", "v", "r")}
        return self.model_copy(update={"weights": weights, "nuisance": widths})

    @property
    def signals(self) -> dict[str, float]:
        """Fitted column -> standard deviation of its residuals, in the unit of the column."""
        return {column: width for name, width in self.weights.items() for column in weighted_columns(name)}

    @property
    def linear_from(self) -> float:
        """Standard deviations beyond which a residual counts linearly: `threshold` with huber, else infinite."""
        return self.threshold if self.loss == "huber" else math.inf

    @property
    def outputs(self) -> list[str]:
        """Fitted outputs of components, such as `propeller.thrust`."""
        return [name for name in self.weights if is_output(name)]


def weighted_columns(name: str) -> tuple[str, ...]:
    """Columns of the data that a name in `weights` fits; an output is its column."""
    return WEIGHTED.get(name, (name,))


@dataclass(frozen=True)
class Unknowns:
    """The n factors to estimate.

    groups : paths that share each factor; the first is the name of the factor. With one current of all runs the last
    two are its components.
    scale : for each group, the value of each of its paths at factor 1.
    centre : (n,) factor of the base vessel: 1, or 0 where the base value is 0.
    low, high : (n,) bounds. low is 0 where the vessel's checks refuse the other sign, `POSITIVE` where also 0.
    prior : (n,) standard deviations; inf without a prior.
    """

    groups: tuple[tuple[str, ...], ...]
    scale: tuple[tuple[float, ...], ...]
    centre: Array
    low: Array
    high: Array
    prior: Array

    @property
    def paths(self) -> tuple[str, ...]:
        """Name of each factor: the first path of its group."""
        return tuple(group[0] for group in self.groups)

    def values(self, factors: Sequence[float] | Array) -> dict[str, float]:
        """Path -> parameter value [SI] for given factors (n,); a current is no parameter."""
        return {
            path: float(scale * factor)
            for group, scales, factor in zip(self.groups, self.scale, factors, strict=True)
            for path, scale in zip(group, scales, strict=True)
            if path not in NUISANCES["current"]
        }


def free_factors(vessel: Vessel, settings: Identify) -> Unknowns:
    """The factors that the settings leave free; DocumentError for a selection without a match or a zero base value."""
    base = vessel.parameters

    def chosen(patterns: Sequence[str], key: str) -> list[str]:
        try:
            return select_paths(patterns, base, None, f"{BLOCK}.{key}")
        except DocumentError as error:
            message = f"{error.message}{_default_parameter_remedy(vessel, patterns)}"
            raise DocumentError(message, path=error.path) from None

    selected = chosen(settings.parameters, "parameters")
    known = measured_constants(selected, settings)
    if known == set(selected):
        message = f"selects dimensions and constants only: to fit them all the same, write {', '.join(sorted(known))}"
        raise DocumentError(message, path=f"{BLOCK}.parameters")

    def reached(pattern: str, key: str, among: Collection[str]) -> list[str]:
        paths = [path for path in chosen([pattern], key) if path in among]
        if not paths:
            message = (
                f"{pattern!r} selects no parameter that is free in the fit: add it to parameters, or remove it here"
            )
            raise DocumentError(message, path=f"{BLOCK}.{key}")
        return paths

    fixed = {path for pattern in settings.fixed for path in reached(pattern, "fixed", selected)}
    free = [path for path in selected if path not in fixed | known]
    if not free:
        raise DocumentError(
            "every selected parameter is also fixed, so none is left to estimate: fix fewer",
            path=f"{BLOCK}.fixed",
        )
    unknown = next((path for path in settings.scale if base.get(path, 1.0) != 0), None)
    if unknown is not None:
        hint = f"is {base[unknown]:g}: scale is for a 0" if unknown in base else suggest_name(unknown, base)
        raise DocumentError(f"{unknown!r}: {hint}", path=f"{BLOCK}.scale")
    groups = [without_zeros(group, settings, base) for group in _factor_groups(settings, free, chosen)]
    scales = []
    for group in groups:
        if len({base[path] == 0 for path in group}) > 1:
            message = f"{' and '.join(group)} share a factor, but some are 0 and some are not: untie them"
            raise DocumentError(message, path=f"{BLOCK}.together")
        bare = next((path for path in group if base[path] == 0 and path not in settings.scale), None)
        if bare is not None:
            message = f'{bare} is 0, which no factor changes: give its size, scale."{bare}" = ..., or fix it'
            raise DocumentError(message, path=f"{BLOCK}.scale")
        scales.append(tuple(settings.scale.get(path, base[path]) for path in group))
    centre = np.array([0.0 if base[group[0]] == 0 else 1.0 for group in groups])
    high, prior = np.full(len(groups), np.inf), np.full(len(groups), np.inf)
    key = _VesselKey(vessel.digest, vessel)
    low = np.array([max(_smallest_factor(key, path) for path in group) for group in groups])
    place = {path: i for i, group in enumerate(groups) for path in group}
    for path, i in place.items() if settings.ranges else ():
        least, most = plausible_factors(vessel, path)
        low[i], high[i] = max(low[i], least), min(high[i], most)
    for pattern, limits in settings.bounds.items():
        for path in reached(pattern, "bounds", place):
            low[place[path]], high[place[path]] = limits  # as the user says, also below 0
    for pattern, width in settings.prior.items():
        for path in reached(pattern, "prior", place):
            prior[place[path]] = width
    if settings.current == "one":  # two more factors, of the width of its prior
        groups += [(name,) for name in NUISANCES["current"]]
        scales += 2 * [(settings.widths["current"],)]
        centre, low, high, prior = (
            np.append(x, 2 * [more]) for x, more in ((centre, 0.0), (low, -np.inf), (high, np.inf), (prior, 1.0))
        )
    return Unknowns(tuple(groups), tuple(scales), centre, low, high, prior)


def _default_parameter_remedy(vessel: Vessel, patterns: Sequence[str]) -> str:
    """How to make a number that the vessel leaves at its default one that can be fitted; empty where there is none."""
    for path in patterns:
        block, _, name = path.rpartition(".")
        if path in vessel.parameters or "*" in path or not block:
            continue
        if any(_accepts_value(vessel, path, value) for value in (0.0, 1.0)):
            return f"; to fit {name}, which this vessel leaves out, write it in [{block}] of a file that extends her"
    return ""


def measured_constants(asked: Sequence[str], settings: Identify) -> set[str]:
    """Dimensions and constants among paths that patterns select, which are measured or known; none written in full."""
    named = {*settings.parameters, *settings.prior, *settings.bounds, *settings.scale}
    named |= {path for group in settings.together for path in group}
    return {
        path
        for path in asked
        if path.rpartition(".")[2] in DIMENSIONS and ".actuator." not in path and path not in named
    }


@dataclass(frozen=True)
class _VesselKey:
    """A vessel as a key of a cache: two are equal if their documents have one digest."""

    digest: str
    vessel: Vessel = field(compare=False)


@lru_cache(maxsize=4096)
def _smallest_factor(key: _VesselKey, path: str) -> float:
    """Smallest factor that the vessel's checks accept: -inf; 0 if they refuse the other sign; `POSITIVE` if also 0."""
    vessel, base = key.vessel, key.vessel.parameters[path]
    if base == 0 or _accepts_value(vessel, path, -base):
        return -math.inf
    return 0.0 if _accepts_value(vessel, path, 0.0) else POSITIVE


def _accepts_value(vessel: Vessel, path: str, value: float) -> bool:
    try:
        vessel.with_values({path: value})
    except DocumentError:
        return False
    return True


def _factor_groups(settings: Identify, free: list[str], chosen: Any) -> list[tuple[str, ...]]:
    of: dict[str, int] = {}
    for number, patterns in enumerate(settings.together):
        for path in chosen(patterns, f"together.{number}"):
            if path not in free or path in of:
                bound = "is tied but not free: add it to parameters, or untie it"
                message = f"{path} {bound if path not in free else 'is in two groups: tie all of them in one'}"
                raise DocumentError(message, path=f"{BLOCK}.together.{number}")
            of[path] = number
    groups: dict[Any, list[str]] = {}
    for path in free:
        groups.setdefault(of.get(path, path), []).append(path)
    return [tuple(group) for group in groups.values()]


def without_zeros(group: Sequence[str], settings: Identify, base: Mapping[str, float]) -> tuple[str, ...]:
    """A group without the numbers that are 0 and that patterns alone tie to others: times a factor they stay 0."""
    named = {*settings.scale, *settings.parameters, *(path for patterns in settings.together for path in patterns)}
    kept = tuple(path for path in group if base[path] != 0 or path in named)
    return kept if any(base[path] != 0 for path in kept) else tuple(group)


def run_overrides(settings: Identify, runs: Sequence[str]) -> dict[str, Any]:
    """The overrides `<run>.<path>` -> value in the settings that belong to some runs."""
    given = documents.document_leaves(settings.runs, lists=False)
    return {key: value for key, value in given if any(key.startswith(f"{run}.") for run in runs)}


def resolve_overrides(
    settings: Identify, runs: Sequence[str], vessel: Vessel, channels: Sequence[str], known: Sequence[str] = ()
) -> dict[str, dict[str, float]]:
    """Run -> {path or `environment.<channel>`: value} of the settings' `runs`; DocumentError for an unknown name.

    channels : of the vessel. known : all runs of the data; overrides for runs outside the fit are left out.
    """
    result: dict[str, dict[str, float]] = {run: {} for run in (*runs, *known)}
    valid = [*vessel.parameters, *(f"{ENVIRONMENT}.{name}" for name in channels)]
    for key, value in documents.document_leaves(settings.runs, lists=False):
        run = next((name for name in sorted(result, key=len, reverse=True) if key.startswith(f"{name}.")), None)
        where = f"{BLOCK}.runs.{key}"
        if run is None:
            hint = suggest_name(key.split(".", 1)[0], result)
            raise DocumentError(f"does not begin with the name of a run: {hint}", path=where)
        path = key[len(run) + 1 :]
        if path not in valid:
            raise DocumentError(f"{path!r} cannot be set for a run: {suggest_name(path, valid)}", path=where)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise DocumentError(f"{value!r} is not a number", path=where)
        result[run][path] = float(value)
    return {run: result[run] for run in runs}
