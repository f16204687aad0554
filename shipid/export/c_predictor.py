"""C99 of a predictor: physics, method, memory, observer, alarm and band, with libm as the only dependency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from casadi import SX

from shipid.data.dataset import FORGOTTEN, RARE
from shipid.export.band import COLUMNS
from shipid.export.blocks import Block, Formula, Precision, c_functions
from shipid.export.c import (
    NEARBY,
    Array,
    Files,
    array_of,
    comment,
    provenance_lines,
    refusals,
    source_head,
    strings,
    tables_of_names,
)
from shipid.export.equations import Equations
from shipid.export.model import Model
from shipid.export.turns import SAME_TURN, Turned, turned
from shipid.hybrid.bands import FEWEST, LEVELS, Bands
from shipid.observer import DIVERGED, LOW, MEASURED, MOST_PARTS, ROUNDING, STATES, Bank, bank, filter_function, sizes
from shipid.physics.signals import SIGNALS
from shipid.version import __version__
from shipid.vessel.load import Vessel

PARTS_OF_STEP = 8  # of three rows within such a part of a step a recorder keeps the first and the last
FAR = 1000  # m: beyond it a recorder counts the integrated way anew
GAP = 3.0  # steps: after a longer pause, see `after_pauses`, the past of a recorder begins anew


def predictor_files(model: Model, name: str, precision: Precision) -> Files:
    """A predictor: physics, method, memory, observer, alarm and band as one C source."""
    parts = PredictorParts(model, name, precision)
    return Files(name, {f"{name}.h": parts.header(), f"{name}.c": parts.source(), "main.c": parts.example()})


@dataclass(frozen=True)
class PredictorParts:
    """Text of the C of a predictor."""

    model: Model
    name: str
    precision: Precision

    @property
    def row(self) -> tuple[str, ...]:
        """Entries of a row of the recorder: position, then what else is measured."""
        return ("north", "east", *(name for name in self.model.layout.now if name not in ("north", "east")))

    @property
    def capacity(self) -> int:
        """Rows that a recorder keeps: two for each part of a step, however often rows come."""
        return 2 * PARTS_OF_STEP * self.model.layout.num_past + 4

    @property
    def filters(self) -> Bank | None:
        """The filters of the observer, where there is one: of the vessel without the terms of the method, as in Python."""
        physics = self.model.predictor.physics
        if physics.observer is None or physics.vessel is None:
            return None
        return bank(physics.vessel, physics.observer)

    def sizes(self) -> dict[str, int]:
        """Constants of the header."""
        names = self.model.layout
        return {
            "HORIZON": names.horizon,
            "NUM_ROW": len(self.row),
            "NUM_NOW": len(names.now),
            "NUM_REACHED": len(names.reached),
            "PAST": names.num_past,
            "NUM_PAST": len(names.past),
            "NUM_PLANNED": len(names.planned),
            "NUM_ESTIMATES": len(names.estimates),
            "NUM_PARAMETERS": len(names.parameters),
            **({} if self.bands is None else {"BAND": len(COLUMNS), "NUM_KINDS": len(self.bands.kinds)}),
        }

    @property
    def bands(self) -> Bands | None:
        """The bands of the predictor, where it has some."""
        return self.model.predictor.bands

    def _groups(self) -> dict[str, tuple[str, ...]]:
        names = self.model.layout
        return {
            "row": self.row,
            "now": names.now,
            "reached": names.reached,
            "past": names.past,
            "planned": names.planned,
            "estimates": names.estimates,
            "parameters": names.parameters,
        }

    def _limits(self) -> Array:
        """(NUM_ROW, 2) limits; what has none is unlimited."""
        return np.array([self.model.limits.get(name, (-np.inf, np.inf)) for name in self.row])

    def tables(self) -> tuple[str, str]:
        """Declarations and definitions of names, units, limits and defaults."""
        declared, defined, name = [], [], self.name
        for group, names in self._groups().items():
            one, other = tables_of_names(name, group, names, {key: self.model.unit(key) for key in names})
            declared.append(one)
            defined.append(other)
        values = {"defaults": self.model.parameters, "limits": self._limits()}
        for key, array in values.items():
            declared.append(f"extern const {name}_real {name}_{key}[{max(1, array.size)}];")
            defined.append(array_of(f"{name}_real", f"{name}_{key}", array.size, self.precision.table(array)))
        if self.bands is not None:
            kinds = f"const char *const {name}_kind_names[{len(self.bands.kinds) + 1}]"
            declared.append(f"extern {kinds};")
            defined.append(f"{kinds} = {{\n    {strings(['any', *self.bands.kinds])}}};")
        return "\n".join(declared), "\n".join(defined)

    def header(self) -> str:
        """The header: names, units, order, limits, functions."""
        name, model, names = self.name, self.model, self.model.layout
        physics, predictor = model.physics, model.predictor
        guard = f"{name.upper()}_H"
        constants = ",\n    ".join(f"{name}_{key} = {value}" for key, value in self.sizes().items())
        declared, _ = self.tables()
        real = "float" if self.precision.single else "double"
        what = "no physics" if physics.vessel is None else physics.vessel.name
        limits = [f"{key} {low:.6g} to {high:.6g} {model.unit(key)}" for key, (low, high) in model.limits.items()]
        filters = self.filters
        states = "" if filters is None else f"    {name}_real filters[{_size(filters) * filters.num_filters}];\n"
        return f"""{
            comment(
                [
                    f"Predictor of a trajectory in C99, written by shipid {__version__}: {what}, method {predictor.method}.",
                    f"{names.horizon} steps of {physics.step:g} s ({physics.integrator}); commands are {predictor.commands} over the horizon.",
                    *(
                        []
                        if physics.observer is None
                        else [
                            "An observer filters the motion and estimates slow forces and current. It takes the noise of its",
                            "settings: std_u, std_v, std_r of a log, which widen it in Python, have no entry here.",
                        ]
                    ),
                    "",
                    "SI units, radians, revolutions per second; directions of wind and current are towards. Path: x ahead and y to",
                    "starboard [m] in body axes frozen at the instant of prediction. What is not measured is 0.",
                    *(NEARBY if self.precision.single else []),
                    *self._promise(),
                    *(
                        [f"Alarm for the first {predictor.run_up:g} s: the observer settles."]
                        if predictor.run_up
                        else []
                    ),
                    "Limits of the alarm: " + ("; ".join(limits) or "none: every instant counts as outside") + ".",
                    "",
                    "Not in this file: a screening of inputs, a fusion of sensors, a repair of logs. Fixes that were interpolated",
                    "look ahead; give what is known at the time"
                    + (f" ({', '.join(predictor.causal)})." if predictor.causal else "."),
                    "No memory is allocated; everything that is kept is in the struct, so that many may run side by side.",
                    "",
                    *provenance_lines(predictor.provenance),
                ]
            )
        }
