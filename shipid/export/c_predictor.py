"""C99 of a predictor: CasADi's C of its functions behind a header with names, units and limits, and a recorder of rows."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from shipid.data.dataset import PAUSE_STEPS, SHORTEST_STEP_GROWTH
from shipid.export.band import BAND_ROWS, factor_function
from shipid.export.c import (
    ARE_FINITE,
    SINGLE_PRECISION_NOTE,
    SOURCE_HEAD,
    GeneratedC,
    NumberPrecision,
    SourceFiles,
    array_of,
    c_comment,
    c_strings,
    fill_template,
    generate_c,
    places_above_zero,
    provenance_lines,
    tables_of,
)
from shipid.export.known import POSITION_ENTRIES
from shipid.export.model import ExportModel
from shipid.export.recorder import KEPT_ENTRIES, filters_of, recorder_functions
from shipid.observer import MOST_FILTER_STEPS, STEP_SLACK, FilterBank, filter_state_sizes
from shipid.version import __version__

PARTS_OF_STEP = 8  # of three rows within such a part of a step a recorder keeps the first and the last
STEPS_OF_GAP = 3.0  # steps: after a longer pause, see `after_pauses`, the past of a recorder begins anew


def predictor_files(model: ExportModel, name: str, precision: NumberPrecision) -> SourceFiles:
    """A predictor: physics, method, memory, observer, alarm and band as C."""
    functions = {"predict": model.function, **recorder_functions(model)}
    if model.predictor.bands is not None:
        functions["factor"] = factor_function(model.predictor.bands)
    made = generate_c(functions, name, precision)
    values = _template_values(model, name, precision, functions, made)
    source = "".join(
        [SOURCE_HEAD, _DEFINITIONS, ARE_FINITE, _PATH_SOURCE, _RECORD_SOURCE, _PREDICT_SOURCE, _BAND_SOURCE]
    )
    texts = {
        f"{name}.h": f"{c_comment(_header_comment(model, precision))}\n{fill_template(_PREDICTOR_HEADER, name, values)}",
        f"{name}.c": c_comment([f"Predictor, written by shipid {__version__}; see {name}.h."])
        + fill_template(source, name, values),
        f"{name}_casadi.c": made.text,
        "main.c": fill_template(_EXAMPLE, name, values),
    }
    return SourceFiles(name, texts)


def header_sizes(model: ExportModel) -> dict[str, int]:
    """Constants of the header."""
    names, bands = model.layout, model.predictor.bands
    return {
        "HORIZON": names.horizon,
        "NUM_ROW": len(names.now),
        "NUM_NOW": len(names.now),
        "NUM_REACHED": len(names.reached),
        "PAST": names.num_past,
        "NUM_PAST": len(names.past),
        "NUM_PLANNED": len(names.planned),
        "NUM_ESTIMATES": len(names.estimates),
        "NUM_PARAMETERS": len(names.parameters),
        **({} if bands is None else {"BAND": len(BAND_ROWS), "NUM_KINDS": len(bands.kinds)}),
    }


def _template_values(
    model: ExportModel, name: str, precision: NumberPrecision, functions: Mapping[str, ca.Function], made: GeneratedC
) -> dict[str, str]:
    """What the texts of C are filled with."""
    names, filters, step = model.layout, filters_of(model), model.physics.step
    groups = {"row": names.now, "now": names.now, "reached": names.reached, "past": names.past}
    groups |= {"planned": names.planned, "estimates": names.estimates, "parameters": names.parameters}
    units = {group: {key: model.unit(key) for key in keys} for group, keys in groups.items()}
    limits = np.array([model.limits.get(key, (-np.inf, np.inf)) for key in names.now])
    declared, defined = tables_of(name, units, {"defaults": model.parameters, "limits": limits}, precision)
    bands, above, states = (
        model.predictor.bands,
        places_above_zero(names.parameters, model.vessel),
        _num_filter_states(filters),
    )
    if bands is not None:
        kinds = array_of("char *const", f"{name}_kind_names", ("any", *bands.kinds), c_strings(["any", *bands.kinds]))
        declared, defined = f"{declared}\nextern {kinds.partition(' = ')[0]};", f"{defined}\n{kinds}"
    past, plan = names.sizes["past"], names.sizes["planned"]
    has = {
        "OBSERVER": filters is not None, "PAST": past > 0, "PLAN": plan > 0, "TURNS": "plan" in functions,
        "BAND": bands is not None,
    }  # fmt: skip
    orders = [names.now.index(key) for key in names.planned]
    source = names.planned or names.now
    lengths = {
        "CAPACITY": 2 * PARTS_OF_STEP * names.num_past + 4, "WIDTH": len(names.now) + len(KEPT_ENTRIES), "STATES": max(1, states),
        "WORK": made.num_w, "FACTOR_WORK": functions["factor"].sz_w() + 1 if bands is not None else 1, "BUFFER": max(states, past + 2 * plan) + 1,
    }  # fmt: skip
    settled = model.predictor.run_up - 1e-3 * step
    given = [model.limits.get(key, (0.0, 0.0)) for key in names.now]
    middles = [sum(ends) / 2 if np.isfinite(sum(ends)) else 0.0 for ends in given]
    return {
        "GUARD": f"{name.upper()}_H",
        "REAL": precision.real,
        "SIZES": ",\n    ".join(f"{name}_{key} = {value}" for key, value in header_sizes(model).items()),
        "DECLARED": declared,
        "DEFINED": defined,
        "FUNCTIONS": made.declared,
        "ARRAYS": made.arrays,
        **{key: str(value) for key, value in lengths.items()},
        **{f"HAS_{key}": str(int(value)) for key, value in has.items()},
        "NUM_STEPS": str(names.num_past),
        "RARE": f"{PAUSE_STEPS:g}",
        "FORGOTTEN": repr(SHORTEST_STEP_GROWTH),
        "AFTER_PAUSES": _pause_note(model, filters),
        "OFTEN": f"{step / PARTS_OF_STEP:g}",
        "NEAR": repr(step / PARTS_OF_STEP * (1 - 1e-6)),
        "SLACK": repr(1e-3 * step / PARTS_OF_STEP),
        "STEP": repr(step),
        "GAP": repr(STEPS_OF_GAP * step),
        "PAUSE": repr(STEPS_OF_GAP * step if filters is None else float(filters.pause)),
        "TOO_LONG": "INFINITY" if filters is None else repr(MOST_FILTER_STEPS * float(filters.longest)),
        "LONGEST": "1" if filters is None else repr(float(filters.longest)),
        "ROUNDING": repr(STEP_SLACK),
        "SETTLED": repr(settled) if settled > 0 else "-INFINITY",
        "ABOVE": f"static {array_of('int', 'above_zero', above)}",
        "NUM_ABOVE": str(len(above)),
        "ORDERS": f"static {array_of('int', 'orders', orders)}",
        "ACTUATORS": f"static {array_of('int', 'actuators', [source.index(key) for key in names.reached])}",
        "ORDERED": "planned" if names.planned else "now",
        "OF_BAND": fill_template(_BAND_DECLARATIONS, name, {}) if bands is not None else "",
        "ROW": ", ".join(names.now),
        "MIDDLES": precision.table(np.array(middles)),
        "ROWS": str(names.num_past + 1),
        "SPEED": str(names.now.index("u")),
        "STEP_OF_REAL": precision.number(step),
        "UNUSED": str(0 if takes_positions(model) else len(POSITION_ENTRIES)),
        "UNUSED_NOW": str(0 if model.vessel is not None else len(POSITION_ENTRIES)),
    }


def takes_positions(model: ExportModel) -> bool:
    """Whether north and east of a row have an effect: physics begins there, or the past holds them."""
    physics = model.physics
    return physics.vessel is not None or (model.layout.num_past > 0 and physics.path == "position")


def _num_filter_states(filters: FilterBank | None) -> int:
    return 0 if filters is None else sum(filter_state_sizes(filters.model)) * filters.num_filters


def _header_comment(model: ExportModel, precision: NumberPrecision) -> list[str]:
    """Lines of the first comment of the header."""
    physics, predictor = model.physics, model.predictor
    what = "no physics" if physics.vessel is None else physics.vessel.name
    limits = [f"{key} {low:.6g} to {high:.6g} {model.unit(key)}" for key, (low, high) in model.limits.items()]
    observed = [
        "An observer filters the motion and estimates slow forces and current. It takes the noise of its",
        "settings: std_u, std_v, std_r of a log, which widen it in Python, have no entry here.",
    ]
    causal = f" ({', '.join(predictor.causal)})" if predictor.causal else ""
    return [
        f"Predictor of a trajectory in C99, written by shipid {__version__}: {what}, method {predictor.method}.",
        f"{physics.horizon} steps of {physics.step:g} s ({physics.integrator}); commands are {predictor.commands} over the horizon.",
        *(observed if physics.observer is not None else []),
        "",
        "SI units, radians, revolutions per second; directions of wind and current are towards. Path: x ahead and y to",
        "starboard [m] in body axes frozen at the instant of prediction. What is not measured is 0.",
        *([] if takes_positions(model) else ["Nothing takes north and east: they may be any values, also NAN."]),
        *(SINGLE_PRECISION_NOTE if precision.single else []),
        *_band_note(model),
        *([f"Alarm for the first {predictor.run_up:g} s: the observer settles."] if predictor.run_up else []),
        f"Limits of the alarm: {'; '.join(limits) or 'none: every instant counts as outside'}.",
        "",
        "Not in this file: a screening of inputs, a fusion of sensors, a repair of logs. Fixes that were interpolated",
        f"look ahead; give what is known at the time{causal}.",
        "No memory is allocated; everything that is kept is in the struct, so that many may run side by side.",
        "",
        *provenance_lines(predictor.provenance),
    ]


def _band_note(model: ExportModel) -> list[str]:
    """Lines of the header on the band."""
    bands = model.predictor.bands
    if bands is None:
        return [f"No band: {model.predictor.no_band}."]
    kinds = "".join(f", {kind} ({count})" for kind, count in bands.kinds.items())
    return [
        f"Bands: calibrated on {bands.runs} runs{kinds}. A level p needs p / (1 - p) runs or more: 9 for 0.9. Where the",
        "alarm is raised, nothing is promised.",
    ]


def _pause_note(model: ExportModel, filters: FilterBank | None) -> str:
    """What begins anew after pauses, in words."""
    gap = STEPS_OF_GAP * model.physics.step
    if filters is None:
        return f"After one of more than {gap:g} s the past begins anew."
    words = f"After one of more than {min(gap, filters.pause):.4g} s the past begins anew"
    if filters.pause > gap:
        words += f", of more than {filters.pause:.4g} s observer, actuators and angles, too"
    return f"{words}. After {MOST_FILTER_STEPS * filters.longest:.4g} s all does, pause or not."


_PREDICTOR_HEADER = """#ifndef $GUARD
#define $GUARD

