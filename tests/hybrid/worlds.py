"""Made-up worlds in which one thing is missing from the physics, and what a method makes of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.data.windows import Windows, cut_windows
from shipid.engine.rollout import rollout
from shipid.hybrid.method import Case, Corrector, Method, Task
from shipid.hybrid.physics import Physics
from shipid.vessel.load import Vessel, load_vessel

Array = np.ndarray
#: (velocities (S, 3), commands by name (S,)) at each past step of `FINE` seconds, the present last -> force (S, 3)
Force = Callable[[Sequence[Array], Sequence[Mapping[str, Array]]], Array]
FINE = 0.2  # s: step of the truth
HORIZON = 15
TEST = "test"  # runs whose names begin so are held out


@dataclass(frozen=True)
class World:
    """Windows that train and windows that judge; physics: what is known of the ship.

    commands : names of the command columns.
    """

    train: Windows
    test: Windows
    physics: Physics
    commands: tuple[str, ...]
    known: bool = False

    def task(self, physics: Mapping[str, Physics] | None = None, **changes: object) -> Task:
        cases = {
            name: case_of(one, self.train, self.known) for name, one in (physics or {"physics": self.physics}).items()
        }
        return replace(Task(cases, self.train, folds_of(self.train), self.commands, self.known), **changes)

    def removed(self, corrector: Corrector) -> float:
        """Share of the error of the physics that a corrector removes on runs it never saw."""
        instants = self.test.instants(known=self.known)
        paths = self.physics.paths(instants)
        return 1 - self.error(corrector.predict(self.physics, instants, paths)) / self.error(paths)

    def error(self, paths: Array) -> float:
        """Mean distance [m] to the true path."""
        return float(np.hypot(*np.moveaxis(paths - self.test.future, -1, 0)).mean())


def case_of(physics: Physics, windows: Windows, known: bool = False) -> Case:
    return Case(physics, physics.paths(windows.instants(known=known)))


def folds_of(windows: Windows) -> list[tuple[Array, Array]]:
    """One fold: every fifth run validates."""
    names = sorted(set(windows.run))
    validation = np.isin(windows.run, names[::5])
    return [(np.flatnonzero(~validation), np.flatnonzero(validation))]


def world(
    truth: Vessel,
    known_as: Vessel | None,
    *,
    force: Force | None = None,
    runs: int = 20,
    seconds: float = 60.0,
    past: int = 0,
    known: bool = False,
    hold: tuple[float, float] = (8.0, 25.0),
) -> World:
    """Windows of a truth, and physics for it."""
    dataset = simulated(truth, runs + 6, runs, seconds, 0, force, hold)
    windows = cut_windows(dataset, horizon=HORIZON, past=past)
    held_out = np.char.startswith(windows.run, TEST)
    physics = Physics(known_as, HORIZON, 1.0, "rk4")
    return World(windows.select(~held_out), windows.select(held_out), physics, tuple(dataset.commands), known)


def simulated(
    vessel: Vessel,
    count: int,
    training: int,
    seconds: float,
    seed: int,
    force: Force | None = None,
    hold: tuple[float, float] = (8.0, 25.0),
) -> Dataset:
    """Runs at 1 Hz with orders that change at random times; both units act as one."""
    rng = np.random.default_rng(seed)
    steps = round(seconds / FINE)
    state = {name: np.zeros(count) for name in ("north", "east")}
    state |= {"psi": rng.uniform(-3, 3, count), "u": rng.uniform(2, 5, count)}
    state |= {"v": rng.uniform(-0.3, 0.3, count), "r": rng.uniform(-0.03, 0.03, count)}
    n, alpha = (orders(rng, count, steps, *span, hold) for span in ((1.2, 3.2), (-0.5, 0.5)))
    orders_ = {"port.n": n, "port.alpha": alpha, "starboard.n": n, "starboard.alpha": alpha}
    rows, nus, commands = [], [], []
    every = round(1 / FINE)
    for i in range(steps):
        here = {name: values[i] for name, values in orders_.items()}
        nus.append(np.stack([state[name] for name in ("u", "v", "r")], axis=1))
        commands.append(here)
        if i % every == 0:
            rows.append(pd.DataFrame({"run": names(count, training), "t": i * FINE, **state, **here, "flags": 0}))
        extra = None if force is None else force(nus, commands)
        path = rollout(
            vessel, state, here, dict.fromkeys(("V_w", "beta_w"), np.zeros(count)),
            step=FINE, num_steps=1, method="rk4", tau_extra=extra, engine="native",
        )  # fmt: skip
        state = {name: path[name][-1, 0] for name in state}
    frame = pd.concat(rows).sort_values(["run", "t"], ignore_index=True)
    return Dataset(frame, {"clock": "run"})


def names(count: int, training: int) -> list[str]:
    return [f"run-{i:02d}" if i < training else f"{TEST}-{i:02d}" for i in range(count)]


def orders(
    rng: np.random.Generator, count: int, steps: int, low: float, high: float, hold: tuple[float, float]
) -> Array:
    """Orders (steps, count) that are held for some seconds and then jump."""
    levels = np.zeros((steps, count))
    for run in range(count):
        at = 0
        while at < steps:
            length = max(round(rng.uniform(*hold)), 1) * round(1 / FINE)  # orders change on whole seconds
            levels[at : at + length, run] = rng.uniform(low, high)
            at += length
    return levels


def ship() -> Vessel:
    return load_vessel("gunnerus-28.9")


def fitted(method: Method, world_: World, seed: int = 0) -> Corrector:
    fit = method.fit(world_.task(seed=seed))["physics"].corrector
    return fit


def missed(world_: World, error: Callable[[World, Windows], Array]) -> World:
    """The world whose true paths are those of the physics plus an error (T, S, 2) [m]."""

    def changed(windows: Windows) -> Windows:
        paths = world_.physics.paths(windows.instants(known=world_.known))
        return replace(windows, future=paths + error(world_, windows))

    return replace(world_, train=changed(world_.train), test=changed(world_.test))
