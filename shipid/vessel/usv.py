"""First guess of a small craft driven by forces: an uncrewed surface vessel of one hull or two, with any thrusters.

Small craft are outside the regressions of ships. What is used of these holds for slender hulls; each of two hulls
counts by itself. Forces that go with u v and u r, and cross-flow drag, hold at any speed, on the spot too. The thrust
is the resistance at the top speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from shipid.errors import ShipidError
from shipid.units import GRAVITY
from shipid.vessel.template import (
    RHO_SEA,
    FirstGuess,
    Particulars,
    TemplateValue,
    Values,
    added_mass_values,
    block_lines,
    finish_guess,
    head_lines,
)

SLENDER = 2.5  # length / beam from which on a craft counts as one hull
BEAMIEST = 2.2  # least length / beam of one hull: below, the formulae would not damp yaw
PONTOON, PONTOON_BLOCK, BLOCK = 0.23, 0.4, 0.45  # beam of one of two hulls over that of the craft; block coefficients
CRUISE = 0.7  # of the top speed: the service speed
ASTERN = 0.56  # least thrust over the greatest, 13.6 kgf over 24.4 kgf of the Otter
OTTER_THRUST = 24.4 / 80.0 / 0.486  # thrust over weight and F_n^2: 24.4 kgf drive 80 kg, 2 m long, at 6 knots


@dataclass(frozen=True)
class SmallCraft:
    """What is known of a craft; None takes a guess.

    length, beam : [m], over both hulls. mass : [kg]. top_speed : [m/s], with all thrusters full ahead.
    thrusters : place (x, y) [m] of each, x forward of amidships, y to starboard. thrust : greatest of each [N].
    swivel : to how far the thrusters turn, to either side [deg]; 0: they are fixed. hulls : 1 or 2.
    """

    length: float
    beam: float
    mass: float
    top_speed: float
    thrusters: tuple[tuple[float, float], ...]
    thrust: float | None = None
    swivel: float = 0.0
    hulls: int | None = None

    @property
    def count(self) -> int:
        """Number of hulls."""
        return self.hulls or (2 if self.length / self.beam < SLENDER else 1)

    @cached_property
    def hull(self) -> Particulars:
        """One hull, at the draught that carries its share of the mass."""
        beam, block = (self.beam, BLOCK) if self.count == 1 else (PONTOON * self.beam, PONTOON_BLOCK)
        draught = self.mass / (RHO_SEA * self.count * block * beam * self.length)
        return Particulars(self.length, beam, draught, block, self.top_speed, scale=1.0)

    @property
    def resistance(self) -> float:
        """Resistance [N] at the top speed: that of the thrust given, else of the Otter by Froude's rule."""
        otter = OTTER_THRUST * self.top_speed**2 / self.length * self.mass  # of the weight, and F_n^2
        return otter if self.thrust is None else self.thrust * len(self.thrusters)


def guess_craft(given: SmallCraft, name: str, file: str) -> FirstGuess:
    """Fill a vessel document of a small craft; ShipidError for one that cannot be, or that nothing steers."""
    _check_craft(given)
    speed, remarks = CRUISE * given.top_speed, tuple(_craft_remarks(given))
    return finish_guess(_craft_lines(given, name), file, speed, remarks, "N of each thruster")


def _check_craft(given: SmallCraft) -> None:
    for path, value, low, high in (
        ("--length", given.length, 0.3, 20.0),
        ("--beam", given.beam, 0.08 * given.length, given.length / (BEAMIEST if given.hulls == 1 else 1.0)),
        ("--mass", given.mass, 1e-3 * given.length**3, 300.0 * given.length**3),
        ("--speed", given.top_speed, 0.1, 2.0 * math.sqrt(GRAVITY * given.length)),
        ("--swivel", given.swivel, 0.0, 180.0),
        ("--thrust", 1.0 if given.thrust is None else given.thrust, 0.01, 1e6),
    ):
        if not low <= value <= high:
            raise ShipidError(f"{value:.3g}: small craft have {low:.3g} to {high:.3g}", path=path)
    if not given.thrusters:
        raise ShipidError("missing: give the place X,Y [m] of each, such as -0.8,-0.4 and -0.8,0.4", path="--thruster")
    (xs, ys), swivels = zip(*given.thrusters, strict=True), given.swivel > 0
    if not (min(ys) < 0 < max(ys) or (swivels and any(xs))):
        what = "X other than 0 to some thruster" if swivels else "thrusters at two sides, or --swivel"
        raise ShipidError(f"nothing turns this craft: give {what}", path="--thruster")
    added = {name: value.number for name, value in added_mass_values(given.hull).items()}
    if given.hull.draught > given.count * given.hull.beam or max(added[x] for x in ("X_udot", "Y_vdot", "N_rdot")) >= 0:
        raise ShipidError(
            f"each hull would have a draught of {given.hull.draught:.3g} m at a beam of {given.hull.beam:.3g} m, which "
            "the formulae do not know: give --hulls, or is the mass another one?",
            path="--mass",
        )


