"""FMI 2.0 for co-simulation: a vessel or a predictor as an FMU with its sources and, where there is a compiler, a binary.

The standard: Functional Mock-up Interface 2.0.4, fmi-standard.org.
"""

from __future__ import annotations

import platform
import re
import sys
import uuid
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax import saxutils

import numpy as np

from shipid.engine.integrate import Method
from shipid.engine.libraries import run_compiler
from shipid.engine.native import find_compiler
from shipid.errors import ShipidError
from shipid.export.c import NumberPrecision, SourceFiles
from shipid.export.c_predictor import predictor_files
from shipid.export.c_vessel import VesselParts, vessel_files
from shipid.export.fmu_c import Variable, predictor_wrapper, vessel_wrapper
from shipid.export.model import ExportModel
from shipid.files import replace_whole
from shipid.physics.signals import ACTUAL, SIGNALS, neutral_value
from shipid.version import __version__
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

BINARIES = {("Linux", "x86_64"): ("linux64", ".so"), ("Darwin", "x86_64"): ("darwin64", ".dylib")}
"""System and processor -> folder of the binary in an FMU, and how its name ends."""
_BAND_OUTPUTS = {
    "along": ("m", "half axis along the predicted track"),
    "across": ("m", "half axis across the predicted track"),
    "ahead_x": ("-", "unit vector of the track, ahead"),
    "ahead_y": ("-", "unit vector of the track, to starboard"),
}
LEAST_ABOVE_ZERO = sys.float_info.min  # FMI 2.0 has no limit that is not allowed itself
LARGEST_STEP = 0.1  # s: inside a communication step, of a ship of 30 m and more; times the root of the length below


@dataclass(frozen=True)
class FmuParts:
    """The parts of an FMU: its variables in the order of value references, its C, and its name."""

    identifier: str
    title: str
    variables: tuple[Variable, ...]
    files: SourceFiles
    wrapper: str
    step: float | None


def quoteattr(text: str) -> str:
    """A text as an attribute of XML; a character that XML cannot hold becomes U+FFFD, the replacement character."""
    return saxutils.quoteattr(re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text))


def words_of_signal(name: str) -> str:
    """Words for a signal: `port.alpha` is `azimuth, port`."""
    component, _, signal = name.rpartition(".")
    word = SIGNALS[signal].word if signal in SIGNALS else signal
    return f"{word}, {component}" if component else word


def _input_variables(rows: Mapping[str, tuple[str, str, float]]) -> list[Variable]:
    """Inputs of an FMU: name -> unit, words, start."""
    return [Variable(name, "input", "continuous", *row) for name, row in rows.items()]


def _output_variables(rows: Mapping[str, tuple[str, str]]) -> list[Variable]:
    """Outputs that are calculated: name -> unit, words."""
    return [Variable(name, "output", "continuous", *row, None) for name, row in rows.items()]


def _setting_variables(rows: Mapping[str, tuple[str, float]]) -> list[Variable]:
    """Parameters without a unit: name -> words, start."""
    return [Variable(name, "parameter", "tunable", "-", *row) for name, row in rows.items()]


def _vessel_variables(vessel: Vessel | None) -> list[Variable]:
    """Parameters: the numbers of a vessel document."""
    if vessel is None:
        return []
    text, above_zero = "number of the vessel document", vessel.above_zero
    return [
        Variable(key, "parameter", "tunable", vessel.units[key], text, value, above_zero=key in above_zero)
        for key, value in vessel.parameters.items()
    ]


def vessel_unit(vessel: Vessel, name: str, method: Method) -> FmuParts:
    """The FMU of a vessel: commands, weather and loads in, motion out."""
    units = VesselParts(vessel, method).units()
    largest = round(LARGEST_STEP * min(1.0, ((vessel.length or 30.0) / 30.0) ** 0.5), 4)
    begins = "; begins at its order, within its stops, unless a start value is set"
    variables = []
    for key, unit in units["carry"].items():
        order, lags = key.removeprefix(ACTUAL), key.startswith(ACTUAL)
        text = f"reached: {words_of_signal(order)}{begins}" if lags else words_of_signal(order)
        variables.append(Variable(key, "output", "continuous", unit, text, 0.0, lags))
    variables += _input_variables(
        {key: (unit, f"order: {words_of_signal(key)}", neutral_value(key)) for key, unit in units["commands"].items()}
        | {key: (unit, words_of_signal(key), 0.0) for key, unit in units["environment"].items()}
        | {f"load.{key}": (unit, f"added {key}, such as waves or a tug", 0.0) for key, unit in units["loads"].items()}
    )
    solver = Variable("solver.step", "parameter", "tunable", "s", f"largest internal step of {method}", largest)
    variables += [*_vessel_variables(vessel), solver]
    sizes, num_reached = {group: len(names) for group, names in units.items()}, len(vessel_dynamics(vessel).memory)
    return FmuParts(
        name, vessel.name, tuple(variables), vessel_files(vessel, name, method, NumberPrecision()),
        vessel_wrapper(name, sizes, sizes["carry"] - num_reached, variables), None,
    )  # fmt: skip


