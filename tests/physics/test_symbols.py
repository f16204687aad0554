from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any, get_args, get_type_hints

import casadi as ca
import pytest

from shipid.physics import TERMS, symbols
from shipid.physics.hull import resistance
from shipid.physics.symbols import types_of


def test_names_are_those_of_casadi() -> None:
    assert symbols.SX is ca.SX
    assert symbols.vertcat is ca.vertcat
    assert not hasattr(symbols, "__path__")  # CasADi is a package, this is none
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = symbols.no_such_name


@pytest.mark.parametrize(
    "function", {one for term in TERMS.values() for one in term.functions}, ids=lambda f: f.__name__
)
def test_types_of_every_function_of_shipid_are_read_without_casadi(function: Callable[..., Any]) -> None:
    """Only the type of symbols is another: units, marks and defaults are the same."""
    read = types_of(function)
    whole = get_type_hints(function, localns={"SX": ca.SX}, include_extras=True)
    assert read.keys() == whole.keys()
    assert [get_args(one)[1:] for one in read.values()] == [get_args(one)[1:] for one in whole.values()]
    assert "casadi" not in repr(read)


def test_users_need_no_name_of_casadi_to_have_their_types_read() -> None:
    """A copy of a module of shipid, and a function with the arguments of one, are terms of a user's file."""

    def drag(nu_r: SX, *, C: Annotated[SX, "kg"]) -> SX:  # type: ignore[name-defined]  # noqa: F821
        return C * nu_r

    @wraps(resistance, assigned=("__annotations__",))
    def half(nu_r: Any, **given: Any) -> Any:
        return resistance(nu_r, **given) / 2

    assert get_args(types_of(drag)["C"])[1:] == ("kg",)
    assert types_of(half) == types_of(resistance)


def test_a_type_that_is_none_is_named() -> None:
    def drag(nu_r: SX, *, C: Newton) -> SX:  # type: ignore[name-defined]  # noqa: F821
        return C * nu_r

    with pytest.raises(NameError, match="'Newton' is not defined"):
        types_of(drag)
