"""What is wrong where a vessel and a log disagree: every cause is a nuisance of one fit, and all of them are compared.

**The fit.** Equations of motion and of kinematics are multiplied by a bump phi(t) that moves along the runs, and
integrated by parts (weak form: Messenger, Bortz, JCP 443 (2021) 110525): nothing is differentiated, nothing diverges.
Each bump gives six residuals, measured change less predicted change: of u, v, r by the physics, of heading by the yaw
rate, of position along and across by heading and velocities. A cause is a change of the log (commands, sensors), of
the water or of the numbers of the vessel; it is fitted alone by Gauss-Newton from the same start.

**Keys.** `command C zero`, `scale`, `sign`, `delay`, of a shaft also `scale astern` and `unsigned`;
`exchange A B` (two thrusters); `sensor S bias` (u, v, r, psi), `scale` (u, v, r, velocity), `sign` (v, r, psi), `delay`
(u, v, r, psi, velocity, position); `heading is course`; `lever arm position`, `lever arm position and velocity`,
`lever arm velocity`; `current`, `current by run`, `velocity through water`; `wind scale`, `wind direction`;
`coefficient damping`, `mass`, `thrust`, `rudder`, `several coefficients`; besides `none`, `unexplained`, `cannot tell`.

**Classes of equals**, which no or hardly any log tells apart (each with the run that would):

- zero of an angle that steers, and an asymmetry of hull or screw;
- scale of an angle, and the coefficient of the rudder; scale and zero of a shaft, and the coefficients of its thrust
  and of the damping ahead, at few speeds;
- delay of a command, a slower actuator, and all sensors early;
- bias of psi, positions in turned axes, and on one course a current, velocity through water or bias of v;
- bias and scale of u at one speed, velocity through water on one course, and scale of the velocity; bias and scale of r
  at one rate of turn;
- lever arm of the position ahead, and its delay, at one speed and without turns; without a vessel also that of the
  velocity;
- exchanged thrusters, and the sign of each where they are used against each other;
- coefficient of mass, and of thrust and damping together; coefficients of thrust and damping at steady speed.

**Judgement.** The misfit of a cause is the sum over the six equations of n ln(mean square + floor^2), n being bumps
that do not overlap: it is free of scale, and an equation in which the vessel is poor weighs little. The floor is the
white noise that the log itself shows, as it passes the bump, and `EXACT` of the size of the terms. A cause is
estimated without a part of the runs (or of the time, where there is one run) and its misfit is taken on that part.

The causes of least misfit also predict paths of 5 ship lengths, whose errors count as a seventh equation. How far noise
makes them err is seen on the log with its noise once more.

- What a cause lowers the misfit by is a logarithm of a ratio of likelihoods. Its *proof* is all that it gains in the
  equations of heading and position, as kinematics hold for every ship, and of the rest, which a defect of the physics
  may make as well, the share of the error of the paths that it explains, noise apart.
- `none`: no proof exceeds ln(n / `LEVEL`): chance gives that once in n / `LEVEL` times, and n causes are tried (Ville,
  Bonferroni), and none gains as many standard errors over blocks of time as chance gives so rarely (normal); or the
  proof of those that do so is less than a share `WORTH` of the gain; or paths err by noise alone; or the causes are
  smaller than what a log has anyhow (a command that is a row late).
- Causes tie with that of least misfit where they are worse by less than `APART` standard errors, or the share `ALIKE`
  of its gain. The first that is proved is named; of those that kinematics alone prove, one of a whole instrument, then
  the best by kinematics. If others do so, its equals apart, the answer is `cannot tell`, and `equals` are these
  causes; if its class does, these are `equals`.
- Of a heading that is a course and has lost its drift, sway is that of the physics with whatever else is repaired.
- Where no cause is named, or two are of forces, all coefficients are fitted at once: `several coefficients` must be
  proved by a share above `WORTH`. What is left then is judged by itself. A zero of an angle beside wrong forces is said
  where it is better by a standard error: mirror images tell it.
- `unexplained` is a misfit without a name that leaves more than a share `POOR` of the error of constant u, v, r.
- `current by run` must lower the misfit more than an unknown force of each run, such as a wind that the log lacks, and
  by more than the share `ALIKE` than any other cause.
- A second cause is looked for once the log is repaired from the best, also where a share `WORTH` would prove it but is
  not explained: then the best is sought again beside the second. A rival that gains as much as before (`BOTH`) is there
  as well.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import least_squares
from scipy.special import exprel, ndtri

from shipid.data.checks import white_noise_of
from shipid.data.dataset import Array, Dataset, cumulative_integral, stretch_columns
from shipid.engine.casadi import input_symbols, memory_along, summed_rates
from shipid.engine.rollout import rollout_distances
from shipid.engine.samples import map_over_samples
from shipid.errors import DataError
from shipid.identification.causes import (
    ASYMMETRY,
    SEVERAL,
    Cause,
    Motion,
    Scales,
    list_causes,
    multiply_signs,
    rotate_heading,
)
from shipid.physics.signals import is_command, is_shaft, is_steering, is_wrapped_angle
from shipid.simulation.log import body_velocities, state_column
from shipid.units import percent_text
from shipid.vessel.dynamics import INPUTS, Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel

Steps = NDArray[np.integer[Any]]
SetNumbers = Callable[[Array], Mapping[str, float]]
"""Factors (n,) -> path -> parameter of the vessel [SI]."""
NONE, UNCLEAR, UNEXPLAINED = "none", "cannot tell", "unexplained"
LENGTHS, POINTS, STRIDE = 2.0, 32, 16  # ship lengths of way in a bump; its steps; steps from bump to bump
CHANGES = 0.5  # share of the rows with a change: from there on a command is measured, below it is an order
EVERY, BETWEEN = 2, 0.7  # steps from one evaluation of the physics to the next; over which an order is a mean
MOST_PASSING = 200  # rows in which a ship of unknown length runs it, at most
MOST_BUMPS = 160  # of a log: of a longer one parts are taken, evenly
SMOOTH, NOISY = POINTS / 24, 0.03  # steps, of the smoothing before the forces; noise over signal from which it grows
EXACT = 0.01  # of the size of the terms: what no resampled log says better
SHORTEST, AHEAD = 40, 80  # steps of a stretch; of a predicted path, 5 ship lengths where the runs are long enough
FOLDS, BLOCK = 4, 4  # parts of the log left out in turn; bumps of a block
ROUNDS, HALVINGS, SETTLED = 6, 3, 0.02
MOST_FORCES, WEIGHINGS = 20, 3  # evaluations of a fit of the forces alone with the same weights; such fits
CALM = 1e-3  # of SMOOTH: the least smoothing where forces are fitted, which SMOOTH would bias without noise
MOST_RATIO = np.log(2.5)  # a factor beyond is no error of a scale, but hides what it multiplies
MOST_SIZES = 2  # that a sentence names
HUGE = 1e30  # residual where the physics fails
FINALISTS, LOST = 8, 10.0  # causes whose paths are compared; ship lengths of error of a path that diverges
# pieces of a log over which it is seen whether a shaft turns astern; steps of a piece; rounds
SIGN, SIGN_STEPS, SIGN_ROUNDS = 1.0, 4, 4
LEVEL, APART = 0.02, 2.0  # share of sound logs that may be blamed; standard errors
BOTH = 0.5  # share of its gain that a rival keeps once the log is repaired from the best: both are there
WORTH, ALIKE = 0.2, 0.3  # share of the error of the paths; share of a gain that a runner-up may lack
POOR = 0.5  # of the error of held u, v, r: of 12 drawn ships 1 truth errs more, and 10 first guesses
STATES = ("u", "v", "r", "psi", "north", "east")


@dataclass(frozen=True)
class Diagnosis:
    """What is wrong with a vessel and its log.

    cause : key, `none`, `unexplained` or `cannot tell`. equals : keys that the log does not tell from it.
    size : of the cause in SI units, an empty tuple where it has none (a sign). interval : 95 %, (low, high) of each.
    repair : lines for the mapping of the log, the vessel or the settings of an identification.
    sentence : all of it in words. share : of the mean error [m] of predicted paths over `ahead` [s], less that of the
        noise, that it explains.
    noise, held : mean error [m] of these paths by the noise of the log alone, and with u, v, r as they begin.
    next : the same of a second cause beside the first, if there is one; sizes are those beside each other.
    misfits : key -> misfit on parts left out, less that of `none`.
    """

    cause: str
    equals: tuple[str, ...] = ()
    size: tuple[float, ...] = ()
    interval: tuple[tuple[float, float], ...] = ()
    repair: str = ""
    sentence: str = ""
    share: float = 0.0
    error: float = 0.0
    noise: float = 0.0
    held: float = 0.0
    ahead: float = 0.0
    next: Diagnosis | None = None
    misfits: Mapping[str, float] | None = None

    @property
    def how_far(self) -> str:
        """The error of the paths in words."""
        others = f"noise alone: {self.noise:.2g} m, constant u, v, r: {self.held:.2g} m"
        return f"paths over {self.ahead:.3g} s err by {self.error:.3g} m on average ({others})"


@dataclass(frozen=True, eq=False)
class _Fit:
    """A cause at its size theta (k,), with standard errors; residuals (6, W) on parts left out; the log without it."""

    cause: Cause
    theta: Array
    errors: Array
    left_out: Array
    motion: Motion

    @property
    def counts(self) -> bool:
        """Whether it is more than what any log has."""
        return bool(np.linalg.norm(self.theta) >= self.cause.least)


class _Log:
    """A log at equal steps with its bumps, and the residuals of any change of it by kinematics alone."""

    length: float | None = None
    calm = 1.0
    commands: tuple[str, ...] = ()
    environment: Mapping[str, float] = MappingProxyType({})
    numbers: tuple[float, ...] = ()

    def __init__(self, dataset: Dataset, runs: Sequence[str]) -> None:
        mapping = dataset.metadata.get("mapping")
        columns = mapping.get("columns", {}) if isinstance(mapping, dict) else {}  # of another program, too
        self.mapped = {name: one for name, one in columns.items() if {"size", "offset", "unit"} <= {*one}}
        stretches = [(run, rows) for run, rows in stretch_columns(dataset) if run in runs]
        every = {name: np.concatenate([rows[name] for _, rows in stretches]) for name in ("u", "v", "r")}
        speed = float(np.sqrt(np.mean(every["u"] ** 2 + every["v"] ** 2)))
        rate = float(np.sqrt(np.mean(every["r"] ** 2)))
        usual = float(np.median(np.concatenate([np.diff(rows["t"]) for _, rows in stretches])))
        longest = max(float(np.ptp(rows["t"])) for _, rows in stretches)
        length = self.length or max(speed / max(rate, speed / MOST_PASSING / usual, 1e-12), 1e-3)
        self.scales = Scales(length, max(speed, 1e-6 * length / usual), usual)
        self.width = max(min(LENGTHS * self.scales.passing, longest / 4), 8 * usual)
        self.step = self.width / POINTS
        self.motion, self.smoothed = self._resample(runs, stretches), dict[str, tuple[Array, Array]]()
        self._cut(sum(float(np.ptp(rows["t"])) for _, rows in stretches))
        self.noise = self._noise(stretches, usual)
        self.repair(self.motion)
        random = np.random.default_rng(0)
        noisy = {
            name: self.motion.columns[name] + random.normal(0, size, len(self.motion.columns[name]))
            for name, size in self.white.items()
        }
        self.plain_errors = self.path_errors(self.motion)
        more = self.path_errors(self.motion.put(noisy)).mean() ** 2 - self.plain_errors.mean() ** 2
        self.blind = float(np.hypot(max(more, 0.0) ** 0.5, self.blur))

    def repair(self, motion: Motion) -> None:
        """Take another motion for the log."""
        self.motion, self.smoothed = motion, {}
        self.plain_residuals = self.residuals(motion)
        self.held = float(self.path_errors(motion, held=True).mean())

    def causes(self) -> list[Cause]:
        """What may be wrong with the log."""
        return [
            one
            for one in list_causes(None, (), self.motion, self.scales, self.mapped)
            if not one.key.startswith("current")
        ]

    def forces(self, motion: Motion) -> Array:
        """Mean accelerations (3, W) over the bumps, such as they are: no physics says others."""
        return np.array([motion.columns[name][self.bumps] @ self.pull for name in ("u", "v", "r")])

    def path_errors(self, motion: Motion, held: bool = False) -> Array:
        """Mean error (K,) [m] of each path by dead reckoning with u, v, r, or with those of its begin, `held`."""
        columns, rows = self.states(motion), self.paths + np.arange(self.ahead + 1)[:, None]
        u, v, r = (columns[name][rows[:1] + 0 * rows if held else rows] for name in ("u", "v", "r"))

        def travelled(rate: NDArray[Any]) -> NDArray[Any]:
            return self.step * np.cumsum((rate[1:] + rate[:-1]) / 2, axis=0)

        heading = columns["psi"][rows[0]] + np.concatenate([0 * r[:1], travelled(r)])
        place = columns["north"][rows] + 1j * columns["east"][rows]
        return np.asarray(np.abs(place[1:] - place[0] - travelled((u + 1j * v) * np.exp(1j * heading))).mean(axis=0))

    def _resample(self, runs: Sequence[str], stretches: Sequence[tuple[str, Mapping[str, NDArray[Any]]]]) -> Motion:
        parts, places = list[dict[str, Array]](), list[int]()
        for run, rows in stretches:
            t = np.asarray(rows["t"], dtype=float)
            count = int((t[-1] - t[0]) / self.step + 1e-6)
            if count > SHORTEST and len(t) > 8:
                grid = t[0] + self.step * (np.arange(count) + 0.5)  # a mean over half a step is of another time
                names = [name for name in rows if name not in ("run", "t", "flags")]
                parts.append({name: _at_steps(name, t, np.asarray(rows[name], dtype=float), grid) for name in names})
                places.append(list(runs).index(run))
        if not parts:
            raise DataError(
                f"no stretch is longer than {self.width:.3g} s, in which the ship runs {LENGTHS:g} lengths", path="runs"
            )
        shared = sorted(set.intersection(*(set(part) for part in parts)))
        ends = np.cumsum([0, *(len(part["u"]) for part in parts)])
        columns = {name: np.concatenate([part[name] for part in parts]) for name in shared}
        rest = sorted(self.environment.keys() - columns.keys())
        columns |= {name: np.full(int(ends[-1]), self.environment[name]) for name in rest}
        slices = tuple(slice(a, b) for a, b in pairwise(ends.tolist()))
        return Motion(columns, np.array(self.numbers), slices, tuple(places), self.step)

    def _cut(self, duration: float) -> None:
        """Choose the bumps: index (W, POINTS + 1) of their steps, and the block and fold of each."""
        every = max(STRIDE, int(STRIDE * np.ceil(duration / self.step / STRIDE / MOST_BUMPS)))
        here = [np.arange(part.start, part.stop - POINTS - 1, every) for part in self.motion.stretches]
        begin, counts = np.concatenate(here), [len(places) for places in here]
        self.bumps = begin[:, None] + np.arange(POINTS + 1)
        self.block = np.cumsum(np.concatenate([np.arange(count) % BLOCK == 0 for count in counts])) - 1
        self.run = np.repeat(self.motion.runs, counts)
        self.fold = (self.run if len(set(self.motion.runs)) >= FOLDS else self.block) % FOLDS
        lengths = [part.stop - part.start for part in self.motion.stretches]
        self.ahead = int(np.clip(np.median(lengths) // 3, SHORTEST, AHEAD))
        self.paths = np.concatenate(
            [np.arange(part.start, part.stop - self.ahead, max(2 * every, SHORTEST)) for part in self.motion.stretches]
        ).astype(int)
        self.path_block = self.block[np.clip(np.searchsorted(begin, self.paths), 0, len(begin) - 1)]
        s = np.linspace(-1, 1, POINTS + 1)
        phi, slope = (1 - s**2) ** 3, -s * (1 - s**2) ** 2
        self.phi, t = phi / phi.sum(), self.step * np.arange(POINTS + 1)
        slope = slope - slope.mean()
        self.pull = slope / (slope @ t)
        self.worth = len(begin) * STRIDE / POINTS if every == STRIDE else float(len(begin))
        self.turn = np.exp(-1j * self.motion.columns["psi"][self.bumps[:, POINTS // 2]])
        self.used: Steps = np.unique(self.bumps[:, ::EVERY])
        self.place = np.searchsorted(self.used, self.bumps[:, ::EVERY])

    def _noise(self, stretches: Sequence[tuple[str, Mapping[str, NDArray[Any]]]], usual: float) -> Array:
        """Standard deviation (6,) of each residual by the white noise of the log, and by what no log says better."""
        share = (usual / self.step) ** 0.5
        series = {name: [np.asarray(rows[name], dtype=float) for _, rows in stretches] for name in STATES}
        series["psi"] = [np.unwrap(values) for values in series["psi"]]
        u, v, r, psi, north, east = (share * white_noise_of(*series[name]) for name in STATES)
        sizes = (np.sqrt(np.mean(self.motion.columns[name] ** 2)) for name in ("u", "v", "r"))
        rough = max(noise / max(size, 1e-12) for noise, size in zip((u, v, r), sizes, strict=True))
        self.smooth = SMOOTH * float(np.clip(rough / NOISY, self.calm, 3.0))
        pulled, summed = (float(np.linalg.norm(one)) for one in (self.pull, self.phi))
        speed, passing = self.scales.speed, self.scales.passing
        terms = np.array([speed / passing, speed / passing, 1 / passing**2, 1 / passing, speed, speed])
        heading, fix = summed * speed * psi, max(north, east)
        self.blur = float(np.hypot(fix, 0.1 * EXACT * self.scales.length))
        self.white = dict(zip(STATES, (u, v, r, psi, north, east), strict=True))
        turning = np.hypot(pulled * psi, summed * r)
        along, across = (np.hypot(pulled * fix, summed * one) for one in (u, v))
        noise = [pulled * u, pulled * v, pulled * r, turning, along, np.hypot(across, heading)]
        return np.asarray(np.hypot(noise, 0.1 * EXACT * terms))

    def states(self, motion: Motion) -> dict[str, Array]:
        """Columns of the states and orders, smoothed: motion by its noise, orders over the steps of the physics."""
        columns = dict(motion.columns)
        for name in ("u", "v", "r", "psi", *self.commands):
            given, known = columns[name], self.smoothed.get(name)
            if known is None or known[0] is not given:
                values = np.unwrap(given) if is_steering(name) else given
                width = BETWEEN if name in self.commands else self.smooth
                parts = [gaussian_filter1d(values[part], width, mode="nearest") for part in motion.stretches]
                known = given, np.concatenate(parts)
            if given is self.motion.columns[name]:
                self.smoothed[name] = known
            columns[name] = known[1]
        return columns | dict(body_velocities(columns))

    def residuals(self, motion: Motion) -> Array:
        """Residuals (6, W): measured change less predicted change, a unit of time."""
        columns, bumps = motion.columns, self.bumps
        forces = self.forces(motion)
        changes = [columns[name][bumps] @ self.pull for name in STATES]
        velocity = (columns["u"] + 1j * columns["v"]) * np.exp(1j * columns["psi"])
        path = (changes[4] + 1j * changes[5] - velocity[bumps] @ self.phi) * self.turn
        turning = changes[3] - columns["r"][bumps] @ self.phi
        every = np.stack([*(np.array(changes[:3]) - forces), turning, path.real, path.imag])
        return np.asarray(np.clip(np.nan_to_num(every, nan=HUGE), -HUGE, HUGE))

    def estimate(self, cause: Cause, rounds: int = ROUNDS, begin: Array | None = None) -> _Fit:
        """Fit a cause by Gauss-Newton from a size or the start of least misfit; one that lowers nothing stays."""
        trials = np.array(cause.trial)

        def change(theta: Array) -> tuple[Motion, Array]:
            if len(theta) and not theta.any():
                return self.motion, self.plain_residuals
            motion = cause.change(self.motion, theta)
            z = self.residuals(motion)
            if cause.scaled:
                z[list(cause.scaled)] *= np.exp(max(theta[0], 0.0))  # neither way makes less of an error
            return motion, z

        begins = [np.zeros(len(trials)), *map(np.atleast_1d, cause.starts)] if begin is None else [begin]
        theta, (motion, z) = min(((one, change(one)) for one in begins), key=lambda one: self.misfit(one[1][1]))
        J, unit = np.zeros((len(theta), *z.shape)), np.eye(len(theta))
        if cause.of_runs:  # a change of all runs at once: none feels the number of another
            unit = np.repeat(np.eye(2), len(theta) // 2, axis=1)
        for _ in range(rounds if len(theta) else 0):
            J = np.array([(change(theta + one)[1] - z) / one.max() for one in unit * trials])
            if cause.of_runs:
                J = np.concatenate([one * (self.run == np.arange(len(theta) // 2)[:, None, None]) for one in J])
            step = np.clip(self._step(J, z, np.ones(z.shape[1], dtype=bool)), -20 * trials, 20 * trials)
            if cause.ratio and not cause.scaled:
                step = np.clip(step, -MOST_RATIO - theta, MOST_RATIO - theta)
            before = self.misfit(z)
            for _ in range(HALVINGS):
                after, moved = change(theta + step)
                if self.misfit(moved) < before:
                    break
                step = step / 2
            else:
                break
            theta, motion, z = theta + step, after, moved
            if (np.abs(step) < SETTLED * np.abs(trials)).all():
                break
        left = z.copy()
        shown = [np.abs(J[:, :, self.fold != fold]).any(axis=(1, 2)).all() for fold in range(FOLDS)]
        folds = self.fold if all(shown) else self.block % FOLDS  # a number of one run is judged within that run
        for fold in range(FOLDS) if len(theta) else ():
            out = folds == fold
            if out.any() and not out.all():
                step = np.clip(self._step(J, z, ~out), -20 * trials, 20 * trials)
                left[:, out] += np.tensordot(step, J[:, :, out], 1)
        return _Fit(cause, theta, np.sqrt(np.diag(self._covariance(J, z))), left, motion)

    def beyond_noise(self, errors: Array) -> float:
        """Mean error [m] of paths without what the noise of the log makes of it."""
        return float(np.sqrt(max(errors.mean() ** 2 - self.blind**2, self.blur**2)))

    def weights(self, z: Array) -> Array:
        """Inverse of the level (6,) of residuals."""
        return np.asarray(1 / np.sqrt((z**2).mean(axis=1) + self.noise**2))

    def _step(self, J: Array, z: Array, kept: NDArray[np.bool_]) -> Array:
        weight = self.weights(z[:, kept])[:, None]
        A = (J[:, :, kept] * weight).reshape(len(J), -1).T
        size = np.linalg.norm(A, axis=0)
        size = np.where(size > 1e-9 * size.max(initial=0.0), size, np.inf)  # what these bumps do not show stays
        return np.asarray(-np.linalg.lstsq(A / size, (z[:, kept] * weight).ravel(), rcond=1e-6)[0] / size)

    def _covariance(self, J: Array, z: Array) -> Array:
        """Covariance (k, k) by blocks of bumps (sandwich)."""
        weight = self.weights(z)[:, None]
        A, e = J * weight, z * weight
        bread = np.linalg.pinv(np.einsum("icw,jcw->ij", A, A), rcond=1e-12)
        of_block = self.block[:, None] == np.arange(int(self.block.max()) + 1)
        score = bread @ np.einsum("icw,cw->iw", A, e) @ of_block
        return np.asarray(score @ score.T)

    def misfit(self, z: Array) -> float:
        """Sum over the equations of n ln(mean square + floor^2), n being bumps that do not overlap."""
        return self.worth / 2 * float(np.log((z**2).mean(axis=1) + self.noise**2).sum())

    def plainness(self, fit: _Fit) -> float:
        """By how much a cause lowers the misfit of kinematics alone."""
        before, after = ((z[3:] ** 2).mean(axis=1) + self.noise[3:] ** 2 for z in (self.plain_residuals, fit.left_out))
        return fit.counts * self.worth / 2 * max(float(np.log(before / after).sum()), 0.0)

    def needs_runs(self, fit: _Fit, rest: float) -> bool:
        """Whether a cause by run gains more than an unknown force of each run, and than another with misfit `rest`.

        The force is one towards north and east, as a wind, estimated without the blocks that it is judged on.
        """
        z, fold = self.plain_residuals, self.block % FOLDS
        force = (z[0] + 1j * z[1]) / self.turn
        others = (self.run[:, None] == self.run) & (fold[:, None] != fold)
        force = (force - others @ force / np.maximum(others.sum(axis=1), 1)) * self.turn
        forced = np.array([force.real, force.imag, *z[2:]])
        less, error = self.gain((forced, self.plain_errors), (fit.left_out, self.plain_errors))
        return less > APART * error and self.misfit(fit.left_out) < rest - ALIKE * (self.misfit(z) - rest)

    def gain(self, worse: tuple[Array, Array], better: tuple[Array, Array]) -> tuple[float, float]:
        """By how much one misfit is lower than another, and the standard error over blocks of time.

        worse, better : residuals (6, W), errors of paths (K,).
        """
        sums, floors = np.zeros(int(self.block.max()) + 1), (self.noise[:, None], self.blur)
        for i, (block, weight) in enumerate(((self.block, self.worth / 2), (self.path_block, self.worth))):
            a, b = (np.atleast_2d(z[i] ** 2 + floors[i] ** 2) for z in (worse, better))
            off = np.log(a.mean(axis=1) / b.mean(axis=1))
            level = b.mean(axis=1) * exprel(off)  # the logarithmic mean of both
            each = ((a - b) / level[:, None]).sum(axis=0) * weight / a.shape[1]
            sums += np.bincount(block, each, len(sums))
        return float(sums.sum()), float(np.std(sums) * np.sqrt(len(sums))) + 1e-9


class _VesselLog(_Log):
    """A log with the vessel that should have made it."""

    _kept: Array | None = None

    def __init__(
        self,
        vessel: Vessel,
        dataset: Dataset,
        runs: Sequence[str],
        environment: Mapping[str, float],
        calm: float = 1.0,
    ) -> None:
        if "current" not in vessel.document:
            vessel = vessel.with_values({"current.kind": "uniform"})
        self.vessel, self.model = vessel, vessel_dynamics(vessel)
        self.length, self.commands, self.calm = vessel.length, self.model.commands, calm
        self.environment = {name: environment.get(name, 0.0) for name in self.model.environment}
        self.numbers = tuple(vessel.parameters.values())
        for missing in (name for name in self.commands if name not in dataset.commands):
            raise DataError(f"{vessel.name} needs this command; the data have none", path=missing)
        super().__init__(dataset, runs)

    def repair(self, motion: Motion) -> None:
        """Take another motion for the log, whose actuators are kept."""
        self._kept = self.memory(motion)
        super().repair(motion)

    def causes(self) -> list[Cause]:
        """What may be wrong with the log or with the vessel."""
        return [
            *list_causes(self.vessel, self.commands, self.motion, self.scales, self.mapped),
            *_unsigned_shafts(self),
        ]

    def memory(self, motion: Motion) -> Array:
        """Actuator states (M, N) that the orders of a log reach: other changes of the log leave those that are kept."""
        names, columns = self.model.memory, motion.columns
        if self._kept is not None and all(columns[name] is self.motion.columns[name] for name in names):
            return self._kept
        start, stop = np.transpose([(part.start, part.stop) for part in motion.stretches])
        steps = np.arange((stop - start).max())
        rows, inside = np.minimum(start[:, None] + steps, stop[:, None] - 1), steps < (stop - start)[:, None]
        reached = memory_along(self.vessel, {name: columns[name][rows] for name in names}, motion.step * steps) or {}
        return np.reshape([one[inside] for one in reached.values()], (len(names), len(columns["u"])))

    def forces(self, motion: Motion) -> Array:
        """Mean accelerations (3, W) over the bumps by the physics."""
        return np.asarray(self.accelerations(motion, self.used)[:, self.place] @ (EVERY * self.phi[::EVERY]))

    def accelerations(self, motion: Motion, at: Steps) -> Array:
        """Accelerations (3, n) of u, v, r by the physics at n steps."""
        return _mapped_rates(self.model)(*self._inputs(motion, at), motion.parameters)[0]

    def _inputs(self, motion: Motion, at: Steps) -> list[Array]:
        """States, actuators, commands and environment, each (., n), at n steps."""
        columns = self.states(motion)
        given = (
            np.array([columns[name][at] for name in names]).reshape(-1, len(at))
            for names in (self.commands, self.environment)
        )
        return [self._start(columns, at), self.memory(motion)[:, at], *given]

    def _with_drift(self, motion: Motion) -> Motion:
        """The log with its heading, where that is a course: sway is that of the physics, from a while before on."""
        if not motion.course:
            return motion
        speed = np.hypot(motion.columns["u"], motion.columns["v"])
        sway, row = np.zeros(len(speed)), self.model.state.index("v")
        states, *inputs = self._inputs(motion, np.arange(len(sway)))
        parts = [(at, p.start, p.stop - 1) for p in motion.stretches for at in range(p.start, p.stop, SHORTEST)]
        start, first, last = np.transpose(parts)
        v, rates = np.zeros(len(start)), _mapped_rates(self.model)
        for k in range(-SHORTEST, SHORTEST):
            at = np.clip(start + k, first, last)
            sway[at] = states[row, at] = v = np.clip(v, -speed[at], speed[at])
            v = v + motion.step * rates(states[:, at], *(one[:, at] for one in inputs), motion.parameters)[0][1]
        drift = np.arcsin(sway / np.maximum(speed, 1e-12)) * np.sign(motion.columns["u"])
        return rotate_heading(replace(motion, course=False), [drift])

    def residuals(self, motion: Motion) -> Array:
        """Residuals (6, W): measured change less predicted change, a unit of time."""
        return super().residuals(self._with_drift(motion))

    def _start(self, columns: Mapping[str, Array], at: Steps) -> Array:
        """States (., n) at n steps; those that no column has are 0."""
        names = [state_column(name) for name in (*self.model.state, *self.model.hidden)]
        return np.array([columns[name][at] if name in columns else np.zeros(len(at)) for name in names])

    def path_errors(self, motion: Motion, held: bool = False) -> Array:
        """Mean error (K,) [m] of each path that the physics predicts."""
        if held:
            return super().path_errors(motion, held)
        motion = self._with_drift(motion)
        columns, at = self.states(motion), self.paths
        rows = at + np.arange(self.ahead + 1)[:, None]
        found = rollout_distances(
            self.vessel,
            dict(zip((*self.model.state, *self.model.hidden), self._start(columns, at), strict=True)),
            {name: columns[name][rows[:-1]] for name in self.commands},
            {name: columns[name][rows[:-1]] for name in self.environment},
            np.stack([columns["north"][rows[1:]], columns["east"][rows[1:]]], axis=-1),
            step=self.step,
            method="rk4",
            parameters=motion.parameters[None],
            memory=dict(zip(self.model.memory, self.memory(motion)[:, at], strict=True)),
        )
        far = LOST * self.scales.length
        return np.asarray(np.where(found.diverged[0], far, np.minimum(found.total[0] / self.ahead, far)))


def _at_steps(name: str, t: Array, values: Array, grid: Array) -> Array:
    """A column at equal steps: motion is averaged over a step, or goes on smoothly.

    A command that stays for some rows is an order, which holds from its row on, else it goes on evenly.
    """
    if is_command(name) and np.mean(np.diff(values) != 0) < CHANGES:
        last = np.searchsorted(t, grid + 1e-6 * (grid[1] - grid[0]), side="right") - 1
        return np.asarray(values[np.clip(last, 0, len(t) - 1)])
    if is_command(name):
        return np.interp(grid, t, np.unwrap(values) if is_steering(name) else values)
    values = np.unwrap(values) if is_wrapped_angle(name) else values
    step = grid[1] - grid[0]
    if np.median(np.diff(t)) > 0.7 * step:
        return np.asarray(CubicSpline(t, values)(grid))
    total = cumulative_integral(t, values)
    low, high = (np.interp(grid + side * step / 2, t, total) for side in (-1, 1))
    return np.asarray((high - low) / step)


@lru_cache(maxsize=16)
def _mapped_rates(model: Dynamics) -> Callable[..., list[Array]]:
    """(state, memory, commands, environment, each (., n), parameters) -> [accelerations (3, n) of u, v, r].

    It is compiled where it can be, as a diagnosis calls it some hundred times.
    """
    inputs = input_symbols(model)
    rates = ca.SX(summed_rates(model, inputs, ca.SX.zeros(model.num_dof), {}))
    rows = [model.state.index(name) for name in ("u", "v", "r")]
    function = ca.Function("accelerations", inputs, [rates[rows]], [*INPUTS], ["rates"], {"cse": True})
    return map_over_samples(function, np.inf, INPUTS[-1:])


def _unsigned_shafts(log: _VesselLog) -> Iterator[Cause]:
    """Shafts whose speed may lack its sign, each alone and all together.

    They turn astern where u and r change as they do under shafts that turn astern.
    """
    motion, count = log.motion, len(log.motion.columns["u"])
    smooth, measured, every = log.states(motion), np.zeros((2, count)), np.arange(0, count, SIGN_STEPS)
    for part in motion.stretches:
        smoother = (gaussian_filter1d(smooth[name][part], SMOOTH) for name in ("u", "r"))
        measured[:, part] = [np.gradient(values, log.step) for values in smoother]
    turning = {name: motion.columns[name] for name in filter(is_shaft, log.commands)}
    shafts = [name for name, values in turning.items() if 0 <= values.min() < values.max()]
    for names in [*([name] for name in shafts), *([shafts] if len(shafts) > 1 else [])]:
        ahead, astern = (
            (measured[:, every] - log.accelerations(multiply_signs(names, sign, motion), every)[[0, 2]]) ** 2
            for sign in (1, -1)
        )
        signs = np.ones(count)
        for _ in range(SIGN_ROUNDS):  # the clearest parts first: with them right, less is left to hide the others
            weight = log.weights(log.residuals(multiply_signs(names, signs, motion)))[[0, 2]]
            less = gaussian_filter1d(weight**2 @ (ahead - astern), SIGN)
            signs = np.repeat(np.where(less > 0, -1.0, 1.0), SIGN_STEPS)[:count]
        if (signs < 0).any():
            yield Cause(
                " ".join([f"command {names[0]} unsigned", *(["/ with", *names[1:]] if len(names) > 1 else [])]),
                partial(multiply_signs, names, signs),
                repair=f"{' and '.join(names)} without a sign: give the column that says ahead or astern",
                equals=tuple(f"command {name} unsigned" for name in shafts),
                tells="the column that says ahead or astern",
                cost=float((np.diff(signs) != 0).sum()),
            )


def fit_forces(
    vessel: Vessel, dataset: Dataset, runs: Sequence[str], values: SetNumbers, centre: Array, widths: Array
) -> Array:
    """Factors (n,) with which the forces explain the motion of the runs, by least squares over the bumps.

    Each equation weighs as much as the residuals that the factors so far leave in it allow, as in `diagnose`.
    values : parameters by factors. centre, widths : (n,) means and standard deviations of the prior of each factor.
    Raises DataError for runs too short for a bump.
    """
    log, factors = _VesselLog(vessel, dataset, runs, {}, calm=CALM), centre

    def residuals(factors: Array) -> Array:
        numbers = {**log.vessel.parameters, **values(factors)}
        return log.residuals(replace(log.motion, parameters=np.array(list(numbers.values()))))

    def misfit(factors: Array, weight: Array) -> Array:
        return np.append(weight * residuals(factors)[:3], (factors - centre) / widths)

    for _ in range(WEIGHINGS):
        weight = log.weights(residuals(factors))[:3, None]
        factors = np.asarray(least_squares(misfit, factors, max_nfev=MOST_FORCES, args=(weight,)).x)
    return factors


def diagnose(
    vessel: Vessel | None,
    dataset: Dataset,
    runs: Sequence[str] | None = None,
    keys: Collection[str] | None = None,
    environment: Mapping[str, float] | None = None,
) -> Diagnosis:
    """Find what is wrong with a vessel and a log of it, or with a log alone.

    runs : names; default: all. keys : causes to compare; default: all. environment : channel, such as V_c -> value [SI]
    where the data have none; default: 0.

    Raises DataError where a command is missing, or no stretch is long enough.
    """
    names = list(dataset.runs if runs is None else runs)
    log = _Log(dataset, names) if vessel is None else _VesselLog(vessel, dataset, names, environment or {})
    causes = [cause for cause in log.causes() if keys is None or cause.key in keys]
    motion = log.motion
    first, fit = _judge(log, causes)
    if fit is None:
        return replace(first, sentence=first.sentence + _describe_zeros(log, causes, first))
    _repair(log, fit, fit.motion)
    second, other = _judge(log, [one for one in causes if one.name != fit.cause.name])
    if other is not None and fit.cause.is_of_forces and other.cause.is_of_forces:  # two of them: all are a guess
        log.repair(motion)
        joint, every = _judge_physics(log, causes, (log.plain_residuals, log.path_errors(motion)), first, None)
        if every is not None:
            _repair(log, every, every.motion)
            first, fit, second, other = joint, every, _judge(log, causes)[0], None
    rivals = [name for name in first.equals if first.cause == UNCLEAR and name != fit.cause.name]
    if rivals and all(_gain_of(second, name) > BOTH * _gain_of(first, name) for name in rivals):  # both are there
        first = _describe(replace(first, cause=fit.cause.name, equals=()), fit)
    if other is not None and second.cause not in (NONE, UNEXPLAINED):  # the best alone may not be so beside the other
        _repair(log, other, other.cause.change(motion, other.theta))
        first, fit = _judge(log, [one for one in causes if one.name != other.cause.name])
        log.repair(motion if fit is None else fit.cause.change(motion, fit.theta))
        second = second if second.cause == UNCLEAR else _describe(second, log.estimate(other.cause))
        if first.cause in (NONE, UNCLEAR, UNEXPLAINED):
            first, second = second, first
    words = f"{first.sentence}; without that, {second.sentence}" if first.cause not in (NONE, UNEXPLAINED) else ""
    both = replace(first, sentence=words + _describe_zeros(log, causes, first, second), next=second)
    return both if words else first


def _describe_zeros(log: _Log, causes: Sequence[Cause], *found: Diagnosis) -> str:
    """Zeros of angles that show beside wrong forces, in words: mirror images tell them, however far paths err."""
    names, words = {result.cause for result in found}, ""
    if not names & {UNEXPLAINED, SEVERAL, *(one.name for one in causes if one.is_of_forces)}:
        return words
    given = log.plain_residuals, log.path_errors(log.motion)
    for fit in (log.estimate(one) for one in causes if one.equals == (ASYMMETRY,) and one.name not in names):
        gain, error = log.gain(given, (fit.left_out, log.path_errors(fit.motion)))
        theta, width = fit.theta[0], 1.96 * fit.errors[0]
        if fit.counts and gain > error and abs(theta) > width:
            size = f"{theta:.3g} [{theta - width:.3g}, {theta + width:.3g}] {fit.cause.unit}"
            words += f"; beside wrong forces {fit.cause.name} = {size} or {ASYMMETRY} shows, too"
    return words


def _repair(log: _Log, fit: _Fit, motion: Motion) -> None:
    """Take a motion without a cause for the log; beside coefficients that are a guess, the rest is what there is."""
    log.repair(motion)
    if fit.cause.name == SEVERAL:
        log.plain_errors = log.path_errors(motion)


def _gain_of(result: Diagnosis, name: str) -> float:
    return max(-misfit for key, misfit in (result.misfits or {}).items() if key.partition(" / ")[0] == name)


def _judge(log: _Log, causes: Sequence[Cause]) -> tuple[Diagnosis, _Fit | None]:
    """The best of all causes as a diagnosis, and its fit where it explains more than chance would."""
    given = log.plain_residuals, log.path_errors(log.motion)
    first = {cause.key: log.estimate(cause, 1) for cause in causes if cause.name != SEVERAL}
    near = sorted(first, key=lambda key: log.misfit(first[key].left_out))[: 2 * FINALISTS]
    fits = first | {key: log.estimate(first[key].cause, ROUNDS - 1, first[key].theta) for key in near}
    rest = min(log.misfit(z) for z in (given[0], *(fit.left_out for fit in fits.values() if not fit.cause.of_runs)))
    fits |= {
        key: replace(fit, cause=replace(fit.cause, cost=np.inf))
        for key, fit in fits.items()
        if fit.cause.of_runs and not log.needs_runs(fit, rest)
    }
    misfits = {key: log.misfit(fit.left_out) + fit.cause.cost - log.misfit(given[0]) for key, fit in fits.items()}
    order = sorted(misfits, key=misfits.__getitem__)
    seen = {key: (fits[key].left_out, log.path_errors(fits[key].motion)) for key in order[:FINALISTS]}
    gains = {key: log.gain(given, one) for key, one in seen.items()}
    misfits |= {key: fits[key].cause.cost - less for key, (less, _) in gains.items()}
    order = sorted(seen, key=misfits.__getitem__)
    log.blind = min(log.blind, *(float(errors.mean()) for _, errors in (given, *seen.values())))
    whole, before, missed = log.beyond_noise(log.plain_errors), log.beyond_noise(given[1]), float(given[1].mean())
    gain, sure, lucky = -misfits[order[0]], np.log(len(causes) / LEVEL), -ndtri(LEVEL / len(causes))
    left = {key: log.beyond_noise(errors) for key, (_, errors) in seen.items()}
    result = Diagnosis(NONE, error=missed, noise=log.blind, held=log.held, ahead=log.step * log.ahead, misfits=misfits)
    result = replace(result, sentence=f"{result.how_far}, and no single cause explains that")
    plain = {key: log.plainness(fits[key]) for key in order}
    share = {key: max(min(before, whole) - x, 0.0) / whole * fits[key].counts for key, x in left.items()}
    proof = {key: plain[key] + share[key] * (-misfits[key] - plain[key]) for key in order}
    if missed < log.blur:
        return result, None
    behind = {key: (misfits[key] + gain, log.gain(seen[key], seen[order[0]])[1]) for key in order}
    tied = [fits[key].cause for key, (less, error) in behind.items() if less < min(APART * error, ALIKE * gain)]
    rare = {key for key, (less, error) in gains.items() if proof[key] > sure or less > lucky * error}
    shown = [one for one in tied if one.key in rare and proof[one.key] > -WORTH * misfits[one.key]]
    told = [one for one in shown if plain[one.key] > sure]
    told = sorted(told, key=lambda one: (one.cost, -plain[one.key])) or shown
    if not told:
        return _judge_physics(log, causes, given, result, fits[order[0]] if WORTH * gain > sure else None)
    cause, best, near = told[0], fits[told[0].key], list(dict.fromkeys(one.name for one in told))
    result = replace(result, share=1 - left[cause.key] / before, equals=tuple(near))
    if not all(map(cause.is_like, told)):
        sentence = f"{result.how_far}: {' or '.join(near)} would explain that, and the log does not tell which"
        return replace(result, cause=UNCLEAR, sentence=sentence + cause.remedy), best
    equals = tuple(dict.fromkeys([*near[1:], *(key for key in cause.equals if key not in first)]))
    return _describe(replace(result, cause=cause.name, equals=equals), best), best


def _judge_physics(
    log: _Log, causes: Sequence[Cause], given: tuple[Array, Array], result: Diagnosis, best: _Fit | None
) -> tuple[Diagnosis, _Fit | None]:
    """What is said where no single cause is named: all coefficients are a guess, or the physics says little."""
    whole, before = log.beyond_noise(log.plain_errors), log.beyond_noise(given[1])
    for fit in (log.estimate(one) for one in causes if one.name == SEVERAL):
        errors = log.path_errors(fit.motion)
        (gain, _), left = log.gain(given, (fit.left_out, errors)), log.beyond_noise(errors)
        share = (before - left) / whole
        if share > WORTH and share * gain > np.log(len(causes) / LEVEL):
            return _describe(replace(result, cause=SEVERAL, share=1 - left / before), fit), fit
    if before > POOR * log.held:
        words = f"{before / log.held:.2g} times the error of constant u, v, r"
        words += ": look at units, orders and water, or identify the vessel"
        result = replace(result, cause=UNEXPLAINED, sentence=f"{result.sentence}; {words}")
    return result, best


def _describe(result: Diagnosis, fit: _Fit) -> Diagnosis:
    """A diagnosis with the size, the interval, the repair and the sentence of the fit of its cause."""
    cause, theta, equals = fit.cause, fit.theta, result.equals
    ends = (cause.sizes(theta - 1.96 * fit.errors), cause.sizes(theta + 1.96 * fit.errors))
    interval = tuple((min(pair), max(pair)) for pair in zip(*ends, strict=True))
    sizes, repair = cause.sizes(theta), cause.repair_text(theta)
    words = [f"{size:.3g} [{a:.3g}, {b:.3g}]" for size, (a, b) in zip(sizes, interval, strict=True)]
    words = words if len(words) <= MOST_SIZES else []
    sized, unit = f"{' = ' * bool(words)}{', '.join(words)}", cause.unit.strip("1")
    worth = f"explains {percent_text(result.share)} of what is no noise"
    if result.share <= 0.0:
        worth = "is seen in the motion, but paths are no better without it"
    sentence = f"{result.how_far}: {result.cause}{sized}{' ' * bool(unit)}{unit} {worth}; {' '.join(repair.split())}"
    sentence += f"; {' or '.join(equals)} would look alike{cause.remedy}" if equals else ""
    return replace(result, size=sizes, interval=interval, repair=repair, sentence=sentence)