#ifndef {guard}
#define {guard}

#ifdef __cplusplus
extern "C" {{
#endif

typedef {real} {name}_real;

enum {{
    {constants}
}};

/* Results: 0, or a sum of these. */
enum {{
    {name}_NOT_FINITE = 1, /* an input is not a finite number: the row is not kept, the path is NAN */
    {name}_OUTSIDE = 2,    /* the alarm: the instant is outside of what training has seen; the path is given */
    {name}_DIVERGED = 4,   /* the path is not finite */
    {name}_NO_PAST = 8,    /* the past is shorter than {names.num_past} steps, or there is no row: the path is NAN */
    {name}_TIME = 16,      /* time does not go on: the row is not kept */
    {
            name
        }_NO_BAND = 32,   /* no band can be promised: too few runs for the level or kind, or no such level: it is NAN */
    {name}_PARAMETER = 64 /* a parameter that must be above 0 is not, such as inertia.m: the path is NAN */
}};

{declared}

/* What is kept of the past. Make one, call {name}_init, and change `parameters` where the ship differs. */
typedef struct {{
    {name}_real parameters[{max(1, len(names.parameters))}];
    double t[{self.capacity}], begun, least; /* s; of the first row after a gap; shortest interval of late */
    {name}_real rows[{self.capacity}][{len(self.row) + 4}];
    int first, count;
    {name}_real reached[{max(1, len(names.reached))}];
{states}    {name}_real estimates[{max(1, len(names.estimates))}];
}} {name};

void {name}_init({name} *self);

/* Keep a row that was measured at t [s], entries as in {name}_row_names. Rows come in order. A pause is longer than
 * {RARE:g} times the shortest interval of late; the shortest grows by a tenth with each row, so that it is forgotten.
 * {self._after_pauses()}
 * The heading may wrap, and so may angles of thrusters and rudders: 350 deg is -10 deg. Between
 * stops that are less than a turn apart the angle within them is taken, so a jump is real. A unit that turns all round
 * goes on by the shortest way. The first row is taken by the turn that training had. Rows may come as often as they
 * like: of three within {physics.step / PARTS_OF_STEP:g} s the past keeps the first and the last. */
int {name}_record({name} *self, double t, const {name}_real *row);

/* Path from the newest row: {name}_HORIZON pairs x, y. planned: {name}_HORIZON rows of commands in force, each the
 * mean over its step, or a null pointer: commands stay as they are. */
int {name}_predict(const {name} *self, const {name}_real *planned, {name}_real *path);

/* The same as a pure function, without a recorder. reached: positions of actuators, or a null pointer: at their orders.
 * past: {name}_PAST rows, the oldest first; x, y in the frame of the instant. planned: as above. estimates: of an
 * observer. parameters: {name}_defaults, or a changed copy. Arrays without entries may be null pointers. */
int {name}_path(const {name}_real *now, const {name}_real *reached, const {name}_real *past, const {name}_real *planned,
                const {name}_real *estimates, const {name}_real *parameters, {name}_real *path);
{self._declared_band()}
#ifdef __cplusplus
}}
#endif
#endif
"""

    def source(self) -> str:
        """Text of the C file: tables, functions of the blocks, and the functions of the header."""
        model, name, names = self.model, self.name, self.model.layout
        blocks: list[Block] = [model.graph]
        advance = _advance(model.vessel) if model.vessel is not None and names.reached else None
        filters = self.filters
        filtering = None if filters is None else _filter(filters, names.parameters)
        blocks += [block for block in (advance, filtering, model.radii, model.band) if block is not None]
        text, call = c_functions(blocks, self.precision)
        return f"""{comment([f"Predictor, written by shipid {__version__}; see {name}.h."])}
{source_head(name, self.precision)}
{self.tables()[1]}

