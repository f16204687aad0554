"""Structures of hull forces, and how the hull of a vessel is exchanged for another one.

A structure names the coefficients of a hull. Starting values give the forces of the present hull by linear least
squares over the states of the data and beyond them. The prior of a coefficient is a share of its value and a share of
the hull's force.

Sources: MMG, Yasukawa and Yoshimura (2015); Abkowitz (1964); second-order modulus, Norrbin (1970), Fedyaevsky and
Sobolev (1964).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from shipid import document as documents
from shipid.data.dataset import Array, Dataset
from shipid.engine.casadi import input_symbols, summed_rates
from shipid.errors import DataError, DocumentError, ShipidError, suggest_name
from shipid.identification.settings import Identify, measured_constants, without_zeros
from shipid.physics.signals import is_steering
from shipid.vessel.dynamics import Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel, check_document
from shipid.vessel.perturb import select_paths

PRESENT = "present"
"""Name of the hull as the vessel has it, with the numbers that the settings leave free."""
OF_VALUE, SHARE = 0.3, 0.03  # standard deviation of a prior: of the value at the start, of the hull's force
TINY = 1e-6  # of the hull's force: a coefficient whose force is smaller begins at 0
SAMPLES, BEYOND, SEED = 1500, 1.2, 0  # states of the data, and as many drawn from the ranges, so much wider
DRAWN = 0.05  # weight of a drawn state: along a run forces nearly cancel, and small errors count
NOTHING = 1e-6  # in place of 0 where a coefficient must be positive
LEAST = 1e-3  # of the usual size: where a coefficient that must be positive begins at least
AXES = ("X", "Y", "N")


@dataclass(frozen=True)
class Structure:
    """Coefficients that make a hull, by dotted path; `rudder`: those that replace a rudder behind a propeller."""

    words: str
    hull: tuple[str, ...]
    rudder: tuple[str, ...] = ()


def _coefficient_names(block: str, *names: str) -> tuple[str, ...]:
    return tuple(f"hull.{block}.{name}" for name in names)


def _two_sided_names(*monomials: str) -> tuple[str, ...]:
    return tuple(f"{axis}_{monomial}" for axis in "YN" for monomial in monomials)


_ALONG = ("X_vv", "X_vr", "X_rr")
_STEERING = ("delta", "udelta", "deltadeltadelta", "vvdelta", "vdeltadelta", "rrdelta", "rdeltadelta")
STRUCTURES: dict[str, Structure] = {
    "mmg": Structure(
        "third order in v / U and r L / U (MMG)",
        _coefficient_names(
            "mmg", "R_0", *_ALONG, "X_vvvv", *_two_sided_names("u", "v", "r", "vvv", "vvr", "vrr", "rrr")
        ),
    ),
    "modulus": Structure(
        "second order with moduli in v / U and r L / U",
        _coefficient_names("mmg", "R_0", *_ALONG, *_two_sided_names("u", "v", "r", "|v|v", "|v|r", "|r|v", "|r|r")),
    ),
    "cubic": Structure(
        "third order in v and r, whatever the speed",
        _coefficient_names(
            "derivatives", "X_u|u|", *_ALONG, *_two_sided_names("uu", "uv", "ur", "vvv", "vvr", "vrr", "rrr")
        ),
    ),
    "abkowitz": Structure(
        "third order about the service speed, with rudder derivatives (Abkowitz)",
        (
            "hull.resistance.R_0",
            *_coefficient_names(
                "abkowitz", *_ALONG, *_two_sided_names("v", "uv", "r", "ur", "vvv", "vvr", "vrr", "rrr")
            ),
            *_coefficient_names("derivatives", *_two_sided_names("uu")),
        ),
        ("X_deltadelta", "X_vdelta", "X_rdelta", *_two_sided_names(*_STEERING)),
    ),
}
"""Name -> structure. Each also has a side force and a moment of straight running, which a single screw makes."""
REPLACED = ("mmg", "derivatives", "prime_derivatives", "bis_derivatives", "abkowitz", "crossflow")
"""Blocks of `hull` that a structure replaces, but for what they do with heave, roll, pitch and heel; of `resistance` it
takes over R_0."""
COEFFICIENTS = tuple(f"{axis}_" for axis in "XYZKMN")
PLANAR = re.compile(r"[XYN]_[uvr|]+")  # a coefficient that a structure may have, too


@dataclass(frozen=True, eq=False)
class HullExchange:
    """A vessel with another hull.

    settings : with its coefficients free. misfit : axis -> RMS over the rows of the data of what the starting values
    miss, over the RMS of the forces of the former hull.
    """

    vessel: Vessel
    settings: Identify
    misfit: Mapping[str, float]


def check_structures(names: Sequence[str]) -> None:
    """Raise ShipidError for an unknown structure, or for one that is named twice."""
    for name in names:
        if name not in (PRESENT, *STRUCTURES):
            hint = suggest_name(name, (PRESENT, *STRUCTURES))
            raise ShipidError(f"{name!r} is no structure: {hint}", path="structures")
        if names.count(name) > 1:
            raise ShipidError(f"{name!r} is named twice", path="structures")


def exchange_structure(
    vessel: Vessel, name: str, dataset: Dataset, runs: Sequence[str], settings: Identify
) -> HullExchange:
    """Exchange the hull of a vessel for that of a structure, with starting values that make the same forces.

    name : of `STRUCTURES`, or `present`. dataset, runs : whose states the forces are compared over.
    settings : numbers that are no coefficients of the hull stay free or fixed as they say, with their priors.

    Raises ShipidError for an unknown structure, DocumentError for a vessel without the sizes that it needs, DataError
    for a run or a command that the data do not have.
    """
    check_structures([name])
    if name == PRESENT:
        return HullExchange(vessel, settings, dict.fromkeys(AXES, 0.0))
    structure = STRUCTURES[name]
    rudders = {
        f"thruster.{rudder}": block
        for rudder, block in vessel.document.get("thruster", {}).items()
        if structure.rudder and block.get("kind") == "rudder" and not block.get("off", False)
    }
    paths = [*structure.hull, *(f"{rudder}.{term}" for rudder in rudders for term in structure.rudder)]
    states = _sample_states(vessel, dataset, runs)
    bare = _vessel_without_coefficients(vessel, structure, rudders, paths, float(np.median(states["u"])))
    c, sizes, misfit = _fit_coefficients(vessel, bare, paths, states)
    begun = np.where(np.abs(c) < TINY * sizes, 0.0, c)
    positive = np.array([path.endswith("hull.mmg.R_0") for path in paths])
    begun = np.where(positive, np.maximum(c, LEAST * sizes), begun)
    result = bare.with_values(dict(zip(paths, begun.tolist(), strict=True)))
    return HullExchange(result, _settings_of_exchange(vessel, result, settings, rudders, paths, begun, sizes), misfit)


def _vessel_without_coefficients(
    vessel: Vessel, structure: Structure, rudders: Mapping[str, Mapping[str, Any]], paths: Sequence[str], speed: float
) -> Vessel:
    """The vessel with the blocks of the structure, every coefficient about nothing."""
    document = dict(vessel.document)
    blocks = {path.split(".")[1] for path in structure.hull}
    hull = {key: block for key, block in document.get("hull", {}).items() if key not in REPLACED}
    hull |= {
        key: _strip_coefficients(block)
        for key, block in document.get("hull", {}).items()
        if _keeps_number(key, block, blocks)
    }
    if "resistance" in hull:
        hull["resistance"] = {**hull["resistance"], "R_0": 0.0}
    document["hull"] = hull
    document["thruster"] = dict(document.get("thruster", {}))
    for path, block in rudders.items():
        kept = {key: block[key] for key in ("actuator",) if key in block}
        document["thruster"][path.split(".", 1)[1]] = {"kind": "rudder_derivatives", **kept}
    sizes = document.get("particulars", {})
    missing = next((size for size in ("L_pp", "T") if size not in sizes), None)
    if missing is not None or "rho" not in document.get("constants", {}):
        path = f"particulars.{missing}" if missing else "constants.rho"
        raise DocumentError("missing: a structure of the hull needs it", file=vessel.file, path=path)
    if structure.rudder and "U_0" not in sizes:
        document["particulars"] = {**sizes, "U_0": speed}
    small = {path: NOTHING if path == "hull.mmg.R_0" else 0.0 for path in paths}
    document["name"] = f"{vessel.name}, hull of {structure.words}"
    return check_document(documents.replace_values(document, small), vessel.file)


def _keeps_number(key: str, block: Mapping[str, Any], blocks: Collection[str]) -> bool:
    """Whether a block that a structure replaces has a number that stays; blocks : those of the structure."""
    heeling = any(name[:2] in COEFFICIENTS and not PLANAR.fullmatch(name) for name in block)
    replaced = key in REPLACED and key != "crossflow" and not block.get("off", False)
    return replaced and (key in blocks or heeling)


def _strip_coefficients(block: Mapping[str, Any]) -> dict[str, Any]:
    """A block without the coefficients that a structure replaces: those of heave, roll, pitch and heel, constants."""
    kept = {name: value for name, value in block.items() if not isinstance(value, str) and not PLANAR.fullmatch(name)}
    return {**kept, "R_0": NOTHING} if "R_0" in kept else kept


def _sample_states(vessel: Vessel, dataset: Dataset, runs: Sequence[str]) -> dict[str, Array]:
    """u, v, r and commands (N,): rows of the runs, and as many drawn from ranges; those of v, r and helm are wider."""
    names = ("u", "v", "r", *vessel_dynamics(vessel).commands)
    missing = next((name for name in names if name not in dataset.frame), None)
    if missing is not None:
        raise DataError(f"{vessel.name} needs this command; the data have {', '.join(dataset.commands)}", path=missing)
    rows = dataset.frame.loc[dataset.frame["run"].isin(runs), list(names)].dropna()
    if rows.empty:
        raise DataError("has no complete row in the runs", path="runs")
    rng = np.random.default_rng(SEED)
    some = rows.iloc[rng.permutation(len(rows))[:SAMPLES]]
    result = {}
    for name in names:
        low, high = float(rows[name].min()), float(rows[name].max())
        if name in ("v", "r") or is_steering(name):
            high = BEYOND * max(-low, high, 1e-6)
            low = -high
        result[name] = np.concatenate([some[name].to_numpy(dtype=float), rng.uniform(low, high, SAMPLES)])
    return result


@lru_cache(maxsize=16)
def force_equations(model: Dynamics, free: tuple[int, ...]) -> ca.Function:
    """(state, memory, commands, environment, parameters) -> F, dF/d free.

    The accelerations are M^-1 (F + tau), so M is the inverse of their derivative to tau.
    """
    inputs, dof = input_symbols(model), model.num_dof
    tau = ca.SX.sym("tau", dof)
    acceleration = ca.SX(summed_rates(model, inputs, tau, {}))[dof : 2 * dof]
    mass = ca.inv(ca.densify(ca.jacobian(acceleration, tau)))
    force = mass @ ca.substitute(acceleration, tau, ca.SX.zeros(dof))
    theta = ca.vertcat(*(inputs[-1][i] for i in free))
    result = [force, ca.densify(ca.jacobian(force, theta))]
    return ca.Function("equations", inputs, result, {"cse": True})


def _hull_forces(vessel: Vessel, states: Mapping[str, Array], free: Sequence[str], zero: bool) -> tuple[Array, Array]:
    """Surge, sway and yaw force (3, N) [N, N m] at rest of everything else, and its derivatives (3, N, n) to `free`.

    zero : with 0 for all of `free`.
    """
    model, count = vessel_dynamics(vessel), len(states["u"])
    names = list(vessel.parameters)
    values = np.array([0.0 if zero and name in free else value for name, value in vessel.parameters.items()])
    function = force_equations(model, tuple(names.index(path) for path in free))
    still = np.zeros(count)
    inputs = [
        np.array([states.get(name, still) for name in group]).reshape(len(group), count)
        for group in ((*model.state, *model.hidden), tuple(model.memory), model.commands, model.environment)
    ]
    mapped = function.map("forces", "serial", count, [function.n_in() - 1], [])
    force, slopes = mapped(*inputs, values)
    rows = [model.state[model.num_dof :].index(name) for name in ("u", "v", "r")]
    by_free = np.array(slopes).reshape(model.num_dof, count, len(free))
    return np.array(force)[rows], by_free[rows]


def _fit_coefficients(
    vessel: Vessel, bare: Vessel, paths: Sequence[str], states: Mapping[str, Array]
) -> tuple[Array, Array, dict[str, float]]:
    """Coefficients (n,) that make the forces of the vessel, the size (n,) of each that alone makes all, and misfits."""
    wanted, _ = _hull_forces(vessel, states, (), False)
    without, slopes = _hull_forces(bare, states, paths, True)
    target = wanted - without
    level = np.maximum(np.sqrt((target**2).mean(axis=1)), 1e-12)
    weight = np.where(np.arange(target.shape[1]) < target.shape[1] - SAMPLES, 1.0, DRAWN) / level[:, None]
    scaled = (slopes * weight[:, :, None]).reshape(-1, len(paths))
    lengths = np.sqrt((scaled**2).sum(axis=0))
    lengths = np.where(lengths > 0, lengths, 1.0)
    c = np.linalg.lstsq(scaled / lengths, (target * weight).ravel(), rcond=1e-8)[0] / lengths
    axis = [AXES.index(letter) if (letter := path.rsplit(".", 1)[-1][0]) in AXES else 0 for path in paths]  # R_0: X
    unit = np.sqrt((slopes[axis, :, np.arange(len(paths))] ** 2).mean(axis=1))  # force of a coefficient of 1
    sizes = level[axis] / np.where(unit > 0, unit, 1.0)
    left = np.sqrt(((slopes @ c - target)[:, :-SAMPLES] ** 2).mean(axis=1)) / level
    return c, sizes, dict(zip(AXES, left.tolist(), strict=True))


def _settings_of_exchange(
    vessel: Vessel,
    result: Vessel,
    settings: Identify,
    rudders: Mapping[str, Any],
    paths: Sequence[str],
    begun: Array,
    sizes: Array,
) -> Identify:
    """The settings for the exchanged vessel: its coefficients are free, other numbers as the settings say."""

    def kept(patterns: Sequence[str]) -> list[str]:
        chosen = select_paths(patterns, vessel.parameters, vessel.file, "identify.parameters") if patterns else []
        gone = tuple(f"{path}." for path in (*(f"hull.{block}" for block in REPLACED), *rudders))
        return [
            path
            for path in chosen
            if (".actuator." in path or not path.startswith(gone)) and path not in paths
            and path != "hull.resistance.R_0" and path in result.parameters
        ]  # fmt: skip

    asked = kept(settings.parameters)
    fixed = {*kept(settings.fixed), *measured_constants(asked, settings)}
    free = [path for path in asked if path not in fixed]

    def translated(given: Mapping[str, Any]) -> dict[str, Any]:
        return {path: value for pattern, value in given.items() for path in kept([pattern]) if path in free}

    tied = [[path for path in kept(group) if path in free] for group in settings.together]
    groups = [list(without_zeros(group, settings, result.parameters)) for group in tied]
    zeros = {path for group, left in zip(tied, groups, strict=True) for path in group if path not in left}
    free = [path for path in free if path not in zeros]
    zero = begun == 0
    widths = np.where(zero, SHARE, np.hypot(OF_VALUE, SHARE * sizes / np.where(zero, 1.0, np.abs(begun))))
    update = {
        "parameters": [*free, *paths],
        "fixed": [],
        "together": [group for group in groups if len(group) > 1],
        "prior": translated(settings.prior) | dict(zip(paths, widths.tolist(), strict=True)),
        "bounds": translated(settings.bounds),
        "scale": {path: size for path, size in settings.scale.items() if path in free}
        | {path: float(size) for path, size, none in zip(paths, sizes, zero, strict=True) if none},
    }
    return settings.model_copy(update=update)
