"""What the page of an identification shows, assembled from its outcome."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from shipid.identification.outcome import Identified
from shipid.report.identification import IdentificationContent
from shipid.version import __version__


def identification_content(found: Identified, dataset: str | Path, command: str = "") -> IdentificationContent:
    """Assemble the page: `dataset` is the file of the runs, `command` the line that reproduces the outcome."""
    curves = [
        pd.DataFrame({"factor": curve.values, "rise": curve.rises}).assign(
            path=curve.path, limit=curve.limit, sentence=curve.sentence
        )
        for curve in found.profiles
    ]
    return IdentificationContent(
        title=f"{found.vessel.name}, identified",
        name=found.vessel.key,
        estimates=found.estimates,
        correlations=found.statistics.correlations,
        unseen=found.unseen,
        warnings=found.warnings,
        errors=found.errors,
        series=found.free["test" if found.held_out else "fit"].series,
        held_out=found.held_out,
        ahead=found.ahead,
        manoeuvres=found.manoeuvres,
        colours=found.colours,
        profiles=pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(),
        programme=pd.DataFrame() if found.programme is None else found.programme,
        provenance={
            "Vessel": f"{found.vessel.name}, digest {found.vessel.digest}",
            "Dataset": f"{dataset}, digest {found.digest}",
            "Fitted": ", ".join(found.runs),
            "Held out": ", ".join(found.held_out) or "none",
            "Fit": f"{found.solution.sentence}; objective {found.solution.objective:.6g}, at first "
            f"{found.solution.objective_start:.6g}",
            "shipid": __version__,
        },
        command=command,
        study_document=found.patch(Path()),
    )
