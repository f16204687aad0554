"""FMI 2.0 for co-simulation: a vessel or a predictor as an FMU with its sources and, where there is a compiler, a binary.

The standard: Functional Mock-up Interface 2.0.4, fmi-standard.org.
"""

from __future__ import annotations

import logging
import platform
import re
import sys
import uuid
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any
from xml.etree import ElementTree

from shipid.engine.integrate import Method
from shipid.engine.libraries import run_compiler
from shipid.engine.native import find_compiler
from shipid.errors import ShipidError, escape_unprintable
from shipid.export.c import SourceFiles, number_list
from shipid.export.c_predictor import predictor_files
from shipid.export.c_vessel import vessel_files
from shipid.export.equations import Equations
from shipid.export.fmu_c import FMI_BODY, FMI_HEAD, PREDICTOR_MODEL, VESSEL_MODEL
from shipid.export.model import BAND_CHOICE, BAND_ROWS, ExportModel
from shipid.files import replace_whole
from shipid.physics.signals import ACTUAL, SIGNALS, neutral_value
from shipid.version import __version__
from shipid.vessel.load import Vessel

log = logging.getLogger(__name__)

BINARIES = {("Linux", "x86_64"): ("linux64", ".so"), ("Darwin", "x86_64"): ("darwin64", ".dylib")}
"""System and processor -> folder of the binary in an FMU, and how its name ends."""
LEAST_ABOVE_ZERO = sys.float_info.min  # FMI 2.0 has no limit that is not allowed itself
LARGEST_STEP = 0.1  # s: inside a communication step, of a ship of 30 m and more; times the root of the length below
MOST_SOLVER_STEPS = 1_000_000  # in a communication step: some seconds


@dataclass(frozen=True)
class Variable:
    """A real variable of an FMU.

    start : None where it is calculated. guess : whether it is calculated, too, unless the importer sets a start value.
    above_zero : whether it is a parameter that must be above 0.
    """

    name: str
    causality: str
    unit: str
    description: str
    start: float | None
    guess: bool = False
    above_zero: bool = False

    @property
    def initial(self) -> str:
        """How it begins, in the words of FMI; nothing for inputs."""
        known = "calculated" if self.start is None else "approx" if self.guess else "exact"
        return "" if self.causality == "input" else known

    @property
    def kind(self) -> str:
        """The letter by which the C knows who may set it."""
        exact = self.causality == "output" and self.start is not None
        return "e" if exact else "a" if self.above_zero else self.causality[0]


@dataclass(frozen=True)
class FmuParts:
    """The parts of an FMU: its title, its variables in the order of value references, its C, and the step of a path."""

    title: str
    variables: tuple[Variable, ...]
    files: SourceFiles
    model: str
    values: Mapping[str, Any]
    step: float | None

    def wrapper(self, guid: str) -> str:
        """The C around that of the files."""
        values = {
            "NUM_REALS": len(self.variables),
            "GUID": guid,
            "STARTS": number_list([one.start or 0.0 for one in self.variables]),
            "KINDS": ",".join(f"'{one.kind}'" for one in self.variables),
            **self.values,
        }
        return Template((FMI_HEAD + self.model + FMI_BODY).replace("@", self.files.name)).substitute(values)


def words_of_signal(name: str) -> str:
    """Words for a signal: `port.alpha` is `azimuth, port`."""
    component, _, signal = name.rpartition(".")
    word = SIGNALS[signal].word if signal in SIGNALS else signal
    return f"{word}, {component}" if component else word


