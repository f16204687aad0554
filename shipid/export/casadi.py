"""CasADi files: a predictor or a vessel as a `casadi.Function`, with a list of names in a second file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import casadi as ca

from shipid.engine.integrate import Method
from shipid.export.band import BAND_CHOICE, BAND_ROWS
from shipid.export.c import rename_function
from shipid.export.c_vessel import VesselParts
from shipid.export.model import ExportModel
from shipid.files import json_text, write_set
from shipid.version import __version__
from shipid.vessel.load import Vessel


def vessel_function(vessel: Vessel, name: str, method: Method) -> tuple[ca.Function, dict[str, Any]]:
    """(carry, commands, environment, loads, parameters, dt) -> carry after dt, and the names of the entries."""
    parts = VesselParts(vessel, method)
    described = {key: _names_and_units(units) for key, units in parts.units().items()}
    return rename_function(parts.functions["step"], name), {
        "what": f"one step of {vessel.name} by {method}",
        "inputs": {**described, "dt": _names_and_units({"dt": "s"})},
        "outputs": {"after": described["carry"]},
        "defaults": {"parameters": list(vessel.parameters.values())},
    }


def predictor_function(model: ExportModel, name: str) -> tuple[ca.Function, dict[str, Any]]:
    """The function of `Model.function`, and the names of the entries."""
    names, bands = model.layout, model.predictor.bands
    inputs = {key: {entry: model.unit(entry) for entry in getattr(names, key)} for key in names.sizes}
    outputs = {"path": {"x": "m", "y": "m"}, "outside": {"outside": "-"}}
    described: dict[str, Any] = {
        "what": f"path after 1 ... {names.horizon} steps of {model.physics.step:g} s, method {model.predictor.method}",
        "rows": {"past": names.num_past, "planned": names.horizon},
        "defaults": {"parameters": model.parameters.tolist()},
        "limits": model.limits,
        "provenance": dict(model.predictor.provenance),
    }
    if bands is not None:
        inputs |= {key: {key: "-"} for key in BAND_CHOICE}
        outputs |= {"band": dict(zip(BAND_ROWS, ("m", "m", "-", "-"), strict=True)), "promised": {"promised": "-"}}
        described["runs"] = bands.runs
        described["kinds"] = {kind: [number, count] for number, (kind, count) in enumerate(bands.kinds.items(), 1)}
    described |= {"inputs": {key: _names_and_units(units) for key, units in inputs.items()}}
    described |= {"outputs": {key: _names_and_units(units) for key, units in outputs.items()}}
    return rename_function(model.function, name), described


def _names_and_units(units: Mapping[str, str]) -> list[dict[str, str]]:
    return [{"name": name, "unit": unit} for name, unit in units.items()]


def write_function(function: ca.Function, names: Mapping[str, Any], file: Path) -> list[Path]:
    """Write a file for `casadi.Function.load`, and beside it a `.json` of the names of inputs and outputs.

    Both are on the disk before those of an earlier export are replaced. Raises OSError.
    """
    packed = ca.StringSerializer()  # `Function.save` does not say where a disk is full
    packed.pack(function)
    described = json.loads(json.dumps(names, default=str))
    listing = {"shipid": __version__, "casadi": str(ca.CasadiMeta.version()), **described}
    return write_set({file: packed.encode(), listing_of(file): json_text(listing)})


def listing_of(file: Path) -> Path:
    """Where the names of the inputs and outputs of a written function are."""
    return file.with_name(file.name + ".json")
