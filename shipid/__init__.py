"""Answer one question: how good must the physics be, and how much data is needed, to predict a ship's trajectory.

It declares ships as symbols, degrades them on purpose, compensates them with data, and maps what error remains.
It is not a simulator with a user interface, not a controller, and not a deep-learning framework.
"""

from importlib import import_module

__version__ = "0.1.0"

_PUBLIC = {
    "load_vessel": "shipid.vessel.load",
    "Vessel": "shipid.vessel.load",
    "rollout": "shipid.engine.rollout",
    "read_dataset": "shipid.data.dataset",
    "import_log": "shipid.logs.importing",
    "cut_windows": "shipid.data.windows",
    "identify": "shipid.identification.solve",
    "Identify": "shipid.identification.settings",
    "Predictor": "shipid.predictor",
    "run_study": "shipid.study.run",
    "ShipidError": "shipid.errors",
}

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> object:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'shipid' has no attribute {name!r}; public names: {', '.join(__all__)}")