{text}
{self._path(call)}
{"" if filters is None or filtering is None else _observing(filters, call[id(filtering)], self.row, self.precision)}
{self._recorder(None if advance is None else call[id(advance)])}
{self._band(call)}"""

    def _promise(self) -> list[str]:
        """Comments of the header on the band."""
        if self.bands is None:
            return [f"No band: {self.model.no_band}."]
        kinds = "".join(f", {kind} ({count})" for kind, count in self.bands.kinds.items())
        return [
            f"Bands: calibrated on {self.bands.runs} runs{kinds}. A level p needs p / (1 - p) runs or more: 9 for 0.9. Where the",
            "alarm is raised, nothing is promised.",
        ]

    def _declared_band(self) -> str:
        name = self.name
        if self.bands is None:
            return ""
        return f"""
/* The band around a path from an instant: {name}_HORIZON rows of half axes along the predicted track and across it [m],
 * and the unit vector x, y of the track in body axes. level: share of whole paths that it holds, above 0 to 0.99;
 * pointwise: 1 for the share of positions at each step alone. kind: of the manoeuvre under way, an entry of
 * {name}_kind_names; 0 for any. With both pointwise and kind, or too few runs for the level, the result is
 * {name}_NO_BAND. */
int {name}_band(const {name}_real *now, const {name}_real *path, double level, int pointwise, int kind, {name}_real *band);

/* Path and band from the newest row; results of both. Where the result has {name}_OUTSIDE nothing is promised. */
int {name}_predict_band(const {name} *self, const {name}_real *planned, double level, int pointwise, int kind,
                        {name}_real *path, {name}_real *band);

/* A band that adapts along a run, for those who judge paths when their time has come. miss: begins at 1 - level. missed:
 * whether a path left the band that was given for it. rate: such as 0.02, over how many paths begin within a horizon:
 * else all of them widen the band for one error. Returns miss from then on. */
double {name}_adapted(double miss, double level, double rate, int missed);

/* How much wider than calibrated such a band is now: times both half axes. NAN for a kind or level that is none, and for a
 * miss that is no number. */
double {name}_factor(double miss, double level, int kind);
"""

    def _band(self, call: Mapping[int, str]) -> str:
        """The band of a path, and how it adapts."""
        name, bands, names, row = self.name, self.bands, self.model.layout, self.row
        radii, band = self.model.radii, self.model.band
        if bands is None or radii is None or band is None:
            return ""
        real, rows, most = f"{name}_real", len(COLUMNS) * names.horizon, float(LEVELS[-1])
        taken_ = [row.index(key) for key in names.now]
        return f"""static int no_band({real} *band, int status)
{{
    int i;
    for (i = 0; i < {rows}; ++i) band[i] = NAN;
    return status;
}}

int {name}_band(const {real} *now, const {real} *path, double level, int pointwise, int kind, {real} *band)
{{
    static const int runs[] = {{{_whole([bands.runs, *bands.kinds.values()])}}};
    const real asked = (real)level, alone = (real)(pointwise != 0), of = (real)kind;
    int i;
    for (i = 0; i < {len(names.now)}; ++i) if (!isfinite(now[i])) return no_band(band, {name}_NOT_FINITE);
    for (i = 0; i < {2 * names.horizon}; ++i) if (!isfinite(path[i])) return no_band(band, {name}_DIVERGED);
    if (kind < 0 || kind > {len(bands.kinds)} || (pointwise && kind)) return no_band(band, {name}_NO_BAND);
    if (!(level > 0 && level <= {most!r}) || runs[kind] < {FEWEST}) return no_band(band, {name}_NO_BAND);
    if (level / (1 - level) - 1e-9 > runs[kind]) return no_band(band, {name}_NO_BAND);
    {call[id(band)]}(now, path, &asked, &alone, &of, band);
    for (i = 0; i < {rows}; ++i) if (!isfinite(band[i])) return no_band(band, {name}_NO_BAND);
    return 0;
}}

int {name}_predict_band(const {name} *self, const {real} *planned, double level, int pointwise, int kind,
                        {real} *path, {real} *band)
{{
    static const int taken[{len(taken_)}] = {{{_whole(taken_)}}};
    const int newest = (self->first + self->count - 1) % {self.capacity};
    const int status = {name}_predict(self, planned, path);
    real now[{len(taken_)}];
    int i;
    if (status & ~{name}_OUTSIDE) return no_band(band, status);
    for (i = 0; i < {len(taken_)}; ++i) now[i] = self->rows[newest][taken[i]];
    return status | {name}_band(now, path, level, pointwise, kind, band);
}}

static double radius_of(double level, int kind)
{{
    const real asked = (real)(level < {most!r} ? level : {most!r}), alone = 0, of = (real)kind;
    real radius[{names.horizon}];
    {call[id(radii)]}(&asked, &alone, &of, radius);
    return radius[0];
}}

double {name}_adapted(double miss, double level, double rate, int missed)
{{
    return miss + rate * ((1 - level) - (missed != 0));
}}

