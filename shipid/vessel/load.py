"""Reads and checks vessel documents; every number has a dotted path."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, FiniteFloat

from shipid import document as documents
from shipid.arguments import as_path
from shipid.document import Document
from shipid.errors import DocumentError, suggest_name
from shipid.files import open_file
from shipid.notebooks import NotebookView
from shipid.physics import TERMS
from shipid.physics.grammar import AXES, MOTIONS
from shipid.physics.inertia import total_mass
from shipid.physics.signals import ACTUAL
from shipid.physics.waves import TABLES
from shipid.vessel.ranges import LEAST_BLOCK, UNUSUAL, first_contradiction, out_of_range
from shipid.vessel.schema import (
    BEHIND,
    DOFS,
    TABLE,
    Binding,
    bind_document,
    parameter_units,
    term_blocks,
    upstream_signals,
    vessel_model,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LONGEST_CHAIN = 20  # documents or families that extend or patch one another
FOUR_QUADRANT = "thruster.four_quadrant"
MOST_BLOCK = 2.0  # m / (rho L_pp B T), as `LEAST_BLOCK`: far beyond any ship and its degraded models


@dataclass(frozen=True, repr=False)
class Vessel(NotebookView, shown=("name", "file", "length", "parameters")):
    """A checked vessel document.

    document : plain nested data, after any patch; not to be changed.
    file : where it was read from.
    """

    document: Document = field(repr=False)
    file: str

    def __post_init__(self) -> None:
        if not isinstance(self.document, Mapping) or "inertia" not in self.document:
            raise DocumentError("no document of a vessel: read one with `load_vessel`, change it with `with_values`")

    @cached_property
    def digest(self) -> str:
        """Digest of the document, so that a patch knows its base."""
        return documents.digest_document(self.document)

    @property
    def name(self) -> str:
        """Name for people, such as `R/V Gunnerus, 28.9 m`."""
        return str(self.document["name"])

    @property
    def key(self) -> str:
        """Short name: the file's stem."""
        return Path(self.file).stem

    @property
    def length(self) -> float | None:
        """Length between perpendiculars [m]; None if the document does not give it."""
        length = self.document.get("particulars", {}).get("L_pp")
        return None if length is None else float(length)

    @property
    def axes(self) -> tuple[int, ...]:
        """Rows of the six degrees of freedom that this vessel moves in."""
        return DOFS[self.document["dof"]]

    @cached_property
    def bound(self) -> dict[str, Binding]:
        """Dotted path of every block that the equations use -> what binds its numbers to a physics function."""
        return bind_document(self.document)

    @cached_property
    def units(self) -> dict[str, str]:
        """Dotted path -> unit of every parameter, in document order of use; not to be changed."""
        return parameter_units(self.document)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Dotted path -> value of every number that the equations use; not to be changed."""
        return {path: float(documents.value_at_path(self.document, path)) for path in self.units}

    @property
    def above_zero(self) -> frozenset[str]:
        """Dotted paths of the parameters that must be above 0, such as `inertia.m`."""
        model = vessel_model(self.document)
        return frozenset(
            path
            for path in self.units
            if not documents.is_valid_for(model, documents.replace_values(self.document, {path: 0.0}))
        )

    @property
    def mass(self) -> NDArray[np.float64]:
        """Mass plus added mass (n, n) [kg, kg m, kg m^2] in the degrees of freedom of the vessel; a copy."""
        import numpy as np

        return np.array(self._mass)

    @cached_property
    def _mass(self) -> list[list[float]]:
        numbers: list[dict[str, Any]] = [
            {name: self.parameters[target] if isinstance(target, str) else target for name, target in block.items()}
            for block in (self.bound["inertia"], self.bound["added_mass"])
        ]
        M = total_mass(*numbers)
        return [[M[row][column] for column in self.axes] for row in self.axes]

    @cached_property
    def structure(self) -> str:
        """Digest of the document without its parameters' values: vessels of one structure compile once."""
        without_values = documents.replace_values(_without_words(self.document), dict.fromkeys(self.parameters, 0))
        return documents.digest_document(
            [without_values, list(self.parameters)]
        )  # the order is that of the input vector

    def with_values(self, values: Mapping[str, Any]) -> Vessel:
        """A copy of the vessel with numbers replaced or blocks added at dotted paths; checked like any document.

        Raises DocumentError for values that are no mapping by path, and for what the vessel's checks refuse.
        """
        if not hasattr(values, "items") or not all(isinstance(path, str) for path in values.keys()):  # noqa: SIM118
            raise DocumentError(
                f"values must be a mapping of dotted paths, such as {{'inertia.m': 4e5}}, not {values!r}",
                file=self.file,
            )
        values = {path: documents.plain_values(value) for path, value in values.items()}
        least, most = documents.LEAST_NUMBER, documents.MOST_NUMBER
        odd = {
            path: value
            for path, value in values.items()
            if type(value) is not float or not least < abs(value) < most  # 0 among them; most are not: quick
        }
        documents.check_values(odd, self.file)
        document = documents.replace_values(self.document, values, self.file)
        numbers = all(type(value) in (float, int) for value in values.values())
        if numbers and values.keys() <= self.units.keys() and documents.is_valid_for(vessel_model(document), document):
            vessel = Vessel(document, self.file)  # terms, names and units are as they were
            vessel.__dict__.update(bound=self.bound, units=self.units, structure=self.structure)
            vessel.__dict__["parameters"] = self.parameters | {path: float(value) for path, value in values.items()}
            _check_numbers(vessel)
            return vessel
        return check_document(document, self.file)


