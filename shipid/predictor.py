"""Physics and compensator as one deployable thing: save, load and predict, without pickle."""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from shipid.data.windows import Commands, from_frame, planned_means, to_frame
from shipid.engine.rollout import Distances, distances, rollout
from shipid.errors import DataError, ResultError
from shipid.files import write_arrays
from shipid.hybrid.compensator import Compensator
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel, check_vessel

Array = np.ndarray
FORMAT = 3


@dataclass(frozen=True)
class Predictor:
    """What predicts a trajectory from one instant: a vessel (or none), a compensator (or none), horizon and step.

    vessel : physics with its perturbed numbers; None is pure data-driven.
    horizon, step, method : number of steps, step [s] and rule of the physics rollout; wind is held.
    limits : column -> (least, greatest) seen in training: the region where the compensator has evidence.
    commands : `held` at their value at the instant, or `known` over the horizon: then each method takes `planned`, the
        command in force in each step, name -> (T, S).
    """

    vessel: Vessel | None
    compensator: Compensator | None
    horizon: int
    step: float
    method: str = "euler"
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    commands: Commands = "held"

    def physics(
        self,
        columns: Mapping[str, Array],
        memory: Mapping[str, Array] | None = None,
        planned: Mapping[str, Array] | None = None,
    ) -> Array:
        """Paths (T, S, 2) [m] of the physics alone in the frame (11); zeros for pure data-driven."""
        if self.vessel is None:
            return np.zeros((self.horizon, len(columns["u"]), 2))
        how = self.horizon, self.step, self.method
        paths, _ = physics_paths(self.vessel, columns, *how, memory=memory, planned=self._plan(planned))
        return paths[:, 0]

    def compensation(self, columns: Mapping[str, Array], planned: Mapping[str, Array] | None = None) -> Array:
        """What the compensator adds, (T, S, 2) [m] in the frame (11); zeros without one."""
        if self.compensator is None:
            return np.zeros((self.horizon, len(columns["u"]), 2))
        means = planned_means(columns, self._plan(planned) or {})
        return self.compensator.predict({**columns, **means})

    def predict(
        self,
        columns: Mapping[str, Array],
        memory: Mapping[str, Array] | None = None,
        planned: Mapping[str, Array] | None = None,
    ) -> Array:
        """Cooperative paths (T, S, 2) [m] in the frame (11), from columns (S,) at the instants of prediction."""
        both: Array = self.physics(columns, memory, planned) + self.compensation(columns, planned)
        return both

    def _plan(self, planned: Mapping[str, Array] | None) -> Mapping[str, Array] | None:
        if self.commands == "known" and planned is None:
            raise DataError("this predictor was made for known commands: it needs those planned over the horizon")
        return planned if self.commands == "known" else None

    def outside(self, columns: Mapping[str, Array]) -> Array:
        """Whether each instant (S,) lies outside what training has seen, in any column."""
        outside = np.zeros(len(columns["u"]), dtype=bool)
        for name, (low, high) in self.limits.items():
            if name in columns:
                slack = 1e-9 * max(1.0, abs(low), abs(high))
                outside |= (columns[name] < low - slack) | (columns[name] > high + slack)
        return outside

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Write one `.npz` of arrays and a JSON header; it appears whole or not at all."""
        header = {
            "format": FORMAT,
            "vessel": None if self.vessel is None else {"document": self.vessel.document, "file": self.vessel.file},
            "horizon": self.horizon,
            "step": self.step,
            "method": self.method,
            "commands": self.commands,
            "limits": {name: list(pair) for name, pair in self.limits.items()},
            "provenance": dict(self.provenance),
            "compensator": None if self.compensator is None else self.compensator.header(),
        }
        arrays = {} if self.compensator is None else self.compensator.arrays()
        target = Path(file)
        write_arrays(target, {"header": np.array(json.dumps(header)), **arrays})  # weights do not shrink
        return target

    @classmethod
    def load(cls, file: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; ResultError for anything else."""
        foreign = ResultError("not a predictor of shipid: a run's folder has them in cells/", file=file)
        try:
            arrays = read_arrays(file)
            header = json.loads(str(arrays.pop("header")))
        except OSError as error:
            raise ResultError(f"cannot be read ({error.strerror or 'not a predictor'})", file=file) from None
        except (ValueError, KeyError):
            raise foreign from None
        if not isinstance(header, dict):
            raise foreign
        if header.get("format") != FORMAT:
            raise ResultError(
                f"written in format {header.get('format')}, this shipid reads {FORMAT}: run the study again", file=file
            )
        try:
            vessel, compensator = header["vessel"], header["compensator"]
            return cls(
                vessel=None if vessel is None else check_vessel(vessel["document"], vessel["file"]),
                compensator=None if compensator is None else Compensator.from_arrays(compensator, arrays),
                horizon=int(header["horizon"]),
                step=float(header["step"]),
                method=str(header["method"]),
                limits={name: (low, high) for name, (low, high) in header["limits"].items()},
                provenance=dict(header["provenance"]),
                commands=header["commands"],
            )
        except ResultError as error:
            raise ResultError(error.message, file=file, path=error.path) from None
        except (KeyError, TypeError, ValueError, AttributeError, IndexError):
            raise ResultError("damaged: run the study again", file=file) from None