def vessel_unit(vessel: Vessel, name: str, method: Method) -> FmuParts:
    """The FMU of a vessel: commands, weather and loads in, motion out."""
    equations = Equations(vessel)
    carry, commands, environment, loads, _ = equations.groups.values()
    largest = round(LARGEST_STEP * min(1.0, ((vessel.length or 30.0) / 30.0) ** 0.5), 4)
    begins = "begins at its order, within its stops, unless a start value is set"
    variables = []
    for key, unit in carry.items():
        words, lags = words_of_signal(key.removeprefix(ACTUAL)), key.startswith(ACTUAL)
        variables.append(Variable(key, "output", unit, f"reached: {words}; {begins}" if lags else words, 0.0, lags))
    for key, unit in commands.items():
        variables.append(Variable(key, "input", unit, f"order: {words_of_signal(key)}", neutral_value(key)))
    variables += [Variable(key, "input", unit, words_of_signal(key), 0.0) for key, unit in environment.items()]
    variables += [Variable(f"load.{key}", "input", unit, f"added {key}", 0.0) for key, unit in loads.items()]
    places = {"NUM_STATES": len(equations.states), "COMMANDS": len(carry), "ENVIRONMENT": len(carry) + len(commands)}
    places |= {"LOADS": len(variables) - len(loads), "FIRST_PARAMETER": len(variables)}
    for key, value in vessel.parameters.items():
        least, words = key in vessel.above_zero, "number of the vessel document"
        variables.append(Variable(key, "parameter", vessel.units[key], words, value, above_zero=least))
    variables.append(Variable("solver.step", "parameter", "s", f"largest internal step of {method}", largest))
    files = vessel_files(vessel, name, method)
    return FmuParts(
        vessel.name, tuple(variables), files, VESSEL_MODEL, places | {"MOST_STEPS": MOST_SOLVER_STEPS}, None
    )


def predictor_unit(model: ExportModel, name: str) -> FmuParts:
    """The FMU of a predictor: motion, weather and commands in, path, band and alarm out."""
    names, step, bands = model.layout, model.physics.step, model.predictor.bands
    steps = range(1, names.horizon + 1)
    variables = [Variable(key, "input", unit, words_of_signal(key), 0.0) for key, unit in model.units("now").items()]
    variables += [
        Variable(f"planned[{k}].{key}", "input", unit, f"order in step {k} of the horizon: {words_of_signal(key)}", 0.0)
        for k in steps
        for key, unit in model.units("planned").items()
    ]
    path = len(variables)
    shown = dict.fromkeys("xy", "m") | (dict(zip(BAND_ROWS, "mm--", strict=True)) if bands is not None else {})
    variables += [
        Variable(f"{key}[{k}]", "output", unit, f"{key} of path or band after {step * k:g} s, in body axes then", None)
        for key, unit in shown.items()
        for k in steps
    ]
    variables.append(Variable("instant", "output", "s", "time of the row that the path starts from", None))
    first = len(variables)
    settings = {}
    if names.planned:
        settings["held"] = "1: orders stay as they are over the horizon; 0: as in planned[...]", 1.0
    if bands is not None:
        kinds = ", ".join(f"{number}: {kind}" for number, kind in enumerate(("any", *bands.kinds)))
        words = (
            "share of whole paths in the band, above 0 to 0.99",
            "1: that of positions at each step alone",
            f"manoeuvre, {kinds}",
        )
        usual = next((level for level in (0.9, 0.8) if bands.promises(level)), 0.5)
        settings |= dict(zip(BAND_CHOICE, zip(words, (usual, 0.0, 0.0), strict=True), strict=True))
    at = {key: f"self->values + {place}" for place, key in enumerate(settings, len(variables))}
    variables += [Variable(key, "parameter", "-", *setting) for key, setting in settings.items()]
    values: dict[str, Any] = {"FIRST_PARAMETER": first, "X": path, "BAND": 0 if bands is None else len(BAND_ROWS)}
    values["PLAN"] = f"*({at['held']}) != 0 ? 0 : self->values + {len(names.now)}" if names.planned else 0
    values["CHOICE"] = at.get(BAND_CHOICE[0], 0)
    what = "no physics" if model.physics.vessel is None else model.physics.vessel.name
    files = predictor_files(model, name)
    return FmuParts(f"{what}, {model.predictor.method}", tuple(variables), files, PREDICTOR_MODEL, values, step)


