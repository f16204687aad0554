"""Ships of like particulars, scaled by Froude's law to the size of one's own: physics for a ship without a model.

Lengths go as the ratio of lengths, times as its square root, masses as its cube and the density of the water; every
number by its declared unit. Two things do not scale, and are corrected: friction, which follows the Reynolds number,
and with it the screw, which must still hold the service speed at its shaft speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

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
from shipid.vessel.stability import bisect_root, service_shaft, straight_acceleration, straight_orders
from shipid.vessel.template import MODEL, NU, RHO_SEA

TAYLOR = 2.6
"""Wetted surface over sqrt(volume x length), Taylor (1910)."""
SPREADS = {"L/B": 0.3, "B/T": 0.3, "C_b": 0.12, "Fn": 0.08, "L": 2.0}
"""What counts as one unit of distance: of C_b and the Froude number as they are, of the others in the logarithm."""
ALIKE = 0.05  # differences of features up to which two vessels count as one ship
SCREW = ("D_p", "T_nn", "T_nu", "dT_nu", "T_uu", "c_un", "c_nn", "n_0")  # numbers that go with the size of a screw
SCREW_SIZES, SHAFT_RATIOS = (0.5, 2.0), (0.1, 10.0)  # least and greatest change of a screw's size, and of n_0 alone
TUNNEL = "thruster.tunnel"
ABOUT_SERVICE = "thruster.service_speed"  # thrust less resistance in one polynomial: neither is there alone


def scale_vessel(vessel: Vessel, ratio: float, rho: float | None = None) -> Vessel:
    """The vessel `ratio` times as long, all of it by Froude's law: the same motion in ship lengths.

    rho : density of the water after scaling [kg/m^3]; None: as before. What is off, and loads of waves, are left out:
    paths are predicted without waves.
    """
    document = _acting_document(vessel.document)
    water = 1.0 if rho is None else rho / document.get("constants", {}).get("rho", rho)
    sizes = {"m": ratio, "s": math.sqrt(ratio), "kg": ratio**3 * water}
    units = {f"particulars.{key}": PARTICULARS[key] for key in document.get("particulars", {}) if key in PARTICULARS}
    units |= {path: unit for path, unit in parameter_units(document).items() if not path.startswith("constants.")}
    values = {path: documents.value_at_path(document, path) * unit_value(unit, sizes) for path, unit in units.items()}
    values |= {} if rho is None else {"constants.rho": rho}
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
    L, B, T, U = (known.get(key, math.nan) for key in ("L_pp", "B", "T", "U_0"))
    found = {"L/B": math.log(L / B), "B/T": math.log(B / T), "C_b": known.get("C_b", math.nan)}
    found |= {"Fn": U / math.sqrt(GRAVITY * L), "L": math.log(L)}
    return {name: value for name, value in found.items() if not math.isnan(value)}


def particulars_distance(one: Mapping[str, float], other: Mapping[str, float]) -> float:
    """Distance [-] of two ships by their particulars: the root mean square of differences over `SPREADS`.

    A feature that is known of one ship alone counts as of any two ships, 2 in the square; of neither: it is left out.
    """
    a, b = _shape_features(one), _shape_features(other)
    squares = [
        ((a[name] - b[name]) / spread) ** 2 if name in a and name in b else 2.0
        for name, spread in SPREADS.items()
        if name in a or name in b
    ]
    return math.sqrt(sum(squares) / len(squares))


def read_ships(folder: Path | None = None) -> list[Vessel]:
    """Every bundled vessel, and every vessel in the TOML files of a folder; DocumentError where there is none in it."""
    bundled = [*documents.bundled_documents("models").values()]
    files = [] if folder is None else sorted(folder.glob("*.toml"))
    own = [
        file for file in files if not documents.read_document(file).keys().isdisjoint(("inertia", "base", "extends"))
    ]
    if folder is not None and not own:
        raise DocumentError("no vessel in the TOML files of this folder", file=folder)
    return [load_vessel(file) for file in (*bundled, *own)]


def nearest_ships(known: Mapping[str, float], ships: Iterable[Vessel]) -> list[tuple[float, Vessel]]:
    """Distance and vessel of each ship, the nearest first, one vessel of each ship: that with the fewest freedoms.

    known : as of `vessel_particulars`. Vessels without a length are left out.
    """
    rows: list[tuple[float, Vessel]] = []
    for vessel in sorted(ships, key=lambda ship: (len(ship.axes), ship.key, ship.digest)):
        if vessel.length is not None and not any(_is_same_ship(vessel, other) for _, other in rows):
            rows.append((particulars_distance(known, vessel_particulars(vessel)), vessel))
    return sorted(rows, key=lambda row: (row[0], row[1].key))


def _is_same_ship(vessel: Vessel, other: Vessel) -> bool:
    """Whether two vessels have the same size and form to 5 %, such as a ship and the same with more freedoms."""
    a, b = ({**_shape_features(vessel_particulars(one)), "Fn": 0.0} for one in (vessel, other))
    return a.keys() == b.keys() and all(abs(value - b[name]) < ALIKE for name, value in a.items())


def similar_vessels(
    known: Mapping[str, float], ships: Iterable[Vessel], own: Vessel | None = None
) -> Iterator[tuple[float, Vessel]]:
    """Distance and vessel of ships scaled to the length of one's own, the nearest first.

    Their `source` says what was corrected. What cannot be scaled or driven so is left out, and so is one's own vessel.

    known : particulars of one's own ship, at least L_pp [m]. own : one's own vessel, whose commands the scaled ships
    take: a ship that is driven and steered in the same way keeps its screws and helms under the names of one's own,
    of another the hull alone is taken, with screws and helms of one's own.
    """
    for distance, vessel in nearest_ships(known, [ship for ship in ships if own is None or ship.digest != own.digest]):
        with suppress(ShipidError):
            yield distance, _similar_vessel(known, vessel, own)


def _similar_vessel(known: Mapping[str, float], vessel: Vessel, own: Vessel | None) -> Vessel:
    """One ship scaled, with its friction and screws corrected."""
    before, notes = vessel_particulars(vessel), list[str]()
    ratio = known["L_pp"] / before["L_pp"]
    scaled = scale_vessel(vessel, ratio, None if own is None else own.document.get("constants", {}).get("rho"))
    speed = known.get("U_0") or before.get("U_0", 0.2 * math.sqrt(GRAVITY * before["L_pp"])) * math.sqrt(ratio)
    shaft = service_shaft(own or scaled, speed)
    if own is not None:
        scaled = _drive_like(scaled, own, notes)
    if ABOUT_SERVICE not in _term_keys(scaled):
        change = friction_change(scaled, ratio, speed)
        resistance = scaled.parameters.get("hull.resistance.R_0", 0.0)
        scaled = scaled.with_values({"hull.resistance.R_0": resistance + change})
        notes.append(f"friction by ITTC-57, {change * speed**2:+.3g} N at {speed:.3g} m/s")
    scaled, size = (scaled, 1.0) if shaft is None else fit_screws(scaled, speed, shaft)
    at = "" if shaft is None else f"screws times {size:.3g}: {60 * shaft:.4g} rpm at"
    notes.append(f"{at or 'no shaft speed holds'} {speed:.3g} m/s")
    words = {"name": f"{vessel.name}, {ratio:.3g} times as long", "source": f"{vessel.key} scaled; {'; '.join(notes)}"}
    return Vessel(scaled.document | words, vessel.file)


def _term_keys(vessel: Vessel) -> set[str]:
    return {key for _, key, _ in term_blocks(vessel.document)}


def _drive_layout(vessel: Vessel) -> list[tuple[tuple[str, ...], bool, bool, str]]:
    """Commands, whether it is to port, whether to starboard, and name of each thruster but tunnels, in order."""
    known = rows_of_role("command")
    return sorted(
        (
            tuple(known.keys() & {*function_signals(TERMS[key].function)}),
            block.get("y", 0) < 0,
            block.get("y", 0) > 0,
            path[9:],
        )
        for path, key, block in term_blocks(vessel.document)
        if path.startswith("thruster.") and key != TUNNEL
    )


def _drive_like(vessel: Vessel, own: Vessel, notes: list[str]) -> Vessel:
    """The vessel with the commands of one's own, see `similar_vessels`; `notes` takes what was replaced."""
    mine, theirs, thrusters = _drive_layout(own), _drive_layout(vessel), dict(own.document.get("thruster", {}))
    if [kind for *kind, _ in mine] == [kind for *kind, _ in theirs]:
        names = {other: name for (*_, other), (*_, name) in zip(theirs, mine, strict=True)}
        for other, name in names.items():
            block = vessel.document["thruster"][other]
            thrusters[name] = block | ({BEHIND: names[block[BEHIND]]} if BEHIND in block else {})
    elif ABOUT_SERVICE in _term_keys(vessel) | _term_keys(own):
        raise ShipidError(f"{vessel.name}: hull and screw are one polynomial, which stays with its own drive")
    else:
        notes.append("screws and helms are those of your own ship")
    particulars = own.document.get("particulars", {}) | vessel.document.get("particulars", {})
    return check_document(vessel.document | {"thruster": thrusters, "particulars": particulars}, vessel.file)


