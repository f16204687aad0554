"""The law of exchange: H over the error of the physics, runs and horizon, by a hierarchical fit over ships.

Every error is taken in units of the baseline, the error of constant u, v, r on the same windows. With n = ln(N_D / 8),
a = ln(A / baseline), p = ln(floor / baseline), h = ln(ahead / 2):

    ln(H / baseline) = ln(sqrt(R^2 + F^2)) + effects + rest,    R = exp(theta . features),    F = exp(c + p)

R is what data can reduce, F the floor of sea and sensors. Effects of a ship, of a kind of physics on a ship, of a
foundation and of the runs drawn are Gaussian with variances that the cells tell (`docs/exchange_fit.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shipid.errors import DataError, ResultError, ShipidError
from shipid.files import read_json
from shipid.study.schema import KINDS_OF_PHYSICS
from shipid.units import GRAVITY

CELL_COLUMNS = {
    "ship": "name",
    "type": "of the ship",
    "bundled": "whether shipid ships the vessel",
    "length": "m",
    "speed": "m/s, service",
    "froude": "speed / sqrt(g length)",
    "foundation": "the member",
    "kind": "what is wrong with the physics",
    "A": "m, mean error of the physics alone over the horizon; NaN for none",
    "N_D": "runs; 0: physics alone",
    "ahead": "ship lengths",
    "H": "m, mean error over the horizon with data",
    "baseline": "m, error of constant u, v, r on the same windows",
    "floor": "m, A of the true 3-DOF physics, blind to sea and sensors",
}
CELL_KINDS = (*KINDS_OF_PHYSICS, "none")
NUMBERS = ("length", "speed", "froude", "N_D", "ahead", "H", "baseline", "floor")


def check_cells(cells: pd.DataFrame, file: Path | None = None) -> pd.DataFrame:
    """Cells with a finite H; rows whose prediction diverged are left out, and an empty kind is not known.

    Raises DataError for a column that is missing, a kind that the law does not know, and a number that is not above 0.
    """
    if missing := [name for name in CELL_COLUMNS if name not in cells]:
        raise DataError(
            f"missing: a table of cells has the columns {', '.join(CELL_COLUMNS)}", file=file, path=missing[0]
        )
    if strange := sorted({*cells["kind"]} - {*CELL_KINDS, ""}):
        raise DataError(f"{strange[0]!r} is no kind: give one of {', '.join(CELL_KINDS)}", file=file, path="kind")
    cells = cells[np.isfinite(cells["H"])]
    least = {name: cells[name].min() for name in NUMBERS}
    least["A"] = cells["A"][cells["kind"] != "none"].min()
    for name, value in least.items():
        if value < 0 or (value == 0 and name != "N_D"):
            raise DataError(f"{value:g} is not above 0", file=file, path=name)
    return cells.reset_index(drop=True)


Array = np.ndarray
Physics = str | float | tuple[str, float]
"""A kind of physics of `CELL_KINDS` or `LIKELY`, its A [m], or both."""
LAW_FILE = Path(__file__).with_name("law.json")


class Response(NamedTuple):
    """What a hierarchy predicts: ln(value / unit), with its features and the levels of its effects.

    levels : (columns that make a group, feature of its effect); the last one is that of a row. floor : features of
    the logarithm of what adds in squares, if anything does.
    """

    value: str
    unit: str
    features: tuple[str, ...]
    levels: tuple[tuple[str, str], ...]
    floor: tuple[str, ...] = ()


SHIP, KIND, FOUNDATION, RUNS, CELL, ROW = (
    "ship",
    "ship kind",
    "ship foundation",
    "ship N_D",
    "ship foundation N_D",
    "ship foundation N_D ahead",
)
FLAWS = tuple(kind for kind in CELL_KINDS if kind not in ("none", "nominal"))
NO_PHYSICS = ("none", "none:n", "none:few", "none:h", "none:p")
"""Features of no physics: all of its error is in the second part, as it has no A."""
RESPONSES = {
    "H": Response(
        "H",
        "baseline",
        ("1", "n", "a", "a:n", "h", "h:n", *FLAWS, *(f"{kind}:n" for kind in FLAWS)),
        (
            *((SHIP, feature) for feature in ("1", "n", "a:few", "h", "none:few")),
            (KIND, "few"),
            *((FOUNDATION, feature) for feature in ("1", "few")),
            (RUNS, "few"),
            *((CELL, feature) for feature in ("1", "few")),
            (ROW, "1"),
        ),
        ("1", "p", "n", "h", *NO_PHYSICS),
    ),
    "A": Response(
        "A",
        "baseline",
        ("h", "p", "nominal", *FLAWS),
        ((SHIP, "1"), (SHIP, "h"), (KIND, "1"), (FOUNDATION, "1"), ("ship foundation ahead", "1")),
    ),
    "floor": Response(
        "floor", "baseline", ("1", "h", "froude", "size"), ((SHIP, "1"), (SHIP, "h"), ("ship ahead", "1"))
    ),
    "baseline": Response(
        "baseline", "length", ("1", "h", "froude", "size"), ((SHIP, "1"), (SHIP, "h"), ("ship ahead", "1"))
    ),
}
LIKELY = {"model-test": ("moderate", 1 / 3), "identified": ("moderate", 1 / 5)}
"""Physics that the ships of the law do not have -> the kind whose reducible error it has a share of.

