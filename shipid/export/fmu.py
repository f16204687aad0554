"""FMI 2.0 for co-simulation: a vessel or a predictor as an FMU with its sources and, where there is a compiler, a binary.

The standard: Functional Mock-up Interface 2.0.4, fmi-standard.org. Its declarations are written out in `_FMI_HEAD` below.
"""

from __future__ import annotations

import platform
import re
import tempfile
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax import saxutils

import numpy as np

from shipid.engine.integrate import Method
from shipid.engine.libraries import run_compiler
from shipid.engine.native import compiler
from shipid.errors import ShipidError
from shipid.export.band import CHOICE, COLUMNS
from shipid.export.blocks import Precision
from shipid.export.c import Files
from shipid.export.c_predictor import PredictorParts, predictor_files
from shipid.export.c_vessel import VesselParts, vessel_files
from shipid.export.model import Model
from shipid.files import whole
from shipid.physics.signals import SIGNALS, neutral
from shipid.version import __version__
from shipid.vessel.load import Vessel

BINARIES = {("Linux", "x86_64"): ("linux64", ".so"), ("Darwin", "x86_64"): ("darwin64", ".dylib")}
"""System and processor -> folder of the binary in an FMU, and how its name ends."""
_BAND = {
    "along": ("m", "half axis along the predicted track"),
    "across": ("m", "half axis across the predicted track"),
    "ahead_x": ("-", "unit vector of the track, ahead"),
    "ahead_y": ("-", "unit vector of the track, to starboard"),
}
LARGEST_STEP = 0.1  # s: inside a communication step, of a ship of 30 m and more; times the root of the length below


@dataclass(frozen=True)
class Variable:
    """A real variable of an FMU.

    start : None where it is calculated. guess : whether it is calculated, too, unless the importer sets a start value.
    """

    name: str
    causality: str
    variability: str
    unit: str
    description: str
    start: float | None
    guess: bool = False

    @property
    def initial(self) -> str:
        """How it begins, in the words of FMI; nothing for inputs."""
        known = "calculated" if self.start is None else "approx" if self.guess else "exact"
        return "" if self.causality == "input" else known


@dataclass(frozen=True)
class Packed:
    """The parts of an FMU: its variables in the order of value references, its C, and its name."""

    identifier: str
    title: str
    variables: tuple[Variable, ...]
    files: Files
    wrapper: str
    step: float | None


def quoteattr(text: str) -> str:
    """A text as an attribute of XML; a character that XML cannot hold becomes U+FFFD, the replacement character."""
    return saxutils.quoteattr(re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text))


def described(name: str) -> str:
    """Words for a signal: `port.alpha` is `azimuth, port`."""
    component, _, signal = name.rpartition(".")
    word = SIGNALS[signal].word if signal in SIGNALS else signal
    return f"{word}, {component}" if component else word


def vessel_unit(vessel: Vessel, name: str, method: Method) -> Packed:
    """The FMU of a vessel: commands, weather and loads in, motion out."""
    parts = VesselParts(vessel, name, method, Precision())
    groups = parts.groups()
    largest = round(LARGEST_STEP * min(1.0, ((vessel.length or 30.0) / 30.0) ** 0.5), 4)
    variables = []
    for key in groups["carry"]:
        order, lags = key.removeprefix("actual."), key.startswith("actual.")
        text = described(order)
        text = f"reached: {text}; begins at its order unless a start value is set" if lags else text
        variables.append(Variable(key, "output", "continuous", parts.unit("carry", key), text, 0.0, lags))
    variables += [
        Variable(key, "input", "continuous", parts.unit("commands", key), f"order: {described(key)}", neutral(key))
        for key in groups["commands"]
    ]
    variables += [
        Variable(key, "input", "continuous", parts.unit("environment", key), described(key), 0.0)
        for key in groups["environment"]
    ]
    variables += [
        Variable(
            f"load.{key}", "input", "continuous", parts.unit("loads", key), f"added {key}, such as waves or a tug", 0.0
        )
        for key in groups["loads"]
    ]
    variables += [
        Variable(key, "parameter", "tunable", vessel.units[key], "number of the vessel document", value)
        for key, value in vessel.parameters.items()
    ]
    variables.append(
        Variable("solver.step", "parameter", "tunable", "s", f"largest internal step of {method}", largest)
    )
    sizes = {group: len(names) for group, names in groups.items()}
    return Packed(
        name, vessel.name, tuple(variables), vessel_files(vessel, name, method, Precision()),
        _vessel_wrapper(name, sizes, parts.equations.num_states, variables), None,
    )  # fmt: skip


