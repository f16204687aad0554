"""Cells of ships drawn from a known law."""

import numpy as np
import pandas as pd

from docs.exchange_fit import FLOOR_CENTRE
from shipid.exchange.law import CELL_COLUMNS, RESPONSES, Hierarchy
from shipid.units import GRAVITY

KINDS = ("nominal", *["damping", "mass", "thrust", "missing", "moderate", "high"] * 2, "template", "sister", "none")
AMOUNTS, HORIZONS = (1, 2, 4, 8, 16, 32, 64), (1.0, 2.0, 4.0)
TRUE_THETA = {
    "1": -1.5, "n": -0.4, "a": 0.8, "a:n": -0.1, "h": 0.1, "damping": 0.2, "mass": -0.2,
}  # fmt: skip
TRUE_SPREAD = {
    ("ship", "1"): 0.2, ("ship", "n"): 0.08, ("ship foundation", "1"): 0.1, ("ship N_D", "few"): 0.2,
    ("ship foundation N_D", "1"): 0.1, ("ship foundation N_D ahead", "1"): 0.05,
}  # fmt: skip


def true_law() -> Hierarchy:
    """The law of H that the cells are drawn from: nothing of it is unknown."""
    form = RESPONSES["H"]
    floor = {**FLOOR_CENTRE, "n": -0.1, "none": 0.5, "none:n": -0.2}
    theta = np.array(
        [*(TRUE_THETA.get(name, 0.0) for name in form.features), *(floor.get(name, 0.0) for name in form.floor)]
    )
    variances = np.array([TRUE_SPREAD.get(level, 0.0) ** 2 for level in form.levels])
    return Hierarchy(form, theta, np.zeros((len(theta),) * 2), variances, 1000)


def draw_cells(ships: int, seed: int, kinds: tuple[str, ...] = KINDS) -> pd.DataFrame:
    """Cells of some ships; effects and rest of H are those of `true_law`."""
    rng, law, frames = np.random.default_rng(seed), true_law(), []
    for number in range(ships):
        length, froude = np.exp(rng.uniform(np.log(2), np.log(320))), rng.uniform(0.1, 0.35)
        size = {"length": length, "froude": froude, "speed": froude * np.sqrt(GRAVITY * length)}
        base = np.exp(rng.normal(-2, 0.2))
        floor = base * np.exp(rng.normal(-1.5, 0.4))
        scatter = {ahead: np.exp(rng.normal(0, 0.03, 2)) for ahead in HORIZONS}
        rows = [
            {
                "ship": f"ship-{number}", "type": f"type-{number % 8}", "bundled": number % 5 == 0, **size,
                "foundation": f"{kind}-{place}", "kind": kind,
                "A": np.nan if kind == "none" else length * ahead**1.5 * np.hypot(error * (kind != "nominal"), floor),
                "N_D": amount, "ahead": ahead, "H": 1.0, "baseline": length * base * ahead**1.6 * scatter[ahead][0],
                "floor": length * floor * ahead**1.5 * scatter[ahead][1],
            }
            for place, kind in enumerate(kinds)
            for error in [base * np.exp(rng.normal(-0.3, 0.6))]
            for amount in AMOUNTS
            for ahead in HORIZONS
        ]  # fmt: skip
        part = pd.DataFrame(rows)
        mean, jacobian = law.mean(part)
        root = np.linalg.cholesky(law.spread(part, jacobian) + 1e-12 * np.eye(len(part)))
        frames.append(part.assign(H=part["baseline"] * np.exp(mean + root @ rng.standard_normal(len(part)))))
    return pd.concat(frames, ignore_index=True)[[*CELL_COLUMNS]]
