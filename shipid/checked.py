"""Base of the pydantic models that callers from Python make: a wrong argument is one line, not pydantic's report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from shipid.document import check_numbers, parse_model
from shipid.errors import DocumentError

Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]

if TYPE_CHECKING:
    OneLine = type
else:

    class OneLine(type(BaseModel)):
        """Class of the models whose constructor raises DocumentError: with class, argument, value and remedy.

        Models that are inside others are made by pydantic, not by this call, so a document names the place as before.
        """

        def __call__(cls, *values: Any, **given: Any) -> Any:
            """Return a checked model of arguments that are given by name."""
            if values:
                names = ", ".join(cls.model_fields)
                raise DocumentError(f"write the name of each argument: {names}", path=f"{cls.__name__}({values[0]!r})")
            try:
                made = super().__call__(**given)
            except ValidationError:
                parse_model(cls, given, None, cls.__name__)
                raise  # what a constructor alone refuses
            check_numbers(given, made, None, cls.__name__)
            return made


class CheckedModel(BaseModel, metaclass=OneLine):
    """A pydantic model of which constructor and `model_validate` raise DocumentError, as for a file.

    Unknown keys are refused, and values do not change.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    @classmethod
    def model_validate(cls, obj: Any, **_: Any) -> Self:
        """Return a checked model of plain data; DocumentError with dotted path, value and remedy."""
        result: Self = parse_model(cls, obj, None, cls.__name__.lower())
        return result
