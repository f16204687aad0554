"""Write a predictor or a vessel as files for others.

As CasADi files here: a `casadi.Function`, with a list of names in a second file.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import casadi as ca

from shipid.arguments import as_path, check_choice, check_class
from shipid.engine.integrate import Method
from shipid.errors import DocumentError, ShipidError, suggest_name
from shipid.export.c import SourceFiles, c_name, rename_function
from shipid.export.c_predictor import predictor_files
from shipid.export.c_vessel import vessel_files
from shipid.export.equations import Equations, step_function
from shipid.export.fmu import predictor_unit, vessel_unit, write_fmu
from shipid.export.model import BAND_CHOICE, BAND_ROWS, ExportModel, build_model
from shipid.export.onnx import write_onnx
from shipid.files import json_text, write_set
from shipid.hybrid.mean import DeployedMethod
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
    return _write_function(step_function(equations.model, method), name, file, described, inputs, outputs)


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


EXAMPLE_FILE = "main.c"


@dataclass(frozen=True)
class ExportTarget:
    """A form in which a predictor or a vessel is written for others; both functions return the files they wrote.

    predictor : (model, name, file). vessel : (vessel, name, integrator, file); None where a vessel has nothing for it.
    ending : of the file; empty where the target is a folder.
    takes_path : whether the path of the physics can be an input, where a simulator gives it.
    """

    predictor: Callable[[ExportModel, str, Path], list[Path]]
    vessel: Callable[[Vessel, str, Method, Path], list[Path]] | None = None
    ending: str = ""
    takes_path: bool = False


def export_predictor(
    predictor: DeployedMethod, to: str, out: str | os.PathLike[str], *, single: bool = False, name: str | None = None
) -> list[Path]:
    """Write a predictor for a target; the files that were written.

    Parameters
    ----------
    to : `c` (a folder with NAME.c, NAME_casadi.c, NAME.h, main.c), `fmu` (FMI 2.0), `casadi` (a function, and its names
        as JSON) or `onnx` (the networks alone).
    out : the folder for `c`, else the file.
    single : numbers in single precision, of `onnx` alone.
    name : begins every public name in C, and is the model identifier of an FMU; default the stem of `out`.

    Raises
    ------
    ShipidError : the target does not exist, cannot take the method, or the compiler fails.
    """
    if not hasattr(predictor, "corrector"):
        raise DocumentError(f"give a Predictor, as of `fit` or `Predictor.load`, not {type(predictor).__name__}")
    target, file, title = _check_target(to, out, name)
    if single and to != "onnx":
        raise DocumentError(f"{to} is always in double precision: leave --single out", path="--single")
    model = build_model(predictor)
    if model.layout.physics and not target.takes_path:
        targets = " or ".join(name for name, one in EXPORT_TARGETS.items() if one.takes_path)
        raise ShipidError(f"the physics is a simulator, which {to} cannot hold: {targets} writes the corrector alone")
    return [write_onnx(model, title, file, single=True)] if single else target.predictor(model, title, file)


def export_vessel(
    vessel: Vessel, to: str, out: str | os.PathLike[str], *, integrator: Method = "rk4", name: str | None = None
) -> list[Path]:
    """Write a vessel alone, its step, for simulation: to `c`, `fmu` or `casadi`; see `export_predictor`.

    integrator : rule of the step, `euler` or `rk4`.

    Raises ShipidError as there, and for an unknown integrator.
    """
    target, file, title = _check_target(to, out, name)
    check_class("vessel", vessel, Vessel, "as of `load_vessel`", DocumentError)
    check_choice("integrator", integrator, get_args(Method))
    if target.vessel is None:
        raise DocumentError(f"a vessel has no networks, and {to} takes nothing else: choose another", path="--to")
    return target.vessel(vessel, title, integrator, file)


def _check_target(to: str, out: str | os.PathLike[str], name: str | None) -> tuple[ExportTarget, Path, str]:
    """The target, the file or folder, and the name that begins every public name."""
    if name is not None:
        check_class("name", name, str, "such as 'gunnerus'", DocumentError)
    target, file = EXPORT_TARGETS.get(str(to)), as_path("out", out)
    if target is None:
        raise DocumentError(f"{str(to)!r} is no target: {suggest_name(str(to), EXPORT_TARGETS)}", path="--to")
    if not target.ending and file.exists() and not file.is_dir():
        raise DocumentError(f"is a file: the target {to} takes a folder", file=file, path="--out")
    if target.ending and (file.is_dir() or file.suffix != target.ending):
        raise DocumentError(f"the target {to} is a file that ends in {target.ending}", file=file, path="--out")
    return target, file, c_name(name or file.stem)


def _write_sources(files: SourceFiles, folder: Path) -> list[Path]:
    """Write the files; an example that is there is kept, because it may have become the user's program."""
    texts = {folder / name: text for name, text in files.texts.items()}
    return write_set({file: text for file, text in texts.items() if file.name != EXAMPLE_FILE or not file.exists()})


EXPORT_TARGETS: dict[str, ExportTarget] = {
    "c": ExportTarget(
        lambda model, title, file: _write_sources(predictor_files(model, title), file),
        lambda ship, title, rule, file: _write_sources(vessel_files(ship, title, rule), file),
    ),
    "fmu": ExportTarget(
        lambda model, title, file: write_fmu(predictor_unit(model, title), file),
        lambda ship, title, rule, file: write_fmu(vessel_unit(ship, title, rule), file),
        ".fmu",
    ),
    "casadi": ExportTarget(write_predictor_function, write_vessel_function, ".casadi", True),
    "onnx": ExportTarget(lambda model, title, file: [write_onnx(model, title, file)], None, ".onnx", True),
}
"""Name of a target, as after `--to`, -> how it is written."""
