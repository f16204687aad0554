"""The hyperparameter search: trials per cell, their states, the chosen values and the time they took."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from shipid.report.content import TRIAL, Floats, ReportContent
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, Trace, axis, label, layout, line, logarithmic
from shipid.report.palette import INK, MUTED, category
from shipid.report.section import Section
from shipid.report.selection import sizes
from shipid.report.tables import Cell, Table, duration, figure, text
from shipid.report.wording import counted, fixed, number, short

MOST_DOTS = 1200  # in one panel: more hide each other
MOST_CHOSEN = 200
BINS = 9  # of the middle line
WIDE = 3.0  # largest / smallest value from which an axis is logarithmic
MOST_DECADES = 4.0  # with a tick each: more have no room
CEILING = 4.0  # times the best of the cell: farther off is drawn here
FAILED = CEILING * 1.25  # where diverged trials lie
UNITS = {"delays": "s"}  # of hyperparameters; others have none
# The kinds of memory that a trial may have, by number.
MEMORIES = (
    "none", "the error of the physics", "that and history", "estimates of the observer", "everything",
    "history", "the error of the physics and estimates of the observer", "history and estimates of the observer",
)  # fmt: skip


def search(content: ReportContent) -> Figure | None:
    """Error of the trials over each searched hyperparameter; None without trials or without any."""
    names, frame = searched(content), _relative(content.trials)
    if not names or frame.empty:
        return None
    counts = sizes(frame.N_D) if frame.N_D.nunique() > 1 else []
    parts = [frame, *(frame[frame.N_D.eq(size)] for size in counts)]
    views = {
        str(i) if counts else "": [Panel(_panel(part, name, frame[name]), _caption(part, name)) for name in names]
        for i, part in enumerate(parts)
    }
    return Figure(
        id="search",
        title="Trials of the search",
        takeaway=_takeaway(frame, names),
        how="Each dot is a trial: the root of its validation error over the best of its cell; "
        f"{_thinned(frame)}{_stopped(frame)}diamonds are those whose networks the cell uses; those beyond "
        f"{CEILING:g} times lie at the upper edge, those that diverged above it. The line joins the medians of all "
        "that have a value. Rank correlation (Spearman) is taken within each cell, then averaged over cells: it sees "
        f"what rises or falls throughout, not an optimum in the middle.{_memories(frame, names)}",
        alternative="Dots of the relative validation error of trials over each hyperparameter; a table sums up.",
        height=270,
        views=views,
        controls=[Control("Manoeuvres, N_D", ["all", *map(str, counts)])] if counts else [],
        chips=_chips(frame),
    )


def table(content: ReportContent) -> Table | None:
    """Sum the trials up by N_D; None without trials."""
    frame, names = content.trials, searched(content)
    if frame.empty:
        return None
    passes = bool(frame.epochs.any())
    shares = {name: _yes_or_no(frame[name]) for name in names}
    rows = [_row(int(str(size)), mine, shares, passes) for size, mine in frame.groupby("N_D", sort=True)]
    chosen = [
        f"{'share of ' if share else ''}chosen {spoken(name)} [{unit_of(name)}]" for name, share in shares.items()
    ]
    headings = ["N_D [1]", "cells [1]", "trials [1]", "stopped [1]", "diverged [1]"]
    headings += [*(["epochs [1]"] if passes else []), "time [s]", "time per cell [s]", *chosen]
    takeaway = " ".join(part for part in (_counts(frame), _tried(frame, names)) if part)
    return Table("search-table", "The search by N_D", takeaway, headings, [True] * len(headings), rows)


def searched(content: ReportContent) -> list[str]:
    """Names of the searched hyperparameters: further columns of the trials that take more than one value."""
    frame = content.trials
    return [str(name) for name in frame.columns if name not in TRIAL and frame[name].nunique() > 1]


def spoken(name: str) -> str:
    """Name a hyperparameter as in a sentence."""
    return name.replace("_", " ")


def unit_of(name: str) -> str:
    """Return the unit of a hyperparameter; most have none."""
    return UNITS.get(name, "1")


def importance(frame: pd.DataFrame, name: str) -> float:
    """Rank correlation of the error with a hyperparameter within cells, mean over cells; NaN where nothing varies."""
    cells = frame[frame.value.notna() & frame[name].notna() & frame.cell.notna()].groupby("cell")
    cell, counts = cells.ngroup().to_numpy(), cells.size().to_numpy()
    x, y = cells[[name, "value"]].rank().to_numpy(dtype=float).T - (counts[cell] + 1) / 2
    xy, xx, yy = (np.bincount(cell, product, len(counts)) for product in (x * y, x * x, y * y))
    judged = (counts > 2) & (xx > 0) & (yy > 0)
    return float((xy[judged] / np.sqrt(xx * yy)[judged]).mean()) if judged.any() else math.nan


def _relative(trials: pd.DataFrame) -> pd.DataFrame:
    """Trials with `ratio` [1]: the root of the value over the best of the cell."""
    good = trials.value.where(trials.state.ne("diverged")).astype(float)
    best = good.where(trials.state.eq("complete")).groupby(trials.cell).transform("min")
    return trials.assign(value=good, ratio=np.sqrt(good / best))


def _chips(frame: pd.DataFrame) -> list[Chip]:
    """Return the legend; states that no trial has are left out."""
    states = {
        "complete": Chip("state:complete", "trial", MUTED, "none", symbol="circle"),
        "stopped": Chip("state:stopped", "stopped early", category(4), "none", symbol="triangle-up"),
        "diverged": Chip("state:diverged", "diverged", "var(--bad)", "none", symbol="x"),
    }
    chips = [chip for state, chip in states.items() if frame.state.eq(state).any()]
    return [*chips, Chip("chosen", "chosen", category(0), "none", symbol="diamond"), Chip("median", "median", INK)]


def _panel(frame: pd.DataFrame, name: str, every: pd.Series[float]) -> Plot:
    """One hyperparameter; its axis holds `every` value, so that it stays when N_D changes."""
    traces = []
    looks = {
        "complete": {"symbol": "circle", "size": 4, "color": MUTED, "opacity": 0.45},
        "stopped": {"symbol": "triangle-up", "size": 5, "color": category(4), "opacity": 0.6},
        "diverged": {"symbol": "x", "size": 6, "color": "var(--bad)", "opacity": 0.7},
    }
    chosen = frame.chosen.astype(bool)
    others, best = _some(frame[~chosen], MOST_DOTS), _some(frame[chosen], MOST_CHOSEN)
    for state, marker in looks.items():
        traces.append(_dots(others[others.state == state], name, state, [f"state:{state}"], marker))
    diamond = {"symbol": "diamond", "size": 7, "color": category(0), "opacity": 0.8}
    middle = _medians(frame[frame.ratio.notna()], name)
    if len(middle):
        traces.append(
            line("median", middle[:, 0], middle[:, 1], ["median"], "times the best", line={"color": INK, "width": 2.5})
        )
    traces.append(_dots(best, name, "chosen", ["chosen"], diamond))
    return Plot(traces, _frame(name, every))


def _dots(mine: pd.DataFrame, name: str, what: str, keys: list[str], marker: dict[str, Any]) -> Trace:
    ratio = mine.ratio.to_numpy(dtype=float)
    y = np.where(np.isnan(ratio), FAILED, np.minimum(ratio, CEILING))
    trace = line(what, mine[name].to_numpy(dtype=float), np.round(y, 3), keys, mode="markers", marker=marker)
    known = "" if what == "diverged" else ", %{y:.2f} times the best of its cell"
    value = f"{label(spoken(name))} %{{x:.3g}}" + (f" {UNITS[name]}" if name in UNITS else "")
    trace["hovertemplate"] = f"{label(what)}: {value}{known}<extra></extra>"
    return trace


def _some(frame: pd.DataFrame, most: int) -> pd.DataFrame:
    """Return at most `most` trials, evenly spread over the rows."""
    return frame.iloc[np.linspace(0, len(frame) - 1, min(len(frame), most)).round().astype(int)]


def _thinned(frame: pd.DataFrame) -> str:
    most = MOST_DOTS + MOST_CHOSEN
    return f"of many, at most {most:,} are drawn in a panel; " if len(frame) > most else ""


def _stopped(frame: pd.DataFrame) -> str:
    early = frame.state.eq("stopped").any()
    return "triangles are those that a part of the windows judged, and that were not among the best; " if early else ""


def _memories(frame: pd.DataFrame, names: list[str]) -> str:
    """Sentence on what the numbers of `memory` mean, if it is searched."""
    tried = sorted({int(number) for number in frame.memory.dropna()}) if "memory" in names else []
    words = [f"{number} {MEMORIES[number]}" for number in tried]
    return f" Memory: {', '.join(words)}." if words else ""


def _medians(frame: pd.DataFrame, name: str) -> Floats:
    """Median ratio per value of a hyperparameter, or of `BINS` parts of them where there are many: (n, 2)."""
    values = frame[name].astype(float)
    if frame.empty or values.nunique() < 2:
        return np.empty((0, 2))
    groups = values if values.nunique() <= BINS else values.rank(pct=True).mul(BINS).apply(np.ceil)
    medians = pd.DataFrame({"x": values, "y": frame.ratio}).groupby(groups).median().sort_values("x")
    points: Floats = np.minimum(medians.to_numpy(dtype=float), [np.inf, CEILING])
    return points


def _frame(name: str, every: pd.Series[float]) -> dict[str, Any]:
    low, high = float(every.min()), float(every.max())
    title = f"{label(spoken(name))} [{unit_of(name)}]"
    room = 0.04
    if _yes_or_no(every):
        x = axis(label(spoken(name)), range=[-0.3, 1.3], tickvals=[0, 1], ticktext=["no", "yes"])
    elif low > 0 and high / low > WIDE:
        ends = np.log10([low, high])
        decades = float(np.ptp(ends))
        span = [float(ends[0] - room * decades), float(ends[1] + room * decades)]
        x = logarithmic(title, (1,) if decades > 1.5 else (1, 2, 3, 5), range=span)
        each = math.ceil(decades / MOST_DECADES)
        x |= {name: x[name][::each] for name in ("tickvals", "ticktext")} if each > 1 else {}
    else:
        x = axis(title, range=[low - room * (high - low), high + room * (high - low)], nticks=6)
        counts = sorted(set(every.dropna()))
        if len(counts) <= 6 and all(count == round(count) for count in counts):
            x |= {"tickvals": counts}
    ticks: dict[str, Any] = {
        "tickvals": [1, 1.5, 2, 3, CEILING, FAILED],
        "ticktext": ["1", "1.5", "2", "3", f"≥{CEILING:g}", "div."],
    }
    y = logarithmic("error / best of cell [1]", range=[-0.02, math.log10(FAILED) + 0.04], **ticks)
    return layout(x, y, hovermode="closest")


def _caption(frame: pd.DataFrame, name: str) -> str:
    correlation = importance(frame, name)
    return f"rank correlation {fixed(correlation, 2)}" if math.isfinite(correlation) else "no rank correlation"


def _yes_or_no(values: pd.Series[float]) -> bool:
    return set(values.dropna()) == {0.0, 1.0}


def _counts(frame: pd.DataFrame) -> str:
    stopped, diverged = (int(frame.state.eq(name).sum()) or "none" for name in ("stopped", "diverged"))
    text = f"{counted(len(frame), 'trial')} in {counted(frame.cell.nunique(), 'cell')}: {stopped} stopped early, "
    return f"{text}{diverged} diverged; {duration(float(frame.seconds.sum()))} of training."


def _tried(frame: pd.DataFrame, names: list[str]) -> str:
    """Return the range of each hyperparameter over the trials, as text."""
    ranges = []
    for name in names:
        low, high = float(frame[name].min()), float(frame[name].max())
        unit = f" {UNITS[name]}" if name in UNITS else ""
        values = "yes or no" if _yes_or_no(frame[name]) else f"{short(low)} to {short(high)}{unit}"
        ranges.append(f"{spoken(name)} {values}")
    return f"Tried: {', '.join(ranges)}." if ranges else ""


def _takeaway(frame: pd.DataFrame, names: list[str]) -> str:
    """Return the median ratio of a trial to the best of its cell, and the hyperparameter most correlated with it."""
    if frame.ratio.isna().all():
        return f"None of {counted(len(frame), 'trial')} ended with a value."
    text = f"The median error of a trial is {number(float(frame.ratio.median()))} times that of the best of its cell"
    correlations = {name: importance(frame, name) for name in names}
    correlations = {name: value for name, value in correlations.items() if math.isfinite(value)}
    if correlations:
        most = max(correlations, key=lambda name: abs(correlations[name]))
        text += f"; the error goes most with {spoken(most)}, rank correlation {fixed(correlations[most], 2)}"
    return f"{text}."


def _row(size: int, mine: pd.DataFrame, shares: dict[str, bool], passes: bool) -> list[Cell]:
    counts = [mine.cell.nunique(), len(mine), int(mine.state.eq("stopped").sum()), int(mine.state.eq("diverged").sum())]
    seconds = float(mine.seconds.sum())
    numbers = [size, *counts, *([int(mine.epochs.sum())] if passes else [])]
    chosen = mine[mine.chosen.astype(bool)]
    choices = [_choice(chosen[name], share) for name, share in shares.items()]
    return [*(figure(value, 0) for value in numbers), figure(seconds, 1), figure(seconds / counts[0], 1), *choices]


def _choice(chosen: pd.Series[float], share: bool) -> Cell:
    """Smallest, middle and largest chosen value, or the share of yes."""
    values = chosen.astype(float).dropna()
    if values.empty:
        return text(None)
    if share:
        return figure(values.mean(), 2)
    low, middle, high = (float(value) for value in values.quantile([0.0, 0.5, 1.0]))
    return Cell(" / ".join(short(value) for value in (low, middle, high)), middle)


SECTION = Section(
    "The search",
    draw=lambda content: (search(content), table(content)),
    needs=("trials",),
    anchors=("search", "search-table"),
)