def predictor_unit(model: ExportModel, name: str) -> FmuParts:
    """The FMU of a predictor: motion, weather and commands in, path, band and alarm out."""
    names, step, bands = model.layout, model.physics.step, model.predictor.bands
    steps = range(names.horizon)
    ends = {key: sum(model.limits.get(key, (0.0, 0.0))) / 2 for key in names.now}
    rows = {
        key: (model.unit(key), words_of_signal(key), ends[key] if np.isfinite(ends[key]) else 0.0) for key in names.now
    }
    planned = {
        f"planned[{k + 1}].{key}": (
            model.unit(key), f"order in force in step {k + 1} of the horizon: {words_of_signal(key)}", 0.0
        )
        for k in steps
        for key in names.planned
    }  # fmt: skip
    shown = {
        f"{axis}[{k + 1}]": ("m", f"way {word} after {step * (k + 1):g} s, in body axes at the instant of prediction")
        for axis, word in (("x", "ahead"), ("y", "to starboard"))
        for k in steps
    }
    shown |= {
        f"{key}[{k + 1}]": (unit, f"band after {step * (k + 1):g} s: {word}")
        for key, (unit, word) in (_BAND_OUTPUTS.items() if bands is not None else ())
        for k in steps
    }
    shown["instant"] = "s", "time of the row that the path starts from"
    settings = {}
    if names.planned:
        settings["held"] = "1: orders stay as they are over the horizon; 0: as in planned[...]", 1.0
    if bands is not None:
        kinds = ", ".join(f"{number}: {kind}" for number, kind in enumerate(("any", *bands.kinds)))
        usual = next(level for level in (0.9, 0.8, 0.5) if bands.promises(level) or level == 0.5)
        settings["level"] = "share of whole paths that the band holds, above 0 to 0.99", usual
        settings["pointwise"] = "1: the share is that of positions at each step alone", 0.0
        settings["kind"] = f"of the manoeuvre under way: {kinds}", 0.0
    variables = [
        *_input_variables(rows | planned),
        *_output_variables(shown),
        *_vessel_variables(model.vessel),
        *_setting_variables(settings),
    ]
    what = "no physics" if model.vessel is None else model.vessel.name
    return FmuParts(
        name, f"{what}, {model.predictor.method}", tuple(variables), predictor_files(model, name, NumberPrecision()),
        predictor_wrapper(name, names.horizon, len(names.parameters), variables),
        step,
    )  # fmt: skip


def write_fmu(unit: FmuParts, file: Path) -> list[str]:
    """Write the FMU; the platforms of the binaries in it. ShipidError where the compiler fails."""
    name = unit.identifier
    sources = {key: text for key, text in unit.files.texts.items() if key != "main.c"}
    sources[f"{name}.c"] += "\n" + unit.wrapper
    texts = {f"sources/{key}": text for key, text in sources.items()}
    guid = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, unit.title + ''.join(texts.values()))}}}"
    texts["modelDescription.xml"] = model_description(unit, guid)
    texts[f"sources/{name}.c"] = sources[f"{name}.c"].replace("@GUID@", guid)
    place = BINARIES.get((platform.system(), platform.machine())) if find_compiler() is not None else None
    with replace_whole(file) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for key, text in texts.items():
            archive.writestr(_archive_entry(key), text)
        if place is not None:
            for key in sources:
                (temporary.parent / key).write_text(texts[f"sources/{key}"], encoding="utf-8")
            built = _compile_binary(temporary.parent, name)
            archive.writestr(_archive_entry(f"binaries/{place[0]}/{name}{place[1]}", 0o755), built.read_bytes())
    return [] if place is None else [place[0]]


