"""Options that several commands share."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from shipid.errors import DocumentError, ShipidError


def test_changes_are_toml_or_text() -> None:
    from shipid.cli.options import parsed

    assert parsed(None) == {}
    assert parsed(["grid.N_D=[10, 30]", "method.0.kind=alone", "a=1e-3"]) == {
        "grid.N_D": [10, 30],
        "method.0.kind": "alone",
        "a": 1e-3,
    }
    for wrong in ("grid.N_D", "=3"):
        with pytest.raises(DocumentError, match="write --set path=value"):
            parsed([wrong])


def test_pairs_split_at_the_last_equals_sign() -> None:
    """A selection of paths may hold a comparison."""
    from shipid.cli.options import pairs

    assert pairs(["hull.*[order >= 3]=0.2"], "--prior", "paths=0.3") == {"hull.*[order >= 3]": 0.2}


def test_stem_keeps_the_dot_of_a_name() -> None:
    from shipid.cli.options import stem

    names = ("gunnerus-28.9", "a/b.toml", Path("x/log.parquet"))
    assert [stem(name) for name in names] == ["gunnerus-28.9", "b", "log"]


def test_the_command_line_can_be_typed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    import shlex

    from shipid.cli.options import command_line

    monkeypatch.setattr(sys, "argv", ["/usr/bin/shipid", "manoeuvre", "my ship.toml", "zigzag"])
    assert shlex.split(command_line()) == ["shipid", "manoeuvre", "my ship.toml", "zigzag"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((None, "zigzag", None), "give --level too"),
        ((None, None, 0.1), "give --level too"),
        ((0.9, None, 0.0), "--adaptive: 0 is no rate"),
        ((0.9, None, float("nan")), "--adaptive: nan is no rate"),
    ],
)
def test_a_band_needs_a_level_and_a_rate(given: tuple[float | None, str | None, float | None], message: str) -> None:
    from shipid.cli.options import check_band

    check_band(0.9, "zigzag", 0.02)
    with pytest.raises(ShipidError, match=message):
        check_band(*given)