def write_fmu(unit: FmuParts, file: Path) -> list[Path]:
    """Write the FMU; ShipidError where the compiler fails, a line in the log where it has no binary."""
    name = unit.files.name
    sources = {key: text for key, text in unit.files.texts.items() if key != "main.c"}
    guid = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, unit.title + ''.join(sources.values()) + unit.wrapper(''))}}}"
    sources[f"{name}.c"] += unit.wrapper(guid)
    here = platform.system(), platform.machine()
    compiler, place = find_compiler(), BINARIES.get(here)
    with replace_whole(file) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(_archive_entry("modelDescription.xml"), model_description(unit, guid))
        for key, text in sources.items():
            archive.writestr(_archive_entry(f"sources/{key}"), text)
            (temporary.parent / key).write_text(text, encoding="utf-8")
        if place is not None and compiler is not None:
            built = temporary.parent / f"{name}.so"
            options = ["-std=c99", "-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-s", "-o", str(built)]
            parts = [str(temporary.parent / f"{name}{part}.c") for part in ("", "_casadi")]
            complaint, _ = run_compiler([compiler, *options, *parts, "-lm"], temporary.parent)
            if complaint is not None:
                raise ShipidError(f"the C compiler failed ({complaint.splitlines()[0]})", file=file)
            archive.writestr(_archive_entry(f"binaries/{place[0]}/{name}{place[1]}", 0o755), built.read_bytes())
    if place is None or compiler is None:
        shown, system = escape_unprintable(str(file)), " ".join(here)
        log.warning("%s has no binary for %s: the tool that imports it must compile its sources", shown, system)
    return [file]


def _archive_entry(name: str, mode: int = 0o644) -> zipfile.ZipInfo:
    """A file of the archive, of 1980 whatever the clock says: one without a battery begins in 1970, which no zip takes."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, mode << 16
    return entry


def model_description(unit: FmuParts, guid: str) -> str:
    """Text of modelDescription.xml (FMI 2.0): the variables with their units, and the sources."""
    name, alarm = unit.files.name, unit.step is not None  # of a predictor all is calculated at the start
    root = ElementTree.Element(
        "fmiModelDescription", fmiVersion="2.0", modelName=_xml_text(unit.title), guid=guid,
        generationTool=f"shipid {__version__}", variableNamingConvention="flat",
    )  # fmt: skip

    def add(parent: ElementTree.Element, tag: str, **attributes: Any) -> ElementTree.Element:
        return ElementTree.SubElement(parent, tag, {key: _xml_text(str(value)) for key, value in attributes.items()})

    able = {"canHandleVariableCommunicationStepSize": "true", "canGetAndSetFMUstate": "true"}
    sources = add(add(root, "CoSimulation", modelIdentifier=name, **able), "SourceFiles")
    for part in ("", "_casadi"):
        add(sources, "File", name=f"{name}{part}.c")
    units = sorted({one.unit for one in unit.variables} - {"-", ""})
    if units:
        definitions = add(root, "UnitDefinitions")
        for one in units:
            add(definitions, "Unit", name=one)
    add(add(root, "LogCategories"), "Category", name="logStatusError", description="values that are refused")
    add(root, "DefaultExperiment", startTime=0.0, stopTime=60.0, stepSize=unit.step or 0.1)
    listed, outputs, unknowns = add(root, "ModelVariables"), list[int](), list[int]()

    def variable(name: str, reference: int, causality: str, initial: str, words: str, kind: str, **more: Any) -> None:
        variability = "discrete" if kind != "Real" else "tunable" if causality == "parameter" else "continuous"
        attributes = {"name": name, "valueReference": reference, "causality": causality, "variability": variability}
        attributes |= {"initial": initial} if initial else {}
        add(add(listed, "ScalarVariable", **attributes, description=words), kind, **more)
        if causality == "output":
            outputs.append(len(listed))
            unknowns.extend([len(listed)] if initial != "exact" else [])

    for number, real in enumerate(unit.variables):
        more: dict[str, Any] = {} if real.unit in ("-", "") else {"unit": real.unit}
        more |= {"min": LEAST_ABOVE_ZERO} if real.above_zero else {}
        more |= {} if real.start is None else {"start": float(real.start)}
        variable(real.name, number, real.causality, real.initial, real.description, "Real", **more)
    words, initial = "0, or a sum of the results that the header in sources lists", "calculated" if alarm else "exact"
    variable("status", 0, "output", initial, words, "Integer", **({} if alarm else {"start": 0}))
    if alarm:
        words = "the instant lies outside of what training has seen"
        variable("alarm", 0, "output", "calculated", words, "Boolean")
    structure = add(root, "ModelStructure")
    for tag, places in (("Outputs", outputs), ("InitialUnknowns", unknowns)):
        under = add(structure, tag) if places else structure
        for place in places:
            add(under, "Unknown", index=place)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _xml_text(text: str) -> str:
    """A text in which U+FFFD, the replacement character, stands for what XML cannot hold."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text)
