"""Choose velocities and yaw rate: the columns whose integrals are the track and the heading, with unit, frame, sign."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.dates import DAY
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State, names_another, unit_in_name
from shipid.logs.guess.evidence import Complex, Fit
from shipid.logs.guess.words import is_order, meaning_scores
from shipid.logs.mapping import UNITS, is_dated, rate_of_ais, to_si
from shipid.physics.signals import rows_of_role
from shipid.units import GRAVITY

CLEAR = 1.5  # times the unexplained share of the best, that a hypothesis with fitting names may leave
LEFT, NAMED_LEFT = 0.1, 0.5  # unexplained share of the track, at most: of columns without fitting names, and with
SAME = 0.8  # ratio of two unexplained shares, above which neither is better
MISLED = 0.1  # unexplained share of the heading, and distance from a unit, at most: of a rate with a misleading name
FAR = 2.0  # a factor that no sensor has
FASTEST, HARDEST, SLOWEST = 100.0, 20.0, 0.02  # m/s, m/s^2, m/s: no ship goes or turns harder, no trial is slower
FROUDE = 4.0  # U / sqrt(g L): nothing that is steered in trials is faster for its length
OFF_UNIT = 0.15  # relative distance of a fitted scale from a unit
PLAIN, OFF_RARE = ("m/s", "kn", "km/h"), 0.03  # units that logs have, and the same distance for a unit that few have
WHOLE, OFF_AIS = 0.9, 0.2  # share of whole numbers, at least; distance from the unit, of rates that AIS has coded
ALONG = 0.1  # share of the track that a speed along the heading may leave unexplained
TURNED, ONE_WAY = np.radians(0.5), 0.9  # of a track against a course, at least; mean of its directions, at most
EXCHANGED, INWARD = 0.2, 0.5  # ratio of unexplained shares, at most; correlation of a drift into the turn, at least


@dataclass(frozen=True)
class Velocities:
    """A hypothesis: two columns as `earth`-fixed, `body`-fixed, or `mirrored` (the second is positive to port).

    fit : track = scale * integral. named : how well the names fit, 0 to 1. path : the integral, (N,).
    """

    fit: Fit
    first: str
    second: str
    frame: str
    named: float
    path: Complex

    @property
    def cost(self) -> float:
        """Unexplained share of the track, less for fitting names."""
        return (self.fit.left + 0.003) / (0.25 + self.named)


def choose_velocities(state: State) -> None:
    """Choose the two velocity columns, or speed and course over ground, whose integral fits the track best."""
    seen = state.chosen.change(state.position)
    ranked = sorted(_velocity_hypotheses(state, seen), key=lambda entry: entry.cost)
    named = [entry for entry in ranked if entry.named >= 0.45 and entry.fit.left < NAMED_LEFT]
    bound = min(LEFT, 0.7 * min((entry.fit.left for entry in ranked), default=1.0)) if state.numbered else 0.2
    if not named and _choose_speed_and_course(state, seen, bound):
        return
    least = min((entry.fit.left for entry in ranked), default=1.0)
    best = next(iter(ranked), None)
    if best is None or best.fit.left > (NAMED_LEFT if best.named >= 0.45 else LEFT):
        return
    plain = [entry for entry in named if entry.frame == "body"]
    for better in (named[:1], plain[:1]):
        if better and better[0].fit.left < CLEAR * least + 1e-6:
            best = better[0]
    swapped = best.first in state.called("v") and best.second in state.called("u")
    if best.named < 0.45 and not state.numbered and not swapped:
        names = f"{best.first!r} and {best.second!r}"
        state.find(
            "velocities under other names",
            (best.first, best.second),
            0.6,
            f"{names} are not named as velocities, but their integral is the track",
        )
    _take_velocities(state, _side_of_sway(state, best, ranked, seen), ranked)


def _velocity_hypotheses(state: State, seen: Complex) -> Iterator[Velocities]:
    """Yield every ordered pair of columns as earth-fixed, as body-fixed, and as body-fixed with v to port."""
    words = ("u", "v", "velocity_north", "velocity_east")
    named = [name for name in state.eligible() if any(name in state.called(word) for word in words)]
    free = named if len(named) >= 2 and not state.numbered else state.eligible(*words)[:20]
    turn = np.exp(1j * state.psi)
    earth = {name: evidence.integrate_rate(state.t, state.columns[name]) for name in free}
    body = {name: evidence.integrate_rate(state.t, state.columns[name] * turn) for name in free}
    for first in free:
        for second in free:
            if first == second:
                continue
            ahead, north = ((meaning_scores(first).get(word, 0.0)) for word in ("u", "velocity_north"))
            abeam, east = ((meaning_scores(second).get(word, 0.0)) for word in ("v", "velocity_east"))
            for frame, path, score in (
                ("earth", earth[first] + 1j * earth[second], max(min(north, east), 0.5 * min(ahead, abeam))),
                ("body", body[first] + 1j * body[second], min(ahead, abeam)),
                ("mirrored", body[first] - 1j * body[second], 0.9 * min(ahead, abeam)),
            ):
                result = evidence.fit_without_outliers(seen, state.chosen.change(path))
                known = _is_speed_unit(result.scale)
                if result.scale > 0 and (score >= 0.45 or known):
                    yield Velocities(result, first, second, frame, score, path)


def _side_of_sway(state: State, best: Velocities, ranked: list[Velocities], seen: Complex) -> Velocities:
    """The hypothesis or its mirror: by the track with a free arm, else by a ship's drift out of her turn, v r < 0."""
    if best.frame == "earth":
        return best
    other = next(
        (
            e
            for e in ranked
            if (e.first, e.second) == (best.first, best.second) and e.frame not in (best.frame, "earth")
        ),
        None,
    )
    if other is None:
        return best
    turned = state.chosen.change(np.asarray(np.exp(1j * state.psi)))
    left = {}
    for entry in (best, other):
        change = state.chosen.change(entry.path)
        keep = evidence.windows_without_outliers(seen, change)
        left[entry.frame] = evidence.fit_with_arm(seen[keep], change[keep], turned[keep])[0].left
    by_track = min((best, other), key=lambda entry: left[entry.frame])
    ratio = min(left.values()) / max(max(left.values()), 1e-12)
    r = np.gradient(state.psi, state.t)
    drift = float(np.mean(_window_means(state, state.columns[best.second]) * _window_means(state, r)))
    by_drift = {"body": drift < 0, "mirrored": drift > 0}
    if ratio < SAME and by_drift[by_track.frame]:
        return by_track
    if ratio < 0.5 * SAME:
        return by_track
    simple = min((best, other), key=lambda entry: entry.fit.left)
    likely = best if by_drift[best.frame] else other
    if likely is not simple or ratio < SAME:
        state.ask(
            ("v",),
            f"is {best.second!r} positive to starboard? It is drafted so that she drifts out of her turns, as ships "
            "do near midships; the track does not settle it",
        )
    return likely


