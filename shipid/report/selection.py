"""Which models, data sets and runs a figure draws, how each model looks, and how seeds become one line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd

from shipid.report.content import DATA_DRIVEN, NO_PHYSICS, ReportContent, rows_as_tuples
from shipid.report.figure import INK, MARKERS, MUTED, Chip, category_colour, colour_level, even_places

FEW_MODELS = 6  # up to so many models each has a separate colour and is drawn in every figure
MOST_MODELS = 12  # with more, figures of all models leave out the methods that the study does not judge by
FEW_RUNS = 40  # test runs in the error-over-time figure and the window browser
FAMILY_DASHES = ("solid", "dashdot", "longdash", "longdashdot")
PHYSICS_ERRORS = {"A_end": "H_end", "A_end_90": "H_end_90", "A": "H", "A_90": "H_90", "A_rms": "rms"}
"""Errors of the physics alone -> those of a prediction: at N_D = 0 they are the same."""
SOURCE_DASHES = {"cooperative": "solid", "physics": "dot", "naive": "dash"}


@dataclass(frozen=True)
class Style:
    """How one model is drawn: colour (CSS variable), marker and dash of its family, line width [px]."""

    colour: str
    symbol: str
    width: float
    dash: str = "solid"


def spread_items(items: Sequence[str], count: int) -> list[str]:
    """At most `count` items at even distances, first and last included."""
    return [items[i] for i in even_places(len(items), count)]


@lru_cache(maxsize=4)  # every figure asks for it
def models_by_accuracy(content: ReportContent) -> pd.DataFrame:
    """One row per model: model, family, A [m] (NaN without physics); physics by rising A, those without last."""
    known = content.models[["model", "family", "A"]]
    trained = content.cells[["model", "family", "A"]]
    joined = pd.concat([known, trained]).astype({"model": str, "family": str, "A": float})
    frame = joined.groupby("model", sort=False, as_index=False).agg({"family": "first", "A": "first"})
    frame["last"] = frame.family == DATA_DRIVEN
    return frame.sort_values(["last", "A"], kind="stable", ignore_index=True).drop(columns="last")


def same_physics(frame: pd.DataFrame) -> pd.Series[bool]:
    """Which rows of `models_by_accuracy` have the physics of one before, and another method: the same family and A."""
    return frame.A.notna() & frame.duplicated(["family", "A"])


@lru_cache(maxsize=4)
def data_driven(content: ReportContent) -> str | None:
    """Name of the model without physics, if the study has one; the first of several."""
    frame = models_by_accuracy(content)
    names = frame.model[frame.family == DATA_DRIVEN]
    return None if names.empty else str(names.iloc[0])


def drawn_source(content: ReportContent, model: str, source: str) -> str:
    """Source that a path is called by: `physics`, too, where the method of a cell learns nothing from data."""
    return "physics" if source == "cooperative" and model in content.alone else source


def nothing_learns(content: ReportContent) -> bool:
    """Whether the method of every cell learns nothing from data, so that H is A and nothing is compensated."""
    return bool(len(content.alone)) and bool(content.cells.model.isin(list(content.alone)).all())


def in_words(model: str) -> str:
    """Name of a model in a sentence: without quotes `no physics errs most` would say that no model does."""
    return f'"{model}"' if model.partition(" + ")[0] == NO_PHYSICS else model


def overview_models(content: ReportContent) -> pd.DataFrame:
    """Rows of `models_by_accuracy` that overviews draw: of many methods the one judged, and all without physics."""
    frame = models_by_accuracy(content)
    frame = frame[frame.model.isin(content.cells.model)]
    if len(frame) > MOST_MODELS:
        frame = frame[frame.model.isin(content.models.model) | (frame.family == DATA_DRIVEN)]
    return frame.reset_index(drop=True)


def family_words(content: ReportContent, families: Iterable[str]) -> str:
    """What each family of models is, as sentences; empty where that is not known."""
    known = content.models.dropna(subset="description").groupby("family")["description"].first()
    named = [name for name in dict.fromkeys(families) if name != DATA_DRIVEN and known.get(name)]
    return "".join(f" {name}: {known[name]}{'.' * (known[name][-1] not in '.?!')}" for name in named)


def words_on_left_out(content: ReportContent) -> str:
    """Sentence on the models that `overview_models` leaves out; empty if there are none."""
    shown, total = len(overview_models(content)), content.cells.model.nunique()
    words = f" Of {total} models, the {shown} of the method that the study judges by and without physics are drawn."
    return words if shown < total else ""


@lru_cache(maxsize=4)
def close_up_models(content: ReportContent) -> list[str]:
    """Models drawn in close-ups: all of a few, else some spread over A, no physics and the best in validation."""
    frame = models_by_accuracy(content)
    judged = frame.model[frame.A.notna() & frame.model.isin(content.models.model)]
    kept = {*spread_items([*judged], FEW_MODELS - 2), data_driven(content), content.best}
    return [str(name) for name in frame.model if len(frame) <= FEW_MODELS or name in kept]


def accuracy_range(content: ReportContent) -> tuple[float, float] | None:
    """Smallest and largest A [m] if models are coloured by A; None if there are few and each has a separate colour."""
    frame = models_by_accuracy(content)
    physics = frame.A[frame.A.notna() & (frame.family != DATA_DRIVEN)]
    return None if len(frame) <= FEW_MODELS or physics.empty else (float(physics.min()), float(physics.max()))


@lru_cache(maxsize=4)  # every figure asks for it
def model_styles(content: ReportContent) -> Mapping[str, Style]:
    """Style of every model: colour by A for many models, Okabe-Ito for few, thick ink for no physics."""
    frame, span = models_by_accuracy(content), accuracy_range(content)
    kinds = [kind for kind in pd.unique(frame.family) if kind != DATA_DRIVEN]
    result = _styles_without_physics([str(name) for name in frame.model[frame.family.eq(DATA_DRIVEN)]])
    for index, (row, again) in enumerate(zip(rows_as_tuples(frame), same_physics(frame), strict=True)):
        if row.family != DATA_DRIVEN:
            # A is unknown where the physics diverged. Of several methods on one model the first marker is filled.
            known = span is not None and np.isfinite(row.A)
            shade = f"var(--scale-{colour_level(row.A, span)})" if known and span else MUTED
            kind = kinds.index(row.family)
            symbol = MARKERS[kind % len(MARKERS)] + "-open" * bool(span and again)
            colour = category_colour(index) if span is None else shade
            result[str(row.model)] = Style(colour, symbol, 2.0, FAMILY_DASHES[kind % len(FAMILY_DASHES)])
    return result


@lru_cache(maxsize=4)
def close_styles(content: ReportContent) -> Mapping[str, Style]:
    """Style of the models of a close-up: a colour and a marker each; no physics in ink."""
    of_family = dict(zip(*models_by_accuracy(content)[["model", "family"]].to_numpy().T, strict=True))
    physics = [name for name in close_up_models(content) if of_family[name] != DATA_DRIVEN]
    result = _styles_without_physics([name for name in close_up_models(content) if name not in physics])
    for index, name in enumerate(physics):
        symbol = MARKERS[index % len(MARKERS)]
        result[name] = Style(category_colour(index), symbol, 2.0)
    return result


def _styles_without_physics(names: Sequence[str]) -> dict[str, Style]:
    """Ink: thick for the first model without physics, thin and with other markers for others."""
    thin = [Style(INK, f"{symbol}-open", 1.5) for symbol in MARKERS]
    return {name: thin[i % len(thin)] if i else Style(INK, "x", 3.0) for i, name in enumerate(names)}


def model_chips(names: Sequence[str], looks: Mapping[str, Style], words: Mapping[str, str] | None = None) -> list[Chip]:
    """Legend of models: each with its colour, line width and marker, by its name or other words."""
    return [
        Chip(f"model:{name}", (words or {}).get(name, name), look.colour, look.dash, look.width, look.symbol)
        for name in names
        for look in [looks[name]]
    ]


def figure_sizes(values: pd.Series[int], count: int = 3) -> list[int]:
    """Small, middle and large N_D among those present; physics alone (N_D = 0) counts only if there is nothing else."""
    present = sorted({int(value) for value in values if value > 0}) or [0]
    return [present[i] for i in even_places(len(present), count)]


def over_seeds(frame: pd.DataFrame, by: list[str], values: list[str]) -> pd.DataFrame:
    """Mean over seeds (and over every other column that `by` does not name), NaN rows left out of the mean."""
    return frame.groupby(by, sort=True, as_index=False)[values].mean()


def errors_over_seeds(content: ReportContent) -> pd.DataFrame:
    """Cells that gave a result, by model and N_D: mean over seeds of H_end, H_end_90, H, H_90, rms [m]."""
    good = content.cells[content.cells.status.eq("ok") & content.cells.H.notna()]
    return over_seeds(good, ["model", "N_D"], list(PHYSICS_ERRORS.values()))


def errors_alone(content: ReportContent) -> pd.DataFrame:
    """Errors of the physics alone by model, as of `errors_over_seeds` at N_D = 0; not where the data identify it."""
    known = content.models.family[content.models.A.notna()]
    fixed = content.cells[content.cells.family.isin(known) & content.cells.A.notna()].drop_duplicates("model")
    return fixed[["model", *PHYSICS_ERRORS]].rename(columns=PHYSICS_ERRORS).assign(N_D=0)
