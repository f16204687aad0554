"""Every figure of the reports as a plotly figure: `shipid.figures.error_map(results).show()`.

Figures of a study take `Results`, the content of a report, or a table of cells as of `shipid.read_cells`; others the
outcome of an identification, what `shipid.measure_standard` returns, a family, its trajectories, or a dataset. All
raise ShipidError where there is nothing to draw or an option does not exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from shipid.arguments import check_class, check_number
from shipid.errors import ShipidError
from shipid.report.content import PageContent, ReportContent
from shipid.report.factors import family_figure
from shipid.report.figure import PageFigure, draw_alone
from shipid.report.identification import IDENTIFICATION_PAGE, IdentificationContent
from shipid.report.logs import CHECK_PAGE, CheckContent
from shipid.report.motion import MANOEUVRE_PAGE, ManoeuvreContent, spread_figure
from shipid.report.page import Section
from shipid.report.paths import windows_of
from shipid.report.physics_and_data import gain_lack, map_lack
from shipid.report.sections import SECTIONS
from shipid.report.selection import PHYSICS_ERRORS

if TYPE_CHECKING:
    from shipid.data.dataset import Dataset
    from shipid.engine.rollout import Trajectories
    from shipid.simulation.families import VesselFamily
    from shipid.simulation.measured import MeasuredManoeuvre
    from shipid.study.results import Results

    Source = Results | ReportContent | pd.DataFrame

ErrorStatistic = Literal[
    "at the horizon", "at the horizon, 90th percentile", "mean", "90th percentile", "root mean square"
]
PAGES: dict[type[PageContent], dict[str, Section]] = {
    ReportContent: SECTIONS,
    CheckContent: CHECK_PAGE,
    IdentificationContent: IDENTIFICATION_PAGE,
    ManoeuvreContent: MANOEUVRE_PAGE,
}
ABSENT_COLUMNS: dict[str, Any] = {"family": "given", "seed": 0, "status": "ok"} | dict.fromkeys(
    (*PHYSICS_ERRORS, "H_end", "H_end_90", "H_90", "rms"), np.nan
)
"""Columns of a table of cells that a user leaves out -> their value; errors in m."""

__all__ = [
    "correlations",
    "coverage",
    "envelope",
    "error_map",
    "error_over_horizon",
    "error_over_time",
    "estimates",
    "factors",
    "free_runs",
    "frontier",
    "gain",
    "histories",
    "motion",
    "prediction",
    "profiles",
    "residuals",
    "search",
    "shares",
    "spiral",
    "spread",
    "track",
    "tracks",
    "width_map",
]


def error_map(source: Source, *, dark: bool = False) -> go.Figure:
    """H, the mean over the horizon, over the accuracy A of the physics and N_D; needs several N_D and two models."""
    content = content_of(source)
    return _draw("map", content, dark=dark, lack=map_lack(content))


def gain(
    source: Source,
    statistic: ErrorStatistic | None = None,
    scale: Literal["logarithmic", "linear"] = "logarithmic",
    *,
    dark: bool = False,
) -> go.Figure:
    """Error over N_D, a line per model from its physics alone (N_D = 0) on.

    statistic : default: at the horizon, or the mean over it, H, of a table that has no column H_end.
    """
    content = content_of(source)
    return _draw("gain", content, [statistic, scale], dark=dark, lack=gain_lack(content))


def frontier(source: Source, *, dark: bool = False) -> go.Figure:
    """Expected error at the horizon over the price, a line per physics; needs a study with `[cost]`."""
    return _draw("frontier", content_of(source), dark=dark, lack="the study has no [cost], or no cell with a result")


def coverage(source: Source, N_D: int | None = None, *, dark: bool = False) -> go.Figure:
    """Share of whole test paths in their bands over the share promised, with intervals; `N_D` default: the most."""
    return _draw("coverage", content_of(source), [N_D], dark=dark)


def width_map(source: Source, *, dark: bool = False) -> go.Figure:
    """Mean radius of the bands over the accuracy A of the physics and the amount of data N_D."""
    content = content_of(source)
    return _draw("width-map", content, dark=dark, lack=map_lack(content))


def error_over_horizon(
    source: Source,
    statistic: Literal["mean", "90th percentile", "along (surge)", "across (sway)", "course"] = "mean",
    N_D: int | None = None,
    *,
    dark: bool = False,
) -> go.Figure:
    """Error over the time ahead, of position [m] or course [deg]; `N_D` default: the most."""
    return _draw("horizon", content_of(source), [statistic, N_D], dark=dark)


def error_over_time(source: Source, run: str | None = None, *, dark: bool = False) -> go.Figure:
    """Position error at each instant of prediction of a test run, with its commands below; with the largest N_D."""
    return _draw("over-time", content_of(source), [run], dark=dark)


def prediction(
    source: Source, run: str | None = None, t: float | None = None, N_D: int | None = None, *, dark: bool = False
) -> go.Figure:
    """True and predicted paths from one instant of a test run, in metres ahead and to starboard, ship to scale.

    run : default: the first. t : instant of prediction [s], the nearest recorded one; default: the middle of the run.
    N_D : default: the most.
    """
    if t is not None and not np.isfinite(check_number("t", t)):
        raise ShipidError(f"t must be a time in seconds, not {t}", path="prediction")
    content = content_of(source)
    if t is not None:
        nearest = (min(windows, key=lambda one: abs(one.t - t)) for windows in windows_of(content).values())
        content = replace(content, snapshots=list(nearest))
    return _draw("browser", content, [run, N_D], dark=dark)


def factors(source: Source | VesselFamily, *, dark: bool = False) -> go.Figure:
    """Factors of the perturbed numbers of every model, or member of a family, as dots on a logarithmic axis."""
    from shipid.simulation.families import VesselFamily

    if isinstance(source, VesselFamily):
        if not any(one.factors for one in source.members):
            raise ShipidError(
                f"family {source.rules.name!r} has no factors: it changes no number that is not 0 in its base",
                path="figures",
            )
        return draw_alone(family_figure(pd.DataFrame(source.table().xs("factor", axis=1, level=1))), dark=dark)
    return _draw("factors", content_of(source), dark=dark)


def shares(source: Source, family: str | None = None, *, dark: bool = False) -> go.Figure:
    """Share of H that the error of each number makes, with intervals, at each N_D; `family` default: the first."""
    return _draw("shares", content_of(source), [family], dark=dark, lack="no family has enough members")


def spread(source: Trajectories, *, dark: bool = False) -> go.Figure:
    """Tracks and headings of all members of a family, as of `VesselFamily.trajectories`; those of the first sample."""
    from shipid.engine.rollout import Trajectories

    check_class("source", source, Trajectories, "as of `family.trajectories`")
    motion = {name: source[name][:, ~source.diverged[:, 0], 0] for name in ("north", "east", "psi")}
    return draw_alone(spread_figure(source.interval, motion, int(source.diverged[:, 0].sum())), dark=dark)


def tracks(source: Source, *, dark: bool = False) -> go.Figure:
    """Map of the tracks of all runs, north up; runs of the test in another colour than all others."""
    return _draw("manoeuvres", content_of(source), dark=dark)


def envelope(source: Source, *, dark: bool = False) -> go.Figure:
    """Least, mean and greatest value of every input, per set of runs."""
    return _draw("envelope", content_of(source), dark=dark)


def search(source: Source, N_D: int | Literal["all"] | None = None, *, dark: bool = False) -> go.Figure:
    """Error of the trials of the search over each hyperparameter."""
    return _draw("search", content_of(source), [] if N_D is None else [N_D], dark=dark)


def motion(source: Dataset | CheckContent, run: str | None = None, *, dark: bool = False) -> go.Figure:
    """Heading against yaw rate, position against velocity, and velocities of a run (default: the first) of a log."""
    if isinstance(source, CheckContent):
        content = source
    else:
        from shipid.data.checks import check_dataset

        content = check_content("log", source, check_dataset(source))
    return _draw("motion-figure", content, [run], dark=dark)


def estimates(source: IdentificationContent, *, dark: bool = False) -> go.Figure:
    """Estimates of an identification with 95 % intervals, as factors on the base values."""
    return _draw("estimates", source, dark=dark)


def correlations(source: IdentificationContent, *, dark: bool = False) -> go.Figure:
    """Correlations of the estimates of an identification; needs two of them."""
    return _draw("correlations", source, dark=dark)


def free_runs(source: IdentificationContent, run: str | None = None, *, dark: bool = False) -> go.Figure:
    """Measured motion of a run (default: the first), and free runs of the vessel before and after identification."""
    return _draw("free-runs", source, [run], dark=dark)


def residuals(source: IdentificationContent, *, dark: bool = False) -> go.Figure:
    """Autocorrelation of the residuals of an identification."""
    return _draw("residuals", source, dark=dark)


def profiles(source: IdentificationContent, *, dark: bool = False) -> go.Figure:
    """Profile likelihoods of an identification, of the paths that were asked for."""
    return _draw("profiles", source, dark=dark)


def track(source: MeasuredManoeuvre | ManoeuvreContent, *, dark: bool = False) -> go.Figure:
    """Track of a standard manoeuvre, north up, ship to scale."""
    return _draw("track", _manoeuvre(source), dark=dark)


def histories(source: MeasuredManoeuvre | ManoeuvreContent, *, dark: bool = False) -> go.Figure:
    """Heading, helm, speeds and yaw rate of a standard manoeuvre over time."""
    return _draw("histories", _manoeuvre(source), dark=dark)


def spiral(source: MeasuredManoeuvre | ManoeuvreContent, *, dark: bool = False) -> go.Figure:
    """Steady yaw rate over helm angle, of a spiral."""
    return _draw("spiral", _manoeuvre(source), dark=dark)


def _draw(
    name: str,
    content: PageContent,
    chosen: Sequence[object] = (),
    *,
    dark: bool,
    lack: str = "the results hold no rows for it",
) -> go.Figure:
    """Draw a figure of a page by its id; ShipidError where there is none, with what the source lacks for it."""
    kind, section = next((kind, one) for kind, page in PAGES.items() for one in page.values() if name in one.items)
    check_class("source", content, kind, "as of `run_identification`")  # others are made of what the user gave
    figure = section.draw_item(name, content)
    if not isinstance(figure, PageFigure):
        raise ShipidError(f"there is nothing to draw: {lack}", path="figures")
    return draw_alone(figure, chosen, dark=dark)


def content_of(source: Source) -> ReportContent:
    """Return what a report shows: from results, or from the table of cells alone; to draw many figures, call it once.

    Raises ShipidError for anything else, and for a table that lacks a column.
    """
    if isinstance(source, ReportContent):
        return source
    if isinstance(source, pd.DataFrame):
        if lacking := [name for name in ("model", "N_D", "H") if name not in source]:
            raise ShipidError(f"lacks the columns {', '.join(lacking)}", path="cells")
        cells = source.assign(**{name: value for name, value in ABSENT_COLUMNS.items() if name not in source})
        models = cells.drop_duplicates("model")[["model", "family", "A", "A_90", "A_rms"]]
        models = models.assign(status="ok", description="")
        naive = dict.fromkeys(("end", "end_90", "mean", "p90", "rms"), np.nan)
        return ReportContent(title="", name="", cells=cells, models=models, naive=naive)
    from shipid.answer.pages import report_content
    from shipid.study.results import Results

    check_class("source", source, Results, "as of `read_results`, or a table of cells, as of `read_cells`")
    return report_content(source)


def check_content(name: str, log: Dataset, checks: pd.DataFrame) -> CheckContent:
    """Return the content of the page of a log: `name` is a short name, `checks` the table from `check_dataset`."""
    from shipid.data.checks import check_series

    source = log.metadata.get("source", "")
    words = source if isinstance(source, str) else ", ".join(f"{key} {value}" for key, value in source.items())
    return CheckContent(
        name=name,
        checks=checks,
        series=check_series(log),
        tracks=log.frame[["run", "north", "east"]].assign(set="the log"),
        repairs=pd.DataFrame(log.metadata.get("repairs", []), columns=["kind", "column", "count", "note"]),
        provenance={
            "log": words,
            "vessel": str(log.metadata.get("vessel") or "not given"),
            "rows": str(len(log.frame)),
        },
    )


def _manoeuvre(source: MeasuredManoeuvre | ManoeuvreContent) -> ManoeuvreContent:
    if isinstance(source, ManoeuvreContent):
        return source
    from shipid.simulation.measured import MeasuredManoeuvre, manoeuvre_content

    check_class("source", source, MeasuredManoeuvre, "as of `measure_standard`")
    return manoeuvre_content(source)
