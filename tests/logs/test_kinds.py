"""The name of a run says its kind, in several languages and styles."""

from __future__ import annotations

from typing import get_args

import pytest

from shipid.logs.kinds import COASTING, LOW_SPEED, MIXED, RANDOM, WORDS, kind_in_name
from shipid.logs.mapping import Manoeuvre


def test_a_mapping_takes_every_kind() -> None:
    assert set(get_args(Manoeuvre)) == set(WORDS)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("ZZ_10_10", "zigzag"),
        ("zigzag 3", "zigzag"),
        ("Zig-Zag20", "zigzag"),
        ("TC35stbd", "turning"),
        ("turning 4", "turning"),
        ("circle_port", "turning"),
        ("random07", RANDOM),
        ("Berthing3", LOW_SPEED),
        ("low speed 2", LOW_SPEED),
        ("docking_12", LOW_SPEED),
        ("coastdown 1", COASTING),
        ("crash-stop", "stop"),
        ("zigzag_20_20_1", "zigzag"),
        ("ZZ10-10", "zigzag"),
        ("TC35_2", "turning"),
        ("Drehkreis_35_1", "turning"),
        ("mixed 3", MIXED),
        ("freeDrive2", MIXED),
        ("run007", None),
        ("log", None),
        ("run 7", None),
        ("M001", None),
        ("stczz", None),
    ],
)
def test_names_say_the_kind(name: str, kind: str | None) -> None:
    assert kind_in_name(name) == kind