double {name}_factor(double miss, double level, int kind)
{{
    double usual, now = 1 - miss;
    if (kind < 0 || kind > {len(bands.kinds)} || !(level > 0 && level < 1) || !isfinite(miss)) return NAN;
    if (now <= 0) return 0;
    usual = radius_of(level, kind);
    if (usual == 0) return 1;
    return radius_of(now, kind) / usual * exp((now > {most!r} ? now - {most!r} : 0) / 0.05);
}}
"""

    def _path(self, call: Mapping[int, str]) -> str:
        """The pure function."""
        name, names, model = self.name, self.model.layout, self.model
        sizes_ = names.sizes
        commands = [names.now.index(key) for key in names.planned]
        reached = [names.now.index(key) for key in names.reached]
        first = [names.planned.index(key) for key in names.reached] if names.planned else []
        checked = refusals(names.parameters, model.vessel, f"{name}_PARAMETER")
        lines = ["int i, status = 0;", *checked[:1]]
        if names.planned:
            lines += [f"real held[{sizes_['planned']}];", f"static const int order[] = {{{_whole(commands)}}};"]
        if names.reached:
            source = first if names.planned else reached
            lines += [f"real begun[{len(reached)}];", f"static const int actuator[] = {{{_whole(source)}}};"]
        lines += [f"(void){key};" for key, size in sizes_.items() if not size]
        nan = f"for (i = 0; i < {2 * names.horizon}; ++i) path[i] = NAN;"
        lines.append(nan)
        for key in ("now", "past", "estimates", "parameters"):
            if sizes_[key]:
                lines.append(f"for (i = 0; i < {sizes_[key]}; ++i) if (!isfinite({key}[i])) return {name}_NOT_FINITE;")
        lines += checked[1:]
        if names.planned:
            lines.append(
                f"if (!planned) {{ for (i = 0; i < {sizes_['planned']}; ++i) "
                f"held[i] = now[order[i % {len(commands)}]]; planned = held; }}"
            )
            lines.append(
                f"for (i = 0; i < {sizes_['planned']}; ++i) if (!isfinite(planned[i])) return {name}_NOT_FINITE;"
            )
        if names.reached:
            source_ = "planned" if names.planned else "now"
            lines.append(
                f"if (!reached) {{ for (i = 0; i < {len(reached)}; ++i) begun[i] = {source_}[actuator[i]]; reached = begun; }}"
            )
            lines.append(f"for (i = 0; i < {len(reached)}; ++i) if (!isfinite(reached[i])) return {name}_NOT_FINITE;")
        if model.predictor.limits:
            places = [(names.now.index(key), self.row.index(key)) for key in model.limits]
            for place, row in places:
                lines.append(
                    f"if (!(now[{place}] >= {name}_limits[{2 * row}] && now[{place}] <= {name}_limits[{2 * row + 1}])) "
                    f"status = {name}_OUTSIDE;"
                )
        else:
            lines.append(f"status = {name}_OUTSIDE;")
        given = [key for key, size in model.graph.inputs if size]
        lines.append(f"{call[id(model.graph)]}({', '.join([*given, 'path'])});")
        lines.append(
            f"for (i = 0; i < {2 * names.horizon}; ++i) if (!isfinite(path[i])) return status | {name}_DIVERGED;"
        )
        lines.append("return status;")
        body = "\n".join(f"    {line}" for line in lines)
        return f"""int {name}_path(const {name}_real *now, const {name}_real *reached, const {name}_real *past, const {name}_real *planned,
                const {name}_real *estimates, const {name}_real *parameters, {name}_real *path)
{{
{body}
}}
"""

    def _recorder(self, advance: str | None) -> str:
        """init, record and predict. advance : C function of the actuators, where some lag behind their orders."""
        angled = turned(self.row, self.model.vessel, self.model.layout.parameters)
        turns = [SAME_TURN] if angled else []
        return "\n".join([*turns, self._init(), self._record(advance, angled), self._predict(angled)])

    def _init(self) -> str:
        """A recorder without rows."""
        return f"""void {self.name}_init({self.name} *self)
{{
    memset(self, 0, sizeof *self);
    memcpy(self->parameters, {self.name}_defaults, sizeof self->parameters);
}}
"""

    def _record(self, advance: str | None, angled: Sequence[Turned]) -> str:
        """A row to the past, and actuators and observer up to it."""
        name, row, cap, step = self.name, self.row, self.capacity, self.model.physics.step
        n, real = len(row), f"{name}_real"
        u, v, psi = (row.index(key) for key in ("u", "v", "psi"))
        rates = f"""        kept[{n + 2}] = kept[{u}] * M(cos)(kept[{psi}]) - kept[{v}] * M(sin)(kept[{psi}]);
        kept[{n + 3}] = kept[{u}] * M(sin)(kept[{psi}]) + kept[{v}] * M(cos)(kept[{psi}]);"""
        same_turn = "\n".join(self._turn(one) for one in angled)
        first_actuators = "\n".join(f"        self->reached[{k}] = kept[{i}];" for k, i in enumerate(self._reached))
        begin_filters, go_filters = "", ""
        if self.filters is not None:
            begin_filters = "        begin_filters(self->filters, kept, self->estimates);\n"
            go_filters = (
                "        go_filters(self->filters, last, kept, (real)(t - self->t[newest]), "
                "self->parameters, self->estimates);\n"
            )
        return f"""int {name}_record({name} *self, double t, const {real} *row)
{{
    int i, newest = (self->first + self->count - 1) % {cap}{", alone = 0" if self._goes_on else ""};
    real kept[{n + 4}]{", moved" if angled else ""};
    if (!isfinite(t)) return {name}_NOT_FINITE;
    for (i = 0; i < {n}; ++i) if (!isfinite(row[i])) return {name}_NOT_FINITE;
    if (self->count && !(t > self->t[newest])) return {name}_TIME;
    if (self->count) {{
        const double apart = t - self->t[newest];
        if (!(apart <= {RARE!r} * self->least){self._too_long()}) {{
{self._anew()}
        }}
        if (self->least > 0) self->least *= {FORGOTTEN!r};
        if (!(self->least > 0 && self->least < apart)) self->least = apart;
    }}
    memcpy(kept, row, {n} * sizeof *kept);
{same_turn}    if (self->count) {{
        const real *last = self->rows[newest];
        const real half = (real)((t - self->t[newest]) / 2);
        (void)last;
{self._unwrapped()}
{rates}
        kept[{n}] = last[{n}] + half * (last[{n + 2}] + kept[{n + 2}]);
        kept[{n + 1}] = last[{n + 1}] + half * (last[{n + 3}] + kept[{n + 3}]);
{self._near()}{self._advanced(advance)}{go_filters}        if (self->count > 1 && t - self->t[(newest + {cap - 1}) % {cap}] < {step / PARTS_OF_STEP * (1 - 1e-6)!r})
            --self->count; /* the newest row came so soon that this one replaces it */
    }} else {{
        self->first = 0;
        self->begun = t;
        kept[{n}] = kept[{n + 1}] = 0;
{rates}
{first_actuators}
{begin_filters}    }}
{"    if (alone) self->count = 0;" + chr(10) if self._goes_on else ""}    if (self->count == {cap}) {{
        self->first = (self->first + 1) % {cap};
        --self->count;
    }}
    newest = (self->first + self->count++) % {cap};
    self->t[newest] = t;
    memcpy(self->rows[newest], kept, sizeof kept);
    return 0;
}}
"""

    @property
    def _pause(self) -> float:
        """Time [s] between two rows beyond which all begins anew: that of the observer, where there is one."""
        return GAP * self.model.physics.step if self.filters is None else float(self.filters.pause)

    @property
    def _goes_on(self) -> bool:
        """Whether observer, actuators and angles go on over pauses after which the past begins anew."""
        return self._pause > GAP * self.model.physics.step

    def _too_long(self) -> str:
        """C: whether the observer would take too many steps between two rows, as of a clock in microseconds."""
        return "" if self.filters is None else f" || apart > {MOST_PARTS * float(self.filters.longest)!r}"

    def _anew(self) -> str:
        """C of what begins anew after a pause."""
        lines = [f"            if (apart > {self._pause!r}) self->count = 0;"]
        if self._goes_on:
            lines.insert(0, f"            alone = apart > {GAP * self.model.physics.step!r};")
        return "\n".join(lines)

    def _after_pauses(self) -> str:
        """What begins anew after pauses, in words."""
        filters = self.filters
        always = "" if filters is None else f" After {MOST_PARTS * filters.longest:.4g} s all does, pause or not."
        if not self._goes_on:
            return f"After one of more than {self._pause:g} s the past begins anew.{always}"
        past = f"After one of more than {GAP * self.model.physics.step:g} s the past begins anew"
        return f"{past}, of more than {self._pause:.4g} s observer, actuators and angles, too.{always}"

    @property
    def _reached(self) -> list[int]:
        """Places in a row of the orders of actuators that lag behind them."""
        return [self.row.index(key) for key in self.model.layout.reached]

    def _unwrapped(self) -> str:
        """Heading and other angles of a new row by the turn that goes on."""
        turn = "6.283185307179586476925"
        angles = [i for i, key in enumerate(self.row) if "." not in key and key in SIGNALS and SIGNALS[key].angle]
        return "\n".join(
            f"        kept[{i}] += (real)({turn} * floor(0.5 + ((double)last[{i}] - (double)kept[{i}]) / {turn}));"
            for i in angles
        )

    def _near(self) -> str:
        """C that counts the integrated way from the newest row, where it became long and the past is made of it."""
        if self.model.physics.path != "velocity":
            return ""
        n, cap = len(self.row), self.capacity
        return f"""        if (M(fabs)(kept[{n}]) > {FAR} || M(fabs)(kept[{n + 1}]) > {FAR}) {{ /* single precision would lose a row's way */
            for (i = 0; i < self->count; ++i) {{
                self->rows[(self->first + i) % {cap}][{n}] -= kept[{n}];
                self->rows[(self->first + i) % {cap}][{n + 1}] -= kept[{n + 1}];
            }}
            kept[{n}] = kept[{n + 1}] = 0;
        }}
