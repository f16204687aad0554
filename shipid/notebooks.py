"""How objects show themselves: a line at a console, a table in a notebook, and a bar for what takes its time there."""

from __future__ import annotations

import sys
from operator import attrgetter
from textwrap import shorten
from typing import Any, ClassVar

LONGEST = 100  # characters of a value
ROWS, COLUMNS = 12, 8  # of a table, at most


class NotebookView:
    """Shows the attributes that `shown` names; of a table the number of rows in a line, and itself in a notebook."""

    _shown: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls, shown: tuple[str, ...]) -> None:
        cls._shown = shown

    def __repr__(self) -> str:
        words = (f"{name} {brief_text(value)}" for name, value in self._shown_values().items())
        return f"<{type(self).__name__}: {', '.join(words)}>"

    def _repr_html_(self) -> str:
        import pandas as pd

        values = self._shown_values()
        tables = {name: values.pop(name) for name, value in [*values.items()] if isinstance(value, pd.DataFrame)}
        words = pd.DataFrame({type(self).__name__: {name: brief_text(value) for name, value in values.items()}})
        shown = (one.to_html(max_rows=ROWS, max_cols=COLUMNS, float_format="{:.4g}".format) for one in tables.values())
        return "\n".join([words.to_html(), *shown])

    def _shown_values(self) -> dict[str, Any]:
        """Attribute -> its value, or what it returns where it is a function; None is left out."""
        values = ((name, attrgetter(name)(self)) for name in self._shown)
        return {name: value() if callable(value) else value for name, value in values if value is not None}


def brief_text(value: Any) -> str:
    """A value in few words: numbers of an array or a table, names of a mapping."""
    if hasattr(value, "shape"):
        return " x ".join(map(str, value.shape))
    words = ", ".join(map(str, value)) if isinstance(value, list | tuple | dict) else str(value)
    return shorten(words, LONGEST, placeholder=" ...")


def progress_bar() -> Any:
    """A bar of tqdm, which shows itself in a notebook alone."""
    from tqdm import tqdm

    return tqdm(disable="ipykernel" not in sys.modules)
