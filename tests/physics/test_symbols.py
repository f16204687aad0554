from __future__ import annotations

from typing import Annotated, get_args, get_type_hints

import casadi as ca
import pytest

from shipid.physics import symbols
from shipid.physics.hull import resistance
from shipid.physics.symbols import types_of


def test_names_are_those_of_casadi() -> None:
    assert symbols.SX is ca.SX
    assert symbols.vertcat is ca.vertcat
    assert not hasattr(symbols, "__path__")  # CasADi is a package, this is none
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = symbols.no_such_name


def test_types_of_a_function_of_shipid_are_read_without_casadi() -> None:
    """Only the type of symbols is another: units, marks and defaults are the same."""
    read = types_of(resistance)
    whole = get_type_hints(resistance, localns={"SX": ca.SX}, include_extras=True)
    assert read.keys() == whole.keys()
    assert [get_args(one)[1:] for one in read.values()] == [get_args(one)[1:] for one in whole.values()]
    assert ca.SX not in read.values()


def test_a_type_that_a_user_forgot_to_import_is_missing() -> None:
    def drag(nu_r: SX, *, C: Annotated[SX, "kg"]) -> SX:  # type: ignore[name-defined]  # noqa: F821
        return C * nu_r

    with pytest.raises(NameError, match="'SX' is not defined"):
        types_of(drag)
