"""Ships of like particulars, scaled by Froude's law to the size of one's own: physics for a ship without a model.

Lengths go as the ratio of lengths, times as its square root, masses as its cube and the density of the water; every
number by its declared unit. Two things do not scale, and are corrected: friction, which follows the Reynolds number,
and with it the screw, which must still hold the service speed at its shaft speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit

from shipid import document as documents
from shipid.document import Document
from shipid.errors import DocumentError, ShipidError
from shipid.physics import TERMS
from shipid.physics.signals import rows_of_role
from shipid.units import GRAVITY, unit_value
from shipid.vessel.load import Vessel, check_document, load_vessel
from shipid.vessel.regressions import correlation_allowance, form_factor, ittc_friction
from shipid.vessel.schema import (
    BEHIND,
    PARTICULARS,
    TABLE,
    function_signals,
    parameter_units,
    structural_keys,
    term_blocks,
)
from shipid.vessel.stability import MOST_FORCE, bisect_root, straight_acceleration
from shipid.vessel.template import MODEL, NU, RHO_SEA, service_shaft, straight_orders

TAYLOR = 2.6
"""Wetted surface over sqrt(volume x length), Taylor (1910)."""
SPREADS = {"L/B": 0.3, "B/T": 0.3, "C_b": 0.12, "Fn": 0.08, "L": 2.0}
"""What counts as one unit of distance: of C_b and the Froude number as they are, of the others in the logarithm."""
ALIKE = 0.05  # ratios within which two vessels count as one ship, such as a ship and the same with more freedom
SCREW = ("D_p", "T_nn", "T_nu", "dT_nu", "T_uu", "c_un", "c_nn")  # numbers that go with the size of a screw
SCREW_SIZES = (0.5, 2.0)  # least and greatest change of a screw's size
ABOUT_SERVICE = "thruster.service_speed"  # thrust less resistance in one polynomial: neither is there alone


@dataclass(frozen=True)
class SimilarVessel:
    """A scaled ship.

    vessel : as it is after scaling. source : key of the ship that it was. ratio : length after over length before.
    distance : see `particulars_distance`. notes : what was corrected or replaced, one sentence each.
    """

    vessel: Vessel
    source: str
    ratio: float
    distance: float
    notes: tuple[str, ...]

    def text(self) -> str:
        """The scaled vessel as TOML, which `load_vessel` reads."""
        return tomlkit.dumps(self.vessel.document)


def scale_vessel(vessel: Vessel, ratio: float, rho: float | None = None) -> Vessel:
    """The vessel `ratio` times as long, all of it by Froude's law: the same motion in ship lengths.

    rho : density of the water after scaling [kg/m^3]; None: as before. What is off, and loads of waves, are left out:
    paths are predicted without waves.
    """
    document = _acting_document(vessel.document)
    constants = document.get("constants", {})
    water = rho / constants["rho"] if rho is not None and "rho" in constants else 1.0
    sizes = {"m": ratio, "s": math.sqrt(ratio), "kg": ratio**3 * water}
    units = {f"particulars.{key}": PARTICULARS[key] for key in document.get("particulars", {}) if key in PARTICULARS}
    units |= {path: unit for path, unit in parameter_units(document).items() if not path.startswith("constants.")}
    values: dict[str, Any] = {
        path: documents.value_at_path(document, path) * unit_value(unit, sizes) for path, unit in units.items()
    }
    if water != 1.0:
        values["constants.rho"] = rho
    return check_document(documents.replace_values(document, values), vessel.file)


def _acting_document(document: Document) -> Document:
    """The document without blocks that are off and without terms that read a table of waves."""
    tables = [path for path, key, _ in term_blocks(document) if TABLE in structural_keys(TERMS[key])]
    kept = documents.replace_values(document, {f"{path}.off": True for path in tables})

    def acting(block: Any) -> Any:
        blocks = block.items() if isinstance(block, Mapping) else ()
        return {k: acting(v) for k, v in blocks if not (isinstance(v, Mapping) and v.get("off"))} if blocks else block

    return dict(acting(kept))


def vessel_particulars(vessel: Vessel) -> dict[str, float]:
    """L_pp, B, T [m], C_b [-], U_0 [m/s] of a vessel, as far as they are known; C_b by the mass if it is not given."""
    known = {key: float(value) for key, value in vessel.document.get("particulars", {}).items() if key in PARTICULARS}
    rho = vessel.document.get("constants", {}).get("rho")
    if "C_b" not in known and rho and {"L_pp", "B", "T"} <= known.keys():
        known["C_b"] = vessel.parameters["inertia.m"] / (rho * known["L_pp"] * known["B"] * known["T"])
    return known


def _shape_features(known: Mapping[str, float]) -> dict[str, float]:
    """The features that `SPREADS` names, as far as they are known."""
    L, B, T, U = (known.get(key) for key in ("L_pp", "B", "T", "U_0"))
    found = {
        "L/B": math.log(L / B) if L and B else None,
        "B/T": math.log(B / T) if B and T else None,
        "C_b": known.get("C_b"),
        "Fn": U / math.sqrt(GRAVITY * L) if U and L else None,
        "L": math.log(L) if L else None,
    }
    return {name: value for name, value in found.items() if value is not None}


def particulars_distance(one: Mapping[str, float], other: Mapping[str, float]) -> float:
    """Distance [-] of two ships by their particulars: the root mean square of differences over `SPREADS`.

    A feature that is known of one ship alone counts 1; one that is known of neither is left out.
    """
    a, b = _shape_features(one), _shape_features(other)
    squares = [
        ((a[name] - b[name]) / spread) ** 2 if name in a and name in b else 1.0
        for name, spread in SPREADS.items()
        if name in a or name in b
    ]
    return math.sqrt(sum(squares) / len(squares))


def read_ships(folder: Path | None = None) -> list[Vessel]:
    """Every bundled vessel, and every vessel in the TOML files of a folder; DocumentError where there is none in it."""
    files = [*documents.bundled_documents("models").values()]
    if folder is not None:
        own = [file for file in sorted(folder.glob("*.toml")) if _is_vessel(documents.read_document(file))]
        if not own:
            raise DocumentError("no vessel in the TOML files of this folder", file=folder)
        files += own
    return [load_vessel(file) for file in files]


def _is_vessel(document: Document) -> bool:
    return not document.keys().isdisjoint({"inertia", "base", "extends"})


def nearest_ships(known: Mapping[str, float], ships: Iterable[Vessel]) -> Iterator[tuple[float, Vessel]]:
    """Distance and vessel of each ship, the nearest first, one vessel of each ship: that with the fewest freedoms.

    known : as of `vessel_particulars`. Vessels without a length are left out.
    """
    rows: list[tuple[float, Vessel]] = []
    for vessel in sorted(ships, key=lambda ship: (len(ship.axes), ship.key, ship.digest)):
        features = {name: value for name, value in _shape_features(vessel_particulars(vessel)).items() if name != "Fn"}
        if "L" in features and not any(_is_same_ship(features, other) for _, other in rows):
            rows.append((particulars_distance(known, vessel_particulars(vessel)), vessel))
    yield from sorted(rows, key=lambda row: (row[0], row[1].key))


def _is_same_ship(features: Mapping[str, float], vessel: Vessel) -> bool:
    """Whether a vessel has these features, the Froude number apart, to 5 %."""
    other = {name: value for name, value in _shape_features(vessel_particulars(vessel)).items() if name != "Fn"}
    return features.keys() == other.keys() and all(abs(value - other[name]) < ALIKE for name, value in features.items())


def similar_vessels(
    known: Mapping[str, float], ships: Iterable[Vessel], count: int, own: Vessel | None = None
) -> list[SimilarVessel]:
    """The nearest ships, scaled to the length of one's own, the nearest first.

    known : particulars of one's own ship, at least L_pp [m]. own : one's own vessel, whose commands the scaled ships
    take: a ship that is driven and steered in the same way keeps its screws and helms under the names of one's own,
    of another the hull alone is taken, with screws and helms of one's own. It is no member itself.

    Raises ShipidError where fewer ships can be scaled.
    """
    if "L_pp" not in known:
        raise ShipidError("the length between perpendiculars is not known: give particulars.L_pp")
    found: list[SimilarVessel] = []
    for distance, vessel in nearest_ships(known, [ship for ship in ships if own is None or ship.digest != own.digest]):
        with suppress(ShipidError):
            found.append(_similar_vessel(known, vessel, distance, own))
        if len(found) == count:
            return found
    raise ShipidError(f"{len(found)} ships can be scaled, {count} are asked for: ask for fewer, or give a folder")


def _similar_vessel(known: Mapping[str, float], vessel: Vessel, distance: float, own: Vessel | None) -> SimilarVessel:
    """One ship scaled, with its friction and screws corrected."""
    before = vessel_particulars(vessel)
    ratio, notes = known["L_pp"] / before["L_pp"], list[str]()
    rho = None if own is None else own.document.get("constants", {}).get("rho")
    scaled = scale_vessel(vessel, ratio, rho)
    speed = known.get("U_0") or before.get("U_0", 0.2 * math.sqrt(GRAVITY * before["L_pp"])) * math.sqrt(ratio)
    shaft = _shaft_or_none(own or scaled, speed)
    if own is not None:
        scaled, words = _drive_like(scaled, own)
        notes += words
    if not any(key == ABOUT_SERVICE for _, key, _ in term_blocks(scaled.document)):
        change = friction_change(scaled, ratio, speed)
        resistance = scaled.parameters.get("hull.resistance.R_0", 0.0)
        scaled = scaled.with_values({"hull.resistance.R_0": resistance + change})
        notes.append(f"friction by ITTC-57: {change * speed**2:+.3g} N at {speed:.3g} m/s")
    if shaft is not None:
        scaled, size = fit_screws(scaled, speed, shaft)
        held = f"hold {speed:.3g} m/s at {60 * shaft:.4g} rpm"
        notes.append(f"no screws {held}: they stay" if math.isnan(size) else f"screws {size:.3g} times as large {held}")
    document = scaled.document | {
        "name": f"{vessel.name}, {ratio:.4g} times as long",
        "source": f"shipid vessel similar: {vessel.key} by Froude's law; {'; '.join(notes)}",
    }
    return SimilarVessel(Vessel(document, vessel.file), vessel.key, ratio, distance, tuple(notes))


def _shaft_or_none(vessel: Vessel, speed: float) -> float | None:
    """Shaft speed [rev/s] that holds a speed; None where none does."""
    with suppress(ShipidError):
        return service_shaft(vessel, speed, MOST_FORCE)
    return None


def _drive_layout(vessel: Vessel) -> dict[str, tuple[bool, tuple[str, ...], float]]:
    """Name of each thruster -> whether it is a tunnel, its commands, and the side of the ship that it is on."""
    known = rows_of_role("command")
    return {
        path.partition(".")[2]: (
            key == "thruster.tunnel",
            tuple(signal for signal in function_signals(TERMS[key].function) if signal in known),
            math.copysign(1.0, block["y"]) if block.get("y") else 0.0,
        )
        for path, key, block in term_blocks(vessel.document)
        if path.startswith("thruster.")
    }


def _drive_like(vessel: Vessel, own: Vessel) -> tuple[Vessel, list[str]]:
    """The vessel with the commands of one's own, and what was replaced for that; see `similar_vessels`."""
    mine, theirs, names = _drive_layout(own), _drive_layout(vessel), dict[str, str]()
    for name, kind in theirs.items():
        free = [other for other, one in mine.items() if one == kind and other not in names.values()]
        names |= dict.fromkeys([name], free[0]) if free else {}
    document = vessel.document
    lacking = [name for name, (tunnel, *_) in theirs.items() if name not in names and not tunnel]
    lacking += [name for name, (tunnel, *_) in mine.items() if name not in names.values() and not tunnel]
    if not lacking:
        blocks = {names[name]: block for name, block in document["thruster"].items() if name in names}
        behind = {name: {BEHIND: names[block[BEHIND]]} if BEHIND in block else {} for name, block in blocks.items()}
        thrusters: Document = {name: block | behind[name] for name, block in blocks.items()}
    else:
        thrusters = own.document.get("thruster", {})
        if ABOUT_SERVICE in {key for one in (vessel, own) for _, key, _ in term_blocks(one.document)}:
            raise ShipidError(f"{vessel.name}: hull and screw are one polynomial, which stays with its own drive")
    particulars = own.document.get("particulars", {}) | document.get("particulars", {})
    changed = document | {"thruster": thrusters, "particulars": particulars}
    return check_document(changed, vessel.file), ["screws and helms are those of your own ship"] if lacking else []


