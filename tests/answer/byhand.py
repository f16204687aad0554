"""Results made by hand, so that a sentence or a verdict can be foretold."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.data.windows import Windows
from shipid.study.plan import build_plan
from shipid.study.results import Results
from tests.study.tiny import logged, tiny_plan

STEPS = 4
RIVALS = {"accurate": "good", "inaccurate": "bad"}
ALONE = {"good": 2.0, "bad": 6.0}
Cells = Mapping[tuple[str, int, int], float | None]


def by_hand(
    folder: Path,
    cells: Cells,
    *,
    planned: int | None = None,
    claims: Mapping[str, Any] | None = RIVALS,
    family: Mapping[str, int] | None = None,
    naive: float = 10.0,
    alone: Mapping[str, float] = ALONE,
    curves: Mapping[tuple[str, int, int], list[float]] | None = None,
    losses: Mapping[str, float] | None = None,
    H_90: Mapping[tuple[str, int, int], float] | None = None,
    runs: int = 1,
    changes: Mapping[str, Any] | None = None,
) -> Results:
    """Results of cells (model, N_D, seed) -> H [m]; None has failed. Errors are equal at all steps by default.

    runs : test manoeuvres of one window each; all errors are up to 10 % lower in the first and higher in the last.
    changes : further blocks of the study document.

    family : members by family, called `<family>-<number>`; without it every model is a family.
    """
    document = tiny_plan(folder).document
    document["family"] = (
        [{"name": name, "base": "gunnerus-28.9"} for name in alone]
        if family is None
        else [
            {"name": name, "base": "gunnerus-28.9", "members": count, "equal": True} for name, count in family.items()
        ]
    )
    document["grid"] = {"N_D": sorted({N for _, N, _ in cells}), "seeds": sorted({seed for *_, seed in cells})}
    if claims is not None:
        document["claims"] = dict(claims)
    document["truth"]["manoeuvres"] = 200
    document |= changes or {}
    plan = build_plan(document, folder / "tiny.toml")
    if planned is None:
        assert plan.cells == len(cells), "a complete study by hand"
    hard = np.linspace(0.9, 1.1, runs) if runs > 1 else np.ones(1)
    rows, paths = [], {}
    for (model, N_D, seed), H in cells.items():
        A = alone.get(model, np.nan)
        row = {
            "cell": f"{model}+kernel-{N_D}-{seed}",
            "model": model,
            "foundation": model,
            "method": "kernel",
            "family": model if family is None else model.partition("-")[0],
            "member": 0,
            "N_D": N_D,
            "seed": seed,
        }
        row |= {"runs": N_D, "minutes": 1.0, **dict.fromkeys(("A_end", "A_end_90", "A", "A_90", "A_rms"), A)}
        row |= dict.fromkeys(("H_end", "H_end_90", "H", "H_90"), np.nan)
        row["trials"] = [{"value": (losses or {}).get(model, H), "state": "complete"}]
        row |= {"rms": np.nan, "physics_diverged": 0.0, "status": "failed", "sentence": "no training converged"}
        if H is not None:
            row |= {"H": H, "rms": 1.1 * H, "status": "ok", "sentence": ""}
            row["H_90"] = (H_90 or {}).get((model, N_D, seed), 1.5 * H)
            curve = np.array((curves or {}).get((model, N_D, seed), [H] * STEPS))
            row |= {"H_end": curve[-1], "H_end_90": 1.5 * curve[-1]}
            paths[row["cell"]] = np.stack([np.outer(curve, hard), np.zeros((STEPS, runs))], axis=-1)
        rows.append(row)
    straight = np.zeros((STEPS, runs, 2))
    physics = {name: straight + np.outer(A * hard, [1.0, 0.0]) for name, A in alone.items()} | {"none": straight}
    names = np.array([chr(ord("a") + k) for k in range(runs)])
    columns = {name: np.zeros(runs) for name in ("north", "east", "psi", "u", "v", "r")}
    return Results(
        folder=folder,
        plan=plan,
        cells=pd.DataFrame(rows),
        models=pd.DataFrame(),
        test=Windows(names, np.zeros(runs), columns, straight, {}, STEPS, 2.0),
        physics=physics,
        naive=np.tile(naive * hard, (STEPS, 1)),
        paths=paths,
        dataset=Dataset(logged({"a": {}}, np.arange(2.0)).frame, {"flags": []}),
        provenance={},
    )


def grid(H: Mapping[str, tuple[float | None, ...]], amounts: tuple[int, ...] = (10, 30)) -> dict[Any, float | None]:
    return {(model, N, 0): value for model, values in H.items() for N, value in zip(amounts, values, strict=True)}