#ifdef __cplusplus
extern "C" {
#endif

typedef $REAL @_real;

enum {
    $SIZES,
    @_WORK = $WORK + $BUFFER /* numbers that a function works with */
};

/* Results: 0, or a sum of these. */
enum {
    @_NOT_FINITE = 1, /* an input is not a finite number: the row is not kept, the path is NAN */
    @_OUTSIDE = 2,    /* the alarm: the instant is outside of what training has seen; the path is given */
    @_DIVERGED = 4,   /* the path is not finite */
    @_NO_PAST = 8,    /* the past is shorter than $NUM_STEPS steps, or there is no row: the path is NAN */
    @_TIME = 16,      /* time does not go on: the row is not kept */
    @_NO_BAND = 32,   /* no band can be promised: too few runs for the level or kind, or no such level: it is NAN */
    @_PARAMETER = 64  /* a parameter that must be above 0 is not, such as inertia.m: the path is NAN */
};

$DECLARED

/* What is kept of the past. Make one, call @_init, and change `parameters` where the ship differs. */
typedef struct {
    @_real parameters[@_NUM_PARAMETERS + 1];
    double t[$CAPACITY], begun, least; /* s; of the first row after a gap; shortest interval of late */
    @_real rows[$CAPACITY][$WIDTH];
    int first, count;
    @_real reached[@_NUM_REACHED + 1], filters[$STATES], estimates[@_NUM_ESTIMATES + 1];
    @_real work[@_WORK]; /* nothing in it is kept from call to call */
} @;

void @_init(@ *self);

/* Keep a row that was measured at t [s], entries as in @_row_names. Rows come in order. A pause is longer than
 * $RARE times the shortest interval of late; the shortest grows by a tenth with each row, so that it is forgotten.
 * $AFTER_PAUSES
 * The heading may wrap, and so may angles of thrusters and rudders: 350 deg is -10 deg. Between
 * stops that are less than a turn apart the angle within them is taken, so a jump is real. A unit that turns all round
 * goes on by the shortest way. The first row is taken by the turn that training had. Rows may come as often as they
 * like: of three within $OFTEN s the past keeps the first and the last. */
int @_record(@ *self, double t, const @_real *row);

/* Path from the newest row: @_HORIZON pairs x, y. planned: @_HORIZON rows of commands in force, each the
 * mean over its step, or a null pointer: commands stay as they are. */
int @_predict(@ *self, const @_real *planned, @_real *path);

/* The same as a pure function, without a recorder. reached: positions of actuators, or a null pointer: at their orders.
 * past: @_PAST rows, the oldest first; x, y in the frame of the instant. planned: as above. estimates: of an
 * observer. parameters: @_defaults, or a changed copy. Arrays without entries may be null pointers. work: @_WORK
 * numbers, whatever they are. */
int @_path(const @_real *now, const @_real *reached, const @_real *past, const @_real *planned, const @_real *estimates,
    const @_real *parameters, @_real *path, @_real *work);
$OF_BAND
#ifdef __cplusplus
}
#endif
#endif
"""

_BAND_DECLARATIONS = """
/* Path and band from the newest row: @_HORIZON rows of half axes along the predicted track and across it [m], and the
 * unit vector x, y of the track in body axes. level: share of whole paths that it holds, above 0 to 0.99;
 * pointwise: 1 for the share of positions at each step alone. kind: of the manoeuvre under way, an entry of
 * @_kind_names; 0 for any. With both pointwise and kind, or too few runs for the level, the result has
 * @_NO_BAND. Where it has @_OUTSIDE nothing is promised. */
