"""Results: a folder that can be copied and opened anywhere, written batch by batch."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid import document as documents
from shipid.data.windows import Windows
from shipid.errors import DocumentError, ResultError
from shipid.files import read_arrays, read_json, write_arrays, write_json, write_table, write_text
from shipid.study.plan import Batch, Foundation, Plan, build_plan
from shipid.vessel.load import check_vessel

STUDY, VESSELS, PROVENANCE, FOUNDATIONS = "study.toml", "vessels.json", "provenance.json", "foundations.json"
DATASET, TEST, ENVELOPE, TRIALS = "dataset.parquet", "test.npz", "envelope.json", "trials.log"
PARTS = "parts"
METRICS = ("A", "A_90", "A_rms", "H", "H_90", "rms", "seconds")


def open_folder(folder: Path, plan: Plan) -> None:
    """Make the folder of a run, or check that an existing one belongs to the same study."""
    if (folder / STUDY).exists():
        if _provenance(folder)["digest"] != plan.digest:
            raise ResultError(f"holds the results of another study than {plan.file}: choose another --out", file=folder)
        return
    if folder.exists() and not folder.is_dir():
        raise ResultError("is a file: choose another --out", file=folder)
    if folder.exists() and any(entry.name not in (PROVENANCE, VESSELS) for entry in folder.iterdir()):
        raise ResultError("is not empty and holds no run of shipid: choose another --out", file=folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"cannot be made ({error.strerror}): choose another --out", file=folder) from None
    origin: dict[str, Any] = {"name": plan.name, "file": str(Path(plan.file).absolute()), "sources": dict(plan.sources)}
    origin["changes"] = dict(plan.changes)
    write_json(folder / PROVENANCE, {"digest": plan.digest, **origin})
    vessels = {name: {"document": vessel.document, "file": vessel.file} for name, vessel in plan.vessels.items()}
    write_json(folder / VESSELS, vessels)
    write_text(folder / STUDY, plan.text())


def stored_plan(folder: Path) -> Plan:
    """The plan of a run from its folder alone: the study and the vessels as they were when the run began."""
    if not (folder / STUDY).is_file():
        raise ResultError("is not the folder of a run: it holds no study.toml", file=folder)
    provenance = _provenance(folder)
    try:
        document = documents.read(folder / STUDY)
    except DocumentError as error:
        raise ResultError(f"damaged ({error.message}): run the study again", file=folder / STUDY) from None
    stored = read_json(folder / VESSELS)
    vessels = {name: check_vessel(entry["document"], entry["file"]) for name, entry in stored.items()}
    plan = build_plan(document, Path(provenance["file"]), vessels, provenance.get("sources", {}))
    if plan.digest != provenance["digest"]:
        raise ResultError(
            "its study or vessels were changed by hand, or this shipid has other defaults: run the study again",
            file=folder,
        )
    return plan


def _provenance(folder: Path) -> dict[str, Any]:
    """Read what says to which study a folder belongs; ResultError where it does not say so."""
    record = read_json(folder / PROVENANCE)
    if not isinstance(record, dict) or not {"digest", "name", "file"} <= record.keys():
        raise ResultError("damaged: run the study again into a new folder", file=folder / PROVENANCE)
    return record


def write_patches(folder: Path, foundations: Iterable[Foundation]) -> int:
    """Write a patch document for every variant and return how many; it loads from anywhere and rebuilds it exactly."""
    count = 0
    for one in foundations:
        if one.base is not None and one.variant is not None and one.identify is None:
            named = documents.bundled("models").get(one.variant.base) == Path(one.base.file)
            base = one.variant.base if named else str(Path(one.base.file).absolute())
            write_text(folder / f"{one.name}.toml", replace(one.variant, base=base).document())
            count += 1
    return count


def batch_file(folder: Path, batch: Batch) -> Path:
    """Where the rows of a finished batch are; its presence says that the batch is done."""
    return folder / "batches" / f"{batch.key}.json"


def cell_file(folder: Path, cell: str) -> Path:
    """Where the predictor of a cell is."""
    return folder / "cells" / f"{cell}.npz"


def part_folder(folder: Path, part: str) -> Path:
    """Where the run of one part of a study is: a folder like that of any run."""
    return folder / PARTS / part


def finished(folder: Path, batches: Iterable[Batch]) -> list[Batch]:
    """Batches whose results are stored whole."""
    return [batch for batch in batches if batch_file(folder, batch).is_file()]


def read_rows(folder: Path) -> pd.DataFrame:
    """One row per finished cell, with its trials; ordered by N_D, seed, foundation and method."""
    rows = [row for file in sorted((folder / "batches").glob("*.json")) for row in read_json(file)]
    if not rows:
        raise ResultError("no cell is finished yet: continue with `shipid study resume`", file=folder)
    frame = pd.DataFrame(rows)
    for name in METRICS:
        frame[name] = frame[name].astype(float)
    return frame.sort_values(["N_D", "seed"], kind="stable").reset_index(drop=True)


def write_results(folder: Path, rows: pd.DataFrame) -> Path:
    """`results.parquet`: one row per cell and metric, and `trials.parquet`: one row per cell and trial."""
    keys = ["cell", "foundation", "family", "member", "method", "N_D", "runs", "minutes", "seed", "status"]
    table = rows.melt(id_vars=keys, value_vars=list(METRICS), var_name="metric", value_name="value")
    table["unit"] = np.where(table["metric"] == "seconds", "s", "m")
    write_table(folder / "results.parquet", table)
    trials = [{"cell": row["cell"], **_flat(trial)} for _, row in rows.iterrows() for trial in row["trials"]]
    write_table(folder / "trials.parquet", pd.DataFrame(trials))
    return folder / "results.parquet"


def _flat(trial: Mapping[str, Any]) -> dict[str, Any]:
    return {**{k: v for k, v in trial.items() if k != "params"}, **trial.get("params", {})}


def write_test(folder: Path, test: Windows, paths: Mapping[str, np.ndarray], naive: np.ndarray) -> None:
    """Store the test windows and the physics paths of every foundation on them, so that a report needs nothing else."""
    arrays: dict[str, np.ndarray] = {"run": test.run, "t": test.t, "future": test.future, "naive": naive}
    arrays |= {f"column {name}": values for name, values in test.columns.items()}
    arrays |= {f"planned {name}": values for name, values in test.planned.items()}
    arrays |= {f"past {name}": values for name, values in test.past.items()}
    arrays |= {f"states {name}": values for name, values in test.states.items()}
    arrays |= {f"physics {name}": values for name, values in paths.items()}
    arrays["meta"] = np.array(json.dumps({"horizon": test.horizon, "step": test.step, "shared": test.shared_clock}))
    write_arrays(folder / TEST, arrays, compressed=True)


def read_test(folder: Path) -> tuple[Windows, dict[str, np.ndarray], np.ndarray]:
    """Test windows, physics paths by foundation, and the naive floor's errors (T, S)."""
    try:
        arrays = read_arrays(folder / TEST)
        meta = json.loads(str(arrays["meta"]))
    except (OSError, ValueError, KeyError):
        raise ResultError("missing or damaged: continue with `shipid study resume`", file=folder / TEST) from None

    def named(prefix: str) -> dict[str, np.ndarray]:
        return {name.removeprefix(prefix): values for name, values in arrays.items() if name.startswith(prefix)}

    windows = Windows(
        run=arrays["run"],
        t=arrays["t"],
        columns=named("column "),
        future=arrays["future"],
        planned=named("planned "),
        past=named("past "),
        states=named("states "),
        horizon=meta["horizon"],
        step=meta["step"],
        shared_clock=meta["shared"],
    )
    return windows, named("physics "), arrays["naive"]
