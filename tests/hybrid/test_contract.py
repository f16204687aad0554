"""What a user's method lacks is one line with class, part and file, before anything is computed."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, ClassVar

import pytest

from shipid.errors import DataError, DocumentError
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.contract import fault_of_corrector
from shipid.hybrid.method import FitResult, Method, Task
from shipid.hybrid.methods import METHODS, method_kind, method_of
from shipid.hybrid.settings import SearchMethod


class Shift:
    """A corrector with all that is asked."""

    past = 0.0

    def __init__(self) -> None:
        self.hyperparameters: dict[str, float] = {}

    def predict(self, physics: Any, instants: Any, paths: Any) -> Any:  # noqa: ARG002
        return paths

    def header(self) -> dict[str, Any]:
        return {}

    def arrays(self) -> dict[str, Any]:
        return {}

    @classmethod
    def from_arrays(cls, header: Any, arrays: Any) -> Shift:  # noqa: ARG003
        return cls()


class Mine(SearchMethod):
    """A method with all that is asked."""

    corrector: ClassVar[type[Any]] = Shift
    SEARCHED: ClassVar[tuple[str, ...]] = ("width",)
    width: float = 1.0

    def fit(self, task: Task) -> dict[str, FitResult]:  # noqa: ARG002
        return {}


class Bare(Method):
    """A method without a corrector."""

    def fit(self, task: Task) -> dict[str, FitResult]:  # noqa: ARG002
        return {}


def with_field(name: str) -> type[Method]:
    """A method whose class variable is a setting, for want of `ClassVar`."""
    kind = type("Mine", (Mine,), {"__module__": __name__})
    kind.model_fields[name] = Mine.model_fields["width"]
    return kind


def of(**parts: Any) -> type[Method]:
    """The method with other parts of its class."""
    return type("Mine", (Mine,), {"__module__": __name__, **parts})


def on(**parts: Any) -> type[Method]:
    """The method with other parts of the class of its corrector; None takes a part away."""
    parts = {**{key: value for key, value in vars(Shift).items() if not key.startswith("__")}, **parts}
    kept = {key: value for key, value in parts.items() if value is not None}
    return of(corrector=type("Shift", (), {"__module__": __name__, "__init__": Shift.__init__, **kept}))


FAULTS: list[tuple[Callable[[], type[Method]], str]] = [
    (lambda: Bare, "Bare in FILE lacks `corrector`, the class of what `fit` gives"),
    (lambda: of(corrector=Shift()), "`corrector` of Mine in FILE must be a class, not .*Shift object.*"),
    (
        lambda: with_field("corrector"),
        r"Mine in FILE must have `corrector` as a class variable: `corrector: ClassVar.*",
    ),
    (lambda: with_field("validation"), "Mine in FILE must have `validation` as a class variable: .*"),
    (lambda: of(validation="run"), r"`validation` of Mine in FILE must be one of \('share', 'runs'\), not 'run'"),
    (lambda: of(SEARCHED=("widht",)), "`SEARCHED` of Mine in FILE names 'widht', which is none of its settings"),
    (lambda: of(COUNTS=("widht",)), "`COUNTS` of Mine in FILE names 'widht', which is none of its settings"),
    (lambda: of(SEARCHED="width"), r"`SEARCHED` of Mine in FILE must be a tuple, such as \('width',\)"),
    (lambda: of(fit=lambda _: {}), r"`fit` of Mine in FILE must take \(self, task\), not \(_\)"),
    *(
        (lambda name=name: on(**{name: None}), f"Shift in FILE lacks `{name}`.*")
        for name in ("predict", "header", "arrays", "from_arrays")
    ),
    (lambda: on(predict=3), "`predict` of Shift in FILE must be a function"),
    (
        lambda: on(predict=lambda self, instants, paths: paths),  # noqa: ARG005
        r"`predict` of Shift in FILE must take \(self, physics, instants, paths\), not \(self, instants, paths\)",
    ),
]


@pytest.mark.parametrize(("made", "message"), FAULTS)
def test_what_a_class_lacks_is_said_as_a_plan_is_read(
    made: Callable[[], type[Method]], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended in a traceback, in the middle of a study."""
    kind = made()
    monkeypatch.setitem(METHODS, "mine", kind)
    said = message.replace("FILE", re.escape(__file__))
    with pytest.raises(DocumentError, match=rf"^method\.2\.kind: METHODS\['mine'\]: {said}$") as caught:
        method_of("mine", {}, "method.2")
    assert "\n" not in str(caught.value)
    with pytest.raises(DataError, match=rf"^METHODS\['mine'\]: {said}$"):
        method_kind(kind.model_construct())


@pytest.mark.parametrize("name", ["predict", "header", "arrays", "hyperparameters", "past"])
def test_what_a_corrector_lacks_is_said(name: str) -> None:
    parts = {key: None for key in ("predict", "header", "arrays", "hyperparameters", "past") if key != name}
    held = type("Held", (), {"__module__": __name__, **parts})()
    assert fault_of_corrector(held) == f"Held in {__file__} lacks `{name}`"
    setattr(held, name, 3)
    assert fault_of_corrector(held) == ""
    assert fault_of_corrector(Shift()) == fault_of_corrector(UnchangedPath({})) == ""
    assert fault_of_corrector(Shift).startswith("the corrector must be an object of Shift in ")