def _window_means(state: State, values: Array) -> Array:
    """A signal as means over the windows, less its mean, (W,)."""
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    means = state.chosen.change(evidence.integrate_rate(state.t, values)).real / span
    return np.asarray(means - np.mean(means))


def _take_velocities(state: State, best: Velocities, ranked: list[Velocities]) -> None:
    fit, first, second, frame = best.fit, best.first, best.second, best.frame
    pair = {first, second}
    runner = min(
        (e.fit for e in ranked if e.frame != frame and {e.first, e.second} == pair),
        key=lambda one: one.left,
        default=None,
    )
    unit, rest = _fitted_speed_unit(fit, (first, second), state)
    factor = to_si(unit, "u")
    contrast = 1.0 - fit.left / runner.left if runner is not None and runner.left > 0 else 1.0
    confidence = float(np.clip(0.6 + 0.4 * contrast, 0.0, 0.99)) * (1 - min(0.5, fit.left))
    swapped = first in state.all_called("v") and second in state.all_called("u")
    confidence = confidence if best.named >= 0.45 or state.numbered or swapped else min(confidence, 0.59)
    if frame == "earth" and contrast < 0.2:
        state.ask(
            ("u", "v"), f"are {first!r} and {second!r} north and east velocities, or along and across the heading?"
        )
    fixed = "earth" if frame == "earth" else "body"
    why = f"integrated as {fixed}-fixed [{unit}] they leave {100 * fit.left:.2g} % of the track unexplained"
    if runner is not None:
        why += f", otherwise {100 * runner.left:.2g} %"
    in_unit = state.columns[first] * factor, state.columns[second] * factor
    extra_v: dict[str, Any] = {}
    if frame == "earth":
        extra = {"frame": "earth"}
        if meaning_scores(first).get("u", 0.0) > meaning_scores(first).get(
            "velocity_north", 0.0
        ) and first in state.all_called("u"):
            state.find(
                "earth-fixed velocities",
                (first, second),
                confidence,
                f"{first!r} and {second!r} are named like body-fixed velocities, but are the rates of north and east",
            )
    else:
        extra = {}
        if frame == "mirrored":
            state.find(
                "wrong sign of v",
                (second,),
                confidence,
                f"{second!r} is positive to port: the track is met with its sign changed",
            )
            extra_v = {"sign": -1}
        if swapped:
            state.find(
                "u and v swapped", (first, second), confidence, f"{first!r} is along the heading, {second!r} across it"
            )
    state.suggest("u", first, unit, confidence, why, **extra)
    state.suggest("v", second, unit, confidence, why, **extra, **extra_v)
    velocity = in_unit[0] + 1j * in_unit[1] * (-1 if frame == "mirrored" else 1)
    turn = np.exp(1j * state.psi)
    state.body = np.asarray(velocity / turn if frame == "earth" else velocity)
    fit = Fit(fit.scale / factor, fit.error / factor, fit.left)
    along = "" if frame == "earth" else next((one.source for one in state.suggestions if one.name == "psi"), "psi")
    ground = velocity if frame == "earth" else velocity * turn
    fit, state.velocity = _as_track(state, fit, np.asarray(ground), (first, second), along=along)
    _report_factor(state, rest, fit, (first, second), unit)