A factor uniform in 0.4-1.6 has a standard deviation of 35 %. Derivatives of captive tests are uncertain by some 10 %
(ITTC 7.5-02-06-04); those that are identified from free runs are taken to be half as far off as they.
"""
SEAS = ("calm", "ordinary", "rough")
ASKED = "asked"  # name of the ship that the law is asked about
ANY = "any"  # kind of a physics of which A is all that is known: each draw has another one
LIMITED = ("length", "froude", "N_D", "ahead", "A")


def feature_columns(cells: pd.DataFrame, names: Sequence[str]) -> Array:
    """Return the features (rows, names) of cells; `a:n` is a product."""
    base = cells["baseline"].to_numpy(float)
    formulae: dict[str, Callable[[], Any]] = {
        "1": lambda: np.ones(len(cells)),
        "n": lambda: np.log(cells["N_D"].clip(lower=1).to_numpy(float) / 8),
        "few": lambda: cells["N_D"].clip(lower=1).to_numpy(float) ** -0.5,
        "a": lambda: np.where(cells["kind"] == "none", 0.0, np.log(cells["A"].to_numpy(float) / base)),
        "p": lambda: np.log(cells["floor"].to_numpy(float) / base),
        "h": lambda: np.log(cells["ahead"].to_numpy(float) / 2),
        "froude": lambda: np.log(cells["froude"].to_numpy(float) / 0.2),
        "size": lambda: np.log(cells["length"].to_numpy(float) / 50),
    }
    parts = {part for name in names for part in name.split(":")}
    known = {part: formulae[part]() if part in formulae else (cells["kind"] == part).to_numpy(float) for part in parts}
    return np.stack([np.prod([known[part] for part in name.split(":")], axis=0) for name in names], axis=1)


def group_codes(cells: pd.DataFrame, level: str) -> Array:
    """Return a number (rows,) for each group of a level."""
    return np.asarray(cells.groupby(level.split(), sort=False).ngroup())


@dataclass(frozen=True)
class Hierarchy:
    """A fitted response: theta (P,) with its covariance (P, P), variances (levels,), and how many ships taught it.

    theta ends with c, the share of the floor, where the response has one.
    """

    response: Response
    theta: Array
    covariance: Array
    variances: Array
    ships: int

    def mean(self, cells: pd.DataFrame) -> tuple[Array, Array]:
        """ln(value / unit) (rows,) without effects, and its derivatives (rows, P) by theta."""
        return mean_of_features(self.theta, *both_features(self.response, cells))

    def spread(self, cells: pd.DataFrame, jacobian: Array, known: int = 0) -> Array:
        """Covariance (rows, rows) of cells of one ship: effects, rest, and what is unknown of theta.

        known : rows at the beginning whose runs and tests are others than those of the remaining rows.
        """
        parts = zip(self.variances, _kernels(self.response, cells, known), strict=True)
        return np.asarray(sum((one * kernel for one, kernel in parts), jacobian @ self.covariance @ jacobian.T))

    def residuals(self, known: pd.DataFrame, floors: Array) -> Array:
        """ln(value / unit) less `mean` (draws, rows) of known cells, if their floors are so many times as large."""
        many = known.iloc[np.tile(np.arange(len(known)), len(floors))]
        many = many.assign(floor=many["floor"] * np.repeat(floors, len(known)))
        return np.asarray(response_values(self.response, many) - self.mean(many)[0]).reshape(len(floors), -1)

    def likelihood(self, own: pd.DataFrame, floors: Array) -> Array:
        """Student log density (draws,), but for a constant, of known cells of a ship at each of these factors."""
        known = response_rows(self.response, own)
        apart = self.residuals(known, floors)
        distance = (apart * np.linalg.solve(self.spread(known, self.mean(known)[1]), apart.T).T).sum(axis=1)
        return np.asarray(-(self.freedom + len(known)) / 2 * np.log1p(distance / self.freedom))

    def deviations(
        self,
        cells: pd.DataFrame,
        draws: int,
        rng: np.random.Generator,
        own: pd.DataFrame | None = None,
        floors: Array | float = 1.0,
    ) -> Array:
        """Student draws (draws, rows) of value less `mean` for cells of one ship, given those of its cells in `own`.

        Known cells move them and make them narrower; ones that are further off than expected make them wider. What is
        drawn has other runs and another test, so that a cell that is known does not come out as it was measured.
        floors : factors, or (draws,), of the floor of the known cells.
        """
        known = cells.head(0) if own is None else response_rows(self.response, own)
        joined = pd.concat([known, cells], ignore_index=True)
        count, freedom, widen, centre = len(known), self.freedom, np.ones(1), np.zeros((1, len(cells)))
        spread = self.spread(joined, self.mean(joined)[1], count)
        if count:
            gain = np.linalg.solve(spread[:count, :count], spread[:count, count:]).T
            apart = self.residuals(known, np.atleast_1d(floors))
            distance = (apart * np.linalg.solve(spread[:count, :count], apart.T).T).sum(axis=1)
            centre, widen = apart @ gain.T, (freedom + distance) / (freedom + count)
            spread, freedom = spread[count:, count:] - gain @ spread[:count, count:], freedom + count
        values, vectors = np.linalg.eigh(spread)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        scale = np.sqrt(widen * freedom / rng.chisquare(freedom, draws))
        return np.asarray(centre + scale[:, None] * (rng.standard_normal((draws, len(cells))) @ root.T))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of Student draws for a new ship: ships less the effects that each of them has."""
        return float(max(self.ships - sum(level == SHIP for level, _ in self.response.levels), 3))


