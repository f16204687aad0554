"""What one imports: public names, their types, and what an installed shipid takes along."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import shipid
from shipid.document import bundled_folder


def test_the_wheel_takes_models_and_studies_along() -> None:
    """pyproject maps both folders to where `bundled_folder` looks first."""
    build = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    assert build["targets"]["wheel"]["force-include"] == {
        "models": "shipid/_bundled/models",
        "studies": "shipid/_bundled/studies",
    }


def test_what_is_installed_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid import document

    (tmp_path / "site" / "shipid" / "_bundled" / "models").mkdir(parents=True)
    (tmp_path / "site" / "models").mkdir()
    monkeypatch.setattr(document, "__file__", str(tmp_path / "site" / "shipid" / "document.py"))
    assert bundled_folder("models") == tmp_path / "site" / "shipid" / "_bundled" / "models"
    assert bundled_folder("studies") == tmp_path / "site" / "studies"


def test_public_names_load() -> None:
    for name in shipid.__all__:
        assert getattr(shipid, name) is not None
    with pytest.raises(AttributeError, match="public names: "):
        _ = shipid.nothing
    assert np.isfinite(len(shipid.__all__))