def _fitted_speed_unit(fit: Fit, sources: tuple[str, str], state: State, quiet: bool = False) -> tuple[str, bool]:
    """The unit nearest to the fitted scale, and whether a factor remains; report another unit in the name."""
    units = UNITS["m/s"]
    unit = min(PLAIN, key=lambda name: abs(np.log(max(fit.scale, 1e-9) / units[name])))
    written = unit_in_name(sources[0], "m/s")
    rare = next((name for name in units if name not in PLAIN and abs(fit.scale / units[name] - 1) < OFF_RARE), None)
    clocked = next(
        (one for one in ((written,) if written else PLAIN) if _clock_unit(state, fit.scale / units[one])), None
    )
    if clocked and (rare is None or not is_possible(state)):
        return clocked, True
    if clocked and rare != written:
        other = _clock_unit(state, fit.scale / units[clocked])
        words = f"in {rare} and the clock in {state.clock_unit}, or in {clocked} and the clock in {other}"
        state.ask(("t", "u", "v", "speed"), f"is {sources[0]!r} {words}? The track is the same")
    near = written in PLAIN and abs(fit.scale / units[written] - 1) < OFF_UNIT  # a factor, and no mile per hour
    if rare and abs(fit.scale / units[unit] - 1) > OFF_UNIT / 2 and not near:
        unit = rare
    if (
        written is not None
        and abs(fit.scale / units[written] - 1) < OFF_UNIT
        and abs(fit.scale / units[unit] - 1) > 0.05
    ):
        unit = written
    if unit != (written or (unit if quiet and unit in PLAIN else "m/s")) and abs(fit.scale / units[unit] - 1) < 0.08:
        word = "knots" if "kn" in (unit, written) else "speed unit"
        wanted = f"the name says {written}" if written else "nothing says so"
        state.find(
            word,
            sources,
            0.95,
            f"the track is {fit.scale:.3f} times the integral: {sources[0]!r} is in {unit} ({wanted})",
        )
    elif written is not None and abs(fit.scale / units[unit] - 1) >= 0.08:
        unit = written
    return unit, abs(fit.scale / units[unit] - 1) > 0.004