"""

    def _advanced(self, advance: str | None) -> str:
        """Actuators on their way to the orders of the last row."""
        vessel = self.model.vessel
        if advance is None or vessel is None:
            return ""
        orders = Equations(vessel).model.commands
        given = ", ".join(f"last[{self.row.index(key)}]" for key in orders)
        return f"""        {{
            const real dt = (real)(t - self->t[newest]);
            const real given[{len(orders)}] = {{{given}}};
            real after[{len(self._reached)}];
            {advance}(self->reached, given, self->parameters, &dt, after);
            memcpy(self->reached, after, sizeof after);
        }}
"""

    def _predict(self, angled: Sequence[Turned]) -> str:
        """The path from the newest row."""
        name, names, model, row = self.name, self.model.layout, self.model, self.row
        cap, real, taken = self.capacity, f"{name}_real", [row.index(key) for key in names.now]
        sizes_, past_lines = names.sizes, self._past() if names.num_past else ""
        settled = model.predictor.run_up - 1e-3 * model.physics.step
        young = (
            f"    if (self->t[newest] - self->begun < {settled!r}) i |= {name}_OUTSIDE; /* no run-up of the observer */\n"
            if settled > 0
            else ""
        )
        plan = f", plan[{sizes_['planned']}]" if any(one.command in names.planned for one in angled) else ""
        return f"""int {name}_predict(const {name} *self, const {real} *planned, {real} *path)
{{
    const int newest = (self->first + self->count - 1) % {cap};
    static const int taken[{len(taken)}] = {{{_whole(taken)}}};
    real now[{len(taken)}], past[{max(1, sizes_["past"])}]{plan};
    int i;
    for (i = 0; i < {2 * names.horizon}; ++i) path[i] = NAN;
    if (!self->count) return {name}_NO_PAST;
    for (i = 0; i < {len(taken)}; ++i) now[i] = self->rows[newest][taken[i]];
{past_lines or "    past[0] = 0;"}
{self._plan(angled)}    i = {name}_path(now, self->reached, past, planned, self->estimates, self->parameters, path);
{young}    return i;
}}
"""

    def _turn(self, one: Turned) -> str:
        """The turn of an angle of a new row; where the past must move to it, what is kept of it does."""
        names, place, cap = self.model.layout, one.place, self.capacity
        last = f"self->count ? self->rows[newest][{place}] : {one.first(self.name, f'kept[{place}]')}"
        moves = [f"for (i = 0; i < self->count; ++i) self->rows[(self->first + i) % {cap}][{place}] += moved;"]
        if one.command in names.reached:
            moves.append(f"self->reached[{names.reached.index(one.command)}] += moved;")
        filters = self.filters
        if filters is not None:
            places = [*np.cumsum([0, *sizes(filters.model)])]
            held = ((filters.model.memory, places[2]), (filters.model.commands, places[4]))
            each = [int(start) + list(group).index(one.command) for group, start in held if one.command in group]
            moves += [
                f"for (i = 0; i < {filters.num_filters}; ++i) self->filters[i * {_size(filters)} + {k}] += moved;"
                for k in each
            ]
        lines = [
            f"kept[{place}] = {one.call(self.name, f'kept[{place}]', last, '&moved')};",
            "if (moved < 0 || moved > 0) {",
            *(f"    {move}" for move in moves),
            "}",
        ]
        return "".join(f"    {line}\n" for line in lines)

    def _plan(self, angled: Sequence[Turned]) -> str:
        """Planned angles by the turn that goes on from the newest row."""
        names = self.model.layout
        width, lines = len(names.planned), []
        for one in angled:
            if one.command in names.planned:
                at = names.planned.index(one.command)
                entry, last = f"plan[{width} * k + {at}]", f"self->rows[newest][{one.place}]"
                before = f"k ? plan[{width} * (k - 1) + {at}] : {last}"
                lines.append(f"            {entry} = {one.call(self.name, entry, before, '0')};")
        if not lines:
            return ""
        rows = "\n".join(lines)
        return f"""    if (planned) {{
        int k;
        memcpy(plan, planned, sizeof plan);
        for (k = 0; k < {names.horizon}; ++k) {{
{rows}
        }}
        planned = plan;
    }}
