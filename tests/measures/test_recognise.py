"""From columns to a record: which angle is the helm, and which way it turns the ship."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.errors import DataError
from shipid.measures.recognise import record_of
from shipid.measures.record import Record
from tests.measures.sailed import SAILED, every


def columns(record: Record) -> dict[str, np.ndarray]:
    return {name: getattr(record, name) for name in ("t", "north", "east", "psi", "u", "v", "r")}


@pytest.mark.parametrize("kind", [kind for kind in SAILED if kind not in ("stop", "reverse-spiral")])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_helm_is_counted_by_what_it_does(kind: str, sign: float) -> None:
    record = every(SAILED[kind](), 0.5)
    angles = {"rudder.delta": sign * record.helm, "bow.alpha": -sign * record.helm, "idle.alpha": 0 * record.helm}
    np.testing.assert_allclose(record_of(columns(record) | angles).helm, record.helm)


def test_shafts_that_run_and_columns_that_lack() -> None:
    record = every(SAILED["stop"](), 0.5)
    given = columns(record) | {"port.n": record.shaft, "bow.n": 0 * record.t, "actual.port.n": 9 + 0 * record.t}
    np.testing.assert_array_equal(record_of(given).shaft, record.shaft)
    assert record_of(columns(record)).shaft is None
    del given["psi"]
    with pytest.raises(DataError, match="psi: missing column"):
        record_of(given)
