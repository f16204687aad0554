"""The table of an FMU: which of its variables are which signals, in which unit and axes.

The standard: Functional Mock-up Interface 1.0, 2.0 and 3.0 for co-simulation, fmi-standard.org.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from shipid import document as documents
from shipid.checked import CheckedModel, Positive
from shipid.errors import DocumentError, ShipidError, suggest_name
from shipid.foundations.function import STATES
from shipid.logs.mapping import UNITS
from shipid.physics.signals import ACTUAL, SIGNALS, is_command, signal_of

Array = np.ndarray
Role = Literal["input", "output", "start", "parameter"]
BEFORE = ("output", "local", "parameter", "input")  # what may be set before the start
ROLES = {"input": ("input",), "output": ("output", "local"), "start": BEFORE, "parameter": BEFORE}
"""Role of a row -> causalities of the variables that it may name."""


class FmuRow(BaseModel):
    """A row of `[fmu]`, `signal = { variable = ... }`: the signal is scale * variable + offset in `unit`."""

    model_config = ConfigDict(extra="forbid")
    variable: str
    unit: str | None = Field(default=None, description="default: that of the variable, else that of the signal")
    scale: Annotated[FiniteFloat, Field(description="not 0")] = 1.0
    offset: FiniteFloat = 0.0
    frame: Literal["ned", "enu", "body"] | None = Field(
        default=None,
        description="ned: angles from north to the right; enu: from east to the left; u, v in these or body axes",
    )
    role: Role | None = Field(default=None, description="default: by the causality of the variable")


class FmuTable(CheckedModel, BaseModel):
    """`[fmu]`: a file, its step, and a row, or a list of rows, for each signal."""

    model_config = ConfigDict(extra="forbid")
    file: str
    step: Annotated[Positive | None, Field(description="s of communication; default: that of the prediction")] = None
    limit: Annotated[Positive, Field(description="s that one run may take")] = 60.0
    rows: dict[str, list[FmuRow]] = {}


@dataclass(frozen=True)
class Link:
    """A signal and its variable: signal [SI] = factor * (scale * variable + offset), then turned by its frame."""

    signal: str
    reference: int
    factor: float
    row: FmuRow

    @property
    def over_ground(self) -> bool:
        """Whether it is a speed along north or east, in place of u or v."""
        return self.signal in ("u", "v") and self.row.frame in ("ned", "enu")

    def to_signal(self, values: Array) -> Array:
        """The signal [SI] of values of the variable."""
        return self._turned(self.factor * (self.row.scale * values + self.row.offset))

    def to_variable(self, values: Array) -> Array:
        """Values of the variable of a signal [SI]."""
        return np.asarray((self._turned(values) / self.factor - self.row.offset) / self.row.scale)

    def _turned(self, values: Array) -> Array:
        """An angle or a rate of turn to or from the axes east, north and up; the same both ways."""
        if self.row.frame != "enu" or self.signal in ("north", "east", "u", "v"):
            return values
        return np.pi / 2 - values if SIGNALS[signal_of(self.signal)].angle else -values


@dataclass(frozen=True)
class Fmu:
    """What an FMU and its table say.

    path : of the FMU. digest : of both.
    links : role -> rows, `parameter` with `start`. parameters : name -> value of each real parameter that is no signal.
    references : name of a parameter -> its value reference. branches : whether it can go back to a state that it had.
    """

    path: Path
    digest: str
    table: FmuTable
    links: Mapping[str, Sequence[Link]]
    parameters: Mapping[str, float]
    references: Mapping[str, int]
    branches: bool

    @property
    def startable(self) -> bool:
        """Whether it can be started with given u and r; else it runs along a run from its beginning."""
        return {"u", "r"} <= {link.signal for link in self.links["start"]}


def read_fmu(name: str | Path, relative_to: Path | None = None) -> Fmu:
    """An FMU by its table, or by its own path where its variables have the names of signals.

    DocumentError for a file that is no FMU for co-simulation, and for rows that are wrong or missing.
    """
    file = documents.find_document(Path(name), "models", relative_to)
    raw = {"file": file.name} if file.suffix == ".fmu" else documents.read_document(file).get("fmu")
    if not isinstance(raw, dict):
        raise DocumentError("has no table [fmu]: give file, step, and a row for each signal", file=file)
    own = {key: raw[key] for key in FmuTable.model_fields.keys() - {"rows"} if key in raw}
    rows = {key: row if isinstance(row, list) else [row] for key, row in raw.items() if key not in own}
    table: FmuTable = documents.parse_model(FmuTable, own | {"rows": rows}, file, "fmu")
    path = documents.find_document(Path(table.file), "models", file.parent)
    description = _read_description(path)
    variables = {
        one.name: one for one in description.modelVariables if one.type in ("Real", "Float64") and not one.dimensions
    }
    for one in variables.values():  # by its name, where no row says else
        if one.causality in ("input", "output") and _is_signal(one.name) and one.name not in table.rows:
            table.rows[one.name] = [FmuRow(variable=one.name)]
    links: dict[str, list[Link]] = {role: [] for role in ROLES}
    for signal, its in table.rows.items():
        for row in its:
            for role, link in _links_of_row(signal, row, variables, file):
                links[role].append(link)
    have = {link.signal for link in links["output"]}
    missing = {"output": [name for name in STATES if name not in have], "input": [] if links["input"] else ["orders"]}
    for role, names in missing.items():
        if names:
            there = ", ".join(one.name for one in variables.values() if one.causality in ROLES[role]) or "none"
            words = f"no row gives {', '.join(names)}; variables of the FMU for a row of role {role}: {there}"
            raise DocumentError(words, file=file, path="fmu")
    used = {link.reference for some in links.values() for link in some}
    free = {name: one for name, one in variables.items() if one.causality == "parameter" and one.start is not None}
    free = {name: one for name, one in free.items() if one.valueReference not in used}
    return Fmu(
        path,
        hashlib.sha256(path.read_bytes() + table.model_dump_json().encode()).hexdigest()[:8],
        table,
        links | {"start": links["start"] + links["parameter"]},
        {name: float(one.start) for name, one in free.items()},
        {name: one.valueReference for name, one in free.items()},
        description.fmiVersion[0] != "1" and description.coSimulation.canGetAndSetFMUstate,
    )


def _read_description(path: Path) -> Any:
    """The model description of an FMU for co-simulation; DocumentError where it is none that runs here."""
    try:
        import fmpy
    except ImportError:
        raise ShipidError("FMPy runs an FMU: pip install 'shipid[fmu]'", file=path) from None
    try:
        description = fmpy.read_model_description(str(path), validate=False)
        platforms = fmpy.supported_platforms(str(path))
    except Exception as error:  # of the archive, of its XML or of what that says
        raise DocumentError(f"is no FMU: {' '.join(str(error).split())[:200]}", file=path) from None
    if description.coSimulation is None:
        raise DocumentError("is an FMU for model exchange: export it for co-simulation", file=path)
    if fmpy.platform not in platforms:
        there = ", ".join(platforms) or "no platform"
        raise DocumentError(f"has no binary for {fmpy.platform}, but for {there}: `fmpy compile` makes one", file=path)
    return description


def _is_signal(name: str) -> bool:
    """Whether a name is that of a state, an order or the weather."""
    return (
        name in STATES
        or is_command(name.removeprefix(ACTUAL))
        or (name in SIGNALS and SIGNALS[name].role == "environment")
    )


def _links_of_row(signal: str, row: FmuRow, variables: Mapping[str, Any], file: Path) -> Iterator[tuple[str, Link]]:
    """Role and link of a row; of an output that may be set before the start, too, two."""
    path = f"fmu.{signal}"
    if not _is_signal(signal):
        words = f"no signal: give {', '.join(STATES)}, an order such as rudder.delta, or wind such as V_w"
        raise DocumentError(words, file=file, path=path)
    if row.variable not in variables:
        words = f"no real variable {row.variable!r}: {suggest_name(row.variable, variables)}"
        raise DocumentError(words, file=file, path=f"{path}.variable")
    variable = variables[row.variable]
    roles = [role for role, kinds in ROLES.items() if variable.causality in kinds]
    role: Any = row.role or next(iter(roles), None)
    if role not in roles or role == ("input" if signal in STATES or signal.startswith(ACTUAL) else "output"):
        words = f"{row.variable!r} has the causality {variable.causality}, no {role or 'variable'} of {signal}"
        raise DocumentError(words, file=file, path=f"{path}.role")
    si = SIGNALS[signal_of(signal)].unit
    declared = variable.unit or getattr(variable.declaredType, "unit", None)
    unit, known = row.unit or declared or si, UNITS.get(si, {si: 1.0})
    if unit not in known or row.scale == 0:
        words = f"{unit!r}: give one of {', '.join(known)}, and a scale that is not 0"
        raise DocumentError(words, file=file, path=f"{path}.unit")
    link = Link(signal, variable.valueReference, known[unit], row)
    yield role, link
    settable = variable.start is not None and variable.initial in ("exact", "approx", None)
    if row.role is None and role == "output" and settable:
        yield "start", link