def _is_speed_unit(scale: float) -> bool:
    away = {unit: abs(scale / factor - 1) for unit, factor in UNITS["m/s"].items()}
    return any(distance < (OFF_UNIT if unit in PLAIN else OFF_RARE) for unit, distance in away.items())


def _clock_unit(state: State, ratio: float) -> str | None:
    """The unit of the clock with which the track would be the integral, if it is `ratio` times the integral."""
    if state.clock_unit == "date":
        return None
    now = DAY if is_dated(state.clock_unit) else to_si(state.clock_unit, "t")
    others = {unit: factor / now for unit, factor in UNITS["s"].items() if not is_dated(unit) and factor != now}
    return next((unit for unit, factor in others.items() if abs(ratio / factor - 1) < OFF_RARE), None)


def _report_factor(
    state: State, remains: bool, fit: Fit, sources: tuple[str, ...], unit: str, columns: tuple[str, ...] = ("u", "v")
) -> None:
    pair = " and ".join(repr(source) for source in sources)
    begins = f"the track is {fit.scale:.4g} times the integral of {pair} in {unit}"
    if (other := _clock_unit(state, fit.scale)) is not None:
        state.find(
            "clock unit",
            sources,
            0.9,
            f"{begins}: a clock in {other}, not {state.clock_unit}, or another unit of the positions would explain it",
        )
        state.ask(("t", *columns), f"is the clock in {other}? The draft says {state.clock_unit}, with which {begins}")
        return
    if not 1 / FAR <= fit.scale <= FAR:
        state.find(
            "factor", sources, 0.6, f"{begins}: the unit of the clock, of the positions or of the speeds is another one"
        )
        state.ask(("t", *columns), f"are the units of the clock, of the positions and of {pair} right? {begins}")
        return
    per_knot = 1.0 / (UNITS["m/s"]["kn"] / UNITS["m/s"][unit])
    rounds = [evidence.value_lattice(state.columns[source], 0.85 * per_knot, 1.15 * per_knot) for source in sources]
    near = [entry for entry in rounds if entry[1] > 0.9]
    if near and unit != "kn":
        multiplier, _, count = max(near, key=lambda entry: entry[2])
        factor = multiplier / per_knot
        if abs(factor - fit.scale) < max(0.03, 3 * fit.error) and abs(factor - 1.0) > 1e-3:
            sentence = (
                f"{count} values are round in knots if these were divided by {multiplier:.4f}, not {per_knot:.4f}"
            )
            sentence += f" (the track says {fit.scale:.3f} +- {fit.error:.3f})"
            repair = {"kind": "scale", "columns": list(columns), "factor": round(factor, 4)}
            state.find("factor", sources, 0.95, sentence, repair)
        return
    off = abs(fit.scale - 1.0)
    if not remains or not np.isfinite(fit.error) or off < max(3 * fit.error, 0.004):
        return
    sure = float(np.clip(off / (5 * fit.error + 1e-9), 0.2, 0.9))
    sentence = f"the track is {fit.scale:.4f} +- {fit.error:.4f} times the integral of {pair} in {unit}"
    repair = {"kind": "scale", "columns": list(columns), "factor": round(fit.scale, 4)}
    state.find("factor", sources, sure, sentence, repair)