"""

    def _past(self) -> str:
        """Rows of the past by interpolation, commands by the last row before."""
        name, names, row, step = self.name, self.model.layout, self.row, self.model.physics.step
        n, cap = len(row), self.capacity
        places = [row.index(key) for key in names.past if key not in ("x", "y")]
        held = [int("." in row[place]) for place in places]
        psi, north, east = (row.index(key) for key in ("psi", "north", "east"))
        if self.model.physics.path == "velocity":  # the trapezoid of linear rates, exact between rows
            position = f"""            const real later_n = before[{n + 2}] + (real)share * (after[{n + 2}] - before[{n + 2}]);
            const real later_e = before[{n + 3}] + (real)share * (after[{n + 3}] - before[{n + 3}]);
            const real north = before[{n}] + (real)((at - t0) / 2) * (before[{n + 2}] + later_n) - newest_row[{n}];
            const real east = before[{n + 1}] + (real)((at - t0) / 2) * (before[{n + 3}] + later_e) - newest_row[{n + 1}];"""
        else:
            position = f"""            const real north = before[{north}] + (real)share * (after[{north}] - before[{north}]) - newest_row[{north}];
            const real east = before[{east}] + (real)share * (after[{east}] - before[{east}]) - newest_row[{east}];"""
        width = len(names.past)
        return f"""    {{
        static const int place[{len(places)}] = {{{_whole(places)}}};
        static const int holds[{len(places)}] = {{{_whole(held)}}};
        const real *newest_row = self->rows[newest];
        const real c = M(cos)(newest_row[{psi}]), s = M(sin)(newest_row[{psi}]);
        const double slack = {1e-3 * step / PARTS_OF_STEP!r}, t = self->t[newest];
        int k, j = 0;
        if (t - {names.num_past * step!r} < self->t[self->first] - slack) return {name}_NO_PAST;
        for (k = 0; k < {names.num_past}; ++k) {{
            double at = t - {step!r} * ({names.num_past} - k), t0, t1, share;
            const real *before, *after, *order;
            real *entry = past + k * {width};
            if (at < self->t[self->first]) at = self->t[self->first];
            while (j + 1 < self->count && self->t[(self->first + j + 1) % {cap}] <= at) ++j;
            before = self->rows[(self->first + j) % {cap}];
            t0 = self->t[(self->first + j) % {cap}];
            after = j + 1 < self->count ? self->rows[(self->first + j + 1) % {cap}] : before;
            t1 = j + 1 < self->count ? self->t[(self->first + j + 1) % {cap}] : t0 + 1;
            order = t1 <= at + slack ? after : before; /* in force: that of a row which is only rounding away */
            share = (at - t0) / (t1 - t0);
            for (i = 0; i < {len(places)}; ++i)
                entry[i] = holds[i] ? order[place[i]] : before[place[i]] + (real)share * (after[place[i]] - before[place[i]]);
            {{
{position}
            entry[{width - 2}] = c * north + s * east;
            entry[{width - 1}] = c * east - s * north;
            }}
        }}
    }}"""

    def example(self) -> str:
        """An example: the same row again and again, then a path."""
        name, row, names = self.name, self.row, self.model.layout
        values = []
        for key in row:
            low, high = self.model.limits.get(key, (0.0, 0.0))
            values.append(self.precision.number((low + high) / 2 if np.isfinite(low + high) else 0.0))
        rows = names.num_past + 1
        predict, around, shown = "predict(&ship, 0, path)", "", ""
        if self.bands is not None:
            predict, around = (
                "predict_band(&ship, 0, 0.5, 0, 0, path, band)",
                f"    {name}_real band[{name}_BAND * {name}_HORIZON];\n",
            )
            shown = (
                f"    for (i = 0; i < {name}_HORIZON && !(status & {name}_NO_BAND); ++i)\n"
                f'        printf("half of the paths: %.2f m along the track, %.2f m across\\n", '
                f"(double)band[{name}_BAND * i], (double)band[{name}_BAND * i + 1]);\n"
            )
        return f"""/* A ship that does the same for a while, and where she goes. cc -std=c99 main.c {name}.c -lm */