def _archive_entry(name: str, mode: int = 0o644) -> zipfile.ZipInfo:
    """A file of the archive, of 1980 whatever the clock says: one without a battery begins in 1970, which no zip takes."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, mode << 16
    return entry


def _compile_binary(folder: Path, name: str) -> Path:
    command = find_compiler()
    assert command is not None
    options = ["-std=c99", "-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-s"]
    built = folder / f"{name}.so"
    sources = [str(folder / f"{name}{part}.c") for part in ("", "_casadi")]
    complaint, _ = run_compiler([command, *options, "-o", str(built), *sources, "-lm"], folder)
    if complaint is not None:
        raise ShipidError(f"the C compiler failed ({complaint.splitlines()[0]})")
    return built


def model_description(unit: FmuParts, guid: str) -> str:
    """Text of modelDescription.xml (FMI 2.0): the variables with their units, and the sources."""
    units = sorted({variable.unit for variable in unit.variables} - {"-", ""})
    rows = []
    for reference, variable in enumerate(unit.variables):
        head = f'    <ScalarVariable name={quoteattr(variable.name)} valueReference="{reference}"'
        head += f' causality="{variable.causality}" variability="{variable.variability}"'
        head += f' initial="{variable.initial}"' if variable.initial else ""
        real = "" if variable.unit in ("-", "") else f" unit={quoteattr(variable.unit)}"
        real += f' min="{LEAST_ABOVE_ZERO!r}"' if variable.above_zero else ""
        real += "" if variable.start is None else f' start="{float(variable.start)!r}"'
        rows.append(
            f"{head} description={quoteattr(variable.description)}>\n      <Real{real}/>\n    </ScalarVariable>"
        )
    alarm = unit.step is not None  # a predictor: what is computed from the inputs is so at the start, too
    known = "calculated" if alarm else "exact"
    rows.append(
        f'    <ScalarVariable name="status" valueReference="0" causality="output" variability="discrete" initial="{known}"'
        ' description="0, or a sum of the results that the header in sources lists">\n'
        + ("      <Integer/>" if alarm else '      <Integer start="0"/>')
        + "\n    </ScalarVariable>"
    )
    if alarm:
        rows.append(
            '    <ScalarVariable name="alarm" valueReference="0" causality="output" variability="discrete"'
            ' initial="calculated" description="the instant lies outside of what training has seen">\n'
            "      <Boolean/>\n    </ScalarVariable>"
        )
    outputs = [i + 1 for i, variable in enumerate(unit.variables) if variable.causality == "output"]
    unknown = [i for i in outputs if unit.variables[i - 1].initial != "exact"]
    others = [len(unit.variables) + 1 + k for k in range(1 + alarm)]
    outputs += others
    unknown += others if alarm else []
    structure = "    <Outputs>\n" + "".join(f'      <Unknown index="{i}"/>\n' for i in outputs) + "    </Outputs>\n"
    if unknown:
        listed = "".join(f'      <Unknown index="{i}"/>\n' for i in unknown)
        structure += f"    <InitialUnknowns>\n{listed}    </InitialUnknowns>\n"
    newline = "\n"
    experiment = f' stepSize="{unit.step!r}"' if unit.step is not None else ' stepSize="0.1"'
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(unit.title)} guid={quoteattr(guid)}
  generationTool="shipid {__version__}" variableNamingConvention="flat">
  <CoSimulation modelIdentifier="{unit.identifier}" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUstate="true" canSerializeFMUstate="true">
    <SourceFiles>
      <File name="{unit.identifier}.c"/>
      <File name="{unit.identifier}_casadi.c"/>
    </SourceFiles>
  </CoSimulation>
  <UnitDefinitions>
{newline.join(f"    <Unit name={quoteattr(name)}/>" for name in units)}
  </UnitDefinitions>
  <LogCategories>
    <Category name="logStatusError" description="values that are refused"/>
  </LogCategories>
  <DefaultExperiment startTime="0.0" stopTime="60.0"{experiment}/>
  <ModelVariables>
{newline.join(rows)}
  </ModelVariables>
  <ModelStructure>
{structure}  </ModelStructure>
</fmiModelDescription>
"""
