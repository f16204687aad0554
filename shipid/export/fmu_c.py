"""The C of an FMU: the functions of FMI 2.0 around the step of a vessel, or the path of a predictor.

The standard: Functional Mock-up Interface 2.0.4, fmi-standard.org. Its declarations are written out in `FMI_HEAD`. In
all texts @ stands for the name that begins every public name, and $KEY for a value.
"""

FMI_HEAD = """
#define NUM_REALS $NUM_REALS
#define FIRST_PARAMETER $FIRST_PARAMETER
#include <stdarg.h>
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
#define FUNCTION(name, arguments) FMI2_EXPORT fmi2Status FMI2(name) arguments
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard says which there are */
#endif

#ifdef __cplusplus
extern "C" { /* names as in C */
#endif

static const char guid[] = "$GUID";
static const char identifier[] = "@";
static const double start_values[NUM_REALS] = {$STARTS};
static const char kinds[] = {$KINDS}; /* input, output, exact at the start, parameter, parameter above 0 */
"""

VESSEL_MODEL = """
typedef struct {
    double values[NUM_REALS];
    int status;
} Model;

static void Model_init(Model *self)
{
    memset(self, 0, sizeof *self);
    memcpy(self->values, start_values, sizeof start_values);
}

/* Actuators are at their orders, unless the importer has set them. */
static const char *Model_begin(Model *self, const unsigned char *set, double t)
{
    double carry[@_NUM_CARRY];
    int i;
    memcpy(carry, self->values, sizeof carry);
    @_begin(carry, self->values + $COMMANDS, self->values + FIRST_PARAMETER);
    for (i = $NUM_STATES; i < @_NUM_CARRY; ++i) if (!set[i]) self->values[i] = carry[i];
    return 0;
}

static const char *Model_step(Model *self, double t, double h)
{
    const double count = fmax(ceil(h / self->values[NUM_REALS - 1] - 1e-9), 1);
    double before[@_NUM_CARRY];
    long k;
    if (!(self->values[NUM_REALS - 1] > 0) || count > $MOST_STEPS)
        return "solver.step must be above 0, and a step needs at most $MOST_STEPS of it";
    memcpy(before, self->values, sizeof before);
    for (k = 0; k < (long)count; ++k) {
        self->status = @_step(self->values, self->values + $COMMANDS, self->values + $ENVIRONMENT,
            self->values + $LOADS, self->values + FIRST_PARAMETER, h / count);
        if (self->status) {
            memcpy(self->values, before, sizeof before);
            return self->status == @_DIVERGED
                ? "the motion diverges: take a smaller solver.step, or look at inputs and parameters"
                : "an input is not finite";
        }
    }
    return 0;
}

#define OUTSIDE 0
#define NAME_OF(reference) @_parameters_names[(reference) - FIRST_PARAMETER]
"""

PREDICTOR_MODEL = """
typedef struct {
    double values[NUM_REALS];
    int status;
    @_recorder kept, trial; /* the second for the path at the start: too large for the stack of a thread */
} Model;

static void Model_init(Model *self)
{
    int i;
    memset(self, 0, sizeof *self);
    memcpy(self->values, start_values, sizeof start_values);
    for (i = 0; i < NUM_REALS; ++i) if (kinds[i] == 'o') self->values[i] = NAN; /* NAN is no constant for some compilers */
    self->status = @_NO_PAST;
    @_init(&self->kept);
}

/* Record the row of the inputs, which are the first variables, and predict from it. */
static const char *path_at(Model *self, @_recorder *kept, double t)
{
    double path[2 * @_HORIZON], band[4 * @_HORIZON];
    int i, k;
    k = @_record(kept, t, self->values); /* refused: status and alarm stay those of the path that is there */
    if (k) return k == @_TIME ? "time does not go on" : "an input is not finite";
    self->status = @_predict(kept, $PLAN, $CHOICE, path, band);
    for (k = 0; k < @_HORIZON; ++k) {
        for (i = 0; i < 2; ++i) self->values[$X + i * @_HORIZON + k] = path[2 * k + i];
        for (i = 0; i < $BAND; ++i) self->values[$X + (2 + i) * @_HORIZON + k] = band[4 * k + i];
    }
    self->values[FIRST_PARAMETER - 1] = t;
    return 0;
}

/* The path at the start: from a copy, since the first step keeps this row. */
static const char *Model_begin(Model *self, const unsigned char *set, double t)
{
    self->trial = self->kept;
    return path_at(self, &self->trial, t);
}

static const char *Model_step(Model *self, double t, double h)
{
    return path_at(self, &self->kept, t);
}

#define OUTSIDE @_OUTSIDE
#define NAME_OF(reference) ""
"""