#include <stdio.h>

#include "{name}.h"

int main(void)
{{
    static {name} ship;
    /* {", ".join(row)} */
    {name}_real row[{name}_NUM_ROW] = {{{", ".join(values)}}};
    {name}_real path[2 * {name}_HORIZON];
{around}    int i, status;
    {name}_init(&ship);
    for (i = 0; i < {rows}; ++i) {{
        status = {name}_record(&ship, {self.model.physics.step!r} * i, row);
        if (status) {{ printf("row %d is refused: result %d\\n", i, status); return status; }} /* a path would be that of the row before */
        row[0] += {self.precision.number(self.model.physics.step)} * row[{row.index("u")}]; /* a straight run to the north */
    }}
    status = {name}_{predict};
    printf("status %d: %s\\n", status, status & {name}_OUTSIDE ? "outside of what training has seen" : "inside");
    for (i = 0; i < {name}_HORIZON; ++i)
        printf("%g s: %.2f m ahead, %.2f m to starboard\\n", {self.model.physics.step!r} * (i + 1), (double)path[2 * i], (double)path[2 * i + 1]);
{shown}    return status & ~{name}_OUTSIDE;
}}
"""


def _whole(values: Sequence[int]) -> str:
    return ", ".join(str(int(value)) for value in values) or "0"


def _advance(vessel: Vessel) -> Formula:
    """(memory, commands, parameters, dt) -> memory after dt; state and weather do not count for actuators."""
    model = Equations(vessel).model
    memory, commands = SX.sym("memory", len(model.memory)), SX.sym("commands", len(model.commands))
    parameters, dt = SX.sym("parameters", len(model.parameters)), SX.sym("dt")
    still = SX.zeros(len(model.state) + len(model.hidden)), SX.zeros(len(model.environment))
    result = ca.densify(SX(model.advance(still[0], memory, commands, still[1], parameters, dt)))
    given = [memory, commands, parameters, dt]
    names = ["memory", "commands", "parameters", "dt"]
    return Formula(ca.Function("actuators", given, [result], names, ["out"], {"cse": True}))


def _size(filters: Bank) -> int:
    return sum(sizes(filters.model))


def _filter(filters: Bank, parameters: Sequence[str]) -> Formula:
    """(state, commands, environment, parameters, measured, numbers, dt) -> state after, estimate, innovation, spread.

    parameters : names of those that are given, the terms of the method among them.
    """
    one, given = filter_function(filters.model), SX.sym("parameters", len(parameters))
    symbols = {one.name_in(i): SX.sym(one.name_in(i), one.numel_in(i)) for i in range(one.n_in())}
    symbols["parameters"] = given
    taken = given[[parameters.index(name) for name in filters.model.parameters]]
    constant = {"noise": SX(ca.DM(filters.noise)), "parameters": taken}
    results = one(*(constant.get(name, symbol) for name, symbol in symbols.items()))
    kept = {name: symbol for name, symbol in symbols.items() if name != "noise"}
    result = ca.densify(ca.vertcat(*results[:2]))
    return Formula(ca.Function("filter", list(kept.values()), [result], list(kept), ["out"], {"cse": True}))


def _observing(filters: Bank, filtering: str, row: Sequence[str], precision: Precision) -> str:
    """C of the bank of filters: the first state, and a step with the mixture of `observer_function`."""
    n, count, model, settings = _size(filters), filters.num_filters, filters.model, filters.settings
    num_states, nm, nc = len(STATES), len(model.memory), len(model.commands)
    measured = [row.index(name) if name in settings.measured else -1 for name in MEASURED]
    memory = [row.index(name) for name in model.memory]
    commands = [row.index(name) for name in model.commands]
    weather = [row.index(name) if name in row else -1 for name in model.environment]
    wide = np.array([1e3, 1e3, np.pi, 5.0, 1.0, 0.1])
    missing = ~np.isin(MEASURED, settings.measured)
    deviations = filters.first.copy()
    deviations[:, :6] = np.where(missing, wide, np.hypot(2 * filters.noise, filters.first[:, LOW:]))
    places = np.cumsum([0, *sizes(model)])
    table = precision.table
    known = [f"states + k * {n}"]
    known += ["commands"] if nc else []
    known += ["environment"] if weather else []
    known += ["parameters"] if model.parameters else []
    then = [f"numbers + k * {filters.numbers.shape[1]}", "&part", "filtered"]
    return f"""static void begin_filters(real *states, const real *row, real *estimates)
{{
    static const int measured[6] = {{{_whole(measured)}}};
    static const int memory[{max(1, nm)}] = {{{_whole(memory)}}};
    static const int commands[{max(1, nc)}] = {{{_whole(commands)}}};
    static const real variances[{count * num_states}] = {{{table(deviations**2)}}};
    int i, k;
    memset(states, 0, {n * count} * sizeof *states);
    (void)memory;
    for (k = 0; k < {count}; ++k) {{
        real *state = states + k * {n};
        for (i = 0; i < 6; ++i) state[i] = measured[i] < 0 ? 0 : row[measured[i]];
        for (i = 0; i < {num_states}; ++i) state[{num_states} + i * {num_states + 1}] = variances[k * {num_states} + i];
        for (i = 0; i < {nm}; ++i) state[{places[2]} + i] = row[memory[i]];
        for (i = 0; i < {nc}; ++i) state[{places[4]} + i] = row[commands[i]];
    }}
    for (i = 0; i < {LOW}; ++i) estimates[i] = i < 6 ? states[i] : 0;
}}