int @_predict_band(@ *self, const @_real *planned, double level, int pointwise, int kind, @_real *path, @_real *band);

/* The same as a pure function, see @_path. */
int @_path_band(const @_real *now, const @_real *reached, const @_real *past, const @_real *planned,
    const @_real *estimates, const @_real *parameters, double level, int pointwise, int kind, @_real *path,
    @_real *band, @_real *work);

/* A band that adapts along a run, for those who judge paths when their time has come. miss: begins at 1 - level. missed:
 * whether a path left the band that was given for it. rate: such as 0.02, over how many paths begin within a horizon:
 * else all of them widen the band for one error. Returns miss from then on. */
double @_adapted(double miss, double level, double rate, int missed);

/* How much wider than calibrated such a band is now: times both half axes. NAN for a kind or level that is none, and for a
 * miss that is no number. */
double @_factor(double miss, double level, int kind);
"""

_DEFINITIONS = """
$FUNCTIONS

$DEFINED

"""

_PATH_SOURCE = """
/* Path and, for a level, pointwise and kind in `choice`, its band. */
static int evaluate(const real *now, const real *reached, const real *past, const real *planned, const real *estimates,
    const real *parameters, const real *choice, real *path, real *band, real *work)
{
    $ABOVE
    $ORDERS
    $ACTUATORS
    $ARRAYS
    real begun[@_NUM_REACHED + 1], *held = work + $WORK, outside = 0, promised = 0;
    int i, status;
    (void)held;
    (void)orders;
    for (i = 0; i < 2 * @_HORIZON; ++i) path[i] = NAN;
    for (i = 0; band && i < 4 * @_HORIZON; ++i) band[i] = NAN;
    if (!are_finite(now + $UNUSED_NOW, @_NUM_NOW - $UNUSED_NOW) || !are_finite(past, @_PAST * @_NUM_PAST)
        || !are_finite(estimates, @_NUM_ESTIMATES) || !are_finite(parameters, @_NUM_PARAMETERS)) return @_NOT_FINITE;
    for (i = 0; i < $NUM_ABOVE; ++i) if (!(parameters[above_zero[i]] > 0)) return @_PARAMETER;
#if $HAS_PLAN
    if (!planned) {
        for (i = 0; i < @_HORIZON * @_NUM_PLANNED; ++i) held[i] = now[orders[i % @_NUM_PLANNED]];
        planned = held;
    }
#endif
    if (!are_finite(planned, @_HORIZON * @_NUM_PLANNED)) return @_NOT_FINITE;
    for (i = 0; !reached && i < @_NUM_REACHED; ++i) begun[i] = $ORDERED[actuators[i]];
    if (!reached) reached = begun;
    if (!are_finite(reached, @_NUM_REACHED)) return @_NOT_FINITE;
    arg[0] = now;
    arg[1] = reached;
    arg[2] = past;
    arg[3] = planned;
    arg[4] = estimates;
    arg[5] = parameters;
    for (i = 0; choice && i < 3; ++i) arg[6 + i] = choice + i;
    res[0] = path;
    res[1] = &outside;
    if (choice) res[2] = band;
    if (choice) res[3] = &promised;
    @_casadi_predict(arg, res, iw, work, 0);
    status = outside > 0 ? @_OUTSIDE : 0;
    if (!are_finite(path, 2 * @_HORIZON)) status |= @_DIVERGED;
    if (choice && !(status & @_DIVERGED) && !(promised > 0 && are_finite(band, 4 * @_HORIZON))) status |= @_NO_BAND;
    for (i = 0; choice && (status & ~@_OUTSIDE) && i < 4 * @_HORIZON; ++i) band[i] = NAN;
    return status;
}

