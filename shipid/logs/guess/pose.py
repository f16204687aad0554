"""Choose position and heading: the columns whose track keeps to the heading, with unit, frame and sign."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from pymap3d import geodetic2ned

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.amounts import is_amount
from shipid.logs.frames import PARALLEL, meridian_convergence
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State, unit_in_name
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.words import is_magnetic, is_order, may_be_measured, meaning_scores, name_parts
from shipid.logs.mapping import to_si

POOR = 0.2  # misfit of a course and a heading: 1 - agreement
ABREAST = np.radians(0.5)  # by which two headings of one ship may differ
UNSEEN = 0.5  # misfit from which a track says nothing of the heading: she is moored, or drifts to any side
MIRROR = 2.0  # times smaller a misfit must be, to decide between a heading and its mirror
STRAIGHT = 0.01  # 1 - |mean exp(i psi)| of a ship that hardly turns
COMPASS = frozenset(("heading hdg hdt head compass kompass gyro kreisel kurs course baug psi steuer rumbo cap").split())
OTHER_WAY = frozenset("w west ouest oeste vest south sud sur syd zuid".split())
"""Parts of the name of a longitude or latitude that counts to the west or south."""
DIRECTIONS = frozenset("north northing nord norte noord east easting ost oest este".split())
YAW = frozenset(["yaw", "gier", "gir", "theta"])
TURNED = np.radians(8.0)  # range of a heading that no name says, at least
NEARLY_ALWAYS = 0.9  # share of the rows with a turning shaft in which it turns astern, of a ship that goes astern
FIRST, LAST = 30.0, 330.0  # deg: a heading in degrees that goes all round comes below and above
SEARCHED = 24  # columns at most, where no name helps

RADIUS, OFF_RADIUS = 6.368e6, 2.5e4  # m: from the centre of the Earth to its ellipsoid, with hills
LENGTHS = re.compile(r"/ ?L(?:_?(?:pp|bp|wl|oa))?\b", re.IGNORECASE)
"""The end of the name of a position in ship lengths, such as X/Lpp."""

Frame = Literal["ned", "enu", "zup", "ros"]
"""Where x, y point and from where the heading counts; see `in_frame`."""


@dataclass(frozen=True)
class Pose:
    """A hypothesis: columns of position and heading, and how course and heading agree.

    same, mirrored : mean of exp(i (course - psi)) and of exp(i (course + psi)). cost : misfit, less for fitting names.
    settled : what shows the frame; empty where nothing does. east_sign : -1 where the second axis is to the west.
    counts : sign of the heading that a person gave, else 0.
    """

    north: str
    east: str
    heading: str
    unit: str
    on_globe: bool
    same: complex
    mirrored: complex
    cost: float
    settled: str = ""
    east_sign: int = 1
    counts: int = 0

    @property
    def misfit(self) -> float:
        """1 - agreement, of the better of the heading and its mirror."""
        return 1.0 - max(abs(self.same), abs(self.mirrored))


def choose_pose(state: State, file: Path, frame: Frame | None = None) -> None:
    """Choose position and heading, in the frame of the log where it is known; names that fit are tried first.

    Raises DataError if no column can be one of them, or if the ship does not move as in that frame.
    """
    _refuse_ecef(state, file)
    pairs = list(_position_pairs(state))
    headings = [name for name in state.all_called("psi") if not is_order(name) or may_be_measured(name)]
    headings = [name for name in headings if not is_magnetic(name)] or headings  # beside a true one it is a second one
    if not headings:  # of a plane x, y, theta
        headings = [name for name in state.called("theta") if _all_round(state, name)]
    sure = [name for name in headings if meaning_scores(name).get("psi", 0.0) > meaning_scores(name).get("course", 0.0)]
    best = _best_pose(state, pairs, sure or headings)
    if best is None or best.misfit > POOR:
        wide = _search_pose(state, pairs, headings)
        if wide is not None and np.ptp(state.columns[wide.heading]) * to_si(wide.unit, "psi") < TURNED:
            wide = None  # anything that hardly changes keeps to a straight course
        if wide is not None and (best is None or wide.misfit < 0.5 * best.misfit) and wide.misfit < POOR:
            if best is not None and not state.numbered:
                named = ", ".join(map(repr, (best.north, best.east, best.heading)))
                sentence = f"{named} do not fit together as position and heading (misfit {best.misfit:.2f}); "
                sentence += f"{wide.north!r}, {wide.east!r}, {wide.heading!r} do ({wide.misfit:.3f})"
                state.find("misleading names", (wide.north, wide.east, wide.heading), 0.6, sentence)
            best = wide
    if best is None or (best.misfit > POOR and (not pairs or not headings)):
        missing = "position (north and east, or latitude and longitude)" if not pairs else "heading"
        asked = ("latitude", "longitude", "north", "east", "x", "y") if not pairs else ("psi",)
        numeric = [name for name, text in state.words.items() if re.search(r"\d", text)]
        name = next((name for name in numeric if any(meaning_scores(name).get(one, 0.0) > 0.9 for one in asked)), None)
        remedy = "name the columns with --names, or map by hand"
        if name is not None:
            remedy = f"{name!r} holds {state.words[name][:40]!r}, no number: write it as a number with a sign"
            if is_amount(state.words[name]):
                remedy = f"{name!r} holds {state.words[name][:40]!r}, and other units: write one unit"
        both = [one for one, text in state.words.items() if re.search(r"\d.*[NS].*\d.*[EWO]|[NS].*\d.*[EWO].*\d", text)]
        if both and not pairs:
            remedy = f"{both[0]!r} holds {state.words[both[0]][:40]!r}: write latitude and longitude in two columns"
        lost = next(
            (one for one in state.other if any(meaning_scores(one).get(meant, 0.0) > 0.6 for meant in asked)), None
        )
        if lost is not None:
            remedy = f"{lost!r} is {state.other[lost]}"
        raise DataError(f"no column can be the {missing}: {remedy}", file=file)
    if is_magnetic(best.heading):
        state.ask(
            ("psi", "v"),
            f"{best.heading!r} is of a magnetic compass: where are its variation and deviation taken out?"
            f" A `heading_offset` is one for all courses",
        )
    if best.misfit > POOR and not state.numbered:
        state.ask(
            ("psi", "north", "east", "u", "v", "r"),
            f"course and heading agree badly (misfit {best.misfit:.2f}): are {best.north!r}, {best.east!r} the "
            f"position and {best.heading!r} the heading?",
        )
    if frame is not None:
        best = in_frame(best, frame, file)
    elif not best.on_globe and best.misfit <= POOR:
        best = _by_course(state, best)
        best = best if best.settled else _by_velocities(state, best)
    references = [name for name in (best.north, best.east, best.heading) if may_be_measured(name)]
    lengths = [name for name in (best.north, best.east) if LENGTHS.search(name)]
    if lengths:
        said = " and ".join(map(repr, lengths))
        state.ask(
            ("north", "east", "u", "v"), f"{said} are in ship lengths by their names: write factor = the length in m"
        )
    if references:
        said = ", ".join(map(repr, references))
        state.ask(
            ("psi", "north", "east", "latitude", "longitude"),
            f"is {said} measured, or a set point? By the name it may be either",
        )
    _ask_for_second(state, best, [name for name in sure if not is_magnetic(name)])
    _accept_pose(state, best, sure)


def _refuse_ecef(state: State, file: Path) -> None:
    """Raise DataError where x, y, z count from the centre of the Earth: no plane of two of them is level."""
    for name in state.columns:
        place = name.lower().rfind("x")
        letters = "XYZ" if "X" in name[place : place + 1] else "xyz"
        three = [f"{name[:place]}{letter}{name[place + 1 :]}" for letter in letters]
        if place >= 0 and {*three} <= state.columns.keys():
            far = np.linalg.norm([state.columns[one] for one in three], axis=0)
            if np.all(np.abs(far - RADIUS) < OFF_RADIUS):
                words = ", ".join(map(repr, three))
                remedy = "write latitude and longitude, such as by pymap3d.ecef2geodetic"
                raise DataError(f"{words} count from the centre of the Earth: {remedy}", file=file)


def _all_round(state: State, name: str) -> bool:
    """Whether an angle called theta takes more than a quarter of a turn, as no pitch does."""
    values = state.columns[name]
    unit = unit_in_name(name, "rad") or ("deg" if np.abs(values).max() > 2.2 * np.pi else "rad")
    return bool(np.ptp(values) * to_si(unit, "psi") > np.pi / 2)


def _ask_for_second(state: State, best: Pose, headings: list[str]) -> None:
    """Ask where another heading, as of a second gyro, goes with the one that is taken and differs from it."""
    if best.heading not in headings:
        return
    angles = {}
    for name in headings:
        turn = to_si(unit_in_name(name, "rad") or best.unit, "psi")
        angles[name] = np.exp(1j * turn * state.columns[name])
    for name in headings:
        apart = np.angle(angles[name] * np.conj(angles[best.heading]))
        usual = float(np.median(apart))
        together = float(np.median(np.abs(apart - usual))) < ABREAST
        if ABREAST < abs(usual) < np.pi / 4 and together:
            state.ask(
                ("psi", "v"),
                f"{best.heading!r} and {name!r} differ by {np.degrees(abs(usual)):.1f} deg: which is the heading? "
                f"{best.heading!r} is drafted, as it keeps closer to the track",
            )


def in_frame(best: Pose, frame: Frame, file: Path) -> Pose:
    """A hypothesis in the frame that a person gives.

    ned : x north, y east, heading clockwise from north. enu : x east, y north, heading clockwise from north.
    zup : z upwards: y and the heading count to port of x. ros : x east, y north, heading counter-clockwise from east.
    Raises DataError where positions are on the globe, or where the ship does not move so.
    """
    if best.on_globe:
        raise DataError("latitude and longitude have no other frame: leave it out", file=file, path="--frame")
    clockwise, mirror_like = frame in ("ned", "enu"), abs(best.mirrored) > abs(best.same)
    if best.misfit <= POOR and mirror_like != (frame == "enu"):
        others = ["enu"] if mirror_like else [name for name in get_args(Frame) if name != "enu"]
        raise DataError(
            f"the ship does not move as in {frame}: {best.north!r}, {best.east!r}, {best.heading!r} fit"
            f" {' or '.join(others)}",
            file=file,
            path="--frame",
        )
    given = replace(best, settled=f"--frame {frame}", counts=1 if clockwise else -1)
    if frame != "ned":
        given = _y_is_west(given, given.settled) if frame == "zup" else _x_is_east(given, given.settled)
    if best.misfit > POOR:  # a ship that drifts or goes astern: her track says nothing of the zero
        turn = {"zup": 1.0, "ros": 1j}.get(frame, 0.0)
        size = complex(1.0 - best.misfit)
        given = replace(given, same=size if clockwise else 0j, mirrored=size * turn)
    return given


def _logged_courses(state: State, best: Pose) -> list[str]:
    """Columns of a course over ground beside the heading."""
    named = [name for name in state.all_called("course") if name != best.heading and not is_order(name)]
    return [name for name in named if meaning_scores(name).get("psi", 0.0) < meaning_scores(name)["course"]]


def _by_course(state: State, best: Pose) -> Pose:
    track = state.chosen.change(local_plane(state, best.north, best.east, on_globe=False))
    size = float(np.sum(np.abs(track)))
    middle = (state.chosen.first + state.chosen.last) // 2
    for name in _logged_courses(state, best):
        unit = unit_in_name(name, "rad") or best.unit
        unit = unit if float(np.ptp(state.columns[name])) <= 1.01 * 2 * np.pi / to_si(unit, "psi") else "deg"
        turned = np.exp(1j * state.angle(name, unit)[middle])
        spread = 1.0 - abs(complex(np.mean(turned)))
        same, mirrored = (complex(np.sum(track * way)) / size for way in (np.conj(turned), turned))
        if spread < STRAIGHT or abs(mirrored) < 1.0 - POOR or (1.0 - abs(mirrored)) * MIRROR > 1.0 - abs(same):
            continue  # where it agrees as it is, it may be a course in the same local frame: that settles nothing
        if abs(np.angle(mirrored * -1j)) < 0.3:
            return _x_is_east(best, name)
        if abs(np.angle(mirrored)) < 0.3:
            return _y_is_west(best, name)
    return best


def _by_velocities(state: State, best: Pose) -> Pose:
    pairs = [
        (north, east)
        for north in state.called("velocity_north")
        for east in state.called("velocity_east")
        if not _is_letter_axis(north)
        and not _is_letter_axis(east)
        and _is_letter_axis(best.north)
        and _is_letter_axis(best.east)
    ]
    track = state.chosen.change(local_plane(state, best.north, best.east, on_globe=False))
    for north, east in pairs:
        path = evidence.integrate_rate(state.t, state.columns[north] + 1j * state.columns[east])
        change = state.chosen.change(path)
        frames = {"as it is": track, "east": 1j * np.conj(track), "west": np.conj(track)}
        left = {way: _unexplained_share(seen, change) for way, seen in frames.items()}
        likely = min(left, key=left.__getitem__)
        if left[likely] > POOR or left["as it is"] < MIRROR * POOR:
            continue
        return _x_is_east(best, north) if likely == "east" else _y_is_west(best, north)
    return best


def _is_letter_axis(name: str) -> bool:
    """Whether a name says x or y, which each hand lays in another direction, and no word for north or east."""
    parts = name_parts(name)
    return any(part.rstrip("0123456789") in ("x", "y") for part in parts) and not DIRECTIONS & {*parts}


def _unexplained_share(seen: Complex, integrated: Complex) -> float:
    """Unexplained share of a track, outliers apart; 1 where the scale is negative."""
    fit = evidence.fit_without_outliers(seen, integrated)
    return fit.left if fit.scale > 0 else 1.0


def _x_is_east(best: Pose, settled: str) -> Pose:
    turn = {"same": 1j * np.conj(best.mirrored), "mirrored": 1j * np.conj(best.same)}
    return replace(best, north=best.east, east=best.north, settled=settled, **turn)


def _y_is_west(best: Pose, settled: str) -> Pose:
    turn = {"same": np.conj(best.mirrored), "mirrored": np.conj(best.same)}
    return replace(best, east_sign=-1, settled=settled, **turn)


def _position_pairs(state: State) -> Iterator[tuple[str, str, bool, float]]:
    """Yield north, east, whether they are angles on the globe, and how well the names fit (0 to 1)."""
    for first, second, on_globe in (("latitude", "longitude", True), ("north", "east", False), ("x", "y", False)):
        for north in state.called(first):
            for east in state.called(second):
                score = (meaning_scores(north).get(first, 0.0) + meaning_scores(east).get(second, 0.0)) / 2
                if north != east and (not on_globe or _named_as_latitude(state, north, east)):
                    yield north, east, on_globe, score


def _named_as_latitude(state: State, north: str, east: str) -> bool:
    return bool(np.abs(state.columns[north]).max() <= 90 and np.abs(state.columns[east]).max() <= 360)


def _best_pose(
    state: State,
    pairs: list[tuple[str, str, bool, float]],
    headings: list[str],
    limit: int = 400,
    rated: dict[str, float] | None = None,
) -> Pose | None:
    """The hypothesis of least cost among pairs of position and columns of heading, in degrees or radians.

    A misfit counts against the spread of the heading. rated : what another column, integrated, leaves of it.
    """
    middle = (state.chosen.first + state.chosen.last) // 2
    thin = max(1, len(middle) // limit)
    angles = {}
    for heading in headings:
        for unit in ("deg",) if _is_in_deg(heading, state.columns[heading]) else ("deg", "rad"):
            turned = np.exp(-1j * state.angle(heading, unit)[middle][::thin])
            angles[heading, unit] = turned, 1.0 - abs(complex(np.mean(turned)))
    best: Pose | None = None
    for north, east, on_globe, score in pairs:
        track = state.chosen.change(local_plane(state, north, east, on_globe))[::thin]
        size = float(np.sum(np.abs(track)))
        if size <= 0:
            continue
        for (heading, unit), (turned, spread) in angles.items():
            if heading in (north, east):
                continue
            same = complex(np.sum(track * turned)) / size
            mirrored = complex(np.sum(track * np.conj(turned))) / size
            written = unit_in_name(heading, "rad")
            named = meaning_scores(heading).get("psi", 0.0)
            misfit = 1 - max(abs(same), abs(mirrored))
            quarter = abs(same) >= abs(mirrored) and abs(np.angle(same)) > np.pi / 4  # an acceleration looks like that
            cost = (misfit + 0.003 + 0.1 * quarter) / (spread + 0.01) / (0.3 + score) / (0.3 + named)
            cost *= 0.6 if unit == (written or "deg") else 1.0
            cost *= 2.0 if on_globe and abs(same) < abs(mirrored) else 1.0  # there headings are those of a compass
            cost *= 1.0 if rated is None else 0.02 + rated.get(heading, 1.0)
            if best is None or cost < best.cost:
                best = Pose(north, east, heading, unit, on_globe, same, mirrored, cost)
    return best


def _is_in_deg(name: str, values: Array) -> bool:
    low, high = float(values.min()), float(values.max())
    whole = (0.0 <= low < FIRST and LAST < high <= 360.0) or (-180.0 <= low < FIRST - 180 and LAST - 180 < high <= 180)
    return whole and _is_compass(name) and unit_in_name(name, "rad") is None


def _search_pose(state: State, pairs: list[tuple[str, str, bool, float]], headings: list[str]) -> Pose | None:
    meanings = ("north", "east", "x", "y", "latitude", "longitude", "psi")
    free = [name for name in state.eligible(*meanings) if len(np.unique(state.columns[name][:2000])) > 10][:SEARCHED]
    rated = _columns_with_rate(state, free)
    named = [name for name in headings if name in state.free()]
    places = list(rated) if len(rated) > 2 and state.numbered else free
    angles = list(rated) if rated and state.numbered else free
    globe = [(a, b) for a in free for b in free if a != b and _may_be_globe(state, a, b)]

    def on_plane(names: list[str]) -> list[tuple[str, str, bool, float]]:
        return [(a, b, False, 0.3) for a, b in combinations(names, 2) if not {(a, b), (b, a)} & {*globe}]

    wide = [*on_plane(places), *((a, b, True, 0.3) for a, b in globe)]
    best = _best_pose(
        state, [*pairs, *wide], list(dict.fromkeys([*named, *angles])), 150, rated if state.numbered else None
    )
    if best is None or (best.misfit > POOR and places is not free):
        best = _best_pose(state, on_plane(free), free, 150)
    if best is not None and state.numbered:
        rivals = [name for name in angles if name not in (best.north, best.east, best.heading)]
        other = _best_pose(state, [(best.north, best.east, best.on_globe, 0.3)], rivals, 150)
        close = other is not None and other.misfit < 2 * best.misfit + 0.02
        if close and other is not None and rated.get(other.heading, 1.0) < 2 * rated.get(best.heading, 1.0) + 1e-3:
            best, course = (other, best) if other.misfit > best.misfit else (best, other)  # a ship drifts in a turn
            state.ask(
                ("psi", "north", "east", "u", "v", "r", "speed", "course"),
                f"is {best.heading!r} the heading and {course.heading!r} the course, or the other way?",
            )
    return best


def _may_be_globe(state: State, north: str, east: str) -> bool:
    a, b = state.columns[north], state.columns[east]
    if (
        not _named_as_latitude(state, north, east)
        or max(np.ptp(a), np.ptp(b)) > 1.0
        or np.ptp(a) == 0.0
        or np.ptp(b) == 0.0
    ):
        return False
    return bool(abs(a.mean()) > 20 * np.ptp(a) and abs(b.mean()) > 20 * np.ptp(b))


def _columns_with_rate(state: State, names: list[str]) -> dict[str, float]:
    """The columns whose rate is another column, with the share of their change that it leaves unexplained."""
    integrated = {}
    others = state.eligible()
    integrals = {name: state.chosen.change(evidence.integrate_rate(state.t, state.columns[name])) for name in others}
    for name in names:
        change = state.chosen.change(_unwrap_column(state.columns[name], state.t))
        left = min(
            (evidence.fit_scale(change, integrals[other]).left for other in others if other != name), default=1.0
        )
        if left < 0.05:
            integrated[name] = left
    return integrated


def _unwrap_column(values: Array, t: Array) -> Array:
    """A column that jumps at a whole turn, in degrees or radians, without its jumps; others as they are."""
    steps = np.abs(np.diff(values))
    for turn in (360.0, 2 * np.pi):
        if np.ptp(values) <= 1.01 * turn and np.any(steps > 0.8 * turn) and np.median(steps) < 0.1 * turn:
            return evidence.heal_angle(values, turn, t)[0]
    return values


def local_plane(state: State, north: str, east: str, on_globe: bool) -> Complex:
    """A position as north + i east [m], in the plane that touches the Earth at the first one."""
    a, b = state.columns[north], state.columns[east]
    if not on_globe:
        return np.asarray(a + 1j * b)
    origin = float(a[0]), float(b[0])
    turn = np.unwrap(meridian_convergence(a, b, *origin))
    a, b, _ = geodetic2ned(a, b, 0.0, origin[0], origin[1], 0.0)
    place = np.asarray(a + 1j * b)
    if np.max(np.abs(turn)) <= PARALLEL:
        return place
    return np.append(0.0, np.cumsum(np.diff(place) * np.exp(-0.5j * (turn[1:] + turn[:-1]))))


def _accept_pose(state: State, best: Pose, sure: list[str]) -> None:
    """Take a hypothesis: decide sign, origin and frame of the heading, and ask where nothing decides."""
    best = _pose_by_names(state, best) if best.misfit > UNSEEN else _other_way(state, _sign_by_compass(state, best))
    heading, unit = best.heading, best.unit
    turn = 2 * np.pi / to_si(unit, "psi")
    psi, false = evidence.heal_angle(state.columns[heading], turn, state.t)
    angle = psi * to_si(unit, "psi")
    mirrored, undecided = _heading_mirrored(best, angle)
    compass = _is_compass(heading)
    clear = best.on_globe or all(
        meaning_scores(name).get(meaning, 0.0) > 0.9 and (compass or not _is_letter_axis(name))
        for name, meaning in ((best.north, "north"), (best.east, "east"))
    )
    reading = _read_heading(state, best, -angle if mirrored else angle, mirrored, clear)
    sign, offset, confidence = reading.sign, reading.offset, reading.confidence
    north, east = (best.east, best.north) if reading.swap else (best.north, best.east)
    agreement = max(abs(best.same), abs(best.mirrored))
    misnamed = not best.on_globe and best.settled in state.columns
    if misnamed and all(meaning_scores(one).get(way, 0.0) > 0.9 for one, way in ((north, "east"), (east, "north"))):
        state.find(
            "north and east swapped",
            (north, east),
            agreement,
            f"{best.settled!r} agrees with the track only with {north!r} as north and {east!r} as east",
        )
    _ask_frame(state, best, clear, compass, undecided, heading not in sure and not state.numbered)
    names = ("latitude", "longitude") if best.on_globe else ("north", "east")
    why = f"course over ground keeps to the heading (agreement {agreement:.3f} of 1)"
    length = "deg" if best.on_globe else _length_unit(north, east)
    for name, source, way in zip(names, (north, east), (1, best.east_sign), strict=True):
        more = {"sign": -1} if way < 0 else {}
        state.suggest(name, source, length, confidence, why, **more)
    if best.settled in state.columns and (best.east_sign < 0 or sign < 0):
        words = "counts clockwise from north" if meaning_scores(best.settled).get("course") else "is a speed to north"
        state.find(
            "frame by course or velocity",
            (north, east),
            0.9,
            f"{best.settled!r} {words}, and agrees with the track only with {north!r} as north",
        )
    if false.any():
        across = "360" if unit == "deg" else "2 pi"
        sentence = f"{int(false.sum())} steps of {heading!r} lie between two headings across {across}"
        repair = {"kind": "wrap_interpolation", "columns": ["psi"], "threshold": 20.0, "unit": "deg"}
        state.find("interpolation across 360", (heading,), 0.98, sentence, repair)
    extra: dict[str, Any] = {"wrap": True} | ({"sign": sign} if sign < 0 else {})
    if offset:
        extra["offset"] = offset if unit == "deg" else round(float(np.radians(offset)), 9)
    if heading not in sure and not state.numbered:
        confidence = min(confidence, 0.5)
    state.suggest("psi", heading, unit, confidence, f"{why}; in {unit} rather than another unit", **extra)
    place = local_plane(state, north, east, best.on_globe) * (1.0 if best.on_globe else to_si(length, "north"))
    state.position = np.conj(place) if best.east_sign < 0 else place
    state.psi = sign * angle + np.radians(offset)
    state.chosen = evidence.row_windows(state.t, evidence.window_length(state.t, state.psi, state.chosen))


@dataclass(frozen=True)
class _Reading:
    """How a hypothesis is read: sign and offset [deg] of the heading; `swap`: its north is east, and its east north."""

    confidence: float
    sign: int = 1
    offset: float = 0.0
    swap: bool = False


def _heading_mirrored(best: Pose, angle: Array) -> tuple[bool, bool]:
    """Whether a heading (N,) [rad] counts to port, or east is west, and whether the motion leaves that open."""
    if best.counts:
        return best.counts < 0, False
    spread = 1.0 - abs(complex(np.mean(np.exp(1j * angle))))
    same, mirrored = 1.0 - abs(best.same), 1.0 - abs(best.mirrored)
    undecided = spread < STRAIGHT or max(same, mirrored) < MIRROR * max(min(same, mirrored), 1e-9)
    better = undecided and mirrored < same and spread >= STRAIGHT
    return better or mirrored * MIRROR < same, undecided


def _read_heading(state: State, best: Pose, psi: Array, mirrored: bool, clear: bool) -> _Reading:
    """Decide from where the heading counts, psi (N,) [rad] in the way of the course, and note what is not as usual.

    clear : whether the names say what is north and what is east.
    """
    north, east, heading = best.north, best.east, best.heading
    phase = float(np.angle(best.mirrored if mirrored else best.same))
    quarter = _of_astern(state, best, psi, round(phase / (np.pi / 2)))
    if mirrored and quarter in (1, -1):
        confidence, compass = min(0.9, abs(best.mirrored)), _is_compass(heading)
        if best.on_globe or (clear and not compass) or quarter == -1 or best.settled:
            state.find(
                "heading counted from east",
                (heading,),
                abs(best.mirrored),
                f"{heading!r} counts to port from {'east' if quarter == 1 else 'west'}, as in mathematics",
            )
            return _Reading(confidence, -1, 90.0 * quarter)
        if clear:
            state.find(
                "north and east swapped",
                (north, east),
                abs(best.mirrored),
                f"course and heading agree only with {north!r} as east and {east!r} as north",
            )
        elif not state.numbered and compass:
            state.find(
                "x is east",
                (north, east),
                abs(best.mirrored),
                f"course and heading agree with {north!r} as east and {east!r} as north, as in many local frames",
            )
        return _Reading(confidence, swap=True)
    if mirrored:
        state.find(
            "heading counted to port",
            (heading,),
            abs(best.mirrored),
            f"{heading!r} rises where the course falls: it counts to port, or east is west",
        )
        return _Reading(min(0.9, abs(best.mirrored)), -1, 90.0 * quarter)
    if quarter:
        state.find(
            "zero of the heading",
            (heading,),
            abs(best.same),
            f"course and heading differ by {np.degrees(phase):.0f} deg: another zero of {heading!r} is taken",
        )
    misfits = 1.0 - abs(best.same), 1.0 - abs(best.mirrored)
    agreement = max(abs(best.same), abs(best.mirrored))
    confidence = float(np.clip(1.0 - 0.5 * min(misfits) / max(max(misfits), 1e-9), 0.5, 0.99))
    return _Reading(confidence * min(1.0, agreement + 0.1), offset=90.0 * quarter)


def _pose_by_names(state: State, best: Pose) -> Pose:
    """A hypothesis whose track says nothing of the heading, as of a moored ship, as the names have it."""
    if state.numbered or best.settled:
        return best
    large = float(np.abs(state.columns[best.heading]).max()) > 2.2 * np.pi
    unit = unit_in_name(best.heading, "rad") or ("deg" if large else "rad")
    return replace(best, unit=unit, same=complex(1.0 - best.misfit), mirrored=0j)


def _of_astern(state: State, best: Pose, psi: Array, quarter: int) -> int:
    """Quarters of a turn from a heading psi (N,) [rad] to the course; 0 where the ship goes astern, which is asked."""
    if abs(quarter) != 2:
        return quarter
    why = _astern_reason(state, best, psi)
    if why:
        state.astern = True
        state.find(
            "astern",
            (best.heading,),
            0.8,
            f"course and heading differ by about 180 deg: the ship goes astern, as {why}",
        )
        return 0
    words = f"does the ship go astern, or has {best.heading!r} another zero? If she goes astern, take the offset out"
    state.ask(("psi", "u", "v"), f"course and heading differ by about 180 deg: {words}")
    return quarter


def _astern_reason(state: State, best: Pose, psi: Array) -> str:
    """Why a ship whose heading psi (N,) [rad] points against her track goes astern; empty where nothing says so."""
    track = state.chosen.change(local_plane(state, best.north, best.east, best.on_globe))
    for name in state.called("u"):
        change = state.chosen.change(evidence.integrate_rate(state.t, state.columns[name] * np.exp(1j * psi)))
        if (
            meaning_scores(name)["u"] > meaning_scores(name).get("velocity_north", 0.0)
            and _unexplained_share(track, change) < POOR
        ):
            return f"{name!r} along the heading gives the track"
    for name in state.called("n"):
        turns = state.columns[name][state.columns[name] != 0.0]
        if len(turns) and np.mean(turns < 0.0) > NEARLY_ALWAYS:
            return f"{name!r} is negative"
    return ""


def _follows_course(state: State, best: Pose) -> bool:
    """Whether a logged course over ground agrees with the track, so that the signs of the positions are right."""
    track = state.chosen.change(local_plane(state, best.north, best.east, best.on_globe))
    middle = (state.chosen.first + state.chosen.last) // 2
    for name in _logged_courses(state, best):
        for unit in ("deg", "rad"):
            same = evidence.course_agreement(track, state.angle(name, unit)[middle])
            if abs(same) > 1.0 - POOR and abs(np.angle(same)) < np.pi / 4:
                return True
    return False


def _sign_by_compass(state: State, best: Pose) -> Pose:
    """The hypothesis with the signs of latitude and longitude with which a compass agrees with the track."""
    mirrored = abs(best.mirrored) > abs(best.same)
    phase = abs(float(np.angle(best.mirrored if mirrored else best.same)))
    if not best.on_globe or not _is_compass(best.heading) or best.misfit > POOR:
        return best
    turned: tuple[str, ...] = ()
    if _follows_course(state, best):
        return best
    if mirrored:
        turned = (best.east,) if phase < np.pi / 4 else (best.north,) if phase > 3 * np.pi / 4 else ()
    elif phase > 3 * np.pi / 4:
        turned = () if _astern_reason(state, best, state.angle(best.heading, best.unit)) else (best.north, best.east)
    unsigned = all(
        state.columns[name].min() >= 0 or name in state.negated or OTHER_WAY & {*name_parts(name)} for name in turned
    )
    agreements = sorted((abs(best.same), abs(best.mirrored)))
    if not turned or not unsigned or (mirrored and (1.0 - agreements[1]) * MIRROR > 1.0 - agreements[0]):
        return best
    ways = {best.north: ("south", "north"), best.east: ("west", "east")}
    names = " and ".join(f"{name!r} to {ways[name][name in state.negated]}" for name in turned)
    for name in turned:
        state.negate(name)
    state.find("sign of a position", turned, agreements[1], f"course and heading agree only if the log counts {names}")
    state.ask(("latitude", "longitude", "psi"), f"does the log count {names}? Else {best.heading!r} counts otherwise")
    same, other = (best.mirrored, best.same) if mirrored else (best.same, best.mirrored)
    if mirrored:
        way = 1.0 if turned == (best.east,) else -1.0
        return replace(best, same=way * np.conj(same), mirrored=way * np.conj(other))
    return replace(best, same=-same, mirrored=-other)


def _other_way(state: State, best: Pose) -> Pose:
    """The hypothesis with latitude and longitude changed round where only so a compass agrees with the track."""
    if not best.on_globe or not _is_compass(best.heading) or abs(best.mirrored) <= abs(best.same):
        return best
    if not _named_as_latitude(state, best.east, best.north):
        return best
    other = _best_pose(state, [(best.east, best.north, True, 0.3)], [best.heading])
    if other is None or other.misfit > POOR or abs(other.mirrored) > abs(other.same):
        return best
    if other.misfit > 0.7 * best.misfit:
        state.ask(
            ("latitude", "longitude", "psi"),
            f"is {best.north!r} the longitude and {best.east!r} the latitude? Else {best.heading!r} counts to port",
        )
        return best
    state.find(
        "latitude and longitude swapped",
        (best.north, best.east),
        abs(other.same),
        f"course and heading agree only with {best.north!r} as longitude and {best.east!r} as latitude",
    )
    return other


def _length_unit(north: str, east: str) -> str:
    """The unit of length that both names say, else metres."""
    units = {unit_in_name(name, "m") for name in (north, east)}
    unit = units.pop() if len(units) == 1 else None
    return "m" if unit is None else unit


def _is_compass(name: str) -> bool:
    parts = set(name_parts(name))
    return bool(parts & COMPASS) and not parts & YAW


def _ask_frame(state: State, best: Pose, clear: bool, compass: bool, undecided: bool, course: bool) -> None:
    """Ask for what neither names nor motion decide: the frame, its mirror image, whether a heading is a course."""
    if course:
        state.ask(("psi",), f"is {best.heading!r} the heading, or the course over ground? By its name it may be either")
    if not best.on_globe and not clear and not best.settled:
        state.ask(
            ("psi", "north", "east"),
            f"is {best.north!r} north and does {best.heading!r} count to starboard, or does it count to port, with z "
            f"upwards, or with {best.north!r} east? Motion is the same in both; port and starboard change places: "
            "answer with --frame ned, enu, zup or ros",
        )
    mirrored = best.misfit < POOR and abs(best.mirrored) > abs(best.same)
    unnamed = not compass and not set(name_parts(best.heading)) & YAW
    lettered = _is_letter_axis(best.north) and _is_letter_axis(best.east)
    if (
        not best.on_globe
        and clear
        and mirrored
        and not best.counts
        and (unnamed or (lettered and not compass and not best.settled))
    ):
        state.ask(
            ("psi", "north", "east"),
            f"are {best.north!r} and {best.east!r} north and east, or the other way? Answer with --frame ned or enu",
        )
    if undecided and not (compass and (clear or best.on_globe)):
        state.ask(("psi",), f"the ship turns too little to show which way {best.heading!r} counts: to starboard?")