def predictor_unit(model: Model, name: str) -> Packed:
    """The FMU of a predictor: motion, weather and commands in, path, band and alarm out."""
    parts, names = PredictorParts(model, name, Precision()), model.layout
    variables = []
    for key in parts.row:
        low, high = model.limits.get(key, (0.0, 0.0))
        start = (low + high) / 2 if np.isfinite(low + high) else 0.0
        variables.append(Variable(key, "input", "continuous", model.unit(key), described(key), start))
    for k in range(names.horizon if names.planned else 0):
        for key in names.planned:
            text = f"order in force in step {k + 1} of the horizon: {described(key)}"
            variables.append(Variable(f"planned[{k + 1}].{key}", "input", "continuous", model.unit(key), text, 0.0))
    step = model.physics.step
    for axis, word in (("x", "ahead"), ("y", "to starboard")):
        for k in range(names.horizon):
            text = f"way {word} after {step * (k + 1):g} s, in body axes at the instant of prediction"
            variables.append(Variable(f"{axis}[{k + 1}]", "output", "continuous", "m", text, None))
    bands = model.predictor.bands
    for key, (unit, word) in _BAND.items() if bands is not None else ():
        for k in range(names.horizon):
            text = f"band after {step * (k + 1):g} s: {word}"
            variables.append(Variable(f"{key}[{k + 1}]", "output", "continuous", unit, text, None))
    variables.append(
        Variable("instant", "output", "continuous", "s", "time of the row that the path starts from", None)
    )
    for key, value in zip(names.parameters, model.parameters, strict=True):
        variables.append(
            Variable(key, "parameter", "tunable", model.unit(key), "number of the vessel document", float(value))
        )
    if names.planned:
        text = "1: orders stay as they are over the horizon; 0: as in planned[...]"
        variables.append(Variable("held", "parameter", "tunable", "-", text, 1.0))
    if bands is not None:
        kinds = ", ".join(f"{number}: {kind}" for number, kind in enumerate(("any", *bands.kinds)))
        usual = next(level for level in (0.9, 0.8, 0.5) if bands.promises(level) or level == 0.5)
        for key, text, value in (
            ("level", "share of whole paths that the band holds, above 0 to 0.99", usual),
            ("pointwise", "1: the share is that of positions at each step alone", 0.0),
            ("kind", f"of the manoeuvre under way: {kinds}", 0.0),
        ):
            variables.append(Variable(key, "parameter", "tunable", "-", text, value))
    what = "no physics" if model.vessel is None else model.vessel.name
    return Packed(
        name, f"{what}, {model.predictor.method}", tuple(variables), predictor_files(model, name, Precision()),
        _predictor_wrapper(
            name, len(parts.row), names.horizon, len(names.planned), len(names.parameters), bands is not None, variables
        ),
        step,
    )  # fmt: skip


