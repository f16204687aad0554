"""The physics of a predictor: a vessel with its numbers, rolled out from instants of prediction; or no physics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipid.data.windows import Instants, from_frame, to_frame
from shipid.engine.gradient import rollout_gradient, squared_distance
from shipid.engine.integrate import Method as Integrator
from shipid.engine.rollout import Distances, distances, rollout
from shipid.errors import DataError
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel

Array = np.ndarray
MOTION = ("u", "v", "r", "psi")


@dataclass(frozen=True)
class Physics:
    """What the physics predicts from an instant: `horizon` steps of `step` [s] by the rule `integrator`.

    vessel : equations with their numbers; None is no physics, whose paths are zero.
    integrator : `euler` or `rk4`. Wind is held at its value at the instant, commands are held or planned.
    """

    vessel: Vessel | None
    horizon: int
    step: float
    integrator: Integrator = "euler"

    def with_values(self, values: Mapping[str, Any]) -> Physics:
        """Return the same physics with other numbers, dotted path -> value."""
        return self if self.vessel is None else replace(self, vessel=self.vessel.with_values(values))

    def paths(self, instants: Instants) -> Array:
        """Paths (T, S, 2) [m] in the frame (11); zeros without physics, not finite where the rollout diverges."""
        if self.vessel is None:
            return np.zeros((self.horizon, len(instants), 2))
        paths, _ = self.variant_paths(instants)
        return paths[:, 0]

    def variant_paths(
        self, instants: Instants, parameters: Array | None = None, device: str = "cpu"
    ) -> tuple[Array, Array]:
        """Paths (T, V, S, 2) [m] in the frame (11) of V variants, `parameters` (V, P), and which diverged (V, S).

        What the vessel feels and the columns do not hold, such as wind that was not measured, is zero: see `assumed`.
        """
        found = self._rollout(instants, ("north", "east"), parameters, device)
        north, east = found["north"], found["east"]
        with np.errstate(invalid="ignore"):  # a diverged path is flagged, and no news to the caller
            x, y = to_frame(north[1:], east[1:], north[0], east[0], instants.columns["psi"])
        return np.stack([x, y], axis=-1), found.diverged

    def states(self, instants: Instants, tau_extra: Array | None = None, *, engine: str = "auto") -> dict[str, Array]:
        """Return x, y [m] in the frame (11), u, v, r and psi after 1..T steps, name -> (T, S).

        tau_extra : (T, S, n_dof) forces [N, N m] added over the horizon; None adds none.
        engine : as in `rollout`.
        """
        assert self.vessel is not None
        found = self._rollout(instants, ("north", "east", *MOTION), None, "cpu", tau_extra, engine)
        with np.errstate(invalid="ignore"):
            origin = found["north"][0, 0], found["east"][0, 0], instants.columns["psi"]
            x, y = to_frame(found["north"][1:, 0], found["east"][1:, 0], *origin)
        return {"x": x, "y": y, **{name: found[name][1:, 0] for name in MOTION}}

    def reached(self, instants: Instants) -> dict[str, Array]:
        """What the actuators have reached after 0..T steps, name -> (T + 1, S); none where orders act at once."""
        names = () if self.vessel is None else tuple(dynamics(self.vessel).memory)
        if not names:
            return {}
        found = self._rollout(instants, tuple(f"actual.{name}" for name in names), None, "cpu")
        return {name: found[f"actual.{name}"][:, 0] for name in names}

    def gradient(
        self, instants: Instants, future: Array, names: Sequence[str], parameters: Array | None = None
    ) -> tuple[float, Array]:
        """Mean squared position error [m^2] over windows and steps, and its slope by the parameters `names`, (K,).

        future : true paths (T, S, 2) [m] in the frame (11). parameters : (P,) numbers instead of the vessel's.
        Windows on which the rollout diverges are left out; the error is infinite where all do.
        """
        assert self.vessel is not None
        found = rollout_gradient(
            self.vessel,
            *self._inputs(instants),
            squared_distance(self._north_east(instants, future)),
            step=self.step,
            num_steps=self.horizon,
            method=self.integrator,
            names=names,
            parameters=parameters,
            memory=instants.hidden,
        )
        sound = ~found.diverged
        if not sound.any():
            return float("inf"), np.zeros(len(names))
        return float(found.loss[sound].mean()), np.asarray(found.parameters[sound].mean(axis=0))

    def _north_east(self, instants: Instants, future: Array) -> Array:
        """Paths (T, S, 2) [m] in the frame (11) as north and east."""
        origin = (instants.columns.get(name, np.zeros(len(instants))) for name in ("north", "east", "psi"))
        return np.stack(from_frame(future[..., 0], future[..., 1], *origin), axis=-1)

    def distances(
        self,
        instants: Instants,
        future: Array,
        parameters: Array | None = None,
        *,
        engine: str = "auto",
        device: str = "cpu",
    ) -> Distances:
        """Distances of V variants to the true paths `future` (T, S, 2) [m] in the frame (11), without keeping paths."""
        assert self.vessel is not None
        return distances(
            self.vessel,
            *self._inputs(instants),
            self._north_east(instants, future),
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
        tau_extra: Array | None = None,
        engine: str = "auto",
    ) -> Any:
        assert self.vessel is not None
        return rollout(
            self.vessel,
            *self._inputs(instants),
            step=self.step,
            num_steps=self.horizon,
            method=self.integrator,
            parameters=parameters,
            memory=instants.hidden,
            tau_extra=tau_extra,
            keep=keep,
            engine=engine,
            device=device,
        )

    def _inputs(self, instants: Instants) -> tuple[dict[str, Array], Mapping[str, Array], dict[str, Array]]:
        """Start, commands and environment of a rollout; states and weather without a column are zero."""
        assert self.vessel is not None
        model = dynamics(self.vessel)
        zero = np.zeros(len(instants))
        columns = {"down": instants.columns.get("z", zero), **instants.columns}
        start = {name: columns.get(name, zero) for name in model.state}
        environment = {name: columns.get(name, zero) for name in model.environment}
        return start, {**columns, **(instants.planned or {})}, environment


def assumed(vessel: Vessel, columns: Mapping[str, Array]) -> list[str]:
    """States and weather that a vessel has and the columns do not hold: they are taken as zero and must be said."""
    model = dynamics(vessel)
    return [name for name in (*model.state, *model.environment) if name not in columns]


def check_columns(vessel: Vessel, columns: Mapping[str, Array], file: str) -> None:
    """Raise DataError if a command of the vessel is not among the columns."""
    missing = [name for name in dynamics(vessel).commands if name not in columns]
    if missing:
        commands = sorted(name for name in columns if "." in name)
        raise DataError(
            f"{vessel.name} takes this command; the data have {', '.join(commands) or 'no commands'}",
            file=file,
            path=missing[0],
        )
