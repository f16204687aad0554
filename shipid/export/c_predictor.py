"""C99 of a predictor: CasADi's C of its functions behind a header with names, units and limits, and a recorder of rows."""

from __future__ import annotations

import json

import numpy as np

from shipid.data.dataset import PAUSE_STEPS, SHORTEST_STEP_GROWTH
from shipid.export.c import SourceFiles, Wrapper, array_of, source_files
from shipid.export.model import BAND_CHOICE, ExportModel
from shipid.export.recorder import KEPT_ENTRIES, filters_of, recorder_functions
from shipid.observer import MOST_FILTER_STEPS, STEP_SLACK, filter_state_sizes
from shipid.version import __version__

PARTS_OF_STEP = 8  # of three rows within such a part of a step a recorder keeps the first and the last
STEPS_OF_GAP = 3.0  # steps: after a longer pause, see `after_pauses`, the past of a recorder begins anew


def predictor_files(model: ExportModel, name: str) -> SourceFiles:
    """A predictor: physics, method, memory, observer, alarm and band as C."""
    names, filters, bands, step = model.layout, filters_of(model), model.predictor.bands, model.physics.step
    functions = {"predict": model.function, **recorder_functions(model)}
    units = {"row": model.units("now")} | {
        group: model.units(group) for group in ("reached", "past", "planned", "estimates")
    }
    if bands is not None:
        units["kind"] = dict.fromkeys(("any", *bands.kinds), "-")
    limits = [model.limits.get(key, (-np.inf, np.inf)) for key in names.now]
    states = 0 if filters is None else sum(filter_state_sizes(filters.model)) * filters.num_filters
    gap, past, plan = STEPS_OF_GAP * step, names.sizes["past"], names.sizes["planned"]
    pause = gap if filters is None else float(filters.pause)
    too_long = np.inf if filters is None else MOST_FILTER_STEPS * float(filters.longest)
    ordered = names.planned or names.now
    settled = model.predictor.run_up - 1e-3 * step
    values = {
        "HORIZON": names.horizon,
        "PAST": names.num_past,
        "CAPACITY": 2 * PARTS_OF_STEP * names.num_past + 4,
        "WIDTH": len(names.now) + len(KEPT_ENTRIES),
        "STATES": max(1, states),
        "BUFFER": max(states, past + plan) + 1,
        "CHOICES": 0 if bands is None else len(BAND_CHOICE),
        "HAS_PAST": int(past > 0),
        "HAS_OBSERVER": int(filters is not None),
        "RARE": f"{PAUSE_STEPS:g}",
        "FORGOTTEN": SHORTEST_STEP_GROWTH,
        "OFTEN": f"{step / PARTS_OF_STEP:g}",
        "NEAR": step / PARTS_OF_STEP * (1 - 1e-6),
        "SLACK": 1e-3 * step / PARTS_OF_STEP,
        "STEP": step,
        "GAP": gap,
        "PAUSE": pause,
        "TOO_LONG": "INFINITY" if filters is None else too_long,
        "PAUSES": f"more than {min(gap, pause):.4g} s the past begins anew, of more than {pause:.4g} s all does,"
        f"\n * and after {too_long:.4g} s, pause or not",
        "LONGEST": 1 if filters is None else float(filters.longest),
        "ROUNDING": STEP_SLACK,
        "SETTLED": settled if settled > 0 else "-INFINITY",
        "ORDERS": array_of("int", "orders", [names.now.index(key) for key in names.planned]),
        "ACTUATORS": array_of("int", "actuators", [ordered.index(key) for key in names.reached]),
        "ORDERED": "planned" if names.planned else "row",
        "SPEED": names.now.index("u"),
    }
    return source_files(name, _about(model), functions, units, {"limits": np.array(limits)}, _WRAPPER, values)