def friction_change(vessel: Vessel, ratio: float, speed: float) -> float:
    """How much R_0 [kg/m], resistance over u|u|, of a vessel scaled by `ratio` changes by the Reynolds number.

    1/2 rho S ((1 + k) C_F + C_A), after less before, at a speed [m/s] after scaling: C_F of the ITTC-57 line, k of
    Watanabe where beam and draught are known, S of Taylor; C_A of Holtrop and Mennen for a ship, from 10 m on.
    """
    known, rho = vessel_particulars(vessel), float(vessel.document.get("constants", {}).get("rho", RHO_SEA))
    L, shape = known["L_pp"], [known[key] for key in ("B", "T", "C_b") if key in known]
    k = form_factor(L, *shape) if len(shape) == 3 else 0.0

    def coefficient(length: float, fast: float) -> float:
        return (1 + k) * ittc_friction(fast, length, NU) + (correlation_allowance(length) if length >= MODEL else 0.0)

    S = TAYLOR * math.sqrt(vessel.parameters["inertia.m"] / rho * L)
    return rho / 2 * S * (coefficient(L, speed) - coefficient(L / ratio, speed / math.sqrt(ratio)))


def fit_screws(vessel: Vessel, speed: float, shaft: float) -> tuple[Vessel, float]:
    """The vessel with all screws larger by one factor, so that it holds a speed [m/s] at a shaft speed [rev/s].

    Also the factor: 1 where none from 0.5 to 2 does. A screw about its service speed gets another shaft speed, from a
    tenth to ten times.
    """
    screws = {path: unit for path, unit in vessel.units.items() if path.rpartition(".")[2] in SCREW}
    orders, of_shaft = straight_orders(vessel, shaft), all(path.endswith(".n_0") for path in screws)
    low, high = SHAFT_RATIOS if of_shaft else SCREW_SIZES

    def with_size(factor: float) -> Vessel:
        sizes = {"m": factor, "kg": factor**3, "s": factor}  # of n_0 alone
        return vessel.with_values({path: vessel.parameters[path] * unit_value(screws[path], sizes) for path in screws})

    def surplus(factor: float) -> float:
        return float(straight_acceleration(with_size(factor), speed, orders)[0])

    factor = bisect_root(surplus, low, high, 40) if surplus(low) < 0 < surplus(high) else 1.0
    return with_size(factor), factor