def friction_change(vessel: Vessel, ratio: float, speed: float) -> float:
    """How much R_0 [kg/m], resistance over u|u|, of a vessel scaled by `ratio` changes by the Reynolds number.

    1/2 rho S ((1 + k) C_F + C_A), after less before, at a speed [m/s] after scaling: C_F of the ITTC-57 line, k of
    Watanabe where beam and draught are known, S of Taylor; C_A of Holtrop and Mennen for a ship, from 10 m on.
    """
    known, rho = vessel_particulars(vessel), float(vessel.document.get("constants", {}).get("rho", RHO_SEA))
    L, shape = known["L_pp"], [known.get(key) for key in ("B", "T", "C_b")]
    B, T, C_b = (value or 0.0 for value in shape)
    k = form_factor(L, B, T, C_b) if all(shape) else 0.0

    def coefficient(length: float, fast: float) -> float:
        return (1 + k) * ittc_friction(fast, length, NU) + (correlation_allowance(length) if length >= MODEL else 0.0)

    S = TAYLOR * math.sqrt(vessel.parameters["inertia.m"] / rho * L)
    return rho / 2 * S * (coefficient(L, speed) - coefficient(L / ratio, speed / math.sqrt(ratio)))


def fit_screws(vessel: Vessel, speed: float, shaft: float) -> tuple[Vessel, float]:
    """The vessel with all screws larger by one factor, so that it holds a speed [m/s] at a shaft speed [rev/s].

    Also the factor: nan where none from 0.5 to 2 does, and the screws stay. A screw that is given by the speed for its
    shaft speed gets another shaft speed instead.
    """
    screws = {path: unit for path, unit in vessel.units.items() if path.startswith("thruster.")}
    about = {path: shaft * vessel_particulars(vessel)["U_0"] / speed for path in screws if path.endswith(".n_0")}
    if about:
        return vessel.with_values(about), 1.0
    screws = {path: unit for path, unit in screws.items() if path.rpartition(".")[2] in SCREW}
    orders = straight_orders(vessel, shaft)

    def with_size(factor: float) -> Vessel:
        sizes = {"m": factor, "kg": factor**3}
        return vessel.with_values({path: vessel.parameters[path] * unit_value(screws[path], sizes) for path in screws})

    def surplus(factor: float) -> float:
        return float(straight_acceleration(with_size(factor), speed, orders)[0])

    low, high = SCREW_SIZES
    if not surplus(low) < 0 < surplus(high):
        return vessel, math.nan
    factor = bisect_root(surplus, low, high, 40)
    return with_size(factor), factor