def load_vessel(name: str | Path, relative_to: str | Path | None = None) -> Vessel:
    """Read a bundled vessel by name, or a vessel or patch document by path; DocumentError where it is not valid.

    relative_to : folder that a relative path is tried from first, before the working folder.

    A patch has `base` (a vessel), optionally `base_digest`, and `[set]` with dotted paths; see `shipid.vessel.perturb`.
    """
    folder = None if relative_to is None else as_path("relative_to", relative_to, DocumentError)
    vessel = _load_file(documents.find_document(name, "models", folder), ())
    fault = first_contradiction(vessel.document, vessel.parameters)
    if fault is not None:
        raise DocumentError(fault[1], file=vessel.file, path=fault[0])
    return vessel


def _load_file(file: Path, above: tuple[Path, ...]) -> Vessel:
    document = documents.read_document(file)
    if "base" in document:
        return _apply_patch(document, file, above)
    return check_document(_with_base(document, file, above), str(file))


def _with_base(document: Document, file: Path, above: tuple[Path, ...]) -> Document:
    """A document merged over the one that it `extends`, with its CSV tables read in."""
    document = _with_tables(document, file)
    if "extends" not in document:
        return document
    under = _find_base(document.pop("extends"), "extends", file, above)
    if "base" in documents.read_document(under):
        raise DocumentError(f"{under.stem!r} is a patch: extend a vessel", file=file, path="extends")
    return documents.merge_documents(
        _with_base(documents.read_document(under), under, (*above, file.resolve())), document
    )


def _with_tables(document: Document, file: Path) -> Document:
    """The document with the CSV files of tables replaced by their columns, so that its digest covers their content."""
    tables = {}
    for path, key, block in (*term_blocks(document), *term_blocks(document, off=True)):
        if key in TABLES and isinstance(block.get(TABLE), str):
            tables[f"{path}.{TABLE}"] = _read_table_file(
                file.parent / block[TABLE], TABLES[key], file, f"{path}.{TABLE}"
            )
    return documents.replace_values(document, tables) if tables else dict(document)


def _read_table_file(source: Path, columns: tuple[str, ...], file: Path, path: str) -> dict[str, list[float]]:
    """Columns of a CSV file with a header; lines that begin with # are comments."""
    import numpy as np
    import pandas as pd  # most vessels have no table, and it takes its time

    try:
        with open_file(source) as stream:
            frame = pd.read_csv(stream, comment="#")
    except (OSError, ValueError) as error:
        words = getattr(error, "strerror", None) or "not a CSV table with a header"
        raise DocumentError(f"{source}: cannot be read: {words}", file=file, path=path) from None
    missing = next((name for name in columns if name not in frame), None)
    if missing is not None:
        raise DocumentError(
            f"{source}: has no column {missing!r}: {suggest_name(missing, [str(name) for name in frame])}",
            file=file,
            path=path,
        )
    numbers = frame[list(columns)].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    if not np.isfinite(numbers).all():
        row, column = np.argwhere(~np.isfinite(numbers))[0]
        raise DocumentError(f"{source}: row {row + 1} has no number in {columns[column]!r}", file=file, path=path)
    return {name: numbers[:, i].tolist() for i, name in enumerate(columns)}


def _find_base(name: Any, path: str, file: Path, above: tuple[Path, ...]) -> Path:
    """File of the vessel that a document extends or patches; DocumentError for a circular reference."""
    try:
        other = documents.find_document(str(name), "models", file.parent)
    except DocumentError as error:
        raise DocumentError(f"{name!r}: {error.message}", file=file, path=path) from None
    if len(above) >= LONGEST_CHAIN:
        raise DocumentError(
            f"a chain of more than {LONGEST_CHAIN} documents: write the vessel out", file=file, path=path
        )
    if other.resolve() in (*above, file.resolve()):
        raise DocumentError(f"{name!r} depends on this document: name a vessel that does not", file=file, path=path)
    return other