int @_path(const @_real *now, const @_real *reached, const @_real *past, const @_real *planned, const @_real *estimates,
    const @_real *parameters, @_real *path, @_real *work)
{
    return evaluate(now, reached, past, planned, estimates, parameters, 0, path, 0, work);
}
"""

_RECORD_SOURCE = """
void @_init(@ *self)
{
    memset(self, 0, sizeof *self);
    memcpy(self->parameters, @_defaults, @_NUM_PARAMETERS * sizeof(real));
}

int @_record(@ *self, double t, const @_real *row)
{
    const int newest = (self->first + self->count + $CAPACITY - 1) % $CAPACITY;
    real kept[$WIDTH], moved[$WIDTH], after[@_NUM_REACHED + 1], *last = self->rows[newest], anew, dt;
    int i, k, alone = 0, at;
    $ARRAYS
    if (!isfinite(t) || !are_finite(row + $UNUSED, @_NUM_ROW - $UNUSED)) return @_NOT_FINITE;
    if (self->count && !(t > self->t[newest])) return @_TIME;
    if (self->count) {
        const double apart = t - self->t[newest];
        if (!(apart <= $RARE * self->least) || apart > $TOO_LONG) {
            alone = apart > $GAP;
            if (apart > $PAUSE) self->count = 0;
        }
        if (self->least > 0) self->least *= $FORGOTTEN;
        if (!(self->least > 0 && self->least < apart)) self->least = apart;
    }
    anew = !self->count;
    dt = self->count ? (real)(t - self->t[newest]) : 0;
    if (!self->count) self->begun = t;
    arg[0] = last;
    arg[1] = row;
    arg[2] = self->reached;
    arg[3] = self->parameters;
    arg[4] = &dt;
    arg[5] = &anew;
    res[0] = kept;
    res[1] = moved;
    res[2] = after;
    @_casadi_keep(arg, res, iw, self->work, 0);
    memcpy(self->reached, after, @_NUM_REACHED * sizeof(real));
    for (i = 0; i < self->count; ++i)
        for (k = 0; k < $WIDTH; ++k) self->rows[(self->first + i) % $CAPACITY][k] += moved[k];
#if $HAS_OBSERVER
    {
        double parts = fmax(ceil((double)dt / $LONGEST - $ROUNDING), 1); /* nothing is measured on the way */
        real part = (real)((double)dt / parts), *states = self->work + $WORK;
        res[0] = states;
        arg[0] = self->filters;
        arg[1] = last;
        arg[2] = kept;
        arg[3] = moved;
        arg[4] = self->parameters;
        arg[5] = &part;
        for (; self->count && parts > 1.5; parts -= 1) {
            @_casadi_between(arg, res, iw, self->work, 0);
            memcpy(self->filters, states, sizeof self->filters);
            arg[3] = 0;
        }
        res[1] = self->estimates; /* a call works with what follows its own places */
        if (self->count) @_casadi_observe(arg, res, iw, self->work, 0);
        arg[0] = kept;
        if (!self->count) @_casadi_begin(arg, res, iw, self->work, 0);
        memcpy(self->filters, states, sizeof self->filters);
    }
#endif
    if (self->count > 1 && t - self->t[(newest + $CAPACITY - 1) % $CAPACITY] < $NEAR)
        --self->count; /* the newest row came so soon that this one replaces it */
    if (alone) self->count = 0;
    if (self->count == $CAPACITY) {
        self->first = (self->first + 1) % $CAPACITY;
        --self->count;
    }
    at = (self->first + self->count++) % $CAPACITY;
    self->t[at] = t;
    memcpy(self->rows[at], kept, sizeof kept);
    return 0;
}
"""

_PREDICT_SOURCE = """
#if $HAS_PAST
/* Rows of the past by interpolation, orders by the last row before; 0 where there are too few rows. */
static int past_rows(@ *self, int newest, real *past)
{
    const double t = self->t[newest];
    int j = 0, k;
    $ARRAYS
    if (t - $NUM_STEPS * $STEP < self->t[self->first] - $SLACK) return 0;
    for (k = 0; k < @_PAST; ++k) {
        double at = t - $STEP * (@_PAST - k), t0, t1;
        real since, share;
        if (at < self->t[self->first]) at = self->t[self->first];
        while (j + 1 < self->count && self->t[(self->first + j + 1) % $CAPACITY] <= at) ++j;
        t0 = self->t[(self->first + j) % $CAPACITY];
        t1 = j + 1 < self->count ? self->t[(self->first + j + 1) % $CAPACITY] : t0 + 1;
        since = (real)(at - t0);
        share = (real)((at - t0) / (t1 - t0));
        arg[0] = self->rows[(self->first + j) % $CAPACITY];
        arg[1] = j + 1 < self->count ? self->rows[(self->first + j + 1) % $CAPACITY] : arg[0];
        arg[2] = t1 <= at + $SLACK ? arg[1] : arg[0]; /* in force: that of a row which is only rounding away */
        arg[3] = self->rows[newest];
        arg[4] = &since;
        arg[5] = &share;
        res[0] = past + k * @_NUM_PAST;
        @_casadi_past(arg, res, iw, self->work, 0);
    }
    return 1;
}
#endif

