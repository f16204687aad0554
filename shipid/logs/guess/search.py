"""One search for the motion in a log: which columns are position, heading, velocities and yaw rate of one rigid body.

A hypothesis assigns columns with their unit and sense. Its cost is the sum, over the relations of planar kinematics
(course along heading, integrated velocities along the track, integrated rate along the heading), of the logarithm of
the share of the motion that is left unexplained, and of what names and units speak against it. All is done in the
plane of the log; where its axes point is read last, from names, compass and course.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations, permutations, product
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pymap3d import geodetic2ned

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.frames import PARALLEL, meridian_convergence
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State, names_another
from shipid.logs.guess.evidence import Complex, Fit
from shipid.logs.guess.scales import TURNS, turn_of_jumps
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import is_magnetic, is_order, may_be_measured, meaning_scores, name_parts, unit_in_name
from shipid.logs.mapping import UNITS, to_si
from shipid.physics.signals import rows_of_role

Frame = Literal["ned", "enu", "zup", "ros"]
"""Where x, y point and from where the heading counts: north, east, clockwise from north; east, north, clockwise from
north; ahead and to port, counter-clockwise; east, north, counter-clockwise from east."""
COMPASS = frozenset("heading compass gyro course prow psi steered".split())
DIRECTIONS = frozenset("north east este".split())
OTHER_WAY = frozenset("w west ouest oeste vest south sud sur syd zuid".split())
"""Parts of the name of a longitude or latitude that counts to the west or south."""
YAW = frozenset(["yaw", "theta"])
MOST_COLUMNS, MOST_WINDOWS = 24, 400  # that are tried where no name helps; in the first ranking
PLAIN = ("m/s", "kn", "km/h")  # units of speed that logs usually have
VELOCITIES = ("u", "v", "velocity_north", "velocity_east")
WAYS = ("north", "east", "south", "west")


@dataclass(frozen=True)
class Sense:
    """How an angle counts: direction = sign * value + quarter * 90 deg, from the first axis towards the second."""

    sign: int = 1
    quarter: int = 0

    def direction(self, angle: Array) -> Array:
        """The direction [rad] (N,) of an angle [rad] (N,)."""
        return np.asarray(self.sign * angle + self.quarter * np.pi / 2)


@dataclass(frozen=True)
class Axes:
    """Where the axes of the log point. swap : the first to east. north, east : -1 where it counts the other way."""

    swap: bool = False
    north: int = 1
    east: int = 1

    @property
    def hand(self) -> int:
        """-1 where port and starboard change places."""
        return self.north * self.east * (-1 if self.swap else 1)

    def place(self, plane: Complex) -> Complex:
        """A point or vector of the plane of the log as north + i east."""
        turned = 1j * np.conj(plane) if self.swap else plane
        return np.asarray(self.north * turned.real + 1j * self.east * turned.imag)

    def sense(self, of: Sense) -> Sense:
        """The sense of an angle of the plane of the log, counted clockwise from north."""
        sign, quarter = (-of.sign, 1 - of.quarter) if self.swap else (of.sign, of.quarter)
        sign, quarter = (sign, quarter) if self.north > 0 else (-sign, 2 - quarter)
        sign, quarter = (sign, quarter) if self.east > 0 else (-sign, -quarter)
        return Sense(sign, (quarter + 1) % 4 - 1)


ALL_AXES = [Axes(swap, north, east) for swap in (False, True) for north in (1, -1) for east in (1, -1)]
FRAMES = {
    "ned": (Axes(), Sense()),
    "enu": (Axes(True), Sense()),
    "zup": (Axes(east=-1), Sense(-1)),
    "ros": (Axes(True), Sense(-1, 1)),
}
"""Frame -> where the axes of the log point, and how its heading counts from north."""


@dataclass(frozen=True)
class Place:
    """Two columns as a position: along the first and the second axis, or latitude and longitude; cost of the names."""

    first: str
    second: str
    on_globe: bool
    cost: float


@dataclass(frozen=True)
class Pose:
    """A hypothesis of position and heading: a whole `turn` of the heading in its unit, its sense in the plane.

    misfit : 1 - mean cosine of the angle between track and heading.
    """

    place: Place
    heading: str
    turn: float
    sense: Sense
    misfit: float
    cost: float

    @property
    def unit(self) -> str:
        """Unit of the heading; degrees where the column is scaled to them."""
        return "rad" if self.turn < 7.0 else "deg"


@dataclass(frozen=True)
class Velocity:
    """A hypothesis of velocities: `body`, `earth` or `course` (speed, and course in units of `turn`).

    side : 1 where the second counts along the second axis, or to the side to which that axis is. ground : (N,) in the
    plane and the unit of the log. unsure : whether the track leaves the side
    open, or the ship drifts into its turns along this course.
    """

    kind: str
    first: str
    second: str
    side: int
    ground: Complex
    named: float
    turn: float = 360.0
    sense: Sense = Sense()
    fit: Fit = field(default=Fit(0.0, np.inf, 1.0))
    cost: float = 0.0
    unsure: bool = False

    @property
    def sure(self) -> float:
        """How well the names have to fit."""
        return 0.75 if self.kind == "course" else 0.45


@dataclass(frozen=True)
class Rate:
    """A hypothesis of the yaw rate: its unit, and its fit to the heading, positive as the heading in the plane."""

    name: str
    unit: str
    fit: Fit
    cost: float


@dataclass(frozen=True)
class MotionReading:
    """A hypothesis of the whole motion, with where its axes point, and where nearly as likely."""

    pose: Pose
    velocity: Velocity | None
    rate: Rate | None
    axes: Axes
    cost: float
    settled: str = ""
    rivals: tuple[Axes, ...] = ()


# --- hypotheses ---


def search_motion(state: State, file: Path, frame: Frame | None = None) -> list[MotionReading]:
    """The hypotheses of the motion, the likeliest first; `state.chosen` is then for the turns of this ship.

    Raises DataError if no column can be the position or the heading, or if the ship does not move as in that frame.
    """
    places, headings = list(_named_places(state)), _named_headings(state)
    for again in (True, False):
        poses = _rank_poses(state, places, headings)
        if not poses or poses[0].misfit > SETTINGS.poor:
            poses = _pose_beyond_names(state, poses, places, headings)
        if again and poses:
            theta = _plane_heading(state, poses[0])
            state.chosen = evidence.row_windows(state.t, evidence.window_length(state.t, theta, state.chosen))
    if not poses or (poses[0].misfit > SETTINGS.poor and not (places and headings)):
        raise DataError(_what_is_missing(state, bool(places)), file=file)
    kept = [one for one in poses if one.cost < poses[0].cost + 6.0][: SETTINGS.beam]
    motions = [motion for pose in kept if (motion := _motion_of_pose(state, pose, frame)) is not None]
    if not motions:
        best = poses[0]
        fitting = [name for name in get_args(Frame) if _motion_of_pose(state, best, name) is not None]
        what = ", ".join(map(repr, (best.place.first, best.place.second, best.heading)))
        message = f"the ship does not move as in {frame}: {what} fit {' or '.join(fitting)}"
        if best.place.on_globe:
            message = "latitude and longitude have no other frame: leave it out"
        raise DataError(message, file=file, path="--frame")
    return sorted(motions, key=lambda one: one.cost)


def _named_places(state: State) -> Iterator[Place]:
    """Yield pairs of columns whose names say a position; latitude and longitude changed round, too, at a cost."""
    for first, second, on_globe in (("latitude", "longitude", True), ("north", "east", False), ("x", "y", False)):
        for north, east in product(state.called(first), state.called(second)):
            named = (meaning_scores(north).get(first, 0.0) + meaning_scores(east).get(second, 0.0)) / 2
            cost = -np.log(SETTINGS.unnamed + named)
            for a, b, more in ((north, east, 0.0), (east, north, SETTINGS.odd + 1.0)):
                if a != b and (a == north if not on_globe else _within_globe(state, a, b)):
                    yield Place(a, b, on_globe, float(cost + more))


def _named_headings(state: State) -> list[str]:
    turned = [name for name, unit in state.units.items() if unit == "quaternion"]
    names = [name for name in state.all_called("psi") if not is_order(name) or may_be_measured(name)]
    names = [name for name in names if not is_magnetic(name)] or names  # beside a true one it is a second one
    courses = _logged_courses(state, "")
    names = turned + [name for name in names if name not in {*courses, *turned}] or names
    if not names:  # of a plane x, y, theta, which takes more than a quarter of a turn, as no pitch does
        names = [
            name
            for name in state.called("theta")
            if np.ptp(state.columns[name]) * to_si(_angle_unit(state, name), "psi") > np.pi / 2
        ]
    return names


def _angle_unit(state: State, name: str) -> str:
    return unit_in_name(name, "rad") or ("deg" if np.abs(state.columns[name]).max() > 2.2 * np.pi else "rad")


def _pose_beyond_names(state: State, named: list[Pose], places: list[Place], headings: list[str]) -> list[Pose]:
    """Poses of columns whose names do not say it, where those named do not fit together."""
    meanings = ("north", "east", "x", "y", "latitude", "longitude", "psi")
    free = [name for name in state.eligible(*meanings) if len(np.unique(state.columns[name][:2000])) > 10]
    free = free[:MOST_COLUMNS]
    cost = -float(np.log(SETTINGS.unnamed))
    lengths = [name for name in free if state.units.get(name) != "quaternion"]
    globe = [(a, b) for a, b in permutations(lengths, 2) if _may_be_globe(state, a, b)]
    plane = [pair for pair in combinations(lengths, 2) if not {pair, pair[::-1]} & {*globe}]
    wide = [Place(a, b, False, cost) for a, b in plane] + [Place(a, b, True, cost) for a, b in globe]
    courses = _logged_courses(state, "") if headings else []  # which fit a track better than any heading
    ways = [name for name in dict.fromkeys([*headings, *free]) if name not in courses]
    found = _rank_poses(state, [*places, *wide], ways)
    found = [one for one in found if one.misfit < SETTINGS.poor]
    return sorted([*named, *(one for one in found if one not in named)], key=lambda one: one.cost)


def _rank_poses(state: State, places: list[Place], headings: list[str]) -> list[Pose]:
    """Every position with every heading in every unit, the cheapest first: how well the track keeps to the heading."""
    middle = (state.chosen.first + state.chosen.last) // 2
    thin = max(1, len(middle) // MOST_WINDOWS)
    named = {*state.all_called("psi"), *(name for name, unit in state.units.items() if unit == "quaternion")}
    turned: list[tuple[str, float, float, Complex]] = []
    for name in headings:
        if name not in named and np.ptp(state.columns[name]) * to_si(_angle_unit(state, name), "psi") < SETTINGS.turned:
            continue  # anything that hardly changes keeps to a straight course
        score = 1.0 if name in state.units else meaning_scores(name).get("psi", 0.0)  # a quaternion is of a pose
        cost = -np.log(SETTINGS.unnamed + score * (1.0 if name in named else 0.2))
        for turn, more in _turns_of_angle(state, name):
            turned.append((name, turn, float(cost + more), np.exp(1j * _angle(state, name, turn)[middle][::thin])))
    poses = []
    for place in places:
        track = state.chosen.change(local_plane(state, place.first, place.second, place.on_globe))[::thin]
        size = float(np.sum(np.abs(track)))
        for name, turn, cost, way in turned if size > 0 else ():
            if name in (place.first, place.second):
                continue
            ranked = senses_of_angle(track, way)
            spread = 1.0 - abs(complex(np.mean(way)))
            alike = ranked[1][0] < 2.0 * max(ranked[0][0], 1e-9) or spread < SETTINGS.spread
            if ranked[0][0] > SETTINGS.poor:  # a ship that drifts far: any sense that is not against the track
                ranked += [
                    one
                    for one in senses_by_quarters(track, way)
                    if one[0] < 1.0 and one[1] not in dict(ranked).values()
                ]
            for misfit, sense in ranked if alike else ranked[:1]:
                across = SETTINGS.left * (sense.sign > 0 and sense.quarter != 0)
                share = (misfit + SETTINGS.floor + across) / (spread + SETTINGS.spread)
                poses.append(Pose(place, name, turn, sense, misfit, place.cost + cost + float(np.log(share))))
    return sorted(poses, key=lambda one: one.cost)


def senses_of_angle(track: Complex, way: Complex) -> list[tuple[float, Sense]]:
    """How an angle, exp(i angle) (W,), may count in the plane of a track (W,): misfit and sense, the better first."""
    senses = [
        (1.0 - abs(mean), Sense(sign, (round(float(np.angle(mean)) / (np.pi / 2)) + 1) % 4 - 1))
        for sign, mean in _mean_turns(track, way)
    ]
    return sorted(senses, key=lambda one: one[0])


def senses_by_quarters(track: Complex, way: Complex) -> list[tuple[float, Sense]]:
    """All senses of an angle, exp(i angle) (W,), in the plane of a track (W,), with their misfits."""
    return [
        (1.0 - (mean * np.exp(-0.5j * np.pi * one)).real, Sense(sign, one))
        for sign, mean in _mean_turns(track, way)
        for one in range(-1, 3)
    ]


def _mean_turns(track: Complex, way: Complex) -> list[tuple[int, complex]]:
    """Sign of an angle, exp(i angle) (W,), and the mean of a track (W,) seen from the angle where it counts so."""
    size = max(float(np.sum(np.abs(track))), 1e-12)
    return [(sign, complex(np.sum(track * one)) / size) for sign, one in ((1, np.conj(way)), (-1, way))]


def _turns_of_angle(state: State, name: str) -> Iterator[tuple[float, float]]:
    """Yield whole turns in the units that an angle may have, and the cost of each."""
    values, written = state.columns[name], unit_in_name(name, "rad")
    if name in state.units or name in state.scaled:
        written = "rad" if state.units.get(name) == "quaternion" else "deg"
    jumps = turn_of_jumps(values)
    for turn in (360.0, 2 * np.pi, *TURNS):
        usual = turn in (360.0, 2 * np.pi)
        cost = SETTINGS.usual_unit * (turn != 360.0) if usual else SETTINGS.odd
        if jumps is not None or written is not None:
            named = written is not None and to_si(written, "psi") * turn == 2 * np.pi
            cost = 0.0 if named or turn == jumps else SETTINGS.odd
        if usual or (jumps == turn) or (written is None and 360.5 < values.max() <= turn and values.min() >= 0.0):
            yield turn, cost


def _angle(state: State, name: str, turn: float) -> Array:
    """An angle [rad] (N,), unwrapped, of a column with so much in a whole turn."""
    return 2 * np.pi / turn * evidence.heal_angle(state.columns[name], turn, state.t)[0]


def _plane_heading(state: State, pose: Pose) -> Array:
    return pose.sense.direction(_angle(state, pose.heading, pose.turn))


def _motion_of_pose(state: State, pose: Pose, frame: str | None) -> MotionReading | None:
    """The motion with this pose; None where it cannot be in the frame."""
    place = pose.place
    if frame is not None and pose.misfit > SETTINGS.poor:  # the track does not say the sense, the frame does
        axes, sense = FRAMES[frame]
        pose = next(
            one
            for sign in (1, -1)
            for quarter in range(-1, 3)
            if axes.sense((one := replace(pose, sense=Sense(sign, quarter))).sense) == sense
        )
    plane = local_plane(state, place.first, place.second, place.on_globe)
    theta = _plane_heading(state, pose)
    seen = state.chosen.change(plane)
    velocities = sorted(_velocity_hypotheses(state, pose, seen, theta), key=lambda one: one.cost)[:4]
    rates = sorted(_rate_hypotheses(state, pose, theta), key=lambda one: one.cost)[:4]
    pairs = [
        (velocity, rate)
        for velocity, rate in product([*velocities, None], [*rates, None])
        if velocity is None or rate is None or rate.name not in (velocity.first, velocity.second)
    ]
    velocity, rate = min(pairs, key=lambda pair: sum(one.cost if one else SETTINGS.odd for one in pair))
    readings = sorted(_readings(state, pose, seen, frame), key=lambda one: one[0])
    if not readings:
        return None
    (cost, axes, settled), *others = readings
    total = pose.cost + cost + sum(one.cost for one in (velocity, rate) if one is not None and one.cost < 0.0)
    rivals = tuple(other for more, other, _ in others if more < cost + SETTINGS.close)
    return MotionReading(pose, velocity, rate, axes, total, settled, rivals)


# --- where the axes point ---


def _readings(state: State, pose: Pose, seen: Complex, frame: str | None) -> Iterator[tuple[float, Axes, str]]:
    """Yield what the axes of the log may be, with the cost of each, and which other column shows it."""
    place, compass = pose.place, _is_compass(pose.heading)
    if frame is not None:
        axes, sense = FRAMES[frame]
        if not place.on_globe and axes.sense(pose.sense) == sense:
            yield 0.0, axes, f"--frame {frame}"
        return
    others = [*_course_axes(state, pose, seen), *_velocity_axes(state, place, seen)] if pose.misfit < 0.5 else []
    plain = not place.on_globe and not all(
        meaning_scores(name).get(way, 0.0) > 0.9 and not {"x", "y"} & meaning_scores(name).keys()
        for name, way in ((place.first, "north"), (place.second, "east"))
    )
    for axes in ALL_AXES:
        cost = _sense_cost(axes.sense(pose.sense), compass, plain and pose.sense == Sense())
        first, second = ("east", "north") if axes.swap else ("north", "east")
        if place.on_globe:
            if axes.swap:
                continue
            cost += sum(_side_cost(state, *one) for one in ((place.first, axes.north), (place.second, axes.east)))
        else:
            cost += _axis_cost(place.first, first, axes.east if axes.swap else axes.north)
            cost += _axis_cost(place.second, second, axes.north if axes.swap else axes.east)
        told = ""
        for name, own in others:
            if own == axes:
                told = name
            elif own != Axes():  # as it is, it may be of the same local frame: that settles nothing
                cost += SETTINGS.settling
        yield cost, axes, told


def _sense_cost(sense: Sense, compass: bool, local: bool) -> float:
    """What speaks against a heading that counts so; local : from the first axis to the second, of any hand."""
    if sense == Sense():
        return 0.0
    usual = sense in (Sense(-1, 1), Sense(-1))
    return 0.7 if usual and (local or not compass) else SETTINGS.rare if compass else SETTINGS.odd


def _axis_cost(name: str, way: str, sign: int) -> float:
    """What speaks against an axis with this name to that way."""
    said = {other: meaning_scores(name).get(other, 0.0) for other in ("north", "east")}
    if _is_letter_axis(name) or max(said.values()) <= 0.9:
        return 0.3 * (way != ("east" if "y" in name.lower() else "north")) + 0.3 * (sign < 0)
    return SETTINGS.odd / 2 * (said[way] < 0.6) + SETTINGS.rare * (sign < 0)


def _side_cost(state: State, name: str, sign: int) -> float:
    """What speaks against a latitude or longitude that counts so, -1 to south or west."""
    if OTHER_WAY & {*name_parts(name)}:
        return 0.5 * (sign > 0)
    unsigned = state.columns[name].min() >= 0 or name in state.negated
    return (0.6 * SETTINGS.odd if unsigned else SETTINGS.rare) * (sign < 0)


def _course_axes(state: State, pose: Pose, seen: Complex) -> Iterator[tuple[str, Axes]]:
    """Yield columns of a course over ground, and the axes with which it counts clockwise from north."""
    middle = (state.chosen.first + state.chosen.last) // 2
    for name in _logged_courses(state, pose.heading):
        for turn, _ in _turns_of_angle(state, name):
            way = np.exp(1j * _angle(state, name, turn)[middle])
            (misfit, sense), (other, _) = senses_of_angle(seen, way)
            if misfit > SETTINGS.poor or other < 2.0 * misfit or abs(np.mean(way)) > 0.99:
                continue
            yield from ((name, axes) for axes in ALL_AXES[:5] if axes.sense(sense) == Sense())
            break


def _velocity_axes(state: State, place: Place, seen: Complex) -> Iterator[tuple[str, Axes]]:
    """Yield columns named velocities to north, and the axes with which they, with those to east, are the track."""
    for north, east in product(state.called("velocity_north"), state.called("velocity_east")):
        if place.on_globe or north == east or _is_letter_axis(north) or _is_letter_axis(east):
            continue
        ran = state.chosen.change(evidence.integrate_rate(state.t, state.columns[north] + 1j * state.columns[east]))
        left = {axes: _positive_left(axes.place(seen), ran) for axes in ALL_AXES}
        best = min(left, key=left.__getitem__)
        if (left[best] < SETTINGS.poor and left[best] * 2.0 < left[Axes()] + 1e-9) or best == Axes():
            yield north, best


def _positive_left(seen: Complex, ran: Complex) -> float:
    fit = evidence.fit_without_outliers(seen, ran)
    return fit.left if fit.scale > 0 else 1.0


def _logged_courses(state: State, heading: str) -> list[str]:
    named = [name for name in state.all_called("course") if name != heading and not is_order(name)]
    return [name for name in named if meaning_scores(name).get("psi", 0.0) < meaning_scores(name)["course"]]


def _is_letter_axis(name: str) -> bool:
    """Whether a name says x or y, which each hand lays in another direction, and no word for north or east."""
    parts = name_parts(name)
    return any(part.rstrip("0123456789") in ("x", "y") for part in parts) and not DIRECTIONS & {*parts}


def _is_compass(name: str) -> bool:
    parts = set(name_parts(name))
    return bool(parts & COMPASS) and not parts & YAW


# --- velocities and rates ---


def _velocity_hypotheses(state: State, pose: Pose, seen: Complex, theta: Array) -> Iterator[Velocity]:
    """Yield pairs of columns whose integral is the track: velocities of the Earth or of the ship, speed and course."""
    turn, used = np.exp(1j * theta), {pose.place.first, pose.place.second, pose.heading}
    courses, headings = state.all_called("course"), state.all_called("psi")
    plain = {*state.eligible(*VELOCITIES)}  # no word of their names says another quantity
    steady = {
        kind: _left_by_constant(state, seen, way) for kind, way in (("earth", np.ones_like(turn)), ("body", turn))
    }
    for one in [*_pairs_of_velocities(state, used, seen, turn), *_speeds_and_courses(state, used, seen)]:
        fit = _fit_of_path(state, seen, one.ground)
        sure, usual = one.named >= one.sure, _is_speed_unit(fit.scale)
        against = one.kind != "course" and not {one.first, one.second} <= plain
        limit = SETTINGS.left * steady[one.kind] if against else SETTINGS.named_left if sure else SETTINGS.left
        if one.kind == "course" and not meaning_scores(one.second):
            limit = min(limit, SETTINGS.named_left * steady["earth"])  # any still column is a straight course
        if fit.scale <= 0 or not (sure or usual) or fit.left > limit:
            continue
        cost = one.cost + float(np.log((fit.left + SETTINGS.floor) / (SETTINGS.unnamed + one.named))) + (not usual)
        cost += SETTINGS.odd * against
        unsure, drift = False, _drift_in_turns(state, one.ground, theta)
        inward = -float(np.log(1.0 - SETTINGS.outward)) * (drift > 0.0)  # a ship drifts out of its turns
        if one.kind == "body":  # against its mirror image, by the track, and by a ship's drift out of its turns
            mirror = _fit_of_path(state, seen, np.conj(one.ground / turn) * turn)
            by_track = float(np.log((fit.left + 1e-6) / (mirror.left + 1e-6)))
            cost += max(by_track, 0.0) + inward
            cost += 0.1 * (one.side != pose.sense.sign)
            unsure = abs(by_track) < SETTINGS.alike_left or (by_track < 0.0) == (drift > 0.0)
            surge = _path_of(state, state.columns[one.first] * turn)
            across = evidence.fit_scale(seen - fit.scale * surge, _path_of(state, one.ground) - surge).scale
            if not sure and abs(np.log(max(across, 1e-9) / fit.scale)) > 2 * SETTINGS.alike_left:
                continue  # the second is no sway in the unit of the first: a roll, or nothing
        elif one.kind == "course" and (one.second not in courses or pose.heading not in headings):
            cost += inward
        elif one.kind == "course" and drift > 0.5:
            ahead = _fit_of_path(state, seen, state.columns[one.first] * turn)
            unsure = ahead.scale > 0 and ahead.left < 0.5 * fit.left
        yield replace(one, fit=fit, cost=cost, unsure=unsure)


def _left_by_constant(state: State, seen: Complex, way: NDArray[np.generic]) -> float:
    """Share of a motion (W,) that a constant velocity or rate along a way (N,) leaves, as any still column is one."""
    ran = state.chosen.change(evidence.integrate_rate(state.t, way))
    power = float(np.vdot(ran, ran).real * np.vdot(seen, seen).real)
    return 1.0 - float(abs(np.vdot(ran, seen))) ** 2 / max(power, 1e-300)


def _fit_of_path(state: State, seen: Complex, ground: Complex) -> Fit:
    """How the integral of velocities (N,) in the plane fits the track (W,)."""
    return evidence.fit_without_outliers(seen, _path_of(state, ground))


def _path_of(state: State, ground: Complex) -> Complex:
    """The integral of velocities (N,) over the windows (W,)."""
    return state.chosen.change(evidence.integrate_rate(state.t, ground))


def _pairs_of_velocities(state: State, used: set[str], seen: Complex, turn: Complex) -> Iterator[Velocity]:
    """Yield pairs of columns that may be velocities of the Earth or of the ship, by name and by a rough fit."""
    free = [name for name in state.movable("u") if name not in used]
    free.sort(key=lambda name: -max(meaning_scores(name).get(word, 0.0) for word in VELOCITIES))
    free, total, found = free[:MOST_COLUMNS], float(np.sum(np.abs(seen) ** 2)), list[tuple[float, Velocity]]()
    ways = {"earth": np.ones_like(turn), "body": turn}
    for kind in ways if len(free) > 1 else ():
        paths = (evidence.integrate_rate(state.t, state.columns[one] * ways[kind]) for one in free)
        ran = np.stack([state.chosen.change(path) for path in paths])
        products, ahead, abeam = np.conj(ran) @ ran.T, (np.conj(ran) @ seen).real, (np.conj(ran) @ seen).imag
        for (a, first), (b, second), side in product(enumerate(free), enumerate(free), (1, -1)):
            cross, said = ahead[a] + side * abeam[b], _names_of_velocities(kind, first, second)
            power = products[a, a].real + products[b, b].real - 2.0 * side * products[a, b].imag
            rough = 1.0 - cross**2 / max(power * total, 1e-300)
            if first != second and cross > 0 and (rough < 0.9 or said >= 0.45):
                one = Velocity(kind, first, second, side, seen, said, cost=float(kind == "earth" and side < 0))
                found.append((rough / (SETTINGS.unnamed + said), one))
    for _, one in sorted(found, key=lambda entry: entry[0])[:16]:
        ground = state.columns[one.first] + 1j * one.side * state.columns[one.second]
        yield replace(one, ground=ground * ways[one.kind])


def _names_of_velocities(kind: str, first: str, second: str) -> float:
    ahead, north = (meaning_scores(first).get(word, 0.0) for word in ("u", "velocity_north"))
    abeam, east = (meaning_scores(second).get(word, 0.0) for word in ("v", "velocity_east"))
    if kind == "body":
        return min(ahead, abeam)
    other = min(meaning_scores(first).get("velocity_east", 0.0), meaning_scores(second).get("velocity_north", 0.0))
    return max(min(north, east), other, 0.5 * min(ahead, abeam))


def _speeds_and_courses(state: State, used: set[str], seen: Complex) -> Iterator[Velocity]:
    """Yield speeds with courses over ground in every unit, in the sense in which they keep to the track."""
    plain = [[name for name in state.movable(one) if not meaning_scores(name)][:MOST_COLUMNS] for one in ("u", "psi")]
    speeds = [*state.called("speed"), *plain[0]]
    courses = [*(name for name in state.called("course") if not is_order(name)), *plain[1]]
    middle = (state.chosen.first + state.chosen.last) // 2
    for name in (name for name in dict.fromkeys(courses) if name not in used):
        for turn, more in _turns_of_angle(state, name):
            angle = _angle(state, name, turn)
            misfit, sense = senses_of_angle(seen, np.exp(1j * angle)[middle])[0]
            plane = np.exp(1j * sense.direction(angle))
            for speed in speeds if misfit <= SETTINGS.named_left else ():
                named = (meaning_scores(speed).get("speed", 0.0) + meaning_scores(name).get("course", 0.0)) / 2
                ground = np.asarray(state.columns[speed] * plane)
                if speed not in (name, *used):
                    yield Velocity("course", speed, name, 1, ground, named, turn, sense, cost=more + 0.5)


def _drift_in_turns(state: State, ground: Complex, theta: Array) -> float:
    """The correlation of the sway of velocities (N,) with the rate: below 0 the ship drifts out of its turns."""
    sway, rate = (
        _window_means(state, one) for one in ((ground * np.exp(-1j * theta)).imag, np.gradient(theta, state.t))
    )
    return float(np.sum(sway * rate) / max(float(np.linalg.norm(sway) * np.linalg.norm(rate)), 1e-300))


def _window_means(state: State, values: Array) -> Array:
    """A signal as means over the windows, less its mean, (W,)."""
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    means = state.chosen.change(evidence.integrate_rate(state.t, values)).real / span
    return np.asarray(means - np.mean(means))


def _is_speed_unit(scale: float) -> bool:
    away = {unit: abs(scale / factor - 1) for unit, factor in UNITS["m/s"].items()}
    return any(off < (0.15 if unit in PLAIN else SETTINGS.off_unit) for unit, off in away.items())


def _rate_hypotheses(state: State, pose: Pose, theta: Array) -> Iterator[Rate]:
    """Yield columns whose integral is the heading: those with a fitting name, and others that fit it very well."""
    change = state.chosen.change(theta)
    if float(np.std(change)) < np.radians(0.5):
        return
    steady = _left_by_constant(state, change, np.ones(len(state.t)))
    called, used = state.all_called("r"), {pose.place.first, pose.place.second, pose.heading}
    for name in (name for name in state.movable("r") if name not in used):
        fit = evidence.fit_scale(change, state.chosen.change(evidence.integrate_rate(state.t, state.columns[name])))
        scale = max(abs(fit.scale), 1e-12)
        unit = min(UNITS["rad/s"], key=lambda one: abs(np.log(scale / UNITS["rad/s"][one])))
        off = abs(scale / UNITS["rad/s"][unit] - 1)
        score = meaning_scores(name).get("r", 0.0) if name in called else 0.0
        command = meaning_scores(name).keys() & rows_of_role("command").keys()
        against = not score and names_another(name, "r")
        limit = SETTINGS.named_left if score else SETTINGS.left if command or is_order(name) else 0.3
        limit = SETTINGS.left * steady if against else limit
        if fit.left < limit and off < (0.35 if score else SETTINGS.left):
            cost = np.log((fit.left + SETTINGS.floor) / (SETTINGS.unnamed + score)) + off + SETTINGS.odd * against
            yield Rate(name, unit, fit, float(cost))


# --- positions ---


def local_plane(state: State, first: str, second: str, on_globe: bool) -> Complex:
    """A position as first + i second [m], or as north + i east in the plane that touches the Earth at its first."""
    a, b = state.columns[first], state.columns[second]
    if not on_globe:
        return np.asarray(to_si(length_unit(first, second), "north") * (a + 1j * b))
    origin = float(a[0]), float(b[0])
    turn = np.unwrap(meridian_convergence(a, b, *origin))
    a, b, _ = geodetic2ned(a, b, 0.0, origin[0], origin[1], 0.0)
    place = np.asarray(a + 1j * b)
    if np.max(np.abs(turn)) <= PARALLEL:
        return place
    return np.append(0.0, np.cumsum(np.diff(place) * np.exp(-0.5j * (turn[1:] + turn[:-1]))))


def length_unit(first: str, second: str) -> str:
    """The unit of length that both names say, else metres."""
    units = {unit_in_name(name, "m") or "m" for name in (first, second)}
    return units.pop() if len(units) == 1 else "m"


def _within_globe(state: State, north: str, east: str) -> bool:
    return bool(np.abs(state.columns[north]).max() <= 90 and np.abs(state.columns[east]).max() <= 360)


def _may_be_globe(state: State, north: str, east: str) -> bool:
    sizes = [(float(np.ptp(one)), abs(float(one.mean()))) for one in (state.columns[north], state.columns[east])]
    return _within_globe(state, north, east) and all(0.0 < width <= 1.0 and mean > 20 * width for width, mean in sizes)


def _what_is_missing(state: State, position: bool) -> str:
    """What no column can be, and what to do about it."""
    missing = "heading" if position else "position (north and east, or latitude and longitude)"
    asked = ("psi",) if position else ("latitude", "longitude", "north", "east", "x", "y")
    remedy = "name the columns with --names, or map by hand"
    for name, text in state.words.items():
        if re.search(r"\d.*[NS].*\d.*[EWO]|[NS].*\d.*[EWO].*\d", text) and not position:
            remedy = f"{name!r} holds {text[:40]!r}: write latitude and longitude in two columns"
        elif re.search(r"\d", text) and any(meaning_scores(name).get(one, 0.0) > 0.9 for one in asked):
            remedy = f"{name!r} holds {text[:40]!r}, no number: write it as a number with a sign, without a unit"
    for name, why in state.other.items():
        if any(meaning_scores(name).get(one, 0.0) > 0.6 for one in asked):
            remedy = f"{name!r} is {why}"
    return f"no column can be the {missing}: {remedy}"
