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
from shipid.export.equations import Equations
from shipid.export.model import ExportModel
from shipid.files import json_text, write_set
from shipid.version import __version__
from shipid.vessel.load import Vessel


def write_vessel_function(vessel: Vessel, name: str, method: Method, file: Path) -> list[Path]:
    """Write (carry, commands, environment, loads, parameters, dt) -> carry after dt."""
    equations = Equations(vessel)
    described = {
        "what": f"one step of {vessel.name} by {method}",
        "defaults": {"parameters": list(vessel.parameters.values())},
    }
    inputs, outputs = {**equations.groups, "dt": {"dt": "s"}}, {"after": equations.groups["carry"]}
    return _write_function(equations.step(method), name, file, described, inputs, outputs)


def write_predictor_function(model: ExportModel, name: str, file: Path) -> list[Path]:
    """Write `ExportModel.function`."""
    names, bands = model.layout, model.predictor.bands
    inputs = {group: model.units(group) for group in names.sizes}
    outputs = {"path": {"x": "m", "y": "m"}, "outside": {"outside": "-"}}
    described: dict[str, Any] = {
        "what": f"path after 1 ... {names.horizon} steps of {model.physics.step:g} s, method {model.predictor.method}",
        "rows": {"past": names.num_past, "planned": names.horizon},
        "limits": model.limits,
        "provenance": dict(model.predictor.provenance),
    }
    if names.physics:
        described["rows"]["physics"] = names.horizon
    if bands is not None:
        inputs |= {key: {key: "-"} for key in BAND_CHOICE}
        outputs |= {"band": dict(zip(BAND_ROWS, "mm--", strict=True)), "promised": {"promised": "-"}}
        described["runs"] = bands.runs
        described["kinds"] = {kind: [number, count] for number, (kind, count) in enumerate(bands.kinds.items(), 1)}
    return _write_function(model.function, name, file, described, inputs, outputs)


def _write_function(
    function: ca.Function,
    name: str,
    file: Path,
    described: dict[str, Any],
    inputs: Mapping[str, Mapping[str, str]],
    outputs: Mapping[str, Mapping[str, str]],
) -> list[Path]:
    """Write a file for `casadi.Function.load`, and beside it a `.json` of the entries and units of inputs and outputs.

    Both are on the disk before those of an earlier export are replaced. Raises OSError.
    """
    packed = ca.StringSerializer()  # `Function.save` does not say where a disk is full
    packed.pack(rename_function(function, name))
    for key, groups in (("inputs", inputs), ("outputs", outputs)):
        described[key] = {
            group: [{"name": entry, "unit": unit} for entry, unit in units.items()] for group, units in groups.items()
        }
    plain = json.loads(json.dumps(described, default=str))
    listing = {"shipid": __version__, "casadi": str(ca.CasadiMeta.version()), **plain}
    return write_set({file: packed.encode(), file.with_name(file.name + ".json"): json_text(listing)})
