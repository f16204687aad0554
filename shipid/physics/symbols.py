"""CasADi, imported when it is first used: to read and check a vessel takes no more than the signatures of its terms."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, get_type_hints

from shipid.users import of_users

if TYPE_CHECKING:
    from casadi import *  # noqa: F403
else:

    def __getattr__(name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        import casadi

        globals()[name] = value = getattr(casadi, name)
        return value


class Symbol:
    """Stands for `SX` in the signatures of shipid's own functions, so that they are read without CasADi."""


@cache
def types_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Types of the arguments and of the result of a function of symbols, with their units, by name.

    Raises whatever `typing.get_type_hints` raises, such as NameError for a type that a user's file does not import.
    """
    return get_type_hints(function, localns=None if of_users(function) else {"SX": Symbol}, include_extras=True)