static void go_filters(real *states, const real *last, const real *row, real dt, const real *parameters, real *estimates)
{{
    static const int measured_at[6] = {{{_whole(measured)}}};
    static const int commands_at[{max(1, nc)}] = {{{_whole(commands)}}};
    static const int environment_at[{max(1, len(weather))}] = {{{_whole(weather)}}};
    static const real numbers[{filters.numbers.size}] = {{{table(filters.numbers)}}};
    const real most = {precision.number(DIVERGED)};
    const real parts = M(fmax)(M(ceil)(dt / {precision.number(filters.longest)} - {precision.number(ROUNDING)}), 1);
    const real part = dt / parts; /* nothing is measured on the way */
    real unseen[6], measured[6], left, commands[{max(1, nc)}], environment[{max(1, len(weather))}];
    real likelihood[{count}], weight[{count}], each[{count}][{LOW}], likely[{n}], best = -INFINITY, sum = 0, ties = 0;
    int sound[{count}], i, k;
    for (i = 0; i < 6; ++i) unseen[i] = NAN;
    for (i = 0; i < 6; ++i) measured[i] = measured_at[i] < 0 ? NAN : row[measured_at[i]];
    for (i = 0; i < {nc}; ++i) commands[i] = last[commands_at[i]];
    for (i = 0; i < {len(weather)}; ++i) environment[i] = environment_at[i] < 0 ? 0 : last[environment_at[i]];
    (void)environment_at;
    (void)environment;
    (void)commands;
    (void)parameters;
    for (k = 0; k < {count}; ++k) {{
        real filtered[{n + LOW}];
        for (left = parts; left > 1; left -= 1) {{
            {filtering}({", ".join([*known, "unseen", *then])});
            memcpy(states + k * {n}, filtered, {n} * sizeof *states);
        }}
        {filtering}({", ".join([*known, "measured", *then])});
        sound[k] = 1;
        for (i = 0; i < {n}; ++i) {{
            if (!(M(fabs)(filtered[i]) < most)) sound[k] = 0;
            states[k * {n} + i] = M(fmin)(M(fmax)(filtered[i], -most), most);
        }}
        for (i = 0; i < {LOW}; ++i) each[k][i] = M(fmin)(M(fmax)(filtered[{n} + i], -most), most);
        likelihood[k] = sound[k] ? states[k * {n} + {n - 1}] : -most;
        if (likelihood[k] > best) best = likelihood[k];
    }}
    memset(likely, 0, sizeof likely);
    for (k = 0; k < {count}; ++k) {{
        weight[k] = M(exp)(likelihood[k] - best);
        sum += weight[k];
        if (likelihood[k] == best) ties += 1;
    }}
    for (k = 0; k < {count}; ++k)
        if (likelihood[k] == best)
            for (i = 0; i < {n}; ++i) likely[i] += states[k * {n} + i] / ties;
    for (i = 0; i < {LOW}; ++i) {{
        estimates[i] = 0;
        for (k = 0; k < {count}; ++k) estimates[i] += each[k][i] * (weight[k] / sum);
    }}
    for (k = 0; k < {count}; ++k)
        if (!sound[k]) memcpy(states + k * {n}, likely, sizeof likely);
}}
"""
