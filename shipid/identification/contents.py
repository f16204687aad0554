"""Content of the report page of an identification, assembled from its outcome."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from shipid.identification.outcome import Identification
from shipid.report.identification import IdentificationContent
from shipid.version import __version__


def identification_content(outcome: Identification, dataset: str | Path, command: str = "") -> IdentificationContent:
    """Assemble the page content.

    outcome : a finished identification. dataset : file of the runs. command : command line that reproduces the outcome.
    """
    curves = [
        pd.DataFrame({"factor": curve.values, "rise": curve.rises}).assign(
            path=curve.path, limit=curve.limit, sentence=curve.sentence
        )
        for curve in outcome.profiles
    ]
    return IdentificationContent(
        title=f"{outcome.vessel.name}, identified",
        name=outcome.vessel.key,
        estimates=outcome.estimates,
        correlations=outcome.statistics.correlations,
        unseen=outcome.unseen,
        warnings=outcome.warnings,
        errors=outcome.errors,
        series=outcome.free["test" if outcome.held_out else "fit"].series,
        held_out=outcome.held_out,
        ahead=outcome.ahead,
        manoeuvres=outcome.manoeuvres,
        colours=outcome.colours,
        profiles=pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(),
        programme=pd.DataFrame() if outcome.programme is None else outcome.programme,
        beyond=outcome.beyond,
        provenance={
            "Vessel": f"{outcome.vessel.name}, digest {outcome.vessel.digest}",
            "Dataset": f"{dataset}, digest {outcome.digest}",
            "Fitted": ", ".join(outcome.runs),
            "Held out": ", ".join(outcome.held_out) or "none",
            "Fit": f"{outcome.solution.sentence}; objective {outcome.solution.objective:.6g}, at first "
            f"{outcome.solution.objective_start:.6g}",
            "shipid": __version__,
        },
        command=command,
        study_document=outcome.patch(Path()),
    )