def write_fmu(unit: Packed, file: Path, *, binary: bool = True) -> list[str]:
    """Write the FMU; the platforms of the binaries in it. ShipidError where the compiler fails."""
    source = unit.files.texts[f"{unit.files.name}.c"] + "\n" + unit.wrapper
    texts = {
        f"sources/{unit.files.name}.h": unit.files.texts[f"{unit.files.name}.h"],
        f"sources/{unit.files.name}.c": source,
        "documentation/index.html": _documentation(unit),
    }
    digest = uuid.uuid5(uuid.NAMESPACE_URL, unit.title + "".join(texts.values()))
    texts["modelDescription.xml"] = description(unit, f"{{{digest}}}")
    texts[f"sources/{unit.files.name}.c"] = source.replace("@GUID@", f"{{{digest}}}")
    place = BINARIES.get((platform.system(), platform.machine())) if binary and compiler() is not None else None
    with (
        tempfile.TemporaryDirectory() as folder,
        whole(file) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for name, text in texts.items():
            archive.writestr(_entry(name), text)
        if place is not None:
            for name in (f"{unit.files.name}.c", f"{unit.files.name}.h"):
                (Path(folder) / name).write_text(texts[f"sources/{name}"], encoding="utf-8")
            built = _compiled(Path(folder), unit.files.name)
            archive.writestr(_entry(f"binaries/{place[0]}/{unit.identifier}{place[1]}", 0o755), built.read_bytes())
    return [] if place is None else [place[0]]


def _entry(name: str, mode: int = 0o644) -> zipfile.ZipInfo:
    """A file of the archive, of 1980 whatever the clock says: one without a battery begins in 1970, which no zip takes."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, mode << 16
    return entry


def _compiled(folder: Path, name: str) -> Path:
    command = compiler()
    assert command is not None
    options = ["-std=c99", "-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-s"]
    built = folder / f"{name}.so"
    complaint, _ = run_compiler([command, *options, "-o", str(built), str(folder / f"{name}.c"), "-lm"], folder)
    if complaint is not None:
        raise ShipidError(f"the C compiler failed ({complaint.splitlines()[0]})")
    return built


def description(unit: Packed, guid: str) -> str:
    """modelDescription.xml."""
    units = sorted({variable.unit for variable in unit.variables} - {"-", ""})
    rows = []
    for reference, variable in enumerate(unit.variables):
        head = f'    <ScalarVariable name={quoteattr(variable.name)} valueReference="{reference}"'
        head += f' causality="{variable.causality}" variability="{variable.variability}"'
        head += f' initial="{variable.initial}"' if variable.initial else ""
        real = "" if variable.unit in ("-", "") else f" unit={quoteattr(variable.unit)}"
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
      <File name="{unit.files.name}.c"/>
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


def _documentation(unit: Packed) -> str:
    from html import escape

    rows = "".join(
        f"<tr><td>{escape(v.name)}</td><td>{v.causality}</td><td>{escape(v.unit)}</td><td>{escape(v.description)}</td></tr>\n"
        for v in unit.variables
    )
    text = (
        "The vessel takes as many internal steps as solver.step asks for. A value that is not finite is refused."
        if unit.step is None
        else "A step from t to t + h keeps the inputs as the row that was measured at t; the outputs are the path from then."
    )
    return f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>{escape(unit.title)}</title>
<h1>{escape(unit.title)}</h1><p>{text} SI units, radians, revolutions per second; directions are towards.</p>
<table>{rows}</table></html>
"""


def _vessel_wrapper(name: str, sizes: Mapping[str, int], num_states: int, variables: Sequence[Variable]) -> str:
    at, place = {}, 0
    for group in ("carry", "commands", "environment", "loads", "parameters"):
        at[group] = place
        place += sizes[group]
    total = place + 1
    given = ", ".join(
        f"self->values + {at[group]}" for group in ("carry", "commands", "environment", "loads", "parameters")
    )
    begin = f"""    double carry[{sizes["carry"]}];
    int i;
    memcpy(carry, self->values, sizeof carry);
    {name}_begin(carry, self->values + {at["commands"]});
    for (i = {num_states}; i < {sizes["carry"]}; ++i) if (!set[i]) self->values[i] = carry[i]; /* actuators: at their orders */
    (void)t;
"""
    begin = begin if sizes["carry"] > num_states else "    (void)self;\n    (void)set;\n    (void)t;\n"
    return f"""
#define NUM_REALS {total}
#define NUM_BOOLEANS 0
{_FMI_HEAD}
typedef struct {{
    double values[NUM_REALS];
    int status;
}} Model;
{_fmi(name, variables)}
static void Model_init(Model *self)
{{
    memset(self, 0, sizeof *self);
    memcpy(self->values, start_values, sizeof start_values);
}}

static const char *Model_begin(Model *self, const unsigned char *set, double t)
{{
{begin}    return 0;
}}

static const char *Model_step(Model *self, double t, double h)
{{
    const double largest = self->values[{total - 1}];
    const double count = ceil(h / largest - 1e-9);
    double before[{max(1, sizes["carry"])}];
    long k, steps;
    (void)t;
    if (!(largest > 0)) return "solver.step must be above 0";
    if (!(count < 1e9)) return "the communication step needs too many steps of solver.step";
    steps = count < 1 ? 1 : (long)count;
    memcpy(before, self->values, sizeof before);
    for (k = 0; k < steps; ++k) {{
        self->status = {name}_step({given}, h / (double)steps);
        if (self->status) {{
            memcpy(self->values, before, sizeof before);
            return self->status == {name}_DIVERGED
                ? "the motion diverges: take a smaller solver.step, or look at inputs and parameters"
                : "an input is not finite";
        }}
    }}
    return 0;
}}

static int Model_boolean(const Model *self, unsigned reference)
{{
    (void)self;
    (void)reference;
    return 0;
}}
{_FMI_BODY}"""


def _predictor_wrapper(
    name: str,
    num_row: int,
    horizon: int,
    num_planned: int,
    num_parameters: int,
    banded: bool,
    variables: Sequence[Variable],
) -> str:
    planned = num_row
    path = planned + horizon * num_planned
    band = path + 2 * horizon
    instant = band + (len(COLUMNS) * horizon if banded else 0)
    parameters = instant + 1
    held = parameters + num_parameters
    chosen = held + (1 if num_planned else 0)
    total = chosen + (len(CHOICE) if banded else 0)
    plan = f"self->values[{held}] != 0 ? 0 : self->values + {planned}" if num_planned else "0"
    declared, shown = "", ""
    call = f"{name}_predict(kept, {plan}, path)"
    if banded:
        asked = f"self->values[{chosen}], self->values[{chosen + 1}] != 0, kind_of(self->values[{chosen + 2}])"
        call = f"{name}_predict_band(kept, {plan}, {asked}, path, band)"
        declared = f"    double band[{len(COLUMNS)} * {horizon}];\n"
        shown = "\n".join(
            f"        self->values[{band + place * horizon} + k] = band[{len(COLUMNS)} * k + {place}];"
            for place in range(len(COLUMNS))
        )
    numbered = (
        """
/* A whole number, or -1, which is no kind. */
static int kind_of(double value)
{
    return value >= 0 && value < 1e9 && floor(value) == value ? (int)value : -1;
}
"""
        if banded
        else ""
    )
    return f"""
#define NUM_REALS {total}
#define NUM_BOOLEANS 1
{_FMI_HEAD}
typedef struct {{
    double values[NUM_REALS];
    int status;
    {name} kept, trial; /* the second for the path at the start: too large for the stack of a thread */
}} Model;
{_fmi(name, variables)}
static void Model_init(Model *self)
{{
    memset(self, 0, sizeof *self);
    memcpy(self->values, start_values, sizeof start_values);
    {name}_init(&self->kept);
}}

{numbered}
static const char *predict_from(Model *self, {name} *kept, double t)
{{
    double path[2 * {horizon}];
{declared}    int k;
    {"memcpy(kept->parameters, self->values + " + str(parameters) + ", " + str(num_parameters) + " * sizeof(double));" if num_parameters else ""}
    self->status = {name}_record(kept, t, self->values);
    if (self->status) return self->status == {name}_TIME ? "time does not go on" : "an input is not finite";
    self->status = {call};
    for (k = 0; k < {horizon}; ++k) {{
        self->values[{path} + k] = path[2 * k];
        self->values[{path + horizon} + k] = path[2 * k + 1];
{shown}
    }}
    self->values[{instant}] = t;
    return 0;
}}

/* The path at the start: from a copy, since the first step keeps this row. */
static const char *Model_begin(Model *self, const unsigned char *set, double t)
{{
    (void)set;
    self->trial = self->kept;
    return predict_from(self, &self->trial, t);
}}

static const char *Model_step(Model *self, double t, double h)
{{
    (void)h;
    return predict_from(self, &self->kept, t);
}}

static int Model_boolean(const Model *self, unsigned reference)
{{
    (void)reference;
    return (self->status & {name}_OUTSIDE) != 0;
}}
{_FMI_BODY}"""


def _kind(variable: Variable) -> str:
    exact = variable.causality == "output" and variable.start is not None
    return f"'{'e' if exact else variable.causality[0]}'"


def _fmi(name: str, variables: Sequence[Variable]) -> str:
    """Start values and kinds of the variables."""
    values = Precision().table(np.array([0.0 if v.start is None else v.start for v in variables]))
    return f"""
static const char guid[] = "@GUID@";
static const char identifier[] = "{name}";
static const double start_values[NUM_REALS] = {{{values}}};
static const char kinds[] = {{{", ".join(_kind(v) for v in variables)}}}; /* input, output, exact at the start, parameter */
"""


_FMI_HEAD = """
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

/* Types and status of FMI 2.0 for co-simulation. */
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#ifdef FMI2_FUNCTION_PREFIX
#define PASTE(a, b) a ## b
#define PASTED(a, b) PASTE(a, b)
#define FMI2(name) PASTED(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(name) name
#endif
#if defined _WIN32 || defined __CYGWIN__
#define FMI2_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define FMI2_EXPORT __attribute__((visibility("default")))
#else
#define FMI2_EXPORT
#endif
#define FMI2_STATUS FMI2_EXPORT fmi2Status
"""

_FMI_BODY = """
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Phase;
typedef struct {
    Model model;
    Phase phase;
    double time;
    unsigned char set[NUM_REALS]; /* by the importer */
    int logging;
    char *name;
    fmi2CallbackFunctions call;
} Instance;

static void *get_memory(const fmi2CallbackFunctions *call, size_t size)
{
    return call->allocateMemory ? call->allocateMemory(1, size) : calloc(1, size);
}

static void free_memory(const fmi2CallbackFunctions *call, void *memory)
{
    if (call->freeMemory) call->freeMemory(memory);
    else free(memory);
}

static fmi2Status say(const fmi2CallbackFunctions *call, const char *name, fmi2Status status, const char *text)
{
    if (call->logger) call->logger(call->componentEnvironment, name, status, "logStatusError", "%s", text);
    return status;
}

static fmi2Status refuse(Instance *self, fmi2Status status, const char *format, ...)
{
    char text[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return self ? say(&self->call, self->name, status, text) : status;
}

FMI2_EXPORT const char *FMI2(fmi2GetTypesPlatform)(void);
FMI2_EXPORT const char *FMI2(fmi2GetTypesPlatform)(void) { return "default"; }
FMI2_EXPORT const char *FMI2(fmi2GetVersion)(void);
FMI2_EXPORT const char *FMI2(fmi2GetVersion)(void) { return "2.0"; }

FMI2_STATUS FMI2(fmi2SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]);
FMI2_STATUS FMI2(fmi2SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)n;
    (void)categories;
    ((Instance *)c)->logging = on;
    return fmi2OK;
}

FMI2_EXPORT fmi2Component FMI2(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String given, fmi2String place,
    const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging);
FMI2_EXPORT fmi2Component FMI2(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String given, fmi2String place,
    const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *self;
    (void)place;
    (void)visible;
    if (!call) return 0;
    if (type != fmi2CoSimulation) {
        say(call, identifier, fmi2Error, "this FMU is for co-simulation");
        return 0;
    }
    if (!given || strcmp(given, guid)) {
        say(call, identifier, fmi2Error, "the guid is not that of this FMU");
        return 0;
    }
    if (!name || !*name) {
        say(call, identifier, fmi2Error, "an instance needs a name");
        return 0;
    }
    self = (Instance *)get_memory(call, sizeof *self);
    if (!self) return 0;
    memset(self, 0, sizeof *self);
    self->call = *call;
    self->logging = logging;
    self->name = (char *)get_memory(call, strlen(name) + 1);
    if (!self->name) {
        free_memory(call, self);
        return 0;
    }
    strcpy(self->name, name);
    Model_init(&self->model);
    return self;
}

FMI2_EXPORT void FMI2(fmi2FreeInstance)(fmi2Component c);
FMI2_EXPORT void FMI2(fmi2FreeInstance)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    fmi2CallbackFunctions call;
    if (!self) return;
    call = self->call;
    free_memory(&call, self->name);
    free_memory(&call, self);
}

FMI2_STATUS FMI2(fmi2SetupExperiment)(fmi2Component c, fmi2Boolean known, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean stops, fmi2Real stop);
FMI2_STATUS FMI2(fmi2SetupExperiment)(fmi2Component c, fmi2Boolean known, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean stops, fmi2Real stop)
{
    Instance *self = (Instance *)c;
    (void)known;
    (void)tolerance;
    (void)stops;
    (void)stop;
    if (self->phase != INSTANTIATED) return refuse(self, fmi2Error, "the start time is set before the initialisation");
    if (!isfinite(start)) return refuse(self, fmi2Error, "the start time is not finite");
    self->time = start;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2EnterInitializationMode)(fmi2Component c);
FMI2_STATUS FMI2(fmi2EnterInitializationMode)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    if (self->phase != INSTANTIATED) return refuse(self, fmi2Error, "the initialisation begins once");
    self->phase = INITIALIZING;
    return fmi2OK;
}

/* In the initialisation outputs follow what has been set until then. */
static fmi2Status follow(Instance *self)
{
    const char *message = self->phase == INITIALIZING ? Model_begin(&self->model, self->set, self->time) : 0;
    return message ? refuse(self, fmi2Error, "%s", message) : fmi2OK;
}

FMI2_STATUS FMI2(fmi2ExitInitializationMode)(fmi2Component c);
FMI2_STATUS FMI2(fmi2ExitInitializationMode)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    fmi2Status status;
    if (self->phase != INITIALIZING) return refuse(self, fmi2Error, "there is no initialisation to end");
    status = follow(self);
    self->phase = STEPPING;
    return status;
}

FMI2_STATUS FMI2(fmi2Terminate)(fmi2Component c);
FMI2_STATUS FMI2(fmi2Terminate)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    if (self->phase != STEPPING) return refuse(self, fmi2Error, "Terminate before a step: nothing runs that could end");
    self->phase = TERMINATED;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2Reset)(fmi2Component c);
FMI2_STATUS FMI2(fmi2Reset)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    Model_init(&self->model);
    memset(self->set, 0, sizeof self->set);
    self->phase = INSTANTIATED;
    self->time = 0;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]);
FMI2_STATUS FMI2(fmi2GetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    Instance *self = (Instance *)c;
    size_t i;
    for (i = 0; i < n; ++i)
        if (vr[i] >= NUM_REALS) return refuse(self, fmi2Error, "there is no real variable %u", vr[i]);
    if (follow(self) != fmi2OK) return fmi2Error;
    for (i = 0; i < n; ++i) value[i] = self->model.values[vr[i]];
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2SetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]);
FMI2_STATUS FMI2(fmi2SetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    Instance *self = (Instance *)c;
    size_t i;
    if (self->phase == TERMINATED) return refuse(self, fmi2Error, "the simulation has ended: reset before a value is set");
    for (i = 0; i < n; ++i) {
        if (vr[i] >= NUM_REALS) return refuse(self, fmi2Error, "there is no real variable %u", vr[i]);
        if (kinds[vr[i]] == 'o' || (kinds[vr[i]] == 'e' && self->phase == STEPPING))
            return refuse(self, fmi2Error, "variable %u is an output and cannot be set now", vr[i]);
        if (!isfinite(value[i]))
            return refuse(self, fmi2Discard, "variable %u: %g is not a finite number", vr[i], value[i]);
    }
    for (i = 0; i < n; ++i) {
        self->model.values[vr[i]] = value[i];
        self->set[vr[i]] = 1;
    }
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetInteger)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]);
FMI2_STATUS FMI2(fmi2GetInteger)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
{
    Instance *self = (Instance *)c;
    size_t i;
    if (follow(self) != fmi2OK) return fmi2Error;
    for (i = 0; i < n; ++i) {
        if (vr[i]) return refuse(self, fmi2Error, "there is no integer variable %u", vr[i]);
        value[i] = self->model.status;
    }
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetBoolean)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]);
FMI2_STATUS FMI2(fmi2GetBoolean)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
{
    Instance *self = (Instance *)c;
    size_t i;
    if (follow(self) != fmi2OK) return fmi2Error;
    for (i = 0; i < n; ++i) {
        if (!NUM_BOOLEANS || vr[i]) return refuse(self, fmi2Error, "there is no boolean variable %u", vr[i]);
        value[i] = Model_boolean(&self->model, vr[i]);
    }
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetString)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]);
FMI2_STATUS FMI2(fmi2GetString)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[])
{
    (void)vr;
    (void)value;
    return n ? refuse((Instance *)c, fmi2Error, "there are no strings") : fmi2OK;
}

FMI2_STATUS FMI2(fmi2SetInteger)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]);
FMI2_STATUS FMI2(fmi2SetInteger)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
{
    (void)vr;
    (void)value;
    return n ? refuse((Instance *)c, fmi2Error, "no integer variable can be set") : fmi2OK;
}

FMI2_STATUS FMI2(fmi2SetBoolean)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]);
FMI2_STATUS FMI2(fmi2SetBoolean)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
{
    (void)vr;
    (void)value;
    return n ? refuse((Instance *)c, fmi2Error, "no boolean variable can be set") : fmi2OK;
}

FMI2_STATUS FMI2(fmi2SetString)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]);
FMI2_STATUS FMI2(fmi2SetString)(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
{
    (void)vr;
    (void)value;
    return n ? refuse((Instance *)c, fmi2Error, "there are no strings") : fmi2OK;
}

/* A state is what changes: the model, the phase, the time, and which variables the importer has set; and of which FMU. */
typedef struct {
    char guid[sizeof guid];
    Model model;
    Phase phase;
    double time;
    unsigned char set[NUM_REALS];
} Kept;

FMI2_STATUS FMI2(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state);
FMI2_STATUS FMI2(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    Instance *self = (Instance *)c;
    Kept *kept = (Kept *)*state;
    if (!kept) kept = (Kept *)get_memory(&self->call, sizeof *kept);
    if (!kept) return refuse(self, fmi2Error, "there is no memory for a state");
    memcpy(kept->guid, guid, sizeof guid);
    kept->model = self->model;
    kept->phase = self->phase;
    kept->time = self->time;
    memcpy(kept->set, self->set, sizeof kept->set);
    *state = kept;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2SetFMUstate)(fmi2Component c, fmi2FMUstate state);
FMI2_STATUS FMI2(fmi2SetFMUstate)(fmi2Component c, fmi2FMUstate state)
{
    Instance *self = (Instance *)c;
    const Kept *kept = (const Kept *)state;
    if (!kept) return refuse(self, fmi2Error, "there is no state");
    self->model = kept->model;
    self->phase = kept->phase;
    self->time = kept->time;
    memcpy(self->set, kept->set, sizeof self->set);
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state);
FMI2_STATUS FMI2(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    if (state && *state) {
        free_memory(&((Instance *)c)->call, *state);
        *state = 0;
    }
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size);
FMI2_STATUS FMI2(fmi2SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c;
    (void)state;
    *size = sizeof(Kept);
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size);
FMI2_STATUS FMI2(fmi2SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (!state || size < sizeof(Kept)) return refuse((Instance *)c, fmi2Error, "no state, or too few bytes for it");
    memcpy(bytes, state, sizeof(Kept));
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state);
FMI2_STATUS FMI2(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    Instance *self = (Instance *)c;
    if (size != sizeof(Kept) || memcmp(bytes, guid, sizeof guid))
        return refuse(self, fmi2Error, "these bytes are no state of this FMU");
    if (!*state) *state = get_memory(&self->call, sizeof(Kept));
    if (!*state) return refuse(self, fmi2Error, "there is no memory for a state");
    memcpy(*state, bytes, sizeof(Kept));
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
    const fmi2ValueReference known[], size_t m, const fmi2Real seed[], fmi2Real value[]);
FMI2_STATUS FMI2(fmi2GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
    const fmi2ValueReference known[], size_t m, const fmi2Real seed[], fmi2Real value[])
{
    (void)unknown;
    (void)n;
    (void)known;
    (void)m;
    (void)seed;
    (void)value;
    return refuse((Instance *)c, fmi2Error, "there are no directional derivatives");
}

FMI2_STATUS FMI2(fmi2SetRealInputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], const fmi2Real value[]);
FMI2_STATUS FMI2(fmi2SetRealInputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr;
    (void)order;
    (void)value;
    return n ? refuse((Instance *)c, fmi2Error, "inputs are held over a step") : fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetRealOutputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], fmi2Real value[]);
FMI2_STATUS FMI2(fmi2GetRealOutputDerivatives)(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], fmi2Real value[])
{
    (void)vr;
    (void)order;
    (void)value;
    return n ? refuse((Instance *)c, fmi2Error, "outputs have no derivatives") : fmi2OK;
}

FMI2_STATUS FMI2(fmi2DoStep)(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean keep);
FMI2_STATUS FMI2(fmi2DoStep)(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean keep)
{
    Instance *self = (Instance *)c;
    const char *message;
    (void)keep;
    if (self->phase != STEPPING) return refuse(self, fmi2Error, "the initialisation is not over, or the simulation has ended");
    if (!isfinite(time) || !isfinite(step) || step < 0)
        return refuse(self, fmi2Discard, "time %g and step %g must be finite, the step not below 0", time, step);
    if (step == 0) return fmi2OK;
    message = Model_step(&self->model, time, step);
    if (message) return refuse(self, fmi2Discard, "at %g s: %s", time, message);
    self->time = time + step;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2CancelStep)(fmi2Component c);
FMI2_STATUS FMI2(fmi2CancelStep)(fmi2Component c)
{
    return refuse((Instance *)c, fmi2Error, "a step is over before it could be cancelled");
}

FMI2_STATUS FMI2(fmi2GetStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value);
FMI2_STATUS FMI2(fmi2GetStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)value;
    return refuse((Instance *)c, fmi2Discard, "status %d is not kept", (int)kind);
}

FMI2_STATUS FMI2(fmi2GetRealStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value);
FMI2_STATUS FMI2(fmi2GetRealStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime) return refuse((Instance *)c, fmi2Discard, "status %d is not kept", (int)kind);
    *value = ((Instance *)c)->time;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetIntegerStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value);
FMI2_STATUS FMI2(fmi2GetIntegerStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)value;
    return refuse((Instance *)c, fmi2Discard, "status %d is not kept", (int)kind);
}

FMI2_STATUS FMI2(fmi2GetBooleanStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value);
FMI2_STATUS FMI2(fmi2GetBooleanStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (kind != fmi2Terminated) return refuse((Instance *)c, fmi2Discard, "status %d is not kept", (int)kind);
    *value = 0;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetStringStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2String *value);
FMI2_STATUS FMI2(fmi2GetStringStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)value;
    return refuse((Instance *)c, fmi2Discard, "status %d is not kept", (int)kind);
}
"""
