"""Answer one question: how good must the physics be, and how much data is needed, to predict a ship's trajectory.

It declares ships as symbols, degrades them on purpose, compensates them with data, and maps what error remains.
It is not a simulator with a user interface, not a controller, and not a deep-learning framework.
"""

from __future__ import annotations

import logging
from importlib import import_module
from typing import TYPE_CHECKING

from shipid.version import __version__ as __version__

if TYPE_CHECKING:  # for editors and type checkers; at run time a name is imported when it is first used
    # isort: off
    from shipid import figures as figures
    from shipid.answer.compare import Comparison as Comparison, compare as compare
    from shipid.answer.methods import compare_methods as compare_methods, score as score
    from shipid.answer.pages import write_pages as write_pages
    from shipid.answer.start import events as events, run as run
    from shipid.data.checks import check_dataset as check_dataset
    from shipid.data.dataset import Dataset as Dataset, read_dataset as read_dataset, write_dataset as write_dataset
    from shipid.data.windows import Instants as Instants, Windows as Windows, cut_windows as cut_windows
    from shipid.engine.rollout import Trajectories as Trajectories, rollout as rollout
    from shipid.errors import ShipidError as ShipidError
    from shipid.foundations.predictions import prediction_table as prediction_table
    from shipid.hybrid.alone import Alone as Alone
    from shipid.hybrid.kernel import Kernel as Kernel
    from shipid.hybrid.learned_force import LearnedForce as LearnedForce
    from shipid.hybrid.method import Case as Case, FitResult as FitResult, Task as Task
    from shipid.hybrid.path_trained import PathTrained as PathTrained
    from shipid.hybrid.physics import Physics as Physics
    from shipid.identification.outcome import run_identification as run_identification
    from shipid.identification.settings import Identify as Identify
    from shipid.identification.solve import identify as identify
    from shipid.logs.guess.columns import guess as guess
    from shipid.logs.importing import import_log as import_log
    from shipid.logs.mapping import read_mapping as read_mapping
    from shipid.metrics import position_error as position_error
    from shipid.predictor import Predictor as Predictor, fit as fit
    from shipid.simulation.families import (
        VesselFamily as VesselFamily,
        read_families as read_families,
        read_family as read_family,
        verify_lock as verify_lock,
    )
    from shipid.simulation.measured import measure_standard as measure_standard
    from shipid.simulation.perform import perform_manoeuvres as perform_manoeuvres
    from shipid.simulation.standard import define_standard as define_standard
    from shipid.simulation.truth import Truth as Truth, simulate_truth as simulate_truth
    from shipid.study.plan import Plan as Plan, read_plan as read_plan
    from shipid.study.results import Results as Results, read_cells as read_cells, read_results as read_results
    from shipid.study.run import run_study as run_study
    from shipid.study.screen import screen as screen
    from shipid.study.windows import windows as windows
    from shipid.vessel.load import Vessel as Vessel, load_vessel as load_vessel
    from shipid.vessel.perturb import (
        Family as Family,
        Perturbation as Perturbation,
        Variant as Variant,
        draw_members as draw_members,
        draw_variant as draw_variant,
    )


_PUBLIC = {
    "Alone": "shipid.hybrid.alone",
    "Case": "shipid.hybrid.method",
    "Comparison": "shipid.answer.compare",
    "Dataset": "shipid.data.dataset",
    "Family": "shipid.vessel.perturb",
    "FitResult": "shipid.hybrid.method",
    "Identify": "shipid.identification.settings",
    "Instants": "shipid.data.windows",
    "Kernel": "shipid.hybrid.kernel",
    "LearnedForce": "shipid.hybrid.learned_force",
    "PathTrained": "shipid.hybrid.path_trained",
    "Perturbation": "shipid.vessel.perturb",
    "Physics": "shipid.hybrid.physics",
    "Plan": "shipid.study.plan",
    "Predictor": "shipid.predictor",
    "Results": "shipid.study.results",
    "ShipidError": "shipid.errors",
    "Task": "shipid.hybrid.method",
    "Trajectories": "shipid.engine.rollout",
    "Truth": "shipid.simulation.truth",
    "Variant": "shipid.vessel.perturb",
    "Vessel": "shipid.vessel.load",
    "VesselFamily": "shipid.simulation.families",
    "Windows": "shipid.data.windows",
    "check_dataset": "shipid.data.checks",
    "compare": "shipid.answer.compare",
    "compare_methods": "shipid.answer.methods",
    "cut_windows": "shipid.data.windows",
    "draw_variant": "shipid.vessel.perturb",
    "events": "shipid.answer.start",
    "figures": "shipid",
    "fit": "shipid.predictor",
    "guess": "shipid.logs.guess.columns",
    "identify": "shipid.identification.solve",
    "import_log": "shipid.logs.importing",
    "load_vessel": "shipid.vessel.load",
    "measure_standard": "shipid.simulation.measured",
    "draw_members": "shipid.vessel.perturb",
    "perform_manoeuvres": "shipid.simulation.perform",
    "position_error": "shipid.metrics",
    "prediction_table": "shipid.foundations.predictions",
    "read_cells": "shipid.study.results",
    "read_families": "shipid.simulation.families",
    "verify_lock": "shipid.simulation.families",
    "read_family": "shipid.simulation.families",
    "read_dataset": "shipid.data.dataset",
    "read_mapping": "shipid.logs.mapping",
    "read_plan": "shipid.study.plan",
    "read_results": "shipid.study.results",
    "rollout": "shipid.engine.rollout",
    "run": "shipid.answer.start",
    "run_identification": "shipid.identification.outcome",
    "run_study": "shipid.study.run",
    "score": "shipid.answer.methods",
    "screen": "shipid.study.screen",
    "simulate_truth": "shipid.simulation.truth",
    "define_standard": "shipid.simulation.standard",
    "windows": "shipid.study.windows",
    "write_dataset": "shipid.data.dataset",
    "write_pages": "shipid.answer.pages",
}
"""Public name -> module that defines it."""

__all__ = sorted(_PUBLIC)

logging.getLogger(__name__).addHandler(logging.NullHandler())  # silent until the user asks


def __getattr__(name: str) -> object:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'shipid' has no attribute {name!r}; public names: {', '.join(__all__)}")
    if _PUBLIC[name] == __name__:
        return import_module(f"{__name__}.{name}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