def _choose_speed_and_course(state: State, seen: Complex, bound: float) -> bool:
    """Take speed and course over ground, if the log has them, instead of velocities.

    bound : unexplained share of the track, at most.
    """
    speeds, courses = state.called("speed"), [name for name in state.called("course") if not is_order(name)]
    if state.numbered:
        speeds = courses = state.eligible()
    best: tuple[float, str, str, str, Fit, Complex] | None = None
    for course in courses:
        for turn in ("deg", "rad"):
            way = np.exp(1j * state.angle(course, turn))
            for speed in speeds:
                if speed == course:
                    continue
                path = evidence.integrate_rate(state.t, state.columns[speed] * way)
                fit = evidence.fit_without_outliers(seen, state.chosen.change(path))
                score = 0.0 if state.numbered else meaning_scores(speed)["speed"] + meaning_scores(course)["course"]
                cost = (
                    (fit.left + 0.003)
                    / (0.3 + score)
                    * (0.7 if turn == (unit_in_name(course, "rad") or "deg") else 1.0)
                )
                known = _is_speed_unit(fit.scale)
                if (
                    (known or (score >= 1.5 and fit.scale > 0))
                    and fit.left < bound
                    and (best is None or cost < best[0])
                ):
                    best = (cost, speed, course, turn, fit, way)
    if best is None:
        return False
    _, speed, course, turn, fit, way = best
    unit, rest = _fitted_speed_unit(fit, (speed, course), state, quiet=True)
    factor = to_si(unit, "u")
    why = f"along the course [{turn}] it leaves {100 * fit.left:.2g} % of the track unexplained"
    state.suggest("speed", speed, unit, 0.9, why)
    state.suggest("course", course, turn, 0.9, why, wrap=True)
    state.velocity = np.asarray(to_si(unit, "u") * state.columns[speed] * way)
    state.body = np.asarray(state.velocity * np.exp(-1j * state.psi))
    fit = Fit(fit.scale / factor, fit.error / factor, fit.left)
    if not _ask_heading_and_course(state, seen, speed, course, fit):
        fit, state.velocity = _as_track(state, fit, state.velocity, (course,), turn)
    _report_factor(state, rest, fit, (speed,), unit, ("speed",))
    return True


def _ask_heading_and_course(state: State, seen: Complex, speed: str, course: str, fit: Fit) -> bool:
    """Ask whether heading and course are exchanged: the speed runs along the heading, not along the course."""
    assert state.body is not None
    change = state.chosen.change(evidence.integrate_rate(state.t, state.columns[speed] * np.exp(1j * state.psi)))
    if evidence.fit_without_outliers(seen, change).left > EXCHANGED * fit.left:
        return False
    r = np.gradient(state.psi, state.t)
    inward = np.corrcoef(_window_means(state, state.body.imag), _window_means(state, r))[0, 1]
    if not inward > INWARD:
        return False
    heading = next((one.source for one in state.suggestions if one.name == "psi"), "psi")
    state.ask(
        ("psi", "course", "v"),
        f"are {heading!r} and {course!r} exchanged? The ship moves along {heading!r}, and drifts into her turns"
        f": no ship does. Then exchange them here",
    )
    return True


def _as_track(
    state: State, fit: Fit, velocity: Complex, sources: tuple[str, ...], unit: str = "deg", along: str = ""
) -> tuple[Fit, Complex]:
    """Ask where the track is turned against velocities over ground (N,) [m/s]; return both as turned with it."""
    seen, ran = (state.chosen.change(one) for one in (state.position, evidence.integrate_rate(state.t, velocity)))
    keep = evidence.windows_without_outliers(seen, ran) & (np.abs(ran) > 0.3 * np.percentile(np.abs(ran), 90))
    if keep.sum() < 20 or abs(complex(np.mean(ran[keep] / np.abs(ran[keep])))) > ONE_WAY:
        return fit, velocity
    angles = np.angle(seen[keep] * np.conj(ran[keep]))
    rates = state.chosen.change(state.psi).real[keep]
    design = np.stack([np.ones_like(rates), rates], axis=1)
    (angle, slope), *_ = np.linalg.lstsq(design, angles, rcond=None)
    parts = [float(np.mean(part)) for part in np.array_split(angles - slope * rates, 10)]
    error = 1.25 * float(np.std(parts)) / np.sqrt(len(parts))
    if not max(TURNED, 5 * error) < abs(angle) < np.pi / 4:
        return fit, velocity
    names = " and ".join(map(repr, sources))
    words = f"the track is turned by {np.degrees(angle):+.1f} +- {np.degrees(error):.1f} deg against {names}"
    if along:
        heading = next((one.unit for one in state.suggestions if one.name == "psi"), "rad")
        words += f" along {along!r}: is the heading off, or the north of the positions another? Then write "
        state.ask(("psi", "u", "v"), f"{words}offset = {angle / to_si(heading, 'psi'):.4g} ({heading}) for psi")
        turn = np.exp(1j * angle)
        return evidence.fit_scale(seen[keep], ran[keep] * turn), np.asarray(velocity * turn)
    words += ": is their north another than that of the positions, as that of a map or of a compass?"
    remedy = f"offset = {angle / to_si(unit, 'psi'):.4g} ({unit}) for course, and for psi, too, if it counts so"
    remedy = f"Then write {remedy}" if len(sources) == 1 else "Then turn the positions, or these"
    state.ask(("psi", "course", "u", "v"), f"{words} {remedy}")
    turn = np.exp(1j * angle)
    return evidence.fit_scale(seen[keep], ran[keep] * turn), np.asarray(velocity * turn)