def _craft_remarks(given: SmallCraft) -> Iterator[str]:
    if given.hulls is None:
        yield f"{given.count} {'hulls' if given.count == 2 else 'hull'} by length / beam: give the number by --hulls"
    if given.thrust is None:
        yield "The thrust is a guess by the size of the Otter: give that of each thruster by --thrust"


def _hull_values(given: SmallCraft, added: Values) -> Values:
    """Derivatives in SI: resistance at the top speed, linear ones of each hull by Clarke et al. (1983) times u."""
    L, B, T, C_b = given.length, given.hull.beam, given.hull.draught, given.hull.block
    s, clarke = -given.count * math.pi / 2 * RHO_SEA * T**2, f"Clarke et al. (1983), {given.count} x one hull, x u"
    source = "the thrust given" if given.thrust is not None else "that of the Otter, Fossen (2021), by Froude's rule"
    return {
        "X_u|u|": TemplateValue(-given.resistance / given.top_speed**2, "kg m^-1", f"at the top speed, {source}"),
        "Y_|u|v": TemplateValue(s * (1 + 0.4 * C_b * B / T), "kg m^-1", clarke),
        "Y_ur": TemplateValue(
            s * L * (-0.5 + 2.2 * B / L - 0.08 * B / T) - added["X_udot"].number,
            "kg",
            f"{clarke}, - X_udot, which turns apart",
        ),
        "N_uv": TemplateValue(s * L * (0.5 + 2.4 * T / L), "kg", clarke),
        "N_|u|r": TemplateValue(s * L**2 * (0.25 + 0.039 * B / T - 0.56 * B / L), "kg m", clarke),
    }


def _craft_lines(given: SmallCraft, name: str) -> Iterator[str]:
    """The document, line by line."""
    L, one, apart = given.length, given.hull, (given.beam - given.hull.beam) / 2 if given.count == 2 else 0.0
    yield from head_lines(
        name,
        {
            "L_pp": TemplateValue(L, "m", "given"),
            "B": TemplateValue(given.beam, "m", "given"),
            "T": TemplateValue(
                one.draught, "m", f"carries the mass, C_b {one.block:g} and beam {one.beam:.3g} m of each hull"
            ),
            "U_0": TemplateValue(CRUISE * given.top_speed, "m s^-1", f"{CRUISE:g} of the top speed: a guess"),
        },
        RHO_SEA,
    )
    yield from block_lines(
        "inertia",
        {
            "m": TemplateValue(given.mass, "kg", "given"),
            "I_z": TemplateValue(
                given.mass * (0.25 * L) ** 2, "kg m^2", "m (0.25 L)^2, as of the Otter, Fossen (2021)"
            ),
            "x_G": TemplateValue(0.0, "m", "assumed amidships"),
        },
    )
    added = {
        key: TemplateValue(given.count * value.number, value.unit, f"{given.count} x {value.note}")
        for key, value in added_mass_values(one).items()
    }
    added["N_rdot"] = TemplateValue(
        added["N_rdot"].number + apart**2 * added["X_udot"].number,
        "kg m^2",
        f"{added['N_rdot'].note}, and X_udot {apart:.3g} m off the middle",
    )
    yield from block_lines("added_mass", added, coriolis="mmg")
    yield from block_lines("hull.derivatives", _hull_values(given, added))
    yield from block_lines(
        "hull.crossflow",
        {
            "C_d": TemplateValue(1.0, "-", "of the first hull; Hoerner's curve, Fossen (2021), sec. 6.7: a guess"),
            "x_aft": TemplateValue(-L / 2, "m", "-L / 2"),
            "x_fwd": TemplateValue(L / 2, "m", "L / 2"),
        },
        strips=20,
    )
    sides: list[str] = []
    for x, y in given.thrusters:
        sides.append("port" if y < 0 else "starboard" if y > 0 else "middle")
        count = sides.count(sides[-1])
        yield from _thruster_block(given, f"thruster.{sides[-1]}{f'_{count}' if count > 1 else ''}", x, y)


def _thruster_block(given: SmallCraft, path: str, x: float, y: float) -> Iterator[str]:
    """One thruster ordered by force, with its lag and limits."""
    most = given.resistance / len(given.thrusters)
    values = {
        "x": TemplateValue(x, "m", "given"),
        "y": TemplateValue(y, "m", "given"),
        "k_T": TemplateValue(1.0, "-", "thrust over its order"),
        "actuator.force.T": TemplateValue(1.0, "s", "as of the Otter, Fossen (2021)"),
        "actuator.force.low": TemplateValue(-ASTERN * most, "N", f"{ASTERN:g} of that ahead, as of the Otter"),
        "actuator.force.high": TemplateValue(
            most, "N", "given" if given.thrust else "its share of the resistance at the top speed"
        ),
    }
    words = {"kind": "force", "actuator.force.kind": "first_order"}
    if given.swivel:
        words |= {"kind": "swivel_force", "actuator.alpha.kind": "rate_limit"}
        end = math.radians(given.swivel)
        values |= {
            "actuator.alpha.rate": TemplateValue(math.radians(30.0), "rad/s", "30 deg/s: a guess"),
            "actuator.alpha.low": TemplateValue(-end, "rad", "given"),
            "actuator.alpha.high": TemplateValue(end, "rad", "given"),
        }
    yield from block_lines(path, values, **words)
