"""What is wrong with places that somebody else predicts, in one sentence.

It is a search over hypotheses: a change of the given places that would undo a mistake is believed where it lowers the
error at the first step and over the whole horizon, and does not do so for constant u, v, r as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from shipid.data.windows import Windows, constant_motion, from_frame, to_frame
from shipid.metrics import position_error
from shipid.report.wording import counted_text

Array = np.ndarray
PLACES = ["north", "east"]
BELIEVED = 0.75  # times the error as given: a change of the places that leaves less undoes a mistake
GENERAL = 0.3  # times the error under any other hypothesis: a wrong start explains more if less is left
SLOPE = 0.4  # by which changes of heading and place may differ from the integrals of r, u and v, as a share
SLIGHT = 0.1  # times the speed: less is no drift
FORESEEN = 0.2  # times the least error that can be believed: less is knowledge of the future


def path_of_places(places: Array, test: Windows, turn: Array | float = 0.0) -> Array:
    """Paths (T, S, 2) [m] in the frame (11), turned by angles [rad], of places (T, S, 2) [m], north and east."""
    north, east, psi = (test.columns[name] for name in (*PLACES, "psi"))
    return np.stack(to_frame(places[..., 0], places[..., 1], north, east, psi + turn), axis=-1)


def _places_of_path(path: Array, test: Windows) -> Array:
    """Places (T, S, 2) [m], north and east, of a path (T, S, 2) [m] in the frame (11)."""
    north, east, psi = (test.columns[name] for name in (*PLACES, "psi"))
    return np.stack(from_frame(path[..., 0], path[..., 1], north, east, psi), axis=-1)


def _undo_delay(steps: int) -> Undoing:
    """What undoes a delay by so many steps; below 0 places are too early. Steps that are not given are NaN."""

    def shift(places: Array, test: Windows) -> Array:
        moved = np.roll(path_of_places(places, test), -steps, axis=0)
        moved[slice(-steps, None) if steps > 0 else slice(-steps)] = np.nan
        return moved

    return shift


def _undo_degrees(places: Array, test: Windows) -> Array:
    """Places that are latitudes and longitudes, from the first step of constant u, v, r on."""
    scale = 60 * 1852.0 * np.array([1.0, np.cos(np.radians(places[..., 0].mean()))])
    first = _places_of_path(constant_motion(test), test)[:1]
    return path_of_places(first + (places - places[:1]) * scale, test)


def _undo_offset(places: Array, test: Windows) -> Array:
    """Paths moved so that the line through their first two steps starts at the ship."""
    path = path_of_places(places, test)
    return np.asarray(path - 2 * path[:1] + path[min(1, len(path) - 1)])


# places (T, S, 2) as given, test windows -> paths (T, S, 2) [m] in the frame (11) without a mistake
Undoing = Callable[[Array, Windows], Array]
# what may be wrong -> what undoes it; `hypotheses_of` adds delays
HYPOTHESES: dict[str, Undoing] = {
    "wrong frame, north and east are exchanged": lambda places, test: path_of_places(places[..., ::-1], test),
    "wrong frame, north and east count from the ship": lambda places, test: path_of_places(
        places + _places_of_path(0 * places, test), test
    ),
    "wrong frame, north and east are x and y in the axes of the ship": lambda places, _: places,
    "wrong frame, x and y are added to north and east without the heading": lambda places, test: (
        places - _places_of_path(0 * places, test)
    ),
    "wrong frame, the heading turns the path the wrong way": lambda places, test: path_of_places(
        places, test, -2 * test.columns["psi"]
    ),
    "mirrored, port is starboard": lambda places, test: path_of_places(places, test) * [1.0, -1.0],
    "mirrored, ahead is astern": lambda places, test: -path_of_places(places, test),
    "in degrees, the heading that turns the path": lambda places, test: path_of_places(
        places, test, np.degrees(test.columns["psi"]) - test.columns["psi"]
    ),
    "in degrees, north and east": _undo_degrees,
    "in mm, north and east": lambda places, test: path_of_places(places / 1000, test),
    "in km, north and east": lambda places, test: path_of_places(places * 1000, test),
    "in ft, north and east": lambda places, test: path_of_places(places * 0.3048, test),
}


def hypotheses_of(test: Windows) -> dict[str, Undoing]:
    """The hypotheses for some windows: delays are of a step, and of the time between two instants."""
    between = np.round(np.diff(test.t[:2]) / test.step).astype(int).tolist()
    delays = {
        f"{words} by {counted_text(steps, 'step')}": _undo_delay(sign * steps)
        for steps in {1, *between} & set(range(1, test.horizon))
        for words, sign in (("late", 1), ("saw the future, early", -1))
    }
    return HYPOTHESES | delays


def doubt_of_places(places: Array, test: Windows, believable: Array | None = None) -> str:
    """Say in one sentence what seems to be wrong with places (T, S, 2) [m]; empty where nothing does.

    believable : the least error (T,) [m] at each step that anybody can have.
    """
    doubt, least = "", 1.0
    naive = _places_of_path(constant_motion(test), test)
    for words, undo in {**hypotheses_of(test), "the path does not start at the ship": _undo_offset}.items():
        gain, fair = (_error_ratio(undo(given, test), path_of_places(given, test), test) for given in (places, naive))
        if gain < BELIEVED * min(1.0, fair) and gain < least * (GENERAL if undo is _undo_offset else 1.0):
            least, doubt = gain, f"{words}: undone, the error is {gain:.2g} times as large"
    if doubt or believable is None:
        return doubt
    share = float((errors_at_steps(path_of_places(places, test), test) / believable).min())
    return (
        f"saw the future: at a step its error is {share:.2g} of the least that can be known" if share < FORESEEN else ""
    )


def doubt_of_rates(motion: Array, step: float, slope: float = SLOPE) -> str:
    """Say which of r, u, v the changes of heading and place do not follow; empty where they do.

    motion : (S, K + 1, 6) north, east [m], psi [rad], u, v [m/s], r [rad/s], steps [s] apart.
    """
    north, east, psi, u, v, r = np.moveaxis(motion, -1, 0)
    middle, *rates = [(one[:, 1:] + one[:, :-1]) / 2 for one in (psi, r, u, v)]
    along = np.diff(north + 1j * east) * np.exp(-1j * middle)
    changes, fastest = (np.diff(psi), along.real, along.imag), np.hypot(*rates[1:]).max()
    for name, what, change, rate in zip("ruv", ("heading", "place", "place"), changes, rates, strict=True):
        size = float((rate**2).sum()) * bool(change.any())  # a heading that is held may leave r as it was
        ratio = float((change * rate).sum()) / (step * size) if size else 1.0
        if abs(ratio - 1) > slope and (name != "v" or np.sqrt(size) > SLIGHT * fastest):
            return (
                f"{name}: {what} changes by {ratio:.3g} times the integral of {name}: "
                "check sign (scale), unit and frame of both"
            )
    return ""


def doubt_of_motion(states: Mapping[str, Array], cut: Windows) -> str:
    """Say what seems to be wrong with states, name -> (T, S), of some windows; empty where nothing does."""
    doubt = doubt_of_places(np.stack([states[name] for name in PLACES], axis=-1), cut)
    names = (*PLACES, "psi", "u", "v", "r")
    if doubt or not states.keys() >= {*names}:
        return doubt
    motion = [np.insert(states[name], 0, cut.columns.get(name, states[name][0]), axis=0).T for name in names]
    return doubt_of_rates(np.stack(motion, axis=-1), cut.step)


def errors_at_steps(path: Array, test: Windows) -> Array:
    """Mean error (T,) [m] at each step, with a millimetre added; NaN for steps that are not given."""
    return np.asarray(position_error(path, test.future).mean(axis=1)) + 1e-3


def _error_ratio(path: Array, given: Array, test: Windows) -> float:
    """How many times as large errors are, geometric mean over steps; 1 at least where the first one is no better."""
    ratio = errors_at_steps(path, test) / errors_at_steps(given, test)
    ratio = ratio[np.isfinite(ratio)]
    return max(float(np.exp(np.log(ratio).mean())), float(ratio[0] > 1))