def read_arrays(file: str | os.PathLike[str]) -> dict[str, Array]:
    """Read all arrays of a `.npz`, never a pickle: OSError if it cannot be opened, ValueError for anything else."""
    try:
        with Path(file).open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (zipfile.BadZipFile, zlib.error, EOFError, TypeError, AttributeError, NotImplementedError) as error:
        raise ValueError(f"{file} is not a whole .npz") from error


def physics_paths(
    vessel: Vessel,
    columns: Mapping[str, Array],
    horizon: int,
    step: float,
    method: str,
    *,
    parameters: Array | None = None,
    memory: Mapping[str, Array] | None = None,
    planned: Mapping[str, Array] | None = None,
    device: str = "cpu",
) -> tuple[Array, Array]:
    """Paths (T, V, S, 2) [m] of V variants in the frame (11) of S instants, and which diverged (V, S).

    Commands and wind are held at their value at the instant (method, section 2), but for commands that are `planned`,
    name -> (T, S). What the vessel feels and the columns do not hold, such as wind that was not measured, is zero: see
    `assumed`.
    """
    found = rollout(
        vessel,
        *_instants(vessel, columns, planned),
        step=step,
        num_steps=horizon,
        method=method,  # type: ignore[arg-type]
        parameters=parameters,
        memory=memory,
        keep=("north", "east"),
        device=device,
    )
    north, east = found["north"], found["east"]
    with np.errstate(invalid="ignore"):  # a diverged path is flagged, and no news to the caller
        x, y = to_frame(north[1:], east[1:], north[0], east[0], columns["psi"])
    return np.stack([x, y], axis=-1), found.diverged


def physics_distances(
    vessel: Vessel,
    columns: Mapping[str, Array],
    future: Array,
    step: float,
    method: str,
    *,
    parameters: Array | None = None,
    memory: Mapping[str, Array] | None = None,
    planned: Mapping[str, Array] | None = None,
    engine: str = "auto",
    device: str = "cpu",
) -> Distances:
    """Distances of V variants to the true paths `future` (T, S, 2) [m] in the frame (11) of S instants.

    The errors of `physics_paths` in sum and tally, without keeping a path: for families too large to keep.
    """
    origin = (columns.get(name, np.zeros(future.shape[1])) for name in ("north", "east", "psi"))
    return distances(
        vessel,
        *_instants(vessel, columns, planned),
        np.stack(from_frame(future[..., 0], future[..., 1], *origin), axis=-1),
        step=step,
        method=method,  # type: ignore[arg-type]
        parameters=parameters,
        memory=memory,
        engine=engine,
        device=device,
    )


def _instants(
    vessel: Vessel, columns: Mapping[str, Array], planned: Mapping[str, Array] | None
) -> tuple[dict[str, Array], Mapping[str, Array], dict[str, Array]]:
    """Start, commands and environment of a rollout from columns (S,); what is not there is zero."""
    model = dynamics(vessel)
    zero = np.zeros(len(columns["u"]))
    columns = {"down": columns.get("z", zero), **columns}
    start = {name: columns.get(name, zero) for name in model.state}
    environment = {name: columns.get(name, zero) for name in model.environment}
    return start, {**columns, **(planned or {})}, environment


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