def ship_pace(state: State) -> tuple[float, float]:
    """How fast the ship goes [m/s] and turns [m/s^2] by the drafted clock: nine of ten windows have less."""
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    speeds = np.abs(state.chosen.change(state.position)) / span
    rates = np.abs(state.chosen.change(state.psi)) / span
    return float(np.percentile(speeds, 90)), float(np.percentile(speeds * rates, 90))


def is_possible(state: State, length: float = np.inf) -> bool:
    """Whether a ship of this length [m] may go and turn as this one does by the drafted clock."""
    speed, across = ship_pace(state)
    return SLOWEST < speed < min(FASTEST, FROUDE * np.sqrt(GRAVITY * length)) and across < HARDEST


def check_clock(state: State, length: float = np.inf) -> None:
    """Ask for the unit of the clock where no ship goes so fast, or so slowly. length : of the ship [m], if known."""
    if any("t" in question.about for question in state.questions) or _ask_clock_by_speed(state):
        return
    if is_possible(state, length):
        return
    speed, across = ship_pace(state)
    state.ask(
        ("t", "north", "east"),
        f"by the drafted clock, in {state.clock_unit}, the ship goes {speed:.3g} m/s and turns at {across:.3g} m/s^2"
        f": are the units of the clock and of the positions right?",
    )


def _ask_clock_by_speed(state: State) -> bool:
    """Ask where a recorded speed along the heading gives the track only with a clock in another unit, as in minutes."""
    seen, way = state.chosen.change(state.position), np.exp(1j * state.psi)
    for name in state.called("speed"):
        written = unit_in_name(name, "m/s")
        fit = evidence.fit_scale(seen, state.chosen.change(evidence.integrate_rate(state.t, state.columns[name] * way)))
        if fit.left > ALONG:
            continue
        for unit in (written,) if written is not None else PLAIN:
            ratio = fit.scale / to_si(unit, "u")
            other = _clock_unit(state, ratio)
            if other is not None:
                begins = f"the track is {ratio:.4g} times the integral of {name!r} in {unit}"
                state.ask(
                    ("t", "north", "east"),
                    f"is the clock in {other}? The draft says {state.clock_unit}, with which {begins}",
                )
                return True
    return False


