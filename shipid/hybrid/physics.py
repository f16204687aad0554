"""The physics of a predictor: a vessel with its numbers, rolled out from instants of prediction; or no physics."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from shipid.arguments import (
    as_float_array,
    check_choice,
    check_class,
    check_mapping,
    check_positive,
    check_whole_number,
)
from shipid.data.windows import Instants, PathSource, from_frame, to_frame
from shipid.engine.engines import AUTO, REPEATED
from shipid.engine.gradient import rollout_gradient, squared_distance_loss
from shipid.engine.integrate import Array
from shipid.engine.integrate import Method as Integrator
from shipid.engine.rollout import SPEED_LIMIT, Distances, Trajectories, rollout, rollout_distances
from shipid.errors import DataError, ShipidError
from shipid.metrics import vector_lengths
from shipid.observer import ESTIMATE_COLUMNS, Observer, filter_bank, observed_start
from shipid.physics.signals import ACTUAL
from shipid.simulation.log import LEANING, body_velocities, horizontal_velocities, state_column
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

MOTION = ("u", "v", "r", "psi")
ESTIMATED = tuple(f"observer.{name}" for name in ESTIMATE_COLUMNS)
REPEATED_FROM = 5_000  # steps of one rollout: who asks for so many at once, in training or on a log, asks again
RolloutInputs = tuple[dict[str, Array], Mapping[str, Array], Mapping[str, Array], Array | None, Array | None]
"""Start, commands, environment, slow force (T, S, n_dof) and drift (2, S) of a rollout."""
Needs = Literal["path", "motion", "steps", "equations"]
"""What a method asks of the physics: its paths, u, v, r and psi along them, starts from any state, or equations."""


@dataclass(frozen=True)
class Physics:
    """What the physics predicts from an instant: `horizon` steps of `step` [s] by the rule `integrator`.

    vessel : None is no physics, whose paths are zero.
    observer : with one, the physics starts from the filtered state in moving water, under the slow force as it fades;
        instants must then hold its `estimates`.
    path : where true positions come from, see `cut_windows`. ShipidError for a wrong argument.
    """

    vessel: Vessel | None
    horizon: int
    step: float
    integrator: Integrator = "euler"
    observer: Observer | None = None
    path: PathSource = "position"

    def __post_init__(self) -> None:
        if self.vessel is not None:
            check_class("vessel", self.vessel, Vessel, "as of `load_vessel`, or None")
        object.__setattr__(self, "horizon", check_whole_number("horizon", self.horizon, 1))
        object.__setattr__(self, "step", check_positive("step", self.step))
        check_choice("integrator", self.integrator, get_args(Integrator))
        if self.observer is not None:
            check_class("observer", self.observer, Observer, "such as Observer(), or None")
        check_choice("path", self.path, get_args(PathSource))

    def with_values(self, values: Mapping[str, Any]) -> Physics:
        """Return the same physics with other numbers, dotted path -> value."""
        return self if self.vessel is None else replace(self, vessel=self.vessel.with_values(values))

    @property
    def gives(self) -> tuple[Needs, ...]:
        """What a method may ask of it."""
        return get_args(Needs)

    @property
    def absent(self) -> bool:
        """Whether there is no physics, so that all paths are zero."""
        return self.vessel is None

    @property
    def absence(self) -> Physics:
        """No physics, of the same steps."""
        return replace(self, vessel=None, observer=None)

    @property
    def ship(self) -> Vessel:
        """The vessel; ShipidError where there is none."""
        if self.vessel is None:
            raise ShipidError("no physics, so nothing to roll out: give a vessel, or ask for `paths`, which are zero")
        return self.vessel

    def paths(self, instants: Instants) -> Array:
        """Paths (T, S, 2) [m] in the frame (11), see `variant_paths`; zeros without physics."""
        return self.variant_paths(instants)[0][:, 0]

    def variant_paths(
        self, instants: Instants, parameters: Array | None = None, device: str = "cpu"
    ) -> tuple[Array, Array]:
        """Paths (T, V, S, 2) [m] in the frame (11) of V variants, `parameters` (V, P), and which diverged (V, S).

        From where one diverges it keeps its last velocity, see `hold_velocity`. It is no number where an input is
        none. What the columns do not hold is zero: see `missing_columns`. Without physics there is one, zero.
        """
        check_instants(instants)
        if self.vessel is None:
            return np.zeros((self.horizon, 1, len(instants), 2)), np.zeros((1, len(instants)), bool)
        result, (north, east), lost = self._rollout(instants, ("north", "east"), parameters, device)
        paths = np.stack(positions_in_frame(instants, north, east), axis=-1)
        begun = self.step * np.stack([instants.columns.get(name, 0 * lost) for name in ("u", "v")], axis=-1)
        bad, limit = result.diverged, SPEED_LIMIT * self.step
        paths[:, bad] = hold_velocity(paths[:, bad], np.broadcast_to(begun, paths.shape[1:])[bad], limit)
        return paths + lost[:, None], bad

    def states(self, instants: Instants, *, engine: str = AUTO) -> dict[str, Array]:
        """Return x, y [m] in the frame (11), u, v, r and psi after 1..T steps, name -> (T, S), horizontal as in a log.

        With an observer u and v are those through the water.
        """
        leaning = tuple(name for name in LEANING if name in vessel_dynamics(self.ship).state)
        kept = ("north", "east", *MOTION, *leaning)
        result, (north, east), lost = self._rollout(instants, kept, None, "cpu", engine)
        lost = np.where(result.diverged[0], np.nan, lost)
        x, y = positions_in_frame(instants, north[:, 0] + lost, east[:, 0] + lost)
        motion = {name: result[name][1:, 0] for name in (*MOTION, *leaning)}
        if leaning:
            with np.errstate(all="ignore"):  # a path that diverged
                motion |= horizontal_velocities(motion)
        return {"x": x, "y": y, **{name: motion[name] for name in MOTION}}

    def reached(self, instants: Instants) -> dict[str, Array]:
        """What the actuators have reached after 0..T steps, name -> (T + 1, S); none where orders act at once."""
        names = () if self.vessel is None else tuple(vessel_dynamics(self.vessel).memory)
        if not names:
            return {}
        kept = ("north", "east", *(f"{ACTUAL}{name}" for name in names))
        result, *_ = self._rollout(instants, kept, None, "cpu")
        return {name: result[f"{ACTUAL}{name}"][:, 0] for name in names}

    def call_once(self, function: Callable[..., dict[str, Array]]) -> Callable[..., dict[str, Array]]:
        """Return a function of instants and arrays as it is; physics on symbols writes it once, as one of CasADi."""
        return function

    def gradient(
        self, instants: Instants, future: Array, names: Sequence[str], parameters: Array | None = None
    ) -> tuple[float, Array]:
        """Mean squared position error [m^2] over windows and steps, and its slope by the parameters `names`, (K,).

        future : true paths (T, S, 2) [m] in the frame (11). parameters : (P,) numbers instead of the vessel's.
        The error is infinite where the rollout of a window diverges.
        """
        start, commands, environment, slow, drift = self._inputs(instants)
        gradients = rollout_gradient(
            self.ship,
            start,
            commands,
            environment,
            squared_distance_loss(self._north_east(instants, future, drift)),
            step=self.step,
            num_steps=self.horizon,
            method=self.integrator,
            names=names,
            parameters=parameters,
            memory=instants.hidden,
            tau_extra=slow,
        )
        if gradients.diverged.any():
            return float("inf"), np.zeros(len(names))
        return float(gradients.loss.mean()), np.asarray(gradients.parameters.mean(axis=0))

    def _north_east(self, instants: Instants, future: Array, drift: Array | None) -> Array:
        """Paths (T, S, 2) [m] in the frame (11) as north and east, less the drift of the water."""
        future = as_float_array("future", future, DataError)
        if future.shape != (self.horizon, len(instants), 2):
            raise DataError(f"future must be {(self.horizon, len(instants), 2)}, not {future.shape}")
        goal = np.stack(from_frame(future[..., 0], future[..., 1], *_place_of_instants(instants)), axis=-1)
        if drift is not None:
            goal = goal - self.step * np.arange(1, len(future) + 1)[:, None, None] * drift.T
        return goal

    def distances(
        self,
        instants: Instants,
        future: Array,
        parameters: Array | None = None,
        *,
        engine: str = AUTO,
        device: str = "cpu",
    ) -> Distances:
        """Distances of V variants to the true paths `future` (T, S, 2) [m] in the frame (11), without keeping paths."""
        if self.observer is not None:
            raise ShipidError("screening takes no observer: screen the family that it extends", path="observer")
        start, commands, environment, _, _ = self._inputs(instants)
        return rollout_distances(
            self.ship,
            start,
            commands,
            environment,
            self._north_east(instants, future, None),
            step=self.step,
            method=self.integrator,
            parameters=parameters,
            memory=instants.hidden,
            engine=engine,
            device=device,
        )

    def _rollout(
        self,
        instants: Instants,
        keep: Sequence[str],
        parameters: Array | None,
        device: str,
        engine: str = AUTO,
    ) -> tuple[Trajectories, tuple[Array, Array], Array]:
        """Trajectories of the vessel, and north and east (T, V, S) [m] over ground after 1..T steps.

        Last (S,): NaN for an instant with an input that is no number, which a force may hide; else 0.
        """
        start, commands, environment, slow, drift = self._inputs(instants)
        if engine == AUTO and len(instants) * self.horizon > REPEATED_FROM:
            engine = REPEATED
        result = rollout(
            self.ship,
            start,
            commands,
            environment,
            step=self.step,
            num_steps=self.horizon,
            method=self.integrator,
            parameters=parameters,
            memory=instants.hidden,
            tau_extra=slow,
            keep=keep,
            engine=engine,
            device=device,
        )
        given = (*start.values(), *commands.values(), *environment.values())
        known = np.isfinite([np.atleast_2d(values).sum(axis=0) for values in given]).all(axis=0)
        lost = np.where(known, 0.0, np.nan)
        north, east = result["north"][1:], result["east"][1:]
        if drift is not None:
            ages = self.step * np.arange(1, self.horizon + 1)[:, None, None]
            north, east = north + ages * drift[0], east + ages * drift[1]
        return result, (north, east), lost

    def _inputs(self, instants: Instants) -> RolloutInputs:
        """Start, commands, environment, slow force and drift of a rollout; what has no column is zero."""
        check_instants(instants)
        model = vessel_dynamics(self.ship)
        zero = np.zeros(len(instants))
        columns: Mapping[str, Array] = {"down": instants.columns.get("z", zero), **instants.columns}
        given = {**columns, **(instants.planned or {})}
        check_columns(self.ship, given, "the instants")
        commands = {name: given[name] for name in model.commands}
        environment = {name: columns.get(name, zero) for name in model.environment}
        slow = drift = None
        if self.observer is not None:
            if missing := [name for name in ESTIMATED if name not in instants.estimates]:
                raise DataError("the physics has an observer: instants must hold its estimates", path=missing[0])
            observed = {**columns, **instants.estimates}
            begun = observed_start(filter_bank(self.ship, self.observer), observed, self.horizon, self.step, self.path)
            columns, environment, slow, drift = begun.columns, begun.environment, begun.tau_extra, begun.drift
        start = {name: columns.get(name, zero) for name in model.state}
        if not start.keys().isdisjoint(LEANING):
            start |= body_velocities(start)  # columns are horizontal
        return start, commands, environment, slow, drift


def hold_velocity(paths: Array, begun: Array, limit: float) -> Array:
    """Paths (T, ..., 2) [m] from the origin that repeat their last sound step from where a step is none.

    No place is farther from the origin than the step `begun` takes the ship by then; it lies on the line to it.

    begun : (..., 2) [m], by the present velocity; repeated where the first step is none. limit : [m], no sound step is
        longer.
    """
    places = np.concatenate([np.zeros_like(paths[:1]), paths])
    with np.errstate(all="ignore"):  # a step from infinity to infinity, a place at the origin
        steps = np.concatenate([begun[None], np.diff(places, axis=0)])
        sound = np.logical_and.accumulate(vector_lengths(steps[1:]) <= limit)[..., None]
        last = sound.sum(axis=0, keepdims=True)
        place, step = (np.take_along_axis(each, last, axis=0) for each in (places, steps))
        held = np.where(sound, paths, place + np.cumsum(~sound, axis=0) * step)
        reach = np.multiply.outer(np.arange(1, len(held) + 1), vector_lengths(begun))
        return np.asarray(held * np.fmin(reach / vector_lengths(held), 1.0)[..., None])


def _place_of_instants(instants: Instants) -> tuple[Array, Array, Array]:
    """Place and heading (S,) at the instants; zero where they are not among the columns."""
    zero = np.zeros(len(instants))
    columns = instants.columns
    return columns.get("north", zero), columns.get("east", zero), columns.get("psi", zero)


def positions_in_frame(instants: Instants, north: Array, east: Array) -> tuple[Array, Array]:
    """Positions (T, ..., S) [m] in the frame (11) of the instants; a path that diverged may not be finite."""
    with np.errstate(all="ignore"):  # it is flagged, and no news to the caller
        return to_frame(north, east, *_place_of_instants(instants))


def check_instants(instants: Instants) -> None:
    """Raise DataError for what are no instants, or for instants without columns."""
    check_class("instants", instants, Instants, "such as `windows.instants()`", DataError)
    check_mapping("columns of the instants", instants.columns, "a name to an array", DataError)
    if "u" not in instants.columns:  # which says how many instants there are
        raise DataError("the instants lack this column", path="u")


def missing_columns(vessel: Vessel, columns: Collection[str]) -> list[str]:
    """Columns of states and weather that a vessel has and the columns lack: taken as zero."""
    model = vessel_dynamics(vessel)
    needed = (state_column(name) for name in (*model.state, *model.environment))
    return [name for name in needed if name not in columns]


def check_columns(vessel: Vessel, columns: Collection[str], file: str) -> None:
    """Raise DataError if a command of the vessel is not among the columns."""
    missing = [name for name in vessel_dynamics(vessel).commands if name not in columns]
    if missing:
        commands = sorted(name for name in columns if "." in name)
        have = (
            f"{', '.join(commands)}. `shipid data import --guess LOG --vessel VESSEL` drafts a mapping with the names"
        )
        have = f"{have} of the vessel" if commands else "no commands: `shipid study new` without --vessel needs none"
        raise DataError(
            f"{vessel.name} needs this command; the data have {have}",
            file=file,
            path=missing[0],
        )
