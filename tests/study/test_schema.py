"""Keys of a study document: those of version 0.1, and times in whole steps."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipid.errors import DocumentError
from shipid.study.plan import read_plan
from shipid.study.schema import Prediction

FOLDER = Path(__file__).parents[1] / "bad" / "studies"


def test_a_document_of_version_0_1_is_answered_as_a_whole(tmp_path: Path) -> None:
    """Every old key in one message, a line each with its file and path, and what to write instead."""
    text = (FOLDER / "recipe-of-old.toml").read_text()
    text = text.replace("[[truth.manoeuvre]]\n", "").replace("ahead = 5.0", 'horizon = 10\nstep = 0.5\nmethod = "rk4"')
    text += '\n[family.identify]\nparameters = ["hull.derivatives.N_ur"]\n'
    file = tmp_path / "old.toml"
    file.write_text(text)
    with pytest.raises(DocumentError) as caught:
        read_plan(file)
    lines = str(caught.value).split("\n")
    assert [line.removeprefix(f"{file}: ").partition(": ")[0] for line in lines] == [
        "recipe",
        "prediction.horizon",
        "prediction.method",
        "family.wrong.identify",
    ]
    assert all(line.startswith(f"{file}: ") for line in lines)
    assert "write ahead = 5, in seconds" in lines[1]


def test_the_remedy_for_a_recipe_works(tmp_path: Path) -> None:
    """What the message of an old recipe says, done: the document is one of today."""
    text = (FOLDER / "recipe-of-old.toml").read_text()
    file = tmp_path / "mended.toml"
    file.write_text(text.replace('[recipe]\nkind = "fast"', '[[method]]\nname = "path-drawn"\nkind = "path-drawn"'))
    assert read_plan(file).methods[0].kind == "path-drawn"


@pytest.mark.parametrize(("ahead", "step", "steps"), [(30.0, 1.0, 30), (10.0, 1 / 3, 30), (5.0, 0.3333333, 15)])
def test_a_horizon_is_whole_steps(ahead: float, step: float, steps: int) -> None:
    assert Prediction(ahead=ahead, step=step, interval=1.0).horizon == steps
