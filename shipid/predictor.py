"""Physics and a fitted method as one deployable thing: save, load and predict, without pickle."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self, TypeVar, get_args, overload

import numpy as np
from pydantic import BaseModel, Field

from shipid.arguments import (
    as_float_array,
    as_names,
    as_path,
    check_choice,
    check_class,
    check_mapping,
    check_number,
    check_whole_number,
)
from shipid.data.windows import Commands, Instants, PathSource, Windows, fold_masks, locked_view, run_folds
from shipid.document import plain_values
from shipid.engine.integrate import Method as Integrator
from shipid.errors import DataError, ResultError, ShipidError, suggest_name
from shipid.files import read_arrays, write_arrays
from shipid.hybrid.bands import FEWEST, Bands, Region
from shipid.hybrid.calibration import calibrate_bands
from shipid.hybrid.mean import DeployedMethod, MeanCorrector, reason_of_no_band
from shipid.hybrid.method import Case, Index, Method, Task, fault_of_corrector, fit_all, name_of_class, widen_range
from shipid.hybrid.methods import METHODS, method_kind, method_names
from shipid.hybrid.novelty import NoveltyAlarm, alarm_inputs, calibrate_alarm
from shipid.hybrid.physics import Physics, check_columns, check_instants
from shipid.hybrid.simulated import physics_entry, physics_of_entry
from shipid.hybrid.stored import StoredData
from shipid.metrics import vector_lengths
from shipid.notebooks import NotebookView
from shipid.observer import AGE_COLUMN, Observer
from shipid.physics.signals import SIGNALS, measurable_signals
from shipid.plugins import error_location, locate_errors
from shipid.simulation.log import state_column
from shipid.units import percent_text
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

Array = np.ndarray
Part = TypeVar("Part", bound=StoredData)
FORMAT = 6
DIVISORS = ("std", "spread", "deviation")  # last words of the names of arrays by which inputs or traits are divided
BANDS, ALARM_PARTS = "bands.", "novelty."  # before the names of arrays of a band and an alarm in a saved predictor
MOST_HORIZON_STEPS = 100_000  # of a horizon and of a past


class BandedPrediction(NamedTuple):
    """A prediction with its band.

    paths : (T, S, 2) [m] in the frame (11). region : around every step, see `shipid.hybrid.bands.Region`.
    outside : the alarm (S,), see `Predictor.raise_alarm`: there no band is promised.
    """

    paths: Array
    region: Region
    outside: Array


@dataclass(frozen=True, eq=False, repr=False)
class Predictor(
    NotebookView, DeployedMethod, shown=("method", "vessel", "physics.horizon", "physics.step", "commands")
):
    """Physics and a fitted method as one deployable thing: it predicts a trajectory from one instant."""

    @overload
    def predict(self, instants: Instants, paths: Array | None = None) -> Array: ...

    @overload
    def predict(
        self,
        instants: Instants,
        paths: Array | None = None,
        *,
        level: float,
        pointwise: bool = False,
        kind: str | None = None,
    ) -> BandedPrediction: ...

    def predict(
        self,
        instants: Instants,
        paths: Array | None = None,
        *,
        level: float | None = None,
        pointwise: bool = False,
        kind: str | None = None,
    ) -> Array | BandedPrediction:
        """Return paths (T, S, 2) [m] in the frame (11); with a level, also the band around them.

        They are not numbers where a column that training or the vessel takes is none, at the instant, in the past that
        the method looks at, or in the plan.

        Parameters
        ----------
        instants : what is known at the instants of prediction.
        paths : (T, S, 2) [m] of the physics alone, if they are known already; they are not changed.
        level : share of the true paths that the band is to hold whole, such as 0.9.
        pointwise : the band holds that share of the positions at each step alone: it is narrower, and a whole path
            leaves it more often.
        kind : kind of manoeuvre under way, one of `bands.kinds`: the share then holds for runs of this kind.

        Raises
        ------
        DataError : planned commands, a column or a part of the past is missing, or has another shape; there were too
            few runs for the level.
        ShipidError : the method of a user makes a mistake, such as a division by zero.
        """
        if level is not None:
            self.check_level(level, kind)
        instants = self._known(instants)
        alone = locked_view(self._paths(self.physics.paths(instants) if paths is None else paths, instants))
        home = type(self.corrector)
        with locate_errors(f"{home.__name__}.predict", home):
            try:
                predicted, lost = self.corrector.predict(self.physics, instants, alone), self._lost(instants)
            except (KeyError, ValueError, TypeError, IndexError) as error:
                name = str(*error.args[:1]) if isinstance(error, KeyError) else ""
                lacks, place = name in self.limits and name not in instants.columns, error_location(error, home)
                if place and not lacks:  # a mistake in the code of a user
                    raise
                if name:
                    words = "the method was trained with this input, and the instants lack it"
                    raise DataError(f"{words}{place}", path=name) from error
                message = f"the method {self.method!r} and the instants do not fit together ({error})"
                raise DataError(message) from error
        predicted = self._paths(predicted, instants, f"paths of the method {self.method!r}")
        if np.may_share_memory(predicted, alone) or lost.any():  # the prediction is the caller's to change
            predicted = predicted.copy()
            predicted[:, lost] = np.nan
        if level is None:
            return predicted
        return BandedPrediction(
            predicted,
            self.band(predicted, instants, level, pointwise=pointwise, kind=kind),
            self.raise_alarm(instants, None if paths is None or self.vessel else np.zeros(len(instants), bool)),
        )

    def band(
        self, paths: Array, instants: Instants, level: float, *, pointwise: bool = False, kind: str | None = None
    ) -> Region:
        """Return the region around paths (T, S, 2) [m] of `predict` that are known already; DataError as there."""
        bands, instants = self.check_level(level, kind), self._checked(instants)
        _check_names_held(
            instants.columns, bands.names, "the band was calibrated with this column, and the instants lack it"
        )
        paths = self._paths(paths, instants)
        return bands.region(
            paths,
            instants.columns,
            self.physics.step,
            level,
            pointwise=pointwise,
            kind=kind,
            past=instants.past,
        )

    def check_level(self, level: float, kind: str | None = None) -> Bands:
        """Return the bands; DataError, one sentence, where there are none of this level."""
        return check_bands(self.bands, self.no_band, level, kind)

    def alone(self, instants: Instants) -> Array:
        """Return the paths (T, S, 2) [m] of the physics alone in the frame (11), see `roll_out`."""
        return self.roll_out(instants)[0]

    def roll_out(self, instants: Instants) -> tuple[Array, Array]:
        """Return the paths (T, S, 2) [m] of the physics alone in the frame (11), and whether it diverges (S,).

        Where it diverges a path keeps its last velocity. Paths are zeros for no physics, and not numbers for a mean,
        which diverges where a foundation of it does.
        """
        instants, moved = self._known(instants), self.physics_with_force
        if isinstance(self.corrector, MeanCorrector):
            each = [one.physics_with_force.variant_paths(at)[1][0] for one, at in self.corrector.at_parts(instants)]
            return np.full((self.physics.horizon, len(instants), 2), np.nan), np.any(each, axis=0)
        paths, lost = self.physics.variant_paths(instants)
        return paths[:, 0], (lost if moved is self.physics else moved.variant_paths(instants)[1])[0]

    @property
    def vessels(self) -> tuple[Vessel, ...]:
        """Vessels of the physics: of a mean those of all its foundations, none without physics."""
        parts = self.corrector.parts if isinstance(self.corrector, MeanCorrector) else (self,)
        return tuple(part.vessel for part in parts if part.vessel is not None)

    def _lost(self, instants: Instants) -> Array:
        """Instants (S,) with an input that is no number, now, in the past that the method looks at, or in the plan.

        Else a tree, an input that stands for two, or an error of the physics in the past would hide it.
        """
        taken, before = set(self.limits), {"x", "y", "psi", *self.limits}
        for vessel in self.vessels:
            model = vessel_dynamics(vessel)
            taken |= {*model.commands, *model.environment}
            before |= {*map(state_column, model.state), *taken}
        given = [np.zeros((1, len(instants)))]
        given += [values[None] for name, values in instants.columns.items() if name in taken]
        given += [values[-self.past :] for name, values in instants.past.items() if name in before and self.past]
        given += [values for name, values in (instants.planned or {}).items() if name in taken]
        return np.asarray(~np.isfinite(np.concatenate(given)).all(axis=0))

    def _paths(self, paths: Array, instants: Instants, what: str = "paths") -> Array:
        """The paths as numbers; DataError unless they are (T, S, 2), of this horizon and these instants."""
        paths, shape = as_float_array(what, paths, DataError), (self.physics.horizon, len(instants), 2)
        if paths.shape != shape:
            raise DataError(f"{what} must be {shape}, not {paths.shape}")
        return paths

    def _checked(self, instants: Instants) -> Instants:
        """The instants with arrays of floats that cannot be written to; DataError for another step or other shapes."""
        check_instants(instants)
        _check_names_held(instants.columns, ("u", "v", "r"), "the instants lack this column")
        step = self.physics.step
        if instants.step is not None and abs(check_number("step", instants.step, DataError) - step) > 1e-9 * step:
            message = f"instants of windows with steps of {instants.step:g} s, the predictor has {step:g} s"
            raise DataError(f"{message}: cut windows with its step")
        count = np.shape(instants.columns["u"])
        if len(count) != 1:
            raise DataError(f"must be (S,), a value for each instant, not {count}", path="u")
        motion = {name: values for name, values in instants.columns.items() if name != "run"}  # as of a table
        parts: dict[str, Any] = {"columns": _locked_floats("columns", motion, count)}
        horizon = self.physics.horizon if self.commands == "known" else None
        for part, leading in (("past", (None,)), ("planned", (horizon,)), ("hidden", ()), ("estimates", ())):
            given = getattr(instants, part)
            if given is not None or part in ("past", "estimates"):
                check_mapping(f"{part} of the instants", given, "a name to an array", DataError)
                parts[part] = _locked_floats(part, given, (*leading, *count))
        return replace(instants, **parts)

    def _known(self, instants: Instants) -> Instants:
        """The instants with planned commands where the predictor takes them, and without them where it does not."""
        instants = self._checked(instants)
        if self.commands == "held":
            return replace(instants, planned=None)
        if instants.planned is None:
            raise DataError("this predictor was made for known commands: it needs those planned over the horizon")
        needed = [name for vessel in self.vessels for name in vessel_dynamics(vessel).commands]
        _check_names_held(instants.planned, needed, "this command of the vessel is not among those planned")
        return instants

    def raise_alarm(self, instants: Instants, diverged: Array | None = None) -> Array:
        """Return whether each instant (S,) is unlike those of training in any input of the method, also in its past.

        Without a calibrated alarm, whether it is `outside` the limits. Also where the physics diverges: `diverged`
        (S,) of `roll_out`, if it is known already. DataError as of `predict`.
        """
        instants = self._known(instants)
        known = {**instants.columns, **instants.estimates}
        lost = self.roll_out(instants)[1] if diverged is None else diverged
        if self.alarm is None:
            return np.asarray(lost | self.outside(known))
        raised = lost | self.alarm.is_raised(alarm_inputs(self.alarm.inputs, self.alarm.past, self.physics, instants))
        return np.asarray(raised | self._is_unsettled(known, raised.shape))

    def outside(self, columns: Mapping[str, Array]) -> Array:
        """Return whether each instant (S,) is outside what training has seen, in any column; all are without limits.

        columns : name -> (S,), measured and, with an observer, its estimates: `observer.age` is compared with `run_up`,
            and where it is missing nobody knows that the observer has settled. Columns without limits, and limits
            without a column, are passed over.
        """
        check_mapping("columns", columns, "a name to an array", DataError)
        given = {name: columns[name] for name in (*self.limits, AGE_COLUMN) if name in columns}
        first: Any = next((columns[name] for name in (*self.limits, *columns) if name in columns), [])
        shape = np.shape(first)[:1] or (1,)
        known, outside = _locked_floats("columns", given, shape), np.full(shape, not self.limits)
        for name, ends in self.limits.items():
            if name in known:
                low, high = widen_range(*ends)
                outside |= ~((known[name] >= low) & (known[name] <= high))
        return np.asarray(outside | self._is_unsettled(known, shape))

    def _is_unsettled(self, columns: Mapping[str, Array], shape: tuple[int, ...]) -> Array:
        """Whether nobody knows that the observer has settled, if there is one."""
        age = columns.get(AGE_COLUMN, np.zeros(shape))
        return np.full(shape, self.run_up > 0) & ~(age >= self.run_up - 1e-3 * self.physics.step)

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Write one `.npz` of arrays and a JSON header; it appears whole or not at all.

        Raises
        ------
        ResultError : the file cannot be written.
        DataError : the method gives what could not be read back, such as an array with NaN.
        """
        target = as_path("file", file, ResultError)
        corrector, arrays = self._corrector_parts()
        header = {
            "format": FORMAT,
            "vessel": physics_entry(self.physics),
            "horizon": self.physics.horizon,
            "step": self.physics.step,
            "integrator": self.physics.integrator,
            "commands": self.commands,
            "causal": list(self.causal),
            "path": self.physics.path,
            "observer": None if self.physics.observer is None else self.physics.observer.model_dump(mode="json"),
            "limits": {name: list(pair) for name, pair in self.limits.items()},
            "run_up": self.run_up,
            "provenance": plain_values(self.provenance),
            "method": self.method,
            "corrector": corrector,
            **{name: part and part.header() for name, part in (("bands", self.bands), ("alarm", self.alarm))},
        }
        if target.is_dir():
            raise ResultError("is a folder: name a file to write", file=target)
        arrays["header"] = np.array(json.dumps(header, default=str))
        for prefix, part in ((BANDS, self.bands), (ALARM_PARTS, self.alarm)):
            if part is not None:
                arrays |= {prefix + name: values for name, values in part.arrays().items()}
        write_arrays(target, arrays)  # not compressed: weights do not shrink
        return target

    def _corrector_parts(self) -> tuple[dict[str, Any], dict[str, Array]]:
        """Header and arrays of the method; DataError for what would not be read back as it is."""
        home, what = type(self.corrector), f"of the method {self.method!r}"
        with locate_errors(f"{home.__name__}.header", home):
            header = plain_values(self.corrector.header())
        with locate_errors(f"{home.__name__}.arrays", home):
            given = self.corrector.arrays()
        try:
            json.dumps({**header})
        except (TypeError, ValueError) as error:
            raise DataError(
                f"the header {what} must be a table of texts, numbers and lists of them ({error})"
            ) from None
        try:
            arrays = {str(name): np.asarray(values) for name, values in {**given}.items()}
        except (TypeError, ValueError) as error:
            raise DataError(f"the arrays {what} must be a table of arrays ({error})") from None
        taken = next((name for name in arrays if name == "header" or name.startswith((BANDS, ALARM_PARTS))), None)
        fault = _fault_of(arrays) if taken is None else f"{taken!r} is a name that is taken: use another"
        if fault:
            raise DataError(f"arrays {what}: {fault}")
        return header, arrays

    def check_restored(self, instants: Instants, paths: Array, kind: type[Any]) -> None:
        """Raise ShipidError where the method of a user, read back from what `save` writes, predicts something else.

        instants, paths : of which the first is predicted, as for `predict`. kind : the `corrector` of the method.
        """
        home = type(self.corrector)
        if home.__module__.startswith("shipid."):  # the tests of shipid say so
            return
        header, arrays = self._corrector_parts()
        with locate_errors(f"{kind.__name__}.from_arrays", kind):
            corrector = kind.from_arrays(json.loads(json.dumps(header)), arrays)
        if fault := fault_of_corrector(corrector):
            raise ShipidError(f"`from_arrays` of {name_of_class(kind)} must return a corrector: {fault}")
        one, first = instants.select(np.arange(1)), paths[:, :1]
        kept, restored = (replace(self, corrector=each).predict(one, first) for each in (self.corrector, corrector))
        if not np.allclose(kept, restored, rtol=1e-6, atol=1e-6, equal_nan=True):
            away = float(np.nanmax(vector_lengths(kept - restored)))
            raise ShipidError(
                f"the method {self.method!r}, saved and read back, predicts places {away:.2g} m away: `header`, "
                "`arrays` and `from_arrays` must keep all that `predict` uses, and `predict` may draw nothing at random"
            )

    def export(
        self, to: str, out: str | os.PathLike[str], *, single: bool = False, name: str | None = None
    ) -> list[Path]:
        """Write it for others, to `c`, `fmu`, `casadi` or `onnx`: see `shipid.export.write.export_predictor`."""
        from shipid.export.write import export_predictor  # a study does not need it

        return export_predictor(self, to, out, single=single, name=name)

    @classmethod
    def load(cls, file: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; ResultError for anything else."""
        try:
            arrays = read_arrays(file)
            header = {**json.loads(str(arrays.pop("header")))}
        except IsADirectoryError:
            raise ResultError("a folder: name one of its cells, FOLDER/cells/NAME.npz", file=file) from None
        except OSError as error:
            raise ResultError(f"cannot be read ({error.strerror or 'not a predictor'})", file=file) from None
        except (ValueError, KeyError, TypeError, RecursionError):
            raise ResultError("not a predictor of shipid: a run's folder has them in cells/", file=file) from None
        _check_format(header, file)
        kind: Any = header.get("method")
        if isinstance(kind, str) and kind not in METHODS:
            raise ResultError(f"made by the method {kind!r}, which is not known here: {method_names(kind)}", file=file)
        if fault := _fault_of(arrays):
            raise ResultError(f"damaged: {fault}: run the study again", file=file)
        try:
            known, vessel = _Header.model_validate(header), header["vessel"]
            bands = _read_part(Bands, BANDS, header.get("bands"), arrays)
            alarm = _read_part(
                NoveltyAlarm, ALARM_PARTS, header.get("alarm"), arrays
            )  # the arrays left are the method's
            made = MeanCorrector if "mean_of" in header["corrector"] else METHODS[kind].corrector
            loaded = cls(
                physics=physics_of_entry(
                    vessel,
                    horizon=known.horizon,
                    step=known.step,
                    integrator=known.integrator,
                    observer=None if header["observer"] is None else Observer(**header["observer"]),
                    path=known.path,
                ),
                method=kind,
                corrector=made.from_arrays(header["corrector"], arrays),
                limits=known.limits,
                provenance=known.provenance,
                commands=known.commands,
                causal=tuple(known.causal),
                bands=bands,
                alarm=alarm,
                run_up=known.run_up,
            )
            if not 0 <= loaded.past <= MOST_HORIZON_STEPS:
                raise ResultError(f"damaged: a past of {loaded.past} steps: 0 to {MOST_HORIZON_STEPS}")
            return loaded
        except ResultError as error:
            raise ResultError(error.message, file=file, path=error.path) from None
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError, ShipidError):
            raise ResultError("damaged: run the study again", file=file) from None


def _check_names_held(given: Mapping[str, Array], names: Iterable[str], fault: str) -> None:
    """Raise DataError, with the first name that is not given."""
    for name in names:
        if name not in given:
            raise DataError(fault, path=name)


def _locked_floats(part: str, given: Mapping[str, Array], shape: tuple[int | None, ...]) -> dict[str, Array]:
    """Arrays of floats that cannot be written to; DataError for another shape, of which a None is any length."""
    arrays = {str(name): locked_view(as_float_array(f"{part} {name!r}", given[name], DataError)) for name in given}
    for name, array in arrays.items():
        if len(shape) != array.ndim or any(size not in (None, n) for size, n in zip(shape, array.shape, strict=True)):
            wanted = ", ".join("P" if size is None else str(size) for size in shape)
            raise DataError(f"{part} must be ({wanted}), not {array.shape}", path=name)
    return arrays


class _Header(BaseModel):
    """Further fields of the header of a predictor (besides vessel, observer and method), with their types."""

    horizon: Annotated[int, Field(ge=1, le=MOST_HORIZON_STEPS)]
    step: Annotated[float, Field(gt=0, le=1e4)]
    integrator: Integrator
    commands: Commands
    causal: list[str]
    path: PathSource
    limits: dict[str, tuple[float, float]]
    provenance: dict[str, Any]
    run_up: Annotated[float, Field(ge=0, le=1e9)] = 0.0


def _fault_of(arrays: Mapping[str, Array]) -> str:
    """Which array holds anything but numbers, or NaN, or is a divisor and not above 0; empty where none does."""
    for name, array in arrays.items():
        numbers = array.dtype.kind in "fiub"
        if not numbers or np.isnan(array).any():
            return f"{name!r} holds {'NaN' if numbers else array.dtype}"
        if name.rpartition(".")[2] in DIVISORS and not (array > 0).all():
            return f"{name!r} must be above 0"
    return ""


def fit(
    method: Method,
    physics: Physics,
    windows: Windows,
    *,
    validation_runs: Iterable[str] | None = None,
    commands: Commands = "held",
    seed: int = 0,
    refits: int = 0,
    kinds: Mapping[str, str] | None = None,
) -> Predictor:
    """Fit a method on windows and return a predictor that is ready to predict and to save.

    Windows say nothing of the actuators, so each is taken as having reached its order at the instant of prediction.

    Parameters
    ----------
    method : the method with its settings, such as `Kernel()`.
    physics : the vessel with its numbers, or none, with horizon and step of the windows.
    windows : windows that train and validate; keep test runs out of them.
    validation_runs : names of the runs that validate; the other runs train. None splits by the method's `validation`:
        every run validates in turn (`runs`), or a fifth of the runs, drawn by `seed`, validates (`share`). A single run
        is split in time.
    commands : `held` at their value at the instant, or `known` over the horizon.
    seed : of all that is random.
    refits : of methods that have no errors on runs left out for nothing, fit so many times more, each without a share
        of the runs, to calibrate a band; 0 makes such predictors without a band. Only `alone`, and
        `kernel` and `calibrator` where several runs validate in turn, have such errors.
    kinds : kind of manoeuvre by run, for bands that hold their share for runs of a kind.

    Raises
    ------
    DataError : an argument of another type; a method that has no name in `METHODS`; physics and windows differ in
        horizon or step; the windows hold too short a past, lack a command of the vessel or are too few to be split; the
        physics has an observer; the physics or the training diverges.
    """
    check_class("method", method, Method, "such as Kernel()", DataError)
    kind = method_kind(method)
    check_class("physics", physics, Physics, "such as Physics(vessel, horizon=60, step=1.0)", DataError)
    check_class("windows", windows, Windows, "as of `cut_windows`", DataError)
    check_choice("commands", commands, get_args(Commands), DataError)
    kinds = {} if kinds is None else kinds
    check_mapping("kinds", kinds, "the name of a run to a kind of manoeuvre", DataError)
    seed, refits = check_whole_number("seed", seed, 0, DataError), check_whole_number("refits", refits, 0, DataError)
    _check_fit(method, kind, physics, windows)
    name = "none" if physics.absent else "physics"
    paths, diverged = physics.variant_paths(windows.instants(known=commands == "known"))
    if diverged.any():
        raise DataError(
            f"the physics diverges on {percent_text(diverged.mean(), 1)} of the windows: take a smaller step, or rk4"
        )
    task = Task(
        cases={name: Case(physics, paths[:, 0])},
        windows=windows,
        folds=_split_folds(method, windows, validation_runs, seed) if method.compensates else (),
        commands=tuple(windows.planned),
        known=commands == "known",
        seed=seed,
    )
    fitted = fit_all(method, task)[name]
    corrector, left_out = fitted.corrector, fitted.left_out
    if corrector is None:
        raise DataError("no training converged: check the windows for outliers, or widen the ranges of the method")
    limits = limits_of(windows, windows.planned)
    provenance: dict[str, Any] = {"runs": list(windows.spans), "seed": seed}
    if left_out is None and refits:
        left_out = _errors_of_refits(method, physics, windows, refits, commands, seed)
    predictor = Predictor(physics, kind, corrector, limits, provenance, commands)
    return with_bands(predictor, left_out, windows, windows.instants(known=task.known), kinds)


def _check_fit(method: Method, kind: str, physics: Physics, windows: Windows) -> None:
    """Raise DataError where a method of this kind cannot be fitted to this physics on these windows."""
    if (physics.horizon, physics.step) != (windows.horizon, windows.step):
        message = f"the physics has {physics.horizon} steps of {physics.step:g} s"
        raise DataError(f"{message}, the windows have {windows.horizon} steps of {windows.step:g} s: make them equal")
    if method.past > windows.num_past * windows.step + 1e-9:
        steps = math.ceil(method.past / windows.step - 1e-9)
        raise DataError(f"the method needs a past of {method.past:g} s: cut windows with past = {steps}")
    if physics.absent and not method.meets_none:
        raise DataError(f"the method {kind!r} needs a vessel: the physics has none")
    if physics.observer is not None:
        raise DataError("windows hold no estimates of an observer: run a study, or fit the method on a Task with them")
    if physics.vessel is not None:
        check_columns(physics.vessel, windows.columns, "the windows")


def _errors_of_refits(
    method: Method, physics: Physics, windows: Windows, refits: int, commands: Commands, seed: int
) -> Array:
    """Errors (T, S, 2) [m] of further fits, each on the runs that it leaves out; not numbers where there are none."""
    left_out = np.full_like(windows.future, np.nan)
    for training, judged in refit_folds(windows, refits, seed):
        part = windows.select(judged)
        try:
            other = fit(method, physics, windows.select(training), commands=commands, seed=seed)
        except DataError:  # too little is left to train: the runs that it leaves out have no errors
            continue
        left_out[:, judged] = part.future - other.predict(part.instants(known=commands == "known"))
    return left_out


def read_bands(file: str | os.PathLike[str]) -> tuple[Bands | None, str]:
    """Read the bands of a saved predictor alone, and why it has none if it has none; a damaged file as it comes."""
    arrays = read_arrays(file, "header", BANDS)
    header = json.loads(str(arrays.pop("header")))
    _check_format(header, file)
    return _read_part(Bands, BANDS, header["bands"], arrays), reason_of_no_band(header["provenance"])


def _check_format(header: Mapping[str, Any], file: str | os.PathLike[str]) -> None:
    if header.get("format") != FORMAT:
        words = f"written in format {header.get('format')}, this shipid reads {FORMAT}: run the study again"
        raise ResultError(words, file=file)


def _read_part(kind: type[Part], prefix: str, header: Any, arrays: dict[str, Array]) -> Part | None:
    """A part of a predictor from its header, which is None where there is none, and its arrays, which are taken out."""
    taken = {name.removeprefix(prefix): arrays.pop(name) for name in [*arrays] if name.startswith(prefix)}
    return None if header is None else kind.from_arrays(header, taken)


def check_bands(bands: Bands | None, reason: str, level: float, kind: str | None = None) -> Bands:
    """Return the bands; DataError, one sentence, where there are none, for a reason, or none of this level."""
    if bands is None:
        raise DataError(f"{NO_BAND}{reason}")
    bands.check(level, kind)
    return bands


NO_BAND = "this predictor has no band: "


def with_bands(
    predictor: Predictor,
    left_out: Array | None,
    windows: Windows,
    instants: Instants,
    kinds: Mapping[str, str] | None = None,
) -> Predictor:
    """The predictor with its alarm and its bands, or why it has none, from the windows that trained it.

    left_out : errors (T, S, 2) [m] on the windows by models that did not see their runs. instants : of the windows.
    """
    rows, table = predictor.past, alarm_inputs(predictor.inputs, predictor.past, predictor.physics, instants)
    alarm, bands = calibrate_alarm(predictor.inputs, rows, table, windows.run), None
    reason = "errors on runs left out need further fits: set `refits` (of a study `bands.refits`), such as 5"
    if left_out is not None:
        past = {name: values[-rows:] for name, values in windows.past.items()} if rows else {}
        names, reason = tuple(predictor.limits), "fewer than 3 runs have errors of models that did not see them"
        columns = windows.columns
        bands = calibrate_bands(left_out, windows.future, windows.run, columns, names, windows.step, kinds, past)
    without = {} if bands is not None else {"no_band": reason}
    return replace(predictor, bands=bands, alarm=alarm, provenance={**predictor.provenance, **without})


def refit_folds(windows: Windows, refits: int, seed: int) -> list[tuple[Index, Index]]:
    """(Training, judged) indices of windows for each refit, split by run; no more refits than runs, none of one run."""
    return [] if len(windows.spans) < FEWEST else run_folds(windows, "share", seed, max(refits, 2))


def limits_of(windows: Windows, commands: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Least and greatest value of u, v, r, the commands, wind speed and other environment over windows, by column."""
    others = (name for name in measurable_signals(windows.columns) if not SIGNALS[name].angle)
    names = ["u", "v", "r", *commands, *others]
    return {name: (float(windows.columns[name].min()), float(windows.columns[name].max())) for name in names}


def _split_folds(
    method: Method, windows: Windows, validation_runs: Iterable[str] | None, seed: int
) -> list[tuple[Index, Index]]:
    """(Training, validation) indices of windows, split by run: as the method wants, or with the named runs."""
    if validation_runs is None:
        return run_folds(windows, method.validation, seed)
    names = as_names("validation_runs", validation_runs, DataError)
    runs = list(windows.spans)
    unknown = next((run for run in names if run not in runs), None)
    if unknown is not None:
        raise DataError(f"no run with windows: {suggest_name(unknown, runs)}", path="validation_runs")
    training, judged = fold_masks(windows, names)
    return [(np.flatnonzero(training), np.flatnonzero(judged))]
