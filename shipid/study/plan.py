"""From a study document to batches of cells: what will be computed, before anything is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from shipid import document as documents
from shipid.document import Document
from shipid.errors import DocumentError, choices
from shipid.estimation.tuning import Recipe
from shipid.simulation.truth import Truth
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, Variant, members, resolve

NO_MODEL = "none"


class Strict(BaseModel):
    """A block with no key but those declared."""

    model_config = ConfigDict(extra="forbid")


class Data(Strict):
    """`[data]`: real runs, from a dataset (Parquet) or a raw log with its mapping."""

    mapping: str | None = Field(default=None, description="bundled name or path; the log is fetched if `log` is absent")
    log: str | None = Field(default=None, description="raw log, if not the public original")
    dataset: str | None = Field(default=None, description="Parquet file written by `shipid data import`")
    without: list[str] = Field(default=[], description="repairs of the mapping to leave out")
    path: Literal["position", "velocity"] = Field(
        default="position", description="true path: logged positions, or the integral of u, v, psi"
    )

    @model_validator(mode="after")
    def _one_source(self) -> Data:
        if (self.mapping is None) == (self.dataset is None):
            raise ValueError("give either `dataset`, or `mapping` (with `log` if it is not the public original)")
        return self


class Split(Strict):
    """`[split]`: which runs test, and how the others train and validate; always by run."""

    test: list[str] | Annotated[int, Field(ge=1)] = Field(description="names of the test runs, or how many to draw")
    folds: Annotated[int, Field(ge=1)] = Field(default=1, description="1: 80 % train, 20 % validate; else k-fold")
    seed: int = 0


class Prediction(Strict):
    """`[prediction]`: horizon and step of the predictor; commands and wind are held at their present value."""

    horizon: Annotated[int, Field(ge=2, le=100000, description="steps")]
    step: Annotated[FiniteFloat, Field(gt=0, description="s")] = 1.0
    method: Literal["euler", "rk4"] = "euler"
    interval: Annotated[FiniteFloat, Field(gt=0, description="s between instants of prediction")] = 1.0
    samples: Annotated[int, Field(ge=1)] | None = Field(default=None, description="instants per run, at most")


class Grid(Strict):
    """`[grid]`: amounts of data and repetitions; every model gets a cell at each."""

    N_D: Annotated[list[Annotated[int, Field(ge=2)]], Field(min_length=1, description="runs for training")]
    seeds: Annotated[list[int], Field(min_length=1)] = [0]


class Claims(Strict):
    """`[claims]`: families that findings R1-R4 of the method speak of."""

    accurate: str
    inaccurate: str


class Study(Strict):
    """A whole study document."""

    question: Annotated[str, Field(min_length=3)]
    description: str | None = None
    truth: Truth | None = None
    data: Data | None = None
    split: Split
    prediction: Prediction
    grid: Grid
    recipe: dict[str, Any] = {"kind": "fast"}
    claims: Claims | None = None
    family: Annotated[list[Family], Field(min_length=1)]

    @model_validator(mode="after")
    def _one_world(self) -> Study:
        if (self.truth is None) == (self.data is None):
            raise ValueError("give either [truth] (simulation) or [data] (recorded runs)")
        return self


@dataclass(frozen=True)
class Model:
    """A foundation of the study: a variant of a vessel, or no physics at all (`variant` is None)."""

    name: str
    family: str
    member: int
    variant: Variant | None
    vessel: Vessel | None
    description: str = ""


@dataclass(frozen=True)
class Batch:
    """The unit of work: all models at one amount of data and one seed; they share windows and train together."""

    N_D: int
    seed: int

    @property
    def key(self) -> str:
        """File-safe name."""
        return f"N{self.N_D:04d}-s{self.seed}"

    def cell(self, model: str) -> str:
        """Name of the cell of one model in this batch."""
        return f"{model}-{self.key}"


@dataclass(frozen=True)
class Plan:
    """A study ready to run: checked document, models before any redraw, recipe and batches."""

    name: str
    file: str
    document: Document
    study: Study
    models: tuple[Model, ...]
    recipe: Recipe
    batches: tuple[Batch, ...]

    @property
    def digest(self) -> str:
        """Digest of the document and of every vessel it stands on: what the results depend on."""
        vessels = sorted({model.vessel.digest for model in self.models if model.vessel is not None})
        return documents.digest({"study": self.document, "vessels": vessels})

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.batches) * len(self.models)

    def text(self) -> str:
        """The resolved document as TOML."""
        return tomlkit.dumps(self.document)


def read_plan(name: str | Path, changes: Mapping[str, Any] | None = None) -> Plan:
    """Read a study by bundled name or path, with `--set` changes applied, and check all that can be checked now.

    Raises DocumentError with file, dotted path and remedy.
    """
    file = documents.find(str(name), "studies")
    document = documents.read(file)
    known = dict(documents.leaves(document))
    for path in changes or {}:
        head = path.split(".", 1)[0]
        if head not in Study.model_fields:
            raise DocumentError(f"--set: no such block: {choices(head, Study.model_fields)}", file=file, path=path)
    try:
        document = documents.replace(document, changes or {})
    except (ValueError, IndexError, TypeError):
        bad = next(iter(changes or {}))
        raise DocumentError(f"--set cannot reach this path: {choices(bad, known)}", file=file, path=bad) from None
    return build_plan(document, file)


def build_plan(document: Document, file: Path) -> Plan:
    """Check a study document and expand it into models and batches."""
    study: Study = documents.parse(Study, document, file)
    models = _models(study, file)
    _check_claims(study, models, file)
    recipe = _recipe(study, file)
    batches = tuple(
        Batch(amount, seed) for amount in sorted(set(study.grid.N_D), reverse=True) for seed in sorted(set(study.grid.seeds))
    )
    if study.truth is not None:
        if not isinstance(study.split.test, int):
            raise DocumentError("runs of a [truth] are drawn: give the number of test runs", file=file, path="split.test")
        pool = study.truth.manoeuvres - study.split.test
        if pool < max(study.grid.N_D):
            raise DocumentError(
                f"{max(study.grid.N_D)}: {study.truth.manoeuvres} manoeuvres less {study.split.test} test runs leave {pool}",
                file=file,
                path="grid.N_D",
            )
        if study.truth.duration < study.prediction.horizon * study.prediction.step:
            raise DocumentError(
                f"{study.truth.duration:g} s: shorter than the horizon of "
                f"{study.prediction.horizon * study.prediction.step:g} s",
                file=file,
                path="truth.duration",
            )
    return Plan(file.stem, str(file), document, study, models, recipe, batches)


def truth_vessel(plan: Plan) -> Vessel:
    """The vessel that makes the truth, with the blocks that the study adds."""
    truth = plan.study.truth
    assert truth is not None
    vessel = load_vessel(truth.vessel, relative_to=Path(plan.file).parent)
    return vessel.with_values(truth.set) if truth.set else vessel


def _models(study: Study, file: Path) -> tuple[Model, ...]:
    found: list[Model] = []
    for index, family in enumerate(resolve(study.family, file)):
        assert family.base is not None
        if family.name == NO_MODEL:
            raise DocumentError("this name is taken by the model without physics", file=file, path=f"family.{index}.name")
        vessel = load_vessel(family.base, relative_to=file.parent)
        for variant in members(family, vessel, file):
            found.append(Model(variant.name, family.name, variant.member, variant, vessel, family.description or ""))
    names = [model.name for model in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DocumentError(f"two models would be called {twice!r}: rename a family", file=file, path="family")
    return (*found, Model(NO_MODEL, NO_MODEL, 0, None, None, "pure data-driven: no physics"))


def _recipe(study: Study, file: Path) -> Recipe:
    """The named recipe with the changes of its block."""
    block = dict(study.recipe)
    try:
        return Recipe.preset(str(block.pop("kind", "fast")), **block)
    except DocumentError as error:
        raise DocumentError(error.message, file=file, path=error.path) from None


def _check_claims(study: Study, models: tuple[Model, ...], file: Path) -> None:
    for role in ("accurate", "inaccurate"):
        name = getattr(study.claims, role, None)
        if study.claims is not None and name not in {model.family for model in models}:
            hint = choices(str(name), {model.family for model in models})
            raise DocumentError(f"{name!r} is not a family: {hint}", file=file, path=f"claims.{role}")
