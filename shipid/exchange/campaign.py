"""The study over ships: every bundled ship and drawn ones, each with the same families, amounts of data and horizons.

A ship is a unit: it is the same on every worker, in any order, and its cells are stored when it is finished.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.errors import DivergenceError, ResultError, ShipidError
from shipid.exchange.ships import Dice, DrawnShip, draw_ship
from shipid.files import read_json, write_json, write_table
from shipid.metrics import position_error
from shipid.simulation.approach import Controls, vessel_service_speed
from shipid.study.declared import NO_MODEL
from shipid.study.new import draft_simulated
from shipid.study.plan import Plan, build_plan
from shipid.study.prepare import PreparedStudy, obtain_runs, prepare
from shipid.study.run import run_unit
from shipid.study.store import check_shard
from shipid.study.workers import on_workers
from shipid.units import GRAVITY
from shipid.users import code_digest
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import derivative_order
from shipid.vessel.similar import similar_vessels, vessel_particulars
from shipid.vessel.stability import service_shaft
from shipid.vessel.template import Particulars, first_guess

BUNDLED = {
    "mariner": "cargo",
    "otter": "usv",
    "gunnerus-28.9": "research",
    "esso-190k": "tanker",
    "kvlcc2-l7": "model",
    "container-175": "container",
    "naval-51": "naval",
    "cybership2": "model",
    "supply-vessel": "offshore",
}
"""Ships that shipid ships, one file of each, and their types."""
IN_WAVES = {"gunnerus-28.9": ("gunnerus-28.9-6dof", {"H_s": 1.0, "T_p": 5.0})}  # truth of it, and the sea of `quick`
DRAWN = 30
AMOUNTS, TESTS = (1, 2, 4, 8, 16, 32, 64), 12  # runs for training and for the test
HORIZONS = (1.0, 2.0, 4.0)  # ship lengths at 0.75 of the service speed
ZIGZAG = "zigzag"
ROUGHNESS = {"weather": (0.03, 1.0), "noise": (0.03, 2.0)}
"""Of what `study new` drafts, from next to nothing: a towing tank on a good day, and the open sea."""
STEPS = 32  # of the horizon
SAMPLES = 12  # instants of a run
PARTED = 2.1  # windows between the first and the last instant of a run: a single one can be parted to validate
COUPLING = ("X_vr", "Y_r", "Y_ur", "N_v", "N_uv")
DRIVING, STEERING = ("T_nn", "T_nu", "k_T", "X_u", "X_uu", "X_uuu", "F_2"), ("f_alpha",)
CROSS_FLOW = "C_d"


@dataclass(frozen=True)
class StudiedShip:
    """A ship of the study: its truth, its physics in 3 degrees of freedom, particulars where they are known, a sea."""

    name: str
    type: str
    truth: Vessel
    physics: Vessel
    particulars: Particulars | None
    sea: Mapping[str, float] | None = None


def ship_names(drawn: int = DRAWN) -> list[str]:
    """Names of all ships; bundled and drawn ones alternate, so that a part of them is already mixed."""
    every = max(drawn // len(BUNDLED), 1)
    groups = [[f"drawn-{number:02d}" for number in range(k, drawn, every)] for k in range(every)]
    return [name for row in zip_longest(BUNDLED, *groups) for name in row if name is not None]


@cache
def drawn_ships(seed: int, drawn: int) -> tuple[DrawnShip, ...]:
    """The drawn ships of a study."""
    return tuple(draw_ship(seed, number) for number in range(drawn))


def studied_ship(name: str, seed: int, drawn: int) -> StudiedShip:
    """A ship of the study by its name."""
    if name not in BUNDLED:
        ship = drawn_ships(seed, drawn)[int(name.rpartition("-")[2])]
        vessel = ship.vessel()
        return StudiedShip(name, ship.type, vessel, vessel, ship.particulars)
    truth, sea = IN_WAVES.get(name, (name, None))
    vessel = load_vessel(name)
    return StudiedShip(name, BUNDLED[name], load_vessel(truth), vessel, _known_particulars(vessel), sea=sea)


def _known_particulars(vessel: Vessel) -> Particulars | None:
    """Particulars of a bundled vessel; None where beam or draught are missing."""
    known, controls, U = vessel_particulars(vessel), Controls(vessel), vessel_service_speed(vessel)
    if not {"L_pp", "B", "T", "C_b"} <= known.keys():
        return None
    signals = {name.rpartition(".")[2] for name in controls.commands}
    propulsor = "azimuth" if "alpha" in signals else "propeller-rudder" if "delta" in signals else "differential"
    n = service_shaft(vessel, U)
    L, B, T, block = (known[name] for name in ("L_pp", "B", "T", "C_b"))
    return Particulars(L, B, T, block, U, propulsor, rpm=None if n is None else 60 * n, shafts=len(controls.drives))


def _sister_of(ship: StudiedShip, seed: int, drawn: int) -> Vessel | None:
    """The nearest drawn ship with the same drive, as `vessel similar` scales it; None where there is none."""
    mine = ship.particulars
    if mine is None:
        return None
    near = [
        one.vessel()
        for one in drawn_ships(seed, drawn)
        if one.name != ship.name and (one.particulars.propulsor, one.particulars.units) == (mine.propulsor, mine.units)
    ]
    return next((vessel for _, vessel in similar_vessels(_known_numbers(mine), near, ship.physics)), None)


def _known_numbers(given: Particulars) -> dict[str, float]:
    """Particulars by their keys in a document of a vessel."""
    return {"L_pp": given.length, "B": given.beam, "T": given.draught, "C_b": given.block, "U_0": given.service}


def _template_of(ship: StudiedShip) -> Vessel | None:
    """What `vessel new` gives from the particulars; None where its formulae do not hold."""
    if ship.particulars is None:
        return None
    for given in (ship.particulars, replace(ship.particulars, rpm=None)):
        with suppress(ShipidError):
            return first_guess(given, "template", "template.toml").vessel
    return None


def _families(
    ship: StudiedShip, drafted: list[dict[str, Any]], others: Iterable[str], seed: int
) -> list[dict[str, Any]]:
    """Families of a ship: those of `study new`, one kind of number wrong, a part missing, and vessels of others."""
    paths = list(ship.physics.parameters)
    hull = [path for path in paths if path.startswith("hull.")]
    nominal, moderate, high = drafted
    last = {path: path.rpartition(".")[2] for path in paths}
    drives = [path for path in paths if path.startswith("thruster.") and (last[path] in DRIVING or ".K_T." in path)]
    steers = [
        path
        for path in paths
        if (last[path] in STEERING or (path.startswith("thruster.") and "delta" in last[path]))
        and ".actuator." not in path
    ]
    thrust = [
        {"parameters": group, "factor": ends, "together": True}
        for group, ends in ((drives, [0.4, 1.6]), (steers, [0.6, 1.4]))
        if group
    ]
    curved = [path for path in hull if (derivative_order(path) or 0) >= 3 or last[path] == CROSS_FLOW]
    curved = curved or [path for path in hull if (derivative_order(path) or 0) == 2 and path.split(".")[-1][0] in "YN"]
    coupled = [path for path in hull if last[path] in COUPLING]
    base = {"base": "physics"}
    families = [
        nominal,
        moderate | {"members": 2},
        high,
        base | {"name": "damping", "members": 2, "perturb": moderate["perturb"]},
        base | {"name": "mass", "members": 2, "perturb": high["perturb"]},
        base | {"name": "thrust", "members": 2, "perturb": thrust},
        *(
            base | {"name": f"missing-{words}", "perturb": [{"remove": gone}]}
            for words, gone in (("curved", curved), ("coupling", coupled))
            if gone
        ),
        *({"name": name, "base": name} for name in others),
    ]
    return [one | {"seed": seed + place} for place, one in enumerate(families) if one.get("perturb") != []]


def plan_ship(ship: StudiedShip, seed: int, drawn: int, amounts: Iterable[int] = AMOUNTS) -> Plan:
    """The study of a ship: that of `study new`, with other families, manoeuvres, weather and sensors."""
    out, dice = Path(f"{ship.name}-study.toml"), Dice((seed, "study", ship.name))
    draft = draft_simulated({"physics": ship.physics}, out, max(HORIZONS), STEPS)
    document: dict[str, Any] = tomllib.loads(draft.text)
    found = {"truth": ship.truth, "physics": ship.physics, "template": _template_of(ship)}
    vessels = {
        name: one for name, one in (found | {"sister": _sister_of(ship, seed, drawn)}).items() if one is not None
    }
    amounts = sorted(amounts)
    truth, prediction = document["truth"], document["prediction"]
    turning = truth["manoeuvre"][0]
    passing = ship.physics.length / vessel_service_speed(ship.physics)  # type: ignore[operator]
    shafts = next(values for key, values in turning.items() if "n_rpm" in key and isinstance(values, list))
    kinds = [
        turning | {"share": dice("turning", 0.3, 1.0)},
        turning | {"kind": "steps", "hold": [passing, 5 * passing], "share": dice("steps", 0.5, 1.5)},
    ]
    if not Controls(ship.truth).differential:
        sides, angles = ["starboard", "port"], [10.0, 25.0]
        zigzag = {"kind": ZIGZAG, "n_rpm": shafts, "angle_deg": angles, "side": sides}
        kinds.append(zigzag | {"share": dice("zigzag", 0.2, 0.8)})
    truth |= {
        "vessel": "truth",
        "manoeuvres": amounts[-1] + TESTS,
        "seed": int(dice("seed", 0, 1e6)),
        "manoeuvre": kinds,
    }
    if ship.sea:
        truth["waves"] = dict(ship.sea)
    weather, noise = (math.exp(dice(name, *map(math.log, ends))) for name, ends in ROUGHNESS.items())
    for name, most in (("current_speed", 1.0), ("wind_speed", 1.6)):
        if name in truth:
            truth[name] = [0.0, truth[name][1] * weather * dice(name, 0.5, most)]
    truth["sensors"] = {name: {"noise": noise * one["noise"]} for name, one in truth["sensors"].items()}
    step = prediction["step"]
    steps = round(prediction["ahead"] / step)
    interval = step * math.ceil(PARTED * (steps + truth.get("run_up", 0.0) / step) / (SAMPLES - 1))
    prediction |= {"commands": "known", "interval": interval, "samples": SAMPLES}
    truth["duration"] = prediction["ahead"] + SAMPLES * interval
    document |= {"split": {"test": TESTS, "folds": 1}, "grid": {"N_D": list(amounts), "seeds": [0]}}
    others = [name for name in vessels if name not in ("truth", "physics")]
    document["family"] = _families(ship, document["family"], others, truth["seed"])
    del document["claims"]
    return build_plan(document, out, vessels)


def prepare_ship(plan: Plan) -> tuple[Plan, PreparedStudy]:
    """Runs and physics of a ship, without the families of fixed numbers that diverge; DivergenceError for its own.

    There are zigzags where the ship reaches a straight course, by itself or with a helmsman.
    """
    for approach in ("steady", "helmsman", None):
        kinds = [
            one | {"approach": approach} if one["kind"] == ZIGZAG else one
            for one in plan.document["truth"]["manoeuvre"]
            if one["kind"] != ZIGZAG or approach
        ]
        document = {**plan.document, "truth": {**plan.document["truth"], "manoeuvre": kinds}}
        plan = build_plan(document, Path(plan.file), plan.vessels)
        try:
            data = obtain_runs(plan)
            break
        except ShipidError:
            if approach is None:
                raise
    while True:
        try:
            return plan, prepare(plan, data)
        except DivergenceError as error:
            lost = (error.path or "").removeprefix("family.")
            families = [one for one in plan.document["family"] if one["name"] != lost]
            if lost in ("", "nominal") or len(families) == len(plan.document["family"]):
                raise
            plan = build_plan({**plan.document, "family": families}, Path(plan.file), plan.vessels)


def study_ship(name: str, seed: int, drawn: int, amounts: Iterable[int], part: Path) -> pd.DataFrame:
    """Cells of a ship, see `CELL_COLUMNS`; ShipidError where it cannot be studied.

    part : file that keeps the errors of each finished unit, from which an interrupted study goes on.
    """
    ship = studied_ship(name, seed, drawn)
    plan, prepared = prepare_ship(plan_ship(ship, seed, drawn, amounts))
    test, speed, length = prepared.test, vessel_service_speed(ship.physics), float(ship.physics.length or 0)
    ends = [round(test.horizon * ahead / max(HORIZONS)) for ahead in HORIZONS]

    def mean_errors(paths: np.ndarray) -> list[float]:
        error = position_error(paths, test.future)
        return [float(error[:end].mean()) for end in ends]

    alone = {one: mean_errors(predicted.test_paths) for one, predicted in prepared.known.items()}
    kept: dict[str, list[Any]] = read_json(part) if part.exists() else {}
    for unit in plan.units:
        if unit.key not in kept:
            kept[unit.key] = [
                (cell.row["foundation"], unit.batch.N_D, mean_errors(cell.paths))
                for cell in run_unit(plan, prepared, unit, "cpu")
                if cell.paths is not None
            ]
            write_json(part, kept)
    results = [(one, 0, errors) for one, errors in alone.items() if one != NO_MODEL]
    kinds = {one.name: one.family.partition("-")[0] for one in prepared.foundations}
    rows = [
        {
            "ship": name, "type": ship.type, "bundled": name in BUNDLED, "length": length, "speed": speed,
            "froude": speed / math.sqrt(GRAVITY * length), "foundation": foundation, "kind": kinds[foundation],
            "A": math.nan if foundation == NO_MODEL else alone[foundation][place], "N_D": N_D,
            "ahead": HORIZONS[place], "H": errors[place], "baseline": float(prepared.naive[:end].mean()),
            "floor": alone["nominal"][place],
        }
        for foundation, N_D, errors in chain(results, *kept.values())
        for place, end in enumerate(ends)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def _try_ship(folder: Path, seed: int, drawn: int, amounts: tuple[int, ...], name: str) -> pd.DataFrame | str:
    """Cells of a ship, or why it has none; ResultError where what the folder keeps of it is damaged."""
    try:
        return study_ship(name, seed, drawn, amounts, folder / f"{name}.json")
    except ResultError:
        raise
    except ShipidError as error:
        return str(error)


def run_ships(
    folder: Path,
    seed: int = 0,
    drawn: int = DRAWN,
    amounts: tuple[int, ...] = AMOUNTS,
    *,
    workers: int = 0,
    shard: tuple[int, int] = (1, 1),
) -> Iterator[str]:
    """Study the ships that are not finished in a folder, or every n-th of them from the i-th on; a line for each.

    Each ship has its files, one of them while it is at work, so that shards may share the folder; after each,
    `cells.csv` is anew.

    Raises ResultError for a folder of another study, or of other code, whose ships would be mixed with these.
    """
    first, every = check_shard(shard)
    settings = {"seed": seed, "drawn": drawn, "amounts": list(amounts), "code": code_digest()}
    place = folder / "ships.json"
    if place.exists() and (known := read_json(place)) != settings:
        raise ResultError(f"holds the study over ships with {known}, not {settings}: take another folder", file=place)
    write_json(place, settings)
    names = ship_names(drawn)[first - 1 :: every]
    left = [name for name in names if not (folder / f"{name}.parquet").is_file()]
    if len(left) < len(names):  # a kill may have left the table behind its ships
        _write_cells(folder, drawn)
    for name, cells in on_workers(partial(_try_ship, folder, seed, drawn, amounts), left, workers):
        if isinstance(cells, str):
            yield f"{name} is left out: {cells}"
        else:
            write_table(folder / f"{name}.parquet", cells)
            (folder / f"{name}.json").unlink(missing_ok=True)
            yield f"{name}: {len(cells)} cells; {_write_cells(folder, drawn)} of {len(BUNDLED) + drawn} ships"


def _write_cells(folder: Path, drawn: int) -> int:
    """Join the tables of the ships that are finished; their number. ResultError where one is damaged."""
    files = [file for one in ship_names(drawn) if (file := folder / f"{one}.parquet").is_file()]
    try:
        tables = {file.stem: pd.read_parquet(file) for file in files}
        if any({*one["ship"]} != {name} for name, one in tables.items()):
            raise ValueError("it is of another ship than its name says")
    except (OSError, ValueError, KeyError) as error:
        raise ResultError(
            f"the table of a ship is damaged ({' '.join(str(error).split())}): delete it, and start again", file=folder
        ) from None
    write_table(folder / "cells.csv", pd.concat(tables.values(), ignore_index=True))
    return len(files)