class VesselPatch(BaseModel):
    """A patch document: a base vessel, the digest it was made for, and values by dotted path."""

    model_config = ConfigDict(extra="forbid")
    base: str
    base_digest: str | None = None
    name: str | None = None
    source: str | None = None
    structure: dict[str, Any] = {}
    set: dict[str, Annotated[FiniteFloat, "value"]] = {}
    unusual: list[str] = []
    provenance: dict[str, Any] = {}


def _apply_patch(document: Document, file: Path, above: tuple[Path, ...]) -> Vessel:
    patch: VesselPatch = documents.parse_model(VesselPatch, document, file)
    base = _load_file(_find_base(patch.base, "base", file, above), (*above, file.resolve()))
    base = base.with_values(patch.structure) if patch.structure else base
    if patch.base_digest not in (None, base.digest):
        changed = f"the base {patch.base!r} has changed since (now {base.digest!r}); make the patch anew"
        raise DocumentError(f"{patch.base_digest!r}: {changed}", file=file, path="base_digest")
    for path in patch.set:
        if path not in base.parameters:
            raise DocumentError(
                f"{patch.base} has no such parameter: {suggest_name(path, base.parameters)}",
                file=file,
                path=f"set.{path}",
            )
    changes = {**patch.set, "name": patch.name or f"{base.name} ({file.stem})"}
    if patch.unusual:
        changes[UNUSUAL] = [*base.document.get(UNUSUAL, []), *patch.unusual]
    return check_document(documents.replace_values(base.document, changes), str(file))


def check_document(document: Document, file: str) -> Vessel:
    """Check a complete document; DocumentError with file, dotted path and remedy for the first problem."""
    documents.parse_model(vessel_model(document), document, file)
    vessel = Vessel(document, file)
    paths: dict[str, str] = {}
    for path, key, block in term_blocks(document):
        name = path.rsplit(".", 1)[-1]
        if f"{name}." == ACTUAL:
            raise DocumentError("columns of what actuators have reached begin with it: rename it", file=file, path=path)
        if name in paths:
            raise DocumentError(
                f"{paths[name]} ends in the same name, and commands are named by it: choose another",
                file=file,
                path=path,
            )
        paths[name] = path
        _check_lengths(path, block, file)
        if key in TABLES:
            _check_wave_table(f"{path}.{TABLE}", block[TABLE], TABLES[key], file)
    _check_behind(vessel)
    _check_units(vessel)
    _check_numbers(vessel)
    vessel.__dict__["digest"] = documents.digest_document(
        document
    )  # of what was checked, whatever becomes of the document
    return vessel


def _check_numbers(vessel: Vessel) -> None:
    """Checks of the values of a document whose names are valid."""
    for path, key, block in term_blocks(vessel.document):
        _check_rising_angles(path, key, block, vessel.file)
    _check_inertia(vessel)
    _check_sense(vessel)
    fault = out_of_range(vessel.document, vessel.parameters, vessel.units)
    if fault is not None:
        raise DocumentError(fault[1], file=vessel.file, path=fault[0])


def _check_behind(vessel: Vessel) -> None:
    """DocumentError for a component behind one that is missing, off, or does not provide the needed signal."""
    terms = list(term_blocks(vessel.document))
    for path, key, block in terms:
        for name in upstream_signals(TERMS[key]):
            giving = [other.rsplit(".", 1)[-1] for other, kind, _ in terms if name in TERMS[kind].gives]
            if block[BEHIND] not in giving:
                off = [other.rsplit(".", 1)[-1] for other, _, _ in term_blocks(vessel.document, off=True)]
                remedy = "it is off" if block[BEHIND] in off else suggest_name(block[BEHIND], giving)
                raise DocumentError(
                    f"{block[BEHIND]!r} gives no {name}: {remedy}", file=vessel.file, path=f"{path}.{BEHIND}"
                )


