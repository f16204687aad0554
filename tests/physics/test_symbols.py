from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_args, get_type_hints

import casadi as ca
import pytest

from shipid.physics import TERMS
from shipid.physics.symbols import argument_types


@pytest.mark.parametrize(
    "function",
    sorted({one for term in TERMS.values() for one in term.functions}, key=lambda f: f.__name__),
    ids=lambda f: f.__name__,
)
def test_types_of_every_function_of_shipid_are_read_without_casadi(function: Callable[..., Any]) -> None:
    """Only the type of symbols is another: units, marks and defaults are the same."""
    read = argument_types(function)
    whole = get_type_hints(function, localns={"SX": ca.SX}, include_extras=True)
    assert read.keys() == whole.keys()
    assert [get_args(one)[1:] for one in read.values()] == [get_args(one)[1:] for one in whole.values()]
    assert "casadi" not in repr(read)


def test_a_type_that_is_none_is_named() -> None:
    def drag(nu_r: SX, *, C: Newton) -> SX:  # type: ignore[name-defined]  # noqa: F821
        return C * nu_r

    with pytest.raises(NameError, match="'Newton' is not defined"):
        argument_types(drag)
