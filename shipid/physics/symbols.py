"""CasADi, imported when it is first used: to read and check a vessel takes no more than the signatures of its terms."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, get_type_hints

if TYPE_CHECKING:
    from casadi import *  # noqa: F403
else:

    def __getattr__(name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        import casadi

        globals()[name] = value = getattr(casadi, name)
        return value


class SymbolStandIn:
    """Stands for `SX` in signatures, so that they are read without CasADi."""


@cache
def argument_types(function: Callable[..., Any]) -> dict[str, Any]:
    """Types of the arguments and of the result of a function of symbols, with their units, by name.

    `SX` need not be a name in the function's file. Raises whatever `typing.get_type_hints` raises, such as NameError
    for another type that is none.
    """
    return get_type_hints(function, localns={"SX": SymbolStandIn}, include_extras=True)
