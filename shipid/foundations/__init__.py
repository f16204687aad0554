"""Physics of others, by the key of a `[[family]]` that names it: to add one, write its file and name it here."""

from __future__ import annotations

from shipid.foundations.fmu import SimulatorFmu
from shipid.foundations.function import SimulatorFunction
from shipid.foundations.predictions import PredictionTable
from shipid.hybrid.simulated import NamedSimulator

SIMULATORS: dict[str, type[NamedSimulator]] = {
    "predictions": PredictionTable,
    "function": SimulatorFunction,
    "fmu": SimulatorFmu,
}
"""Key of a family -> simulator: its `read` gives the simulators that the value of the key names."""