def choose_yaw_rate(state: State, most: float = 0.3) -> None:
    """Choose the yaw rate: the column whose integral fits the heading best; a fitting name wins if nearly as good.

    most : share of the heading's change that a column without a fitting name may leave unexplained.
    """
    change = state.chosen.change(state.psi)
    if float(np.std(change)) < np.radians(0.5):
        _rate_by_name(state)
        return
    called = state.all_called("r")
    for name in state.called("r"):
        _take_ais(state, change, name)
    candidates = [
        entry
        for entry in _rate_candidates(state, change, state.eligible("r"))
        if entry[1] in called
        or entry[0].left < MISLED
        or not meaning_scores(entry[1]).keys() & rows_of_role("command").keys()
    ]  # a large ship may turn by as many deg/min as her rudder has degrees
    by_name = [
        entry for entry in candidates if entry[1] in called and entry[0].left < CLEAR * candidates[0][0].left + 0.1
    ]
    if not state.numbered and (not candidates or (not by_name and candidates[0][0].left > most)):
        # a name that says something else misleads, if the integral of its column is the heading to within little
        others = [name for name in state.free() if np.ptp(state.columns[name]) > 0 and not names_another(name, "r")]
        candidates = [
            entry for entry in _rate_candidates(state, change, others) if entry[0].left < MISLED and entry[3] < MISLED
        ]
    if not candidates or (not by_name and candidates[0][0].left > most):
        if called and not state.numbered and called[0] in state.free():
            state.find(
                "yaw rate does not fit",
                (called[0],),
                0.6,
                f"{called[0]!r} is named as a yaw rate, but its integral is not the heading: it is not used",
            )
        return
    fit, name, unit, _ = by_name[0] if by_name else candidates[0]
    extra: dict[str, Any] = {}
    why = f"integrated in {unit} it leaves {100 * fit.left:.2g} % of the heading's change unexplained"
    confidence = 0.99 * (1 - min(0.5, fit.left))
    if fit.scale < 0:
        extra["sign"] = -1
        state.find("wrong sign of r", (name,), confidence, f"{name!r} is positive where the heading falls")
    if name not in called and not name.isdecimal():
        other = f", which {called[0]!r} is not" if called else ""
        state.find("yaw rate under another name", (name,), confidence, f"{name!r} is the rate of the heading{other}")
    written = unit_in_name(name, "rad/s")
    if written is not None and written != unit:
        state.find("unit of r", (name,), confidence, f"{name!r} says {written}, but is in {unit}")
    state.suggest("r", name, unit, confidence, why, **extra)
    state.r = state.columns[name] * to_si(unit, "r") * extra.get("sign", 1)


def _take_ais(state: State, change: Complex, name: str) -> None:
    coded = state.columns[name]
    if unit_in_name(name, "rad/s") is not None or np.abs(coded).max() > 128 or np.mean(coded % 1 == 0) < WHOLE:
        return
    rates = rate_of_ais(coded)
    known = np.isfinite(rates)
    if known.sum() < 2:
        return
    rates = np.interp(state.t, state.t[known], rates[known])
    fits_ = [
        evidence.fit_scale(change, state.chosen.change(evidence.integrate_rate(state.t, one))) for one in (coded, rates)
    ]
    off = abs(abs(fits_[1].scale) / to_si("ais", "r") - 1)
    if fits_[1].left > min(NAMED_LEFT, fits_[0].left) or off > OFF_AIS:
        return
    state.columns[name] = rates
    state.units[name] = "ais"
    state.find("unit of r", (name,), 0.9, f"{name!r} has the numbers that AIS writes, 4.733 times the root of deg/min")
    if not known.all():
        state.find(
            "missing values",
            (name,),
            0.95,
            f"{name!r} is 127, -127 or -128 in {int((~known).sum())} rows, with which AIS says no rate",
        )


def _rate_candidates(state: State, change: Complex, names: list[str]) -> list[tuple[Fit, str, str, float]]:
    """The columns whose integral resembles the heading, the best first: fit, name, unit, relative distance from it.

    change : of the heading over the windows [rad], (W,).
    """
    rates = []
    for name in names:
        fit = evidence.fit_scale(change, state.chosen.change(evidence.integrate_rate(state.t, state.columns[name])))
        scale = max(abs(fit.scale), 1e-12)
        unit, factor = min(UNITS["rad/s"].items(), key=lambda entry: abs(np.log(scale / entry[1])))
        off = abs(scale / factor - 1)
        if fit.left < 0.5 and off < 0.35:
            rates.append((fit, name, unit, off))
    return sorted(rates, key=lambda entry: entry[0].left)


def _rate_by_name(state: State) -> None:
    for name in state.called("r")[:1]:
        unit = unit_in_name(name, "rad/s") or "deg/s"
        state.suggest("r", name, unit, 0.4, "by its name; the ship turns too little to see unit and sign")
