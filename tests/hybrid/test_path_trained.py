"""The trained path: its defaults are those of the method document, and what it holds of the past."""

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
        "mirror": False,
        "groups": None,
        "at_once": 1,
    }