def _about(model: ExportModel) -> list[str]:
    """Lines of the first comment of the header."""
    physics, predictor, bands = model.physics, model.predictor, model.predictor.bands
    what = "no physics" if physics.vessel is None else physics.vessel.name
    limits = [f"{key} {low:.6g} to {high:.6g} {model.units('now')[key]}" for key, (low, high) in model.limits.items()]
    calibrated = f"No band: {predictor.no_band}."
    if bands is not None:
        kinds = "".join(f", {kind} ({count})" for kind, count in bands.kinds.items())
        calibrated = f"Bands: calibrated on {bands.runs} runs{kinds}. A level p needs p / (1 - p) runs: 9 for 0.9."
    return [
        f"Predictor of a trajectory in C99, written by shipid {__version__}: {what}, method {predictor.method}.",
        f"{physics.horizon} steps of {physics.step:g} s ({physics.integrator}); commands are {predictor.commands} over the horizon.",
        *(["An observer filters the motion, with the noise of its settings."] if physics.observer is not None else []),
        "",
        "SI units, radians, revolutions per second; directions of wind and current are towards. Path: x ahead and y to",
        "starboard [m] in body axes frozen at the instant of prediction. What is not measured is 0.",
        calibrated,
        f"Training has seen: {'; '.join(limits) or 'nothing: every instant counts as outside'}.",
        f"The alarm {'sees every input of the method' if predictor.alarm else 'is raised outside'}: nothing is promised there.",
        *([f"Alarm for the first {predictor.run_up:g} s: the observer settles."] if predictor.run_up else []),
        "",
        "Not in this file: a screening of inputs, a fusion of sensors, a repair of logs. Fixes that were interpolated",
        f"look ahead; give what is known at the time: {', '.join(predictor.causal) or 'none was'}.",
        "No memory is allocated; everything that is kept is in the struct, so that many may run side by side.",
        "",
        *(f"{key}: {json.dumps(value, default=str)[:400]}" for key, value in predictor.provenance.items()),
    ]


_HEADER = """enum {
$SIZES
    @_HORIZON = $HORIZON,
    @_PAST = $PAST,
    @_WORK = $WORK + $BUFFER, /* numbers that a function works with */
    /* Results: 0, or a sum of these. */
    @_NOT_FINITE = 1, /* an input is not a finite number: the row is not kept, the path is NAN */
    @_OUTSIDE = 2,    /* the alarm: the instant is outside of what training has seen; the path is given */
    @_DIVERGED = 4,   /* the path is not finite */
    @_NO_PAST = 8,    /* the past is shorter than @_PAST steps, or there is no row: the path is NAN */
    @_TIME = 16,      /* time does not go on: the row is not kept */
    @_NO_BAND = 32    /* no band can be promised: too few runs for the level or kind, or no such level: it is NAN */
};

/* What is kept of the past. Make one, and call @_init. */
typedef struct {
    double t[$CAPACITY], begun, least; /* s; of the first row after a gap; shortest interval of late */
    double rows[$CAPACITY][$WIDTH];
    int first, count;
    double reached[@_NUM_REACHED + 1], filters[$STATES], estimates[@_NUM_ESTIMATES + 1];
    double work[@_WORK]; /* nothing in it is kept from call to call */
} @_recorder;

void @_init(@_recorder *self);

/* Keep a row that was measured at t [s], entries as in @_row_names. Rows come in order. A pause is longer than
 * $RARE times the shortest interval of late; the shortest grows by a tenth with each row, so that it is forgotten.
 * After one of $PAUSES.
 * The heading may wrap, and so may angles of thrusters and rudders: 350 deg is -10 deg. Of a rudder, and between
 * stops that are less than a turn apart, the angle within them is taken, so a jump is real. A unit that turns all round
 * goes on by the shortest way. The first row is taken by the turn that training had. Rows may come as often as they
 * like: of three within $OFTEN s the past keeps the first and the last. */
int @_record(@_recorder *self, double t, const double *row);

/* Path from the newest row: @_HORIZON pairs x, y. planned: @_HORIZON rows of commands in force, each the
 * mean over its step, angles as they go on from the newest row; or a null pointer: commands stay as they are, and a
 * band that was calibrated with known commands promises nothing.
 * choice: a null pointer, or the band that is wanted: its level, the share of whole paths that it holds, above 0 to 0.99;
 * 1 for the share of positions at each step alone, else 0; the kind of the manoeuvre under way, an entry of
 * @_kind_names, 0 for any. band: then @_HORIZON rows of half axes along the predicted track and across it [m], and the
 * unit vector x, y of the track in body axes. */
int @_predict(@_recorder *self, const double *planned, const double *choice, double *path, double *band);

/* The same as a pure function, without a recorder. reached: positions of actuators, or a null pointer: at their orders.
 * past: @_PAST rows, the oldest first; x, y in the frame of the instant. estimates: of an observer. Arrays without entries may be null pointers. work: @_WORK numbers, whatever they are. */
int @_path(const double *row, const double *reached, const double *past, const double *planned, const double *estimates,
    const double *choice, double *path, double *band, double *work);
"""

