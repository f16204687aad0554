"""CasADi files: a predictor or a vessel as a `casadi.Function`, with a list of names in a second file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.engine.integrate import Method
from shipid.export.band import CHOICE, COLUMNS
from shipid.export.blocks import Precision
from shipid.export.c_vessel import VesselParts
from shipid.export.model import Model
from shipid.files import json_text, write_together
from shipid.hybrid.bands import FEWEST, LEVELS
from shipid.version import __version__
from shipid.vessel.load import Vessel


def vessel_function(vessel: Vessel, name: str, method: Method) -> tuple[ca.Function, dict[str, Any]]:
    """(carry, commands, environment, loads, parameters, dt) -> carry after dt, and the names of the entries."""
    parts = VesselParts(vessel, name, method, Precision())
    step, groups = parts.equations.step(method).function, parts.groups()
    order = ("carry", "commands", "environment", "loads", "parameters")
    inputs = {key: MX.sym(key, len(groups[key])) for key in order} | {"dt": MX.sym("dt")}
    after = step(*(inputs["loads" if key == "tau_extra" else key] for key in step.name_in()))
    function = ca.Function(name, list(inputs.values()), [after], list(inputs), ["after"])
    described = {key: [{"name": entry, "unit": parts.unit(key, entry)} for entry in groups[key]] for key in order}
    return function, {
        "what": f"one step of {vessel.name} by {method}",
        "inputs": {**described, "dt": [{"name": "dt", "unit": "s"}]},
        "outputs": {"after": described["carry"]},
        "defaults": {"parameters": list(vessel.parameters.values())},
    }


def predictor_function(model: Model, name: str) -> tuple[ca.Function, dict[str, Any]]:
    """(now, reached, past, planned, estimates, parameters) -> path (2, T), and the names of the entries.

    path : x and y [m] in body axes at the instant, a column for each step. ShipidError for a forest.
    """
    names, function = model.layout, model.graph.function
    inputs = {key: MX.sym(key, size) for key, size in names.sizes.items()}
    path = ca.reshape(function(*inputs.values()), 2, names.horizon)
    outputs = {"path": [{"name": axis, "unit": "m"} for axis in "xy"]}
    rows: Mapping[str, int] = {"past": names.num_past, "planned": names.horizon}
    listed = {key: [{"name": entry, "unit": model.unit(entry)} for entry in getattr(names, key)] for key in names.sizes}
    return ca.Function(name, list(inputs.values()), [path], list(inputs), ["path"]), {
        "what": f"path after 1 ... {names.horizon} steps of {model.physics.step:g} s, method {model.predictor.method}",
        "inputs": listed,
        "rows": rows,
        "outputs": outputs,
        "defaults": {"parameters": model.parameters.tolist()},
        "limits": model.limits,
        "provenance": dict(model.predictor.provenance),
    }


def band_function(model: Model, name: str) -> tuple[ca.Function, dict[str, Any]] | None:
    """(now, path, level, pointwise, kind) -> along, across (1, T) [m], ahead (2, T), promised, and names of entries.

    path : as from `predictor_function`. pointwise : 0 or 1. kind : 0 for any, or its number. promised : 0 where too few
    runs calibrated that level or kind; the band is then not a number. None where the predictor has no bands.

    It is apart from the path, so that derivatives of a path never meet those of its band.
    """
    bands, graph, names = model.predictor.bands, model.band, model.layout
    if bands is None or graph is None:
        return None
    now, path = MX.sym("now", len(names.now)), MX.sym("path", 2, names.horizon)
    level, pointwise, kind = (MX.sym(key) for key in CHOICE)
    counts = ca.DM([bands.runs, *bands.kinds.values()])
    runs = ca.dot(counts, kind == ca.DM(range(len(bands.kinds) + 1)))
    promised = ca.logic_and(ca.logic_and(level > 0, level <= float(LEVELS[-1])), runs >= FEWEST)
    promised = ca.logic_and(promised, level / (1 - level) - 1e-9 <= runs)
    promised = ca.logic_and(promised, ca.logic_not(ca.logic_and(pointwise != 0, kind != 0)))
    rows = ca.reshape(graph.function(now, ca.vec(path), level, pointwise, kind), len(COLUMNS), names.horizon)
    rows = ca.if_else(promised, rows, np.nan)
    results = {"along": rows[0, :], "across": rows[1, :], "ahead": rows[2:, :], "promised": promised}
    inputs = {"now": now, "path": path, "level": level, "pointwise": pointwise, "kind": kind}
    plane = [{"name": axis, "unit": "m"} for axis in "xy"]
    listed = {"now": [{"name": entry, "unit": model.unit(entry)} for entry in names.now], "path": plane}
    return ca.Function(name, list(inputs.values()), list(results.values()), list(inputs), list(results)), {
        "what": f"band around a path of {names.horizon} steps of {model.physics.step:g} s",
        "inputs": listed | {key: [{"name": key, "unit": "-"}] for key in CHOICE},
        "outputs": {key: [{"name": key, "unit": "m"}] for key in ("along", "across")}
        | {"ahead": [{"name": axis, "unit": "-"} for axis in "xy"], "promised": [{"name": "promised", "unit": "-"}]},
        "runs": bands.runs,
        "kinds": {kind_: [number, count] for number, (kind_, count) in enumerate(bands.kinds.items(), start=1)},
        "provenance": dict(model.predictor.provenance),
    }


def band_file(file: Path) -> Path:
    """Where the band of a predictor is written, beside its function."""
    return file.with_name(f"{file.stem}-band{file.suffix}")


def files_of(file: Path) -> list[Path]:
    """Every file that an export to `file` may write or replace: functions, and the names of their entries."""
    return [place for one in (file, band_file(file)) for place in (one, _listing(one))]


def write_functions(
    functions: Mapping[Path, tuple[ca.Function, Mapping[str, Any]]], former: Iterable[Path] = ()
) -> list[Path]:
    """Write files for `casadi.Function.load`, each with a `.json` of the names of inputs and outputs; `former` go.

    All are on the disk before one of an earlier export is replaced. Raises OSError.
    """
    texts: dict[Path, str] = {}
    for file, (function, names) in functions.items():
        packed = ca.StringSerializer()  # `Function.save` does not say where a disk is full
        packed.pack(function)
        texts[file] = packed.encode()
        described = json.loads(json.dumps(names, default=str))
        texts[_listing(file)] = json_text({"shipid": __version__, "casadi": str(ca.CasadiMeta.version()), **described})
    return write_together(texts, former)


def _listing(file: Path) -> Path:
    """Where the names of the inputs and outputs of a written function are."""
    return file.with_name(file.name + ".json")
