"""Runs of a vessel by a document of manoeuvres, `[[manoeuvre]]` after `[[manoeuvre]]`."""

from __future__ import annotations

from typing import Annotated, Any

import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from shipid import document as documents
from shipid.capacity import excess_memory_words
from shipid.errors import DocumentError, ShipidError, suggest_name
from shipid.physics.signals import ACTUAL
from shipid.simulation.approach import Controls
from shipid.simulation.manoeuvre import KINDS, Manoeuvre
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.truth import LONGEST, path_in_block
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

Positive = Annotated[FiniteFloat, Field(gt=0)]


class Script(BaseModel):
    """Given manoeuvres: blocks with a `kind` and the keys of the kind, a run each; times in s."""

    model_config = ConfigDict(extra="forbid")
    manoeuvre: Annotated[list[dict[str, Any]], Field(min_length=1)]
    step: Annotated[Positive, Field(description="s, of the integration")] = 0.05
    interval: Annotated[Positive, Field(description="s between logged rows, a multiple of step")] = 1.0


def simulate_script(vessel: Vessel, name: str) -> pd.DataFrame:
    """Simulate a vessel by the manoeuvres of a document; the columns are those of a dataset.

    name : path of a TOML document. Its `[[manoeuvre]]` blocks are performed in calm water.

    Raises DocumentError with file, path and remedy for what this vessel cannot perform.
    """
    file = documents.find_document(name, "studies")
    document = documents.read_document(file)
    try:
        if "truth" in document:
            raise DocumentError("is a study: simulate it by its name, with --set truth.vessel=...")
        script = documents.parse_model(Script, document, file)
        manoeuvres = _script_manoeuvres(script, vessel)
        length = max(one.length for one in manoeuvres)
        if length > LONGEST:
            raise DocumentError(f"a run of {length:g} s: at most {LONGEST:g} s, make it shorter", path="manoeuvre")
        instants = len(manoeuvres) * length / script.step
        if fault := excess_memory_words(instants * 2 * len(vessel_dynamics(vessel).commands)):
            raise DocumentError(f"{len(manoeuvres)} runs in steps of {script.step:g} s {fault}", path="step")
        frame = perform_manoeuvres(vessel, manoeuvres, step=script.step, interval=script.interval)
    except ShipidError as error:
        raise DocumentError(error.message, file=file, path=error.path) from None
    return frame.drop(columns=[column for column in frame if str(column).startswith(ACTUAL)])


def _script_manoeuvres(script: Script, vessel: Vessel) -> list[Manoeuvre]:
    """The manoeuvres of a document, which this vessel can perform."""
    controls, manoeuvres = Controls(vessel), []
    for place, block in enumerate(script.manoeuvre):
        kind, where = str(block.get("kind", "")), f"manoeuvre.{place}"
        if kind not in KINDS:
            raise DocumentError(f"{kind!r} is no kind of manoeuvre: {suggest_name(kind, KINDS)}", path=f"{where}.kind")
        rest = {key: value for key, value in block.items() if key != "kind"}
        one: Manoeuvre = documents.parse_model(KINDS[kind], rest, None, where)
        try:
            one.check(controls)
        except DocumentError as error:
            raise DocumentError(error.message, path=path_in_block(error.path, where)) from None
        manoeuvres.append(one)
    return manoeuvres
