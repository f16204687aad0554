"""What a user's method lacks is one line with class, part and file, before anything is computed."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import pytest

from shipid.errors import DataError, DocumentError
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.contract import fault_of_corrector
from shipid.hybrid.method import FitResult, Method, Task
from shipid.hybrid.methods import METHODS, method_kind, method_of
from shipid.hybrid.search import SearchMethod


class Bare(Method):
    """A method without a corrector."""

    def fit(self, task: Task) -> dict[str, FitResult]:  # noqa: ARG002
        return {}


class Mine(SearchMethod):
    """A method with all that is asked."""

    corrector: ClassVar[type[Any]] = UnchangedPath

    def fit(self, task: Task) -> dict[str, FitResult]:  # noqa: ARG002
        return {}


def of(**parts: Any) -> type[Method]:
    """The method with other parts of its class."""
    return type("Mine", (Mine,), {"__module__": __name__, **parts})


def on(**parts: Any) -> type[Method]:
    """The method with other parts of the class of its corrector."""
    return of(corrector=type("Shift", (UnchangedPath,), {"__module__": __name__, **parts}))


def shift(self: Any, instants: Any, paths: Any) -> Any:  # noqa: ARG001
    """Predict without being given the physics."""
    return paths


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Bare, "Bare in FILE must have `corrector` as a class variable, the class of what `fit` gives"),
        (of(corrector=UnchangedPath({})), "Mine in FILE must have `corrector` as a class variable, .*"),
        (of(validation="run"), r"`validation` of Mine in FILE must be .* one of \('share', 'runs'\), not 'run'"),
        (of(SEARCHED=("widht",)), "`SEARCHED` of Mine in FILE must be a tuple of names .*, 'widht' is none"),
        (of(fit=lambda _: {}), r"`fit` of Mine in FILE must take \(self, task\): .*"),
        *((on(**{name: None}), f"Shift in FILE lacks .*`{name}`.*") for name in ("predict", "arrays", "from_arrays")),
        (on(predict=shift), r"`predict` of Shift in FILE must take \(self, physics, instants, paths\): .*"),
    ],
)
def test_what_a_class_lacks_is_said_as_a_plan_is_read(
    kind: type[Method], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended in a traceback, in the middle of a study."""
    monkeypatch.setitem(METHODS, "mine", kind)
    said = message.replace("FILE", re.escape(__file__))
    with pytest.raises(DocumentError, match=rf"^method\.2\.kind: METHODS\['mine'\]: {said}$") as caught:
        method_of("mine", {}, "method.2")
    assert "\n" not in str(caught.value)
    with pytest.raises(DataError, match=rf"^METHODS\['mine'\]: {said}$"):
        method_kind(kind.model_construct())


def test_what_a_corrector_lacks_is_said() -> None:
    assert fault_of_corrector(UnchangedPath({})) == ""
    assert re.fullmatch("Mine in .* lacks `predict`", fault_of_corrector(Mine()))