def both_features(response: Response, cells: pd.DataFrame) -> tuple[Array, Array]:
    """Features (rows, F) of what data reduce, and (rows, G) of the floor."""
    return tuple(np.split(feature_columns(cells, response.features + response.floor), [len(response.features)], axis=1))  # type: ignore[return-value]


def mean_of_features(theta: Array, features: Array, floor: Array) -> tuple[Array, Array]:
    """ln(value / unit) (rows,) of features, and its derivatives (rows, P) by theta (P,)."""
    linear, low = features @ theta[: features.shape[1]], floor @ theta[features.shape[1] :]
    if not floor.shape[1]:
        return linear, features
    total = np.logaddexp(2 * linear, 2 * low) / 2
    share = np.exp(2 * (linear - total))[:, None]
    return total, np.hstack([share * features, (1 - share) * floor])


def _kernels(response: Response, cells: pd.DataFrame, known: int = 0) -> list[Array]:
    """Covariances (rows, rows) of the effects of cells of one ship, at variance one; `known` as in `spread`."""
    features = feature_columns(cells, [feature for _, feature in response.levels])
    codes = {level: group_codes(cells, level) for level, _ in response.levels}
    earlier = np.arange(len(cells)) < known
    alike = earlier[:, None] == earlier
    same = {level: (code[:, None] == code) & (alike | ("N_D" not in level)) for level, code in codes.items()}
    return [
        same[level] * np.outer(column, column) for (level, _), column in zip(response.levels, features.T, strict=True)
    ]


def response_values(response: Response, cells: pd.DataFrame) -> Array:
    """Return ln(value / unit) (rows,) of cells."""
    return np.asarray(np.log(cells[response.value] / cells[response.unit]), float)


def response_rows(response: Response, cells: pd.DataFrame) -> pd.DataFrame:
    """Return the cells that teach a response: with runs for H, else one for each foundation, or ship, and horizon."""
    if response.value == "H":
        return cells[cells["N_D"] > 0]
    if response.value == "A":
        return cells[~cells["kind"].isin(["none", ""])].drop_duplicates(["ship", "foundation", "ahead"])
    return cells.drop_duplicates(["ship", "ahead"])