_SOURCE = """
static void clear_results(double *path, double *band)
{
    int i;
    for (i = 0; path && i < 2 * @_HORIZON; ++i) path[i] = NAN;
    for (i = 0; band && i < 4 * @_HORIZON; ++i) band[i] = NAN;
}

int @_path(const double *row, const double *reached, const double *past, const double *planned, const double *estimates,
    const double *choice, double *path, double *band, double *work)
{
    static $ORDERS
    static $ACTUATORS
    double begun[@_NUM_REACHED + 1], *held = work + $WORK, outside = 0, promised = 0;
    const int as_calibrated = planned || @_NUM_PLANNED == 0;
    int i, k, status;
    $ARRAYS
    clear_results(path, band);
    if (!are_finite(row, @_NUM_ROW) || !are_finite(past, @_PAST * @_NUM_PAST)
        || !are_finite(estimates, @_NUM_ESTIMATES)) return @_NOT_FINITE;
    if (!planned) {
        for (k = 0; k < @_HORIZON; ++k)
            for (i = 0; i < @_NUM_PLANNED; ++i) held[k * @_NUM_PLANNED + i] = row[orders[i]];
        planned = held;
    }
    if (!are_finite(planned, @_HORIZON * @_NUM_PLANNED)) return @_NOT_FINITE;
    for (i = 0; !reached && i < @_NUM_REACHED; ++i) begun[i] = $ORDERED[actuators[i]];
    if (!reached) reached = begun;
    if (!are_finite(reached, @_NUM_REACHED)) return @_NOT_FINITE;
    arg[0] = row;
    arg[1] = reached;
    arg[2] = past;
    arg[3] = planned;
    arg[4] = estimates;
    for (i = 0; choice && i < $CHOICES; ++i) arg[5 + i] = choice + i;
    res[0] = path;
    res[1] = &outside;
    if (choice && $CHOICES) {
        res[2] = band;
        res[3] = &promised;
    }
    @_casadi_predict(arg, res, iw, work, 0);
    status = outside > 0 ? @_OUTSIDE : 0;
    if (!are_finite(path, 2 * @_HORIZON)) status |= @_DIVERGED;
    if (choice && !(as_calibrated && promised > 0 && are_finite(band, 4 * @_HORIZON))) status |= @_NO_BAND;
    if (status & ~@_OUTSIDE) clear_results(0, band);
    return status;
}

void @_init(@_recorder *self)
{
    memset(self, 0, sizeof *self);
}

/* Place of a row, 0 for the oldest. */
static int place_of(const @_recorder *self, int number)
{
    return (self->first + number + $CAPACITY) % $CAPACITY;
}

int @_record(@_recorder *self, double t, const double *row)
{
    const int newest = place_of(self, self->count - 1);
    double kept[$WIDTH], moved[$WIDTH], after[@_NUM_REACHED + 1], *last = self->rows[newest], anew, dt;
    int i, k, alone = 0;
    $ARRAYS
    if (!isfinite(t) || !are_finite(row, @_NUM_ROW)) return @_NOT_FINITE;
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
    dt = self->count ? t - self->t[newest] : 0;
    if (!self->count) self->begun = t;
    arg[0] = last;
    arg[1] = row;
    arg[2] = self->reached;
    arg[3] = &dt;
    arg[4] = &anew;
    res[0] = kept;
    res[1] = moved;
    res[2] = after;
    @_casadi_keep(arg, res, iw, self->work, 0);
    memcpy(self->reached, after, @_NUM_REACHED * sizeof(double));
    for (i = 0; i < self->count; ++i)
        for (k = 0; k < $WIDTH; ++k) self->rows[place_of(self, i)][k] += moved[k];
#if $HAS_OBSERVER
    {
        double parts = fmax(ceil(dt / $LONGEST - $ROUNDING), 1), part = dt / parts; /* the last one sees the row */
        double *states = self->work + $WORK;
        res[0] = states;
        arg[0] = self->filters;
        arg[1] = last;
        arg[2] = kept;
        arg[3] = moved;
        arg[4] = &part;
        for (; self->count && parts > 0.5; parts -= 1) {
            res[1] = self->estimates; /* a call also works with what follows its own results */
            if (parts > 1.5) @_casadi_between(arg, res, iw, self->work, 0);
            else @_casadi_observe(arg, res, iw, self->work, 0);
            memcpy(self->filters, states, sizeof self->filters);
            arg[3] = 0;
        }
        arg[0] = kept;
        res[1] = self->estimates;
        if (!self->count) @_casadi_begin(arg, res, iw, self->work, 0);
        memcpy(self->filters, states, sizeof self->filters);
    }
#endif
    if (self->count > 1 && t - self->t[place_of(self, self->count - 2)] < $NEAR)
        --self->count; /* the newest row came so soon that this one replaces it */
    if (alone) self->count = 0;
    if (self->count == $CAPACITY) {
        self->first = (self->first + 1) % $CAPACITY;
        --self->count;
    }
    i = place_of(self, self->count++);
    self->t[i] = t;
    memcpy(self->rows[i], kept, sizeof kept);
    return 0;
}

#if $HAS_PAST
/* Rows of the past by interpolation, orders by the last row before; 0 where there are too few rows. */
static int past_rows(@_recorder *self, double *past)
{
    const int newest = place_of(self, self->count - 1);
    const double t = self->t[newest], oldest = self->t[self->first];
    int j = 0, k;
    $ARRAYS
    if (t - @_PAST * $STEP < oldest - $SLACK) return 0;
    for (k = 0; k < @_PAST; ++k) {
        double at = fmax(t - $STEP * (@_PAST - k), oldest), since, share, t0, t1;
        while (j + 1 < self->count && self->t[place_of(self, j + 1)] <= at) ++j;
        t0 = self->t[place_of(self, j)];
        t1 = j + 1 < self->count ? self->t[place_of(self, j + 1)] : t0 + 1;
        since = at - t0;
        share = (at - t0) / (t1 - t0);
        arg[0] = self->rows[place_of(self, j)];
        arg[1] = j + 1 < self->count ? self->rows[place_of(self, j + 1)] : arg[0];
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

int @_predict(@_recorder *self, const double *planned, const double *choice, double *path, double *band)
{
    const int newest = place_of(self, self->count - 1);
    double *past = self->work + $WORK + @_HORIZON * @_NUM_PLANNED;
    int known = self->count > 0, status;
#if $HAS_PAST
    known = known && past_rows(self, past);
#endif
    clear_results(path, band);
    if (!known) return @_NO_PAST;
    status = @_path(self->rows[newest], self->reached, past, planned, self->estimates, choice, path,
        band, self->work);
    return self->t[newest] - self->begun < $SETTLED ? status | @_OUTSIDE : status; /* no run-up of the observer */
}
"""

_EXAMPLE = """/* A ship that goes straight to the north, and where it goes. cc -std=c99 main.c @.c @_casadi.c -lm */
#include <stdio.h>

#include "@.h"

int main(void)
{
    static @_recorder ship;
    double row[@_NUM_ROW] = {0}, path[2 * @_HORIZON];
    int i, status;
    @_init(&ship);
    row[$SPEED] = 1;
    for (i = 0; i <= @_PAST; ++i) {
        status = @_record(&ship, $STEP * i, row);
        if (status) { printf("row %d is refused: result %d\\n", i, status); return status; } /* a path would be that of the row before */
        row[0] += $STEP * row[$SPEED];
    }
    status = @_predict(&ship, 0, 0, path, 0);
    printf("status %d: %s\\n", status, status & @_OUTSIDE ? "outside of what training has seen" : "inside");
    for (i = 0; i < @_HORIZON; ++i)
        printf("%g s: %.2f m ahead, %.2f m to starboard\\n", $STEP * (i + 1), path[2 * i], path[2 * i + 1]);
    return status & ~@_OUTSIDE;
}
"""

_WRAPPER = Wrapper(_HEADER, _SOURCE, _EXAMPLE)