#if $HAS_TURNS
/* Planned angles by the turn that goes on from the newest row. */
static const real *planned_turns(@ *self, int newest, const real *planned, real *plan)
{
    real first = 1;
    int k;
    $ARRAYS
    for (k = 0; k < @_HORIZON; ++k, first = 0) {
        arg[0] = planned + k * @_NUM_PLANNED;
        arg[1] = k ? plan + (k - 1) * @_NUM_PLANNED : arg[0];
        arg[2] = self->rows[newest];
        arg[3] = self->parameters;
        arg[4] = &first;
        res[0] = plan + k * @_NUM_PLANNED;
        @_casadi_plan(arg, res, iw, self->work, 0);
    }
    return plan;
}
#endif

static int predict_from(@ *self, const real *planned, const real *choice, real *path, real *band)
{
    const int newest = (self->first + self->count + $CAPACITY - 1) % $CAPACITY;
    real *past = self->work + $WORK + 2 * @_HORIZON * @_NUM_PLANNED;
    int i, status = self->count ? 0 : @_NO_PAST;
    (void)past;
#if $HAS_PAST
    if (!status && !past_rows(self, newest, past)) status = @_NO_PAST;
#endif
    for (i = 0; status && i < 2 * @_HORIZON; ++i) path[i] = NAN;
    for (i = 0; status && band && i < 4 * @_HORIZON; ++i) band[i] = NAN;
    if (status) return status;
#if $HAS_TURNS
    if (planned) planned = planned_turns(self, newest, planned, self->work + $WORK + @_HORIZON * @_NUM_PLANNED);
#endif
    status = evaluate(self->rows[newest], self->reached, past, planned, self->estimates, self->parameters, choice, path,
        band, self->work);
    return self->t[newest] - self->begun < $SETTLED ? status | @_OUTSIDE : status; /* no run-up of the observer */
}