@dataclass(frozen=True)
class UnseenShip:
    """A ship that the law has not seen: length [m], service speed [m/s] and, where they are known, what it meets.

    baseline, floor : errors [m] of constant u, v, r and of the true physics over the horizon that is asked for; drawn
        from the ships of the law where they are not known. sea : calm, ordinary or rough: the third of the ships of the
        law, by floor / baseline, from which the floor is drawn; empty: all.
    """

    length: float
    speed: float
    baseline: float | None = None
    floor: float | None = None
    sea: str = ""

    @property
    def froude(self) -> float:
        """Speed / sqrt(g length)."""
        return float(self.speed / np.sqrt(GRAVITY * self.length))


@dataclass(frozen=True)
class ExchangeLaw:
    """The law, learned from many ships.

    parts : response -> its fit. limits : column -> least and greatest of the cells that it learned from; A in ship
    lengths. provenance : of the cells. own : cells of the ship that it is asked about, which condition it.
    """

    parts: Mapping[str, Hierarchy]
    limits: Mapping[str, tuple[float, float]]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    own: pd.DataFrame | None = None

    def given(self, own: pd.DataFrame) -> ExchangeLaw:
        """The law of one ship, of which some cells are known: see `Hierarchy.deviations`."""
        return replace(self, own=check_cells(own))

    def expect(
        self, ship: UnseenShip, foundation: Physics, amounts: Sequence[int], ahead: float, draws: int, seed: int = 0
    ) -> Array:
        """Predictive draws (draws, amounts) of H [m]; see `expect_all`."""
        return self.expect_all(ship, [foundation], amounts, ahead, draws, seed)[:, 0]

    def expect_all(
        self,
        ship: UnseenShip,
        foundations: Sequence[Physics],
        amounts: Sequence[int],
        ahead: float,
        draws: int,
        seed: int = 0,
    ) -> Array:
        """Predictive draws (draws, foundations, amounts) of H [m]; each draw is one ship with all its cells.

        foundations : kind, A [m], or both, of a physics; or the name of one in `own`. A alone is of any kind of error.
        amounts : runs; 0 is the physics alone. ahead : horizon [ship lengths].

        Draws are Student's, with as many degrees of freedom as there are ships beyond the effects of each. Raises
        ShipidError for a foundation that is no kind.
        """
        rng, own = np.random.default_rng(seed), self._own_rows()
        cells, floors = _cells_to_draw(ship, foundations, ahead, self.own), np.ones(1)
        cells["floor"] = cells["floor"].fillna(cells["A"][cells["kind"] == "nominal"].mean())
        many = cells.drop(columns=["ship", "foundation"]).loc[np.tile(cells.index, draws)].reset_index(drop=True)
        many["kind"] = pd.Categorical(many["kind"].where(many["kind"] != ANY, rng.choice(FLAWS, len(many))))
        for name in ("baseline", "floor", "A"):
            unknown = cells[name].isna() & (cells["kind"] != "none" if name == "A" else True)
            known = own if name == "A" else None
            values = self._draw(
                name, cells[unknown], many[np.tile(unknown, draws)], draws, rng, known, floors, ship.sea
            )
            if name == "floor":  # no physics is better than the true one
                least = [*cells["A"], *([] if own is None else own["A"][np.isclose(own["ahead"], ahead)])]
                values = np.fmin(values, np.fmin.reduce(least))
            if name == "floor" and own is not None and values.size:
                values, floors = self._likely_floors(values, own, rng)
            many.loc[np.tile(unknown, draws), name] = values.ravel()
            cells.loc[unknown, name] = np.median(values, axis=0)
        for one in (cells, many):  # of what the physics adds to the floor, some have a share
            one["A"] = one["A"].where(one["kind"] != "nominal", one["floor"])
            reducible = (one["A"] ** 2 - one["floor"] ** 2).clip(lower=0) * one["share"] ** 2
            one["A"] = one["A"].where(one["share"] == 1, np.sqrt(one["floor"] ** 2 + reducible))
        taught = np.array([amount for amount in amounts if amount > 0])
        asked, each = (
            one.loc[one.index.repeat(len(taught))].assign(N_D=np.tile(taught, len(one))) for one in (cells, many)
        )
        alone = many["A"].fillna(many["baseline"]).to_numpy().reshape(draws, -1, 1)
        result = np.repeat(alone, len(amounts), axis=2)
        shape = (draws, len(cells), len(taught))
        result[:, :, np.array(amounts) > 0] = self._draw("H", asked, each, draws, rng, own, floors).reshape(shape)
        return result

    def _draw(
        self,
        name: str,
        cells: pd.DataFrame,
        many: pd.DataFrame,
        draws: int,
        rng: np.random.Generator,
        own: pd.DataFrame | None = None,
        floors: Array | float = 1.0,
        sea: str = "",
    ) -> Array:
        """Draws (draws, rows) of a response of cells; `many` has their rows once for each draw, with what was drawn."""
        part = self.parts[name]
        mean = part.mean(many)[0].reshape(draws, -1)
        deviation = part.deviations(cells, len(SEAS) * draws if name == "floor" and sea else draws, rng, own, floors)
        if len(deviation) > draws:
            third = np.array_split(np.argsort(deviation[:, 0]), len(SEAS))[SEAS.index(sea)]
            deviation = deviation[rng.permutation(third)]
        return np.asarray(np.exp(mean + deviation) * many[part.response.unit].to_numpy().reshape(draws, -1))

    def _likely_floors(self, values: Array, own: pd.DataFrame, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draws of the floor (draws, rows) taken again as the known cells make them likely, and their factors."""
        floors = values[:, 0] / np.median(values[:, 0])
        likely = self.parts["H"].likelihood(own, floors) + self.parts["A"].likelihood(own, floors)
        weights = np.exp(likely - likely.max())
        taken = rng.choice(len(values), len(values), p=weights / weights.sum())
        return values[taken], floors[taken]

    def _own_rows(self) -> pd.DataFrame | None:
        """Cells of the own ship with runs, their floor filled with what the law expects where it is not known."""
        if self.own is None:
            return None
        own = self.own.assign(ship=ASKED)
        mean, least = self.parts["floor"].mean(own)[0], own.groupby("ahead")["A"].transform("min")
        return own.assign(floor=own["floor"].fillna(np.fmin(own["baseline"] * np.exp(mean), least)))


def _cells_to_draw(
    ship: UnseenShip, foundations: Sequence[Physics], ahead: float, own: pd.DataFrame | None
) -> pd.DataFrame:
    """A row for each foundation; A, baseline and floor are NaN where they are to be drawn."""
    here = pd.DataFrame(columns=["foundation"]) if own is None else own[np.isclose(own["ahead"], ahead)]
    same: dict[str, Any] = {"ship": ASKED, "ahead": ahead, "N_D": 0, "length": ship.length, "froude": ship.froude}
    same |= {
        name: np.nan if value is None else value for name, value in (("baseline", ship.baseline), ("floor", ship.floor))
    }
    if len(here):
        same |= {name: here[name].iloc[0] for name in ("baseline", "floor")}
    rows = []
    for foundation in foundations:
        known = here[here["foundation"] == foundation]
        kind, error = foundation if isinstance(foundation, tuple) else (foundation, np.nan)
        kind, share = LIKELY.get(kind, (kind, 1.0)) if isinstance(kind, str) else (kind, 1.0)
        if len(known):
            kind, error = known["kind"].iloc[0], known["A"].iloc[0]
        elif not isinstance(kind, str):
            kind, error = ANY, float(kind)
        elif kind not in CELL_KINDS:
            raise ShipidError(f"{kind!r} is no kind: give one of {', '.join([*LIKELY, *CELL_KINDS])}", path="kind")
        rows.append({**same, "foundation": str(foundation), "kind": kind, "A": error, "share": share})
    return pd.DataFrame(rows)


def response_names(response: Response) -> dict[str, list[str]]:
    """What the numbers of a law belong to: features, then those of the floor, and levels."""
    return {
        "features": [*response.features, *response.floor],
        "levels": [" : ".join(level) for level in response.levels],
    }


def read_law(file: Path = LAW_FILE) -> ExchangeLaw:
    """Read the law that comes with shipid, or another one; ResultError for a file of other features or none."""
    try:
        content, parts = read_json(file), {}
    except ResultError as error:
        raise ResultError("cannot be read, or is no JSON: give the path of a law.json", file=file) from error
    try:
        for name, response in RESPONSES.items():
            part = content["parts"][name]
            if not response_names(response).items() <= part.items():
                raise ResultError("has other features than this version of shipid: fit it anew", file=file, path=name)
            theta, covariance, variances = (np.array(part[key], float) for key in ("theta", "covariance", "variances"))
            parts[name] = Hierarchy(response, theta, covariance, variances, part["ships"])
        limits = {name: (float(low), float(high)) for name in LIMITED for low, high in [content["limits"][name]]}
        return ExchangeLaw(parts, limits, content["provenance"])
    except (KeyError, TypeError, ValueError):
        raise ResultError("is no law of exchange: give a law.json that shipid has written", file=file) from None