def _check_sense(vessel: Vessel) -> None:
    """DocumentError for impossible values: added mass of the wrong sign, a stern ahead of the bow, tonnes for kg."""
    values = vessel.parameters
    for path, value in values.items():
        group, _, name = path.rpartition(".")
        fault = ""
        if group == "added_mass" and AXES[MOTIONS.index(name[2])] == name[0] and value > 0:
            fault = f"{value:g}: added mass is on the force side, so {name} is negative"
        elif ".actuator." in path and name == "high" and value <= (low := values.get(f"{group}.low", -math.inf)):
            fault = f"{value:g}: must be above low, {low:g}"
        elif name == "x_fwd" and value <= values.get(f"{group}.x_aft", -math.inf):
            fault = f"{value:g}: must be ahead of x_aft"
        if fault:
            raise DocumentError(fault, file=vessel.file, path=path)
    sizes = {**vessel.document.get("constants", {}), **vessel.document.get("particulars", {})}
    if {"rho", "L_pp", "B", "T"} <= sizes.keys():
        m = values["inertia.m"]
        share = m / (sizes["rho"] * sizes["L_pp"] * sizes["B"] * sizes["T"])
        if not LEAST_BLOCK < share < MOST_BLOCK:
            raise DocumentError(
                f"{m:g} kg is {share:.2g} of rho L_pp B T, which is no ship's: is the unit kg?",
                file=vessel.file,
                path="inertia.m",
            )


def _check_rising_angles(path: str, key: str, block: Mapping[str, Any], file: str) -> None:
    """DocumentError for angles that do not rise; of a propeller in four quadrants for a gap at 180 deg, too."""
    for name, value in block.items():
        if isinstance(value, list) and name.endswith("_deg") and any(b <= a for a, b in pairwise(value)):
            raise DocumentError("must rise from entry to entry", file=file, path=f"{path}.{name}")
    ends = [block[name][end] for name in ("beta_deg", "C_T") for end in (0, -1)] if key == FOUR_QUADRANT else []
    if ends and (ends[:2] != [-180, 180] or ends[2] != ends[3]):
        raise DocumentError("must go from -180 to 180, where C_T must be the same", file=file, path=f"{path}.beta_deg")


def _check_lengths(path: str, block: Mapping[str, Any], file: str) -> None:
    lists = {key: value for key, value in block.items() if isinstance(value, list)}
    if len({len(value) for value in lists.values()}) > 1:
        counts = ", ".join(f"{key} {len(value)}" for key, value in lists.items())
        raise DocumentError(f"the columns of a table must be equally long, not {counts}", file=file, path=path)


def _check_wave_table(path: str, table: Mapping[str, list[float]], columns: tuple[str, ...], file: str) -> None:
    """DocumentError for a table that is no grid of frequencies and equally spaced headings from 0 to 180 deg."""
    import numpy as np

    missing = next((name for name in columns if name not in table), None)
    if missing is not None:
        raise DocumentError(f"has no column {missing!r}: {suggest_name(missing, table)}", file=file, path=path)
    _check_lengths(path, table, file)
    omega, beta = (np.unique(table[name]) for name in ("omega", "beta_deg"))
    pairs = set(zip(table["omega"], table["beta_deg"], strict=True))
    whole = len(pairs) == len(table["omega"]) == len(omega) * len(beta)
    even = len(beta) > 1 and np.allclose(beta, np.linspace(0, 180, len(beta)), atol=1e-6)
    if not whole or not even or len(omega) < 4:
        raise DocumentError(
            "is no grid: give four frequencies or more, each at the same equally spaced headings from 0 to 180 deg",
            file=file,
            path=path,
        )


def _check_units(vessel: Vessel) -> None:
    for path in vessel.units:
        try:
            documents.value_at_path(vessel.document, path)
        except KeyError:
            raise DocumentError(
                f"missing: a term needs {path.rpartition('.')[2]}, here or in the block of the term",
                file=vessel.file,
                path=path,
            ) from None


def _check_inertia(vessel: Vessel) -> None:
    """DocumentError if a moment of inertia is missing, or mass plus added mass is not positive definite."""
    for row, name in ((3, "I_x"), (4, "I_y")):
        if row in vessel.axes and not vessel.document["inertia"].get(name):
            raise DocumentError(
                f"missing: {len(vessel.axes)} degrees of freedom need it", file=vessel.file, path=f"inertia.{name}"
            )
    if not _is_positive(vessel._mass):
        raise DocumentError(
            "mass plus added mass is not positive: added mass is written on the force side (X_udot < 0), and 4 or 6 "
            "degrees of freedom need I_x (and I_y)",
            file=vessel.file,
            path="inertia",
        )


def _is_positive(M: list[list[float]]) -> bool:
    """Whether a matrix is positive definite: all pivots of its symmetric part are above 0."""
    rows = [[M[i][j] + M[j][i] for j in range(len(M))] for i in range(len(M))]
    while rows:
        (pivot, *right), *below = rows
        if not pivot > 0:
            return False
        rows = [
            [entry - first / pivot * above for entry, above in zip(rest, right, strict=True)] for first, *rest in below
        ]
    return True


def _without_words(document: Document) -> Document:
    """The document without names and sources, which do not influence the equations."""
    return {
        key: _without_words(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if key not in ("source", "name", "description", UNUSUAL)
    }