int @_predict(@ *self, const @_real *planned, @_real *path)
{
    return predict_from(self, planned, 0, path, 0);
}
"""

_BAND_SOURCE = """
#if $HAS_BAND
static const real *choose(real *choice, double level, int pointwise, int kind)
{
    choice[0] = (real)level;
    choice[1] = (real)(pointwise != 0);
    choice[2] = (real)kind;
    return choice;
}

int @_predict_band(@ *self, const @_real *planned, double level, int pointwise, int kind, @_real *path, @_real *band)
{
    real choice[3];
    return predict_from(self, planned, choose(choice, level, pointwise, kind), path, band);
}

int @_path_band(const @_real *now, const @_real *reached, const @_real *past, const @_real *planned,
    const @_real *estimates, const @_real *parameters, double level, int pointwise, int kind, @_real *path,
    @_real *band, @_real *work)
{
    real choice[3];
    return evaluate(now, reached, past, planned, estimates, parameters, choose(choice, level, pointwise, kind), path,
        band, work);
}

double @_adapted(double miss, double level, double rate, int missed)
{
    return miss + rate * ((1 - level) - (missed != 0));
}

double @_factor(double miss, double level, int kind)
{
    const real given = (real)miss, of = (real)kind, share = (real)level;
    real factor = NAN, w[$FACTOR_WORK];
    $ARRAYS
    arg[0] = &given;
    arg[1] = &share;
    arg[2] = &of;
    res[0] = &factor;
    @_casadi_factor(arg, res, iw, w, 0);
    return (double)factor;
}
#endif
"""

_EXAMPLE = """/* A ship that does the same for a while, and where it goes. cc -std=c99 main.c @.c @_casadi.c -lm */
#include <stdio.h>

#include "@.h"

int main(void)
{
    static @ ship;
    /* $ROW */
    @_real row[@_NUM_ROW] = {$MIDDLES};
    @_real path[2 * @_HORIZON];
    int i, status;
    @_init(&ship);
    for (i = 0; i < $ROWS; ++i) {
        status = @_record(&ship, $STEP * i, row);
        if (status) { printf("row %d is refused: result %d\\n", i, status); return status; } /* a path would be that of the row before */
        row[0] += $STEP_OF_REAL * row[$SPEED]; /* a straight run to the north */
    }
    status = @_predict(&ship, 0, path);
    printf("status %d: %s\\n", status, status & @_OUTSIDE ? "outside of what training has seen" : "inside");
    for (i = 0; i < @_HORIZON; ++i)
        printf("%g s: %.2f m ahead, %.2f m to starboard\\n", $STEP * (i + 1), (double)path[2 * i], (double)path[2 * i + 1]);
    return status & ~@_OUTSIDE;
}
"""
