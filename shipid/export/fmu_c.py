"""The C of an FMU: the functions of FMI 2.0 around the step of a vessel, or the path of a predictor.

The standard: Functional Mock-up Interface 2.0.4, fmi-standard.org. Its declarations are written out in `_FMI_HEAD`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shipid.export.band import BAND_CHOICE, BAND_ROWS
from shipid.export.c import NumberPrecision

MOST_SOLVER_STEPS = 1_000_000  # of the solver in a communication step: some seconds


@dataclass(frozen=True)
class Variable:
    """A real variable of an FMU.

    start : None where it is calculated. guess : whether it is calculated, too, unless the importer sets a start value.
    above_zero : whether it is a parameter that must be above 0.
    """

    name: str
    causality: str
    variability: str
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


def vessel_wrapper(name: str, sizes: Mapping[str, int], num_states: int, variables: Sequence[Variable]) -> str:
    """Return the C of a vessel; `sizes` are the lengths of the arrays of its step, by their names."""
    at, place = {}, 0
    for group in ("carry", "commands", "environment", "loads", "parameters"):
        at[group] = place
        place += sizes[group]
    total = place + 1
    given = ", ".join(f"self->values + {first}" for first in at.values())
    begin = f"""    double carry[{sizes["carry"]}];
    int i;
    memcpy(carry, self->values, sizeof carry);
    begin_within(carry, self->values + {at["commands"]}, self->values + {at["parameters"]});
    for (i = {num_states}; i < {sizes["carry"]}; ++i) if (!set[i]) self->values[i] = carry[i]; /* actuators: at their orders */
    (void)t;
"""
    begin = begin if sizes["carry"] > num_states else "    (void)self;\n    (void)set;\n    (void)t;\n"
    return f"""
#define NUM_REALS {total}
#define NUM_BOOLEANS 0
#define FIRST_PARAMETER {at["parameters"]}
#define PARAMETER_NAMES {name}_parameters_names
{_FMI_HEAD}
typedef struct {{
    double values[NUM_REALS];
    int status;
}} Model;
{_variable_tables(name, variables)}
static void Model_init(Model *self)
{{
    memset(self, 0, sizeof *self);
    memcpy(self->values, start_values, sizeof start_values);
}}

static const char *Model_begin(Model *self, const unsigned char *set, double t)
{{
{begin}    return 0;
}}

/* What is wrong with the settings of the solver for a step h: no smaller one mends it. */
static const char *Model_unfit(const Model *self, double h)
{{
    const double largest = self->values[{total - 1}];
    if (!(largest > 0)) return "solver.step must be above 0";
    if (!(h / largest <= {MOST_SOLVER_STEPS})) return "the communication step needs more than {MOST_SOLVER_STEPS} steps of solver.step";
    return 0;
}}

