"""What a report shows, as plain values and frames: SI units, radians, no object of a study."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd

Floats = np.ndarray[tuple[int, ...], np.dtype[np.floating]]
Indices = np.ndarray[tuple[int, ...], np.dtype[np.signedinteger]]
PathKey = tuple[str, str, int]

DATA_DRIVEN = "none"  # the family of the model without physics
NO_PHYSICS = "no physics"
"""Name of that model for people, in sentences and figures: `none` would say that nobody does."""
# Columns of a trial; every other column of its frame is a searched hyperparameter.
TRIAL_COLUMNS = ("cell", "model", "N_D", "seed", "number", "state", "value", "epochs", "seconds", "chosen")
MODEL_NAME_COLUMNS = ("model", "without", "with")  # columns that name a model
PUBLISHED = "published"  # the set of the envelope that holds the paper's numbers


def model_text(model: str) -> str:
    """Name of a model or family for people, with the method that may follow: `none` is `no physics`."""
    alone = model == DATA_DRIVEN or model.startswith(f"{DATA_DRIVEN} + ")
    return model.replace(DATA_DRIVEN, NO_PHYSICS, 1) if alone else model


@dataclass(frozen=True)
class SummaryLine:
    """A line of the summary of a log played as if at sea.

    kind : `predictions`, `alarm` and `band` are how it went, `limit` is what limits that; the page draws a `detail`.
    """

    kind: Literal["predictions", "alarm", "band", "limit", "detail"]
    text: str


@dataclass(frozen=True)
class AnswerSentence:
    """One sentence of the answer as plain text, and the id of the figure or table that carries it, if any."""

    text: str
    figure: str = ""


@dataclass(frozen=True, eq=False)
class WindowSnapshot:
    """One window of a test run with its predictions, in the frame (11) frozen at the instant of prediction.

    run, t [s] : of the instant. outline : (k, 2) of the ship [m]. psi_end : change of the true heading [rad].
    truth : (T + 1, 2) true x, y [m]. paths : (model, source, N_D) -> (T + 1, 2) [m]; N_D = 0 of physics.
    wind : speed [m/s] and direction it blows towards [rad], clockwise from ahead; None where not measured.
    bands : key of the path -> (n, 2) closed outline of the band around it [m].
    """

    run: str
    t: float
    outline: Floats
    psi_end: float
    truth: Floats
    paths: Mapping[PathKey, Floats]
    wind: tuple[float, float] | None = None
    bands: Mapping[PathKey, Floats] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class PageContent:
    """What a page shows besides its sections; every page adds frames and `answer`, the sentences below the title.

    name : beside the kicker. provenance : label -> value. command : what reproduces the page.
    findings : id, claim, verdict, evidence of each.
    """

    title: str
    name: str
    provenance: Mapping[str, str] = field(default_factory=dict)
    command: str = ""
    study_document: str = ""
    findings: Sequence[Mapping[str, Any]] = ()


def rows_as_tuples(frame: pd.DataFrame) -> list[Any]:
    """Rows of a frame as named tuples."""
    return list(frame.itertuples())


def empty_frame(*columns: str) -> Callable[[], pd.DataFrame]:
    """What makes a frame that has these columns and no rows."""
    return lambda: pd.DataFrame(columns=list(columns))


@dataclass(frozen=True, eq=False, kw_only=True)
class ReportContent(PageContent):
    """Everything one report shows; a frame without rows leaves its figure out.

    `source` is "physics", "cooperative" or "naive"; N_D is 0 for physics and naive. The model without physics, of
    family "none", has the source "cooperative" and is called `no physics`.

    cells : model, family, N_D, seed, status ("ok", "diverged", "failed"), sentence, A_end, A_end_90, A, A_90, A_rms,
    H_end, H_end_90, H, H_90, rms [m] (NaN where failed); then member, runs, minutes, seconds, hyperparameters (text).
    naive : end, end_90, mean, p90, rms [m] of constant u, v, r.
    models : model, family, A, A_90, A_rms [m], status, description; where known A_end, A_end_90, A_along, A_across [m].
    factors : model, path, group ("hull", ...), factor [1]; 0 where a term was removed.
    trials : `TRIAL_COLUMNS` and a float column per searched hyperparameter; state is "complete", "diverged" or
    "stopped", value [m^2] NaN where diverged; chosen: its network is in the compensator.
    horizon : model, N_D, seed, source, ahead [s], mean, p90 [m]; where known along, across [m].
    over_time : run, t [s], model, N_D, seed, source, error [m] (mean over the horizon from t).
    commands : run, t [s], one column per command, named with its unit: "port shaft [rpm]".
    tracks : run, set, north, east [m]. envelope : set (or "published"), quantity, unit, min, mean, max.
    repairs : kind, column, count, note. best : the model that validation prefers at the largest amount of data.
    frames : further frames by name. alone : models whose method learns nothing from data.
    """

    answer: Sequence[AnswerSentence] = ()
    cells: pd.DataFrame
    naive: Mapping[str, float]
    models: pd.DataFrame
    horizon: pd.DataFrame = field(default_factory=empty_frame("model", "N_D", "seed", "source", "ahead", "mean", "p90"))
    over_time: pd.DataFrame = field(default_factory=empty_frame("run", "t", "model", "N_D", "seed", "source", "error"))
    commands: pd.DataFrame = field(default_factory=empty_frame("run", "t"))
    snapshots: Sequence[WindowSnapshot] = ()
    tracks: pd.DataFrame = field(default_factory=empty_frame("run", "set", "north", "east"))
    envelope: pd.DataFrame = field(default_factory=empty_frame("set", "quantity", "unit", "min", "mean", "max"))
    factors: pd.DataFrame = field(default_factory=empty_frame("model", "path", "group", "factor"))
    trials: pd.DataFrame = field(default_factory=empty_frame(*TRIAL_COLUMNS))
    repairs: pd.DataFrame = field(default_factory=empty_frame("kind", "column", "count", "note"))
    best: str = ""
    alone: Collection[str] = ()
    frames: Mapping[str, pd.DataFrame] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Give the model without physics its name for people, wherever a model is named."""
        for name in ("cells", "models", "factors", "trials", "horizon", "over_time"):
            object.__setattr__(self, name, name_models(getattr(self, name)))
        object.__setattr__(self, "frames", {name: name_models(frame) for name, frame in self.frames.items()})
        object.__setattr__(self, "alone", {model_text(model) for model in self.alone})

    def sentence_of(self, figure: str, otherwise: str = "") -> str:
        """First sentence of the answer that a figure carries; something else where there is none."""
        return next((one.text for one in self.answer if one.figure == figure), otherwise)

    def frame(self, name: str) -> pd.DataFrame:
        """One of `frames`; without rows and columns where there is none of that name."""
        return self.frames.get(name, pd.DataFrame())


def name_models(frame: pd.DataFrame) -> pd.DataFrame:
    """A frame whose models have their names for people."""
    columns = [column for column in MODEL_NAME_COLUMNS if column in frame]
    return frame.assign(**{column: frame[column].map(model_text, na_action="ignore") for column in columns})
