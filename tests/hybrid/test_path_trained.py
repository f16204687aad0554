"""The trained path: its defaults are those of the method document, and what it holds of the past."""

import logging
from typing import Any

import optuna

from shipid.hybrid.methods import METHODS
from shipid.hybrid.path_trained import PathTrained
from tests.hybrid.quick import small_world


class Rated(PathTrained):
    def suggest(self, trial: Any) -> None:
        trial.suggest_float("learning_rate", 1e-3, 1e-1, log=True)


def test_settings_that_suggest_leaves_out_are_in_the_middle_and_optuna_is_silent(monkeypatch):
    monkeypatch.setitem(METHODS, "rated", Rated)
    messages: list[logging.LogRecord] = []
    handler = logging.Handler()
    monkeypatch.setattr(handler, "emit", messages.append)
    optuna.logging.set_verbosity(optuna.logging.INFO)
    logging.getLogger("optuna").addHandler(handler)
    try:
        fitted = Rated(trials=2, epochs=2, units=(4, 9)).fit(small_world().task())["physics"]
    finally:
        logging.getLogger("optuna").removeHandler(handler)
    assert messages == []
    for row in fitted.trials:
        assert (row["params"]["layers"], row["params"]["units"], row["params"]["input_dropout"]) == (2, 6, 0.5)
    assert len({row["params"]["learning_rate"] for row in fitted.trials}) == 2


def test_the_trained_path_is_what_the_method_pins():
    assert PathTrained().model_dump() == {
        "trials": 50,
        "budget": None,
        "layers": (1, 3),
        "units": (10, 500),
        "input_dropout": (0.0, 1.0),
        "hidden_dropout": (0.0, 1.0),
        "learning_rate": (1e-5, 1e-1),
        "weight_decay": 0.0,  # Adam
        "epochs": 3000,
        "batch": 0,  # full
        "patience": 200,
        "memory": {"history": (), "turned": (), "positions": (), "states": (), "error": (), "observer": False},
        "at_once": 1,
    }