static const char *Model_step(Model *self, double t, double h)
{{
    const double count = ceil(h / self->values[{total - 1}] - 1e-9);
    double before[{max(1, sizes["carry"])}];
    long k, steps;
    (void)t;
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


def predictor_wrapper(name: str, horizon: int, num_parameters: int, variables: Sequence[Variable]) -> str:
    """Return the C of a predictor of `horizon` steps; the row that it records is the first of the variables."""
    return f"""
#define NUM_REALS {len(variables)}
#define NUM_BOOLEANS 1
#define FIRST_PARAMETER {next((i for i, one in enumerate(variables) if one.causality == "parameter"), 0)}
#define PARAMETER_NAMES {name}_parameters_names
{_FMI_HEAD}
typedef struct {{
    double values[NUM_REALS];
    int status;
    {name} kept, trial; /* the second for the path at the start: too large for the stack of a thread */
}} Model;
{_variable_tables(name, variables)}
static void Model_init(Model *self)
{{
    int i;
    memset(self, 0, sizeof *self);
    memcpy(self->values, start_values, sizeof start_values);
    for (i = 0; i < NUM_REALS; ++i) if (kinds[i] == 'o') self->values[i] = NAN; /* NAN is no constant for some compilers */
    self->status = {name}_NO_PAST;
    {name}_init(&self->kept);
}}

{_path_source(name, horizon, num_parameters, {variable.name: place for place, variable in enumerate(variables)})}
/* The path at the start: from a copy, since the first step keeps this row. */
static const char *Model_begin(Model *self, const unsigned char *set, double t)
{{
    (void)set;
    self->trial = self->kept;
    return path_at(self, &self->trial, t);
}}

static const char *Model_unfit(const Model *self, double h)
{{
    (void)self;
    (void)h;
    return 0;
}}

static const char *Model_step(Model *self, double t, double h)
{{
    (void)h;
    return path_at(self, &self->kept, t);
}}

static int Model_boolean(const Model *self, unsigned reference)
{{
    (void)reference;
    return (self->status & {name}_OUTSIDE) != 0;
}}
{_FMI_BODY}"""


def _path_source(name: str, horizon: int, num_parameters: int, at: Mapping[str, int]) -> str:
    """C that records the row of the variables and predicts from it; `at`: place of each variable by name."""
    first_planned = next((place for key, place in at.items() if key.startswith("planned[")), 0)
    plan = f"self->values[{at['held']}] != 0 ? 0 : self->values + {first_planned}" if "held" in at else "0"
    choice, shown = "0", ""
    if BAND_CHOICE[0] in at:
        choice = f"self->values + {at[BAND_CHOICE[0]]}"
        shown = "\n".join(
            f"        self->values[{at[f'{key}[1]']} + k] = band[{len(BAND_ROWS)} * k + {place}];"
            for place, key in enumerate(BAND_ROWS)
        )
    return f"""static const char *path_at(Model *self, {name} *kept, double t)
{{
    double path[2 * {horizon}], band[{len(BAND_ROWS)} * {horizon}];
    int k;
    memcpy(kept->parameters, self->values + {at["instant"] + 1}, {num_parameters} * sizeof(double));
    k = {name}_record(kept, t, self->values); /* refused: status and alarm stay those of the path that is there */
    if (k) return k == {name}_TIME ? "time does not go on" : "an input is not finite";
    self->status = predict_from(kept, {plan}, {choice}, path, band);
    for (k = 0; k < {horizon}; ++k) {{
        self->values[{at["x[1]"]} + k] = path[2 * k];
        self->values[{at["y[1]"]} + k] = path[2 * k + 1];
{shown}
    }}
    self->values[{at["instant"]}] = t;
    return 0;
}}
"""


def _kind_of_variable(variable: Variable) -> str:
    exact = variable.causality == "output" and variable.start is not None
    return f"'{'e' if exact else 'a' if variable.above_zero else variable.causality[0]}'"


def _variable_tables(name: str, variables: Sequence[Variable]) -> str:
    """Start values and kinds of the variables."""
    values = NumberPrecision().table(np.array([0.0 if v.start is None else v.start for v in variables]))
    return f"""
static const char guid[] = "@GUID@";
static const char identifier[] = "{name}";
static const double start_values[NUM_REALS] = {{{values}}};
static const char kinds[] = {{{", ".join(_kind_of_variable(v) for v in variables)}}}; /* input, output, exact at the start, parameter, parameter above 0 */
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

#ifdef __cplusplus
extern "C" { /* names as in C */
#endif
"""


_FMI_BODY = """
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Phase;
typedef struct {
    Model model;
    Phase phase;
    double time, stop; /* the stop is that of the experiment, infinite where it has none */
    unsigned char set[NUM_REALS]; /* by the importer */
    int refused; /* whether the last step was: as it is, the motion does not go on */
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
    (void)on; /* what is refused is always said */
    (void)n;
    (void)categories;
    return c ? fmi2OK : fmi2Error;
}

FMI2_EXPORT fmi2Component FMI2(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String given, fmi2String place,
    const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging);
FMI2_EXPORT fmi2Component FMI2(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String given, fmi2String place,
    const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *self;
    (void)place;
    (void)visible;
    (void)logging;
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
    self->name = (char *)get_memory(call, strlen(name) + 1);
    if (!self->name) {
        free_memory(call, self);
        return 0;
    }
    strcpy(self->name, name);
    Model_init(&self->model);
    self->stop = INFINITY;
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
    if (!self) return fmi2Error;
    if (self->phase != INSTANTIATED) return refuse(self, fmi2Error, "the start time is set before the initialisation");
    if (!isfinite(start)) return refuse(self, fmi2Error, "the start time is not finite");
    if (stops && !(stop >= start))
        return refuse(self, fmi2Error, "the stop time %g must not be before the start time %g", stop, start);
    self->time = start;
    self->stop = stops ? stop : INFINITY;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2EnterInitializationMode)(fmi2Component c);
FMI2_STATUS FMI2(fmi2EnterInitializationMode)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    if (!self) return fmi2Error;
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
    if (!self) return fmi2Error;
    if (self->phase != INITIALIZING) return refuse(self, fmi2Error, "there is no initialisation to end");
    status = follow(self);
    self->phase = STEPPING;
    return status;
}

FMI2_STATUS FMI2(fmi2Terminate)(fmi2Component c);
FMI2_STATUS FMI2(fmi2Terminate)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    if (!self) return fmi2Error;
    if (self->phase != STEPPING) return refuse(self, fmi2Error, "Terminate before a step: nothing runs that could end");
    self->phase = TERMINATED;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2Reset)(fmi2Component c);
FMI2_STATUS FMI2(fmi2Reset)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    if (!self) return fmi2Error;
    Model_init(&self->model);
    memset(self->set, 0, sizeof self->set);
    self->phase = INSTANTIATED;
    self->time = 0;
    self->refused = 0;
    self->stop = INFINITY;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]);
FMI2_STATUS FMI2(fmi2GetReal)(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    Instance *self = (Instance *)c;
    size_t i;
    if (!self) return fmi2Error;
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
    if (!self) return fmi2Error;
    if (self->phase == TERMINATED) return refuse(self, fmi2Error, "the simulation has ended: reset before a value is set");
    for (i = 0; i < n; ++i) {
        if (vr[i] >= NUM_REALS) return refuse(self, fmi2Error, "there is no real variable %u", vr[i]);
        if (kinds[vr[i]] == 'o' || (kinds[vr[i]] == 'e' && self->phase == STEPPING))
            return refuse(self, fmi2Error, "variable %u is an output and cannot be set now", vr[i]);
        if (!isfinite(value[i]))
            return refuse(self, fmi2Discard, "variable %u: %g is not a finite number", vr[i], value[i]);
        if (kinds[vr[i]] == 'a' && !(value[i] > 0))
            return refuse(self, fmi2Discard, "%s: %g must be above 0", PARAMETER_NAMES[vr[i] - FIRST_PARAMETER], value[i]);
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
    if (!self) return fmi2Error;
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
    if (!self) return fmi2Error;
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
    char unit[sizeof guid];
    Model model;
    Phase phase;
    double time;
    unsigned char set[NUM_REALS];
    unsigned long sum; /* of all bytes before it, where they are serialised */
} Kept;

static int is_ours(const Kept *kept)
{
    return kept && !memcmp(kept->unit, guid, sizeof guid);
}

/* A number of the bytes of a state, which is another one where they are damaged (FNV-1a of 32 bits). */
static unsigned long sum_of(const fmi2Byte bytes[])
{
    unsigned long sum = 2166136261UL;
    size_t i;
    for (i = 0; i < offsetof(Kept, sum); ++i) sum = ((sum ^ (unsigned char)bytes[i]) * 16777619UL) & 0xffffffffUL;
    return sum;
}

FMI2_STATUS FMI2(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state);
FMI2_STATUS FMI2(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    Instance *self = (Instance *)c;
    Kept *kept = (Kept *)*state;
    if (!self) return fmi2Error;
    if (!kept) kept = (Kept *)get_memory(&self->call, sizeof *kept);
    if (!kept) return refuse(self, fmi2Error, "there is no memory for a state");
    memcpy(kept->unit, guid, sizeof guid);
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
    if (!self) return fmi2Error;
    if (!is_ours(kept)) return refuse(self, fmi2Error, "this is no state of this FMU");
    self->model = kept->model;
    self->phase = kept->phase;
    self->time = kept->time;
    self->refused = 0;
    memcpy(self->set, kept->set, sizeof self->set);
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state);
FMI2_STATUS FMI2(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    if (!c) return fmi2Error;
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
    unsigned long sum;
    if (!c) return fmi2Error;
    if (!is_ours((const Kept *)state)) return refuse((Instance *)c, fmi2Error, "this is no state of this FMU");
    if (size < sizeof(Kept)) return refuse((Instance *)c, fmi2Error, "too few bytes for a state");
    memcpy(bytes, state, sizeof(Kept));
    sum = sum_of(bytes);
    memcpy(bytes + offsetof(Kept, sum), &sum, sizeof sum);
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state);
FMI2_STATUS FMI2(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    Instance *self = (Instance *)c;
    unsigned long sum;
    if (!self) return fmi2Error;
    if (size != sizeof(Kept) || memcmp(bytes, guid, sizeof guid))
        return refuse(self, fmi2Error, "these bytes are no state of this FMU");
    memcpy(&sum, bytes + offsetof(Kept, sum), sizeof sum);
    if (sum != sum_of(bytes)) return refuse(self, fmi2Error, "the bytes of this state are damaged");
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
    if (!self) return fmi2Error;
    if (self->phase != STEPPING) return refuse(self, fmi2Error, "the initialisation is not over, or the simulation has ended");
    if (!isfinite(time) || !isfinite(step) || step < 0)
        return refuse(self, fmi2Discard, "time %g and step %g must be finite, the step not below 0", time, step);
    if (time + step > self->stop + 1e-9 * fmax(fabs(self->stop), step))
        return refuse(self, fmi2Error, "a step from %g to %g s goes beyond the stop time %g s", time, time + step, self->stop);
    if (step == 0) return fmi2OK;
    message = Model_unfit(&self->model, step);
    if (message) return refuse(self, fmi2Error, "at %g s: %s", time, message);
    message = Model_step(&self->model, time, step);
    self->refused = message != 0;
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
    if (!c) return fmi2Error;
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
    if (!c) return fmi2Error;
    if (kind != fmi2Terminated) return refuse((Instance *)c, fmi2Discard, "status %d is not kept", (int)kind);
    *value = ((Instance *)c)->refused;
    return fmi2OK;
}

FMI2_STATUS FMI2(fmi2GetStringStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2String *value);
FMI2_STATUS FMI2(fmi2GetStringStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)value;
    return refuse((Instance *)c, fmi2Discard, "status %d is not kept", (int)kind);
}

#ifdef __cplusplus
}
#endif
"""
