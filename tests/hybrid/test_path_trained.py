"""The trained path: its defaults are those of the method document, and what it holds of the past."""

from shipid.hybrid.features import Memory
from shipid.hybrid.path_trained import PathTrained


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
        "memory": {"history": (), "turned": (), "error": (), "observer": False},
    }


def test_its_past_is_that_of_its_memory() -> None:
    assert PathTrained().past == 0.0
    assert PathTrained(memory=Memory(history=(4.0,), error=(8.0, 2.0))).past == 8.0


def test_only_ranges_are_searched() -> None:
    assert PathTrained().varied() == ("layers", "units", "input_dropout", "hidden_dropout", "learning_rate")
    assert PathTrained(layers=2, units=10, input_dropout=0.0, hidden_dropout=0.0, learning_rate=1e-3).varied() == ()
    assert PathTrained().num_chosen() == 1