FMI_BODY = """
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

#define SELF Instance *self = (Instance *)c; if (!self) return fmi2Error;
#define ABSENT(name, arguments, asked) FUNCTION(name, arguments) \\
    { return asked ? refuse((Instance *)c, fmi2Error, "this FMU has no " #name) : fmi2OK; }

FMI2_EXPORT const char *FMI2(fmi2GetTypesPlatform)(void) { return "default"; }
FMI2_EXPORT const char *FMI2(fmi2GetVersion)(void) { return "2.0"; }

FUNCTION(fmi2SetDebugLogging, (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]))
{
    return c ? fmi2OK : fmi2Error;
}

FMI2_EXPORT fmi2Component FMI2(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String given, fmi2String place,
    const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *self;
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

FMI2_EXPORT void FMI2(fmi2FreeInstance)(fmi2Component c)
{
    Instance *self = (Instance *)c;
    fmi2CallbackFunctions call;
    if (!self) return;
    call = self->call;
    free_memory(&call, self->name);
    free_memory(&call, self);
}

FUNCTION(fmi2SetupExperiment, (fmi2Component c, fmi2Boolean known, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean stops, fmi2Real stop))
{
    SELF
    if (self->phase != INSTANTIATED) return refuse(self, fmi2Error, "the start time is set before the initialisation");
    if (!isfinite(start)) return refuse(self, fmi2Error, "the start time is not finite");
    if (stops && !(stop >= start))
        return refuse(self, fmi2Error, "the stop time %g must not be before the start time %g", stop, start);
    self->time = start;
    self->stop = stops ? stop : INFINITY;
    return fmi2OK;
}

FUNCTION(fmi2EnterInitializationMode, (fmi2Component c))
{
    SELF
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

FUNCTION(fmi2ExitInitializationMode, (fmi2Component c))
{
    SELF
    fmi2Status status;
    if (self->phase != INITIALIZING) return refuse(self, fmi2Error, "there is no initialisation to end");
    status = follow(self);
    self->phase = STEPPING;
    return status;
}

FUNCTION(fmi2Terminate, (fmi2Component c))
{
    SELF
    if (self->phase != STEPPING) return refuse(self, fmi2Error, "Terminate before a step: nothing runs that could end");
    self->phase = TERMINATED;
    return fmi2OK;
}

FUNCTION(fmi2Reset, (fmi2Component c))
{
    SELF
    Model_init(&self->model);
    memset(self->set, 0, sizeof self->set);
    self->phase = INSTANTIATED;
    self->time = 0;
    self->refused = 0;
    self->stop = INFINITY;
    return fmi2OK;
}

FUNCTION(fmi2GetReal, (fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]))
{
    SELF
    size_t i;
    for (i = 0; i < n; ++i)
        if (vr[i] >= NUM_REALS) return refuse(self, fmi2Error, "there is no real variable %u", vr[i]);
    if (follow(self) != fmi2OK) return fmi2Error;
    for (i = 0; i < n; ++i) value[i] = self->model.values[vr[i]];
    return fmi2OK;
}

FUNCTION(fmi2SetReal, (fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]))
{
    SELF
    size_t i;
    if (self->phase == TERMINATED) return refuse(self, fmi2Error, "the simulation has ended: reset before a value is set");
    for (i = 0; i < n; ++i) {
        if (vr[i] >= NUM_REALS) return refuse(self, fmi2Error, "there is no real variable %u", vr[i]);
        if (kinds[vr[i]] == 'o' || (kinds[vr[i]] == 'e' && self->phase == STEPPING))
            return refuse(self, fmi2Error, "variable %u is an output and cannot be set now", vr[i]);
        if (!isfinite(value[i]))
            return refuse(self, fmi2Discard, "variable %u: %g is not a finite number", vr[i], value[i]);
        if (kinds[vr[i]] == 'a' && !(value[i] > 0))
            return refuse(self, fmi2Discard, "%s: %g must be above 0", NAME_OF(vr[i]), value[i]);
    }
    for (i = 0; i < n; ++i) {
        self->model.values[vr[i]] = value[i];
        self->set[vr[i]] = 1;
    }
    return fmi2OK;
}

FUNCTION(fmi2GetInteger, (fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]))
{
    SELF
    size_t i;
    if (follow(self) != fmi2OK) return fmi2Error;
    for (i = 0; i < n; ++i) {
        if (vr[i]) return refuse(self, fmi2Error, "there is no integer variable %u", vr[i]);
        value[i] = self->model.status;
    }
    return fmi2OK;
}

FUNCTION(fmi2GetBoolean, (fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]))
{
    SELF
    size_t i;
    if (follow(self) != fmi2OK) return fmi2Error;
    for (i = 0; i < n; ++i) {
        if (OUTSIDE == 0 || vr[i]) return refuse(self, fmi2Error, "there is no boolean variable %u", vr[i]);
        value[i] = (self->model.status & OUTSIDE) != 0;
    }
    return fmi2OK;
}

ABSENT(fmi2GetString, (fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]), n)
ABSENT(fmi2SetInteger, (fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]), n)
ABSENT(fmi2SetBoolean, (fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]), n)
ABSENT(fmi2SetString, (fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]), n)
ABSENT(fmi2GetDirectionalDerivative, (fmi2Component c, const fmi2ValueReference unknown[], size_t n,
    const fmi2ValueReference known[], size_t m, const fmi2Real seed[], fmi2Real value[]), n)
ABSENT(fmi2SetRealInputDerivatives, (fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], const fmi2Real value[]), n)
ABSENT(fmi2GetRealOutputDerivatives, (fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], fmi2Real value[]), n)
ABSENT(fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate state, size_t *size), 1)
ABSENT(fmi2SerializeFMUstate, (fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size), 1)
ABSENT(fmi2DeSerializeFMUstate, (fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state), 1)
ABSENT(fmi2CancelStep, (fmi2Component c), 1)
ABSENT(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value), 1)
ABSENT(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value), 1)
ABSENT(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value), 1)

/* A state is a copy of the instance. */
FUNCTION(fmi2GetFMUstate, (fmi2Component c, fmi2FMUstate *state))
{
    SELF
    if (!*state) *state = get_memory(&self->call, sizeof *self);
    if (!*state) return refuse(self, fmi2Error, "there is no memory for a state");
    memcpy(*state, self, sizeof *self);
    return fmi2OK;
}

FUNCTION(fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate state))
{
    SELF
    char *name = self->name;
    if (!state) return refuse(self, fmi2Error, "this is no state");
    memcpy(self, state, sizeof *self);
    self->name = name;
    self->refused = 0;
    return fmi2OK;
}

FUNCTION(fmi2FreeFMUstate, (fmi2Component c, fmi2FMUstate *state))
{
    SELF
    if (state && *state) free_memory(&self->call, *state);
    if (state) *state = 0;
    return fmi2OK;
}

FUNCTION(fmi2DoStep, (fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean keep))
{
    SELF
    const char *message;
    if (self->phase != STEPPING) return refuse(self, fmi2Error, "the initialisation is not over, or the simulation has ended");
    if (!isfinite(time) || !isfinite(step) || step < 0)
        return refuse(self, fmi2Discard, "time %g and step %g must be finite, the step not below 0", time, step);
    if (time + step > self->stop + 1e-9 * fmax(fabs(self->stop), step))
        return refuse(self, fmi2Error, "a step from %g to %g s goes beyond the stop time %g s", time, time + step, self->stop);
    if (step == 0) return fmi2OK;
    message = Model_step(&self->model, time, step);
    self->refused = message != 0;
    if (message) return refuse(self, fmi2Discard, "at %g s: %s", time, message);
    self->time = time + step;
    return fmi2OK;
}

FUNCTION(fmi2GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value))
{
    SELF
    if (kind != fmi2LastSuccessfulTime) return refuse(self, fmi2Discard, "status %d is not kept", (int)kind);
    *value = self->time;
    return fmi2OK;
}

FUNCTION(fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value))
{
    SELF
    if (kind != fmi2Terminated) return refuse(self, fmi2Discard, "status %d is not kept", (int)kind);
    *value = self->refused;
    return fmi2OK;
}

#ifdef __cplusplus
}
#endif
"""
