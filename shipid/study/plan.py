"""From a study document to batches of cells: what will be computed, before anything is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, NonNegativeInt, model_validator

from shipid import document as documents
from shipid.data.windows import Commands
from shipid.document import Document
from shipid.errors import DocumentError, choices
from shipid.hybrid.recipe import Recipe
from shipid.identification.settings import Identify, unknowns
from shipid.logs.importing import sha256_of
from shipid.logs.mapping import read_mapping
from shipid.simulation.truth import Truth, check_truth
from shipid.units import DEGREE, RPM
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, Variant, members, resolve

NO_MODEL = "none"
ALONE, BOTH = "-identified", "-both"  # added to the names of a family and its members
WAYS = {ALONE: "identified from the runs of each cell", BOTH: "identified from the runs of each cell, then compensated"}
WORLDS = 1000  # top-level `seed` times this is added to every other seed
PUBLISHED = {  # key of a published envelope -> signal, factor to SI
    **{name: (name, 1.0) for name in ("u", "v", "r", "u_rw", "v_rw", "n", "alpha", "delta")},
    "n_rpm": ("n", RPM),
    **{f"{name}_deg": (name, DEGREE) for name in ("r", "alpha", "delta")},
}


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
        if self.dataset is not None and (self.log is not None or self.without):
            raise ValueError("`log` and `without` go with a `mapping`: a dataset has been imported already")
        return self


class Split(Strict):
    """`[split]`: which runs test, and how the others train and validate; always by run."""

    test: Annotated[list[str], Field(min_length=1)] | Annotated[int, Field(ge=1)] = Field(
        description="names of the test runs, or how many to draw"
    )
    folds: Annotated[int, Field(ge=1)] = Field(default=1, description="1: 80 % train, 20 % validate; else k-fold")
    seed: NonNegativeInt = 0


class Prediction(Strict):
    """`[prediction]`: horizon and step of the predictor, and what it knows; wind is held at its present value."""

    horizon: Annotated[int, Field(ge=2, le=100000, description="steps")]
    step: Annotated[FiniteFloat, Field(gt=0, description="s")] = 1.0
    method: Literal["euler", "rk4"] = "euler"
    interval: Annotated[FiniteFloat, Field(gt=0, description="s between instants of prediction")] = 1.0
    samples: Annotated[int, Field(ge=1)] | None = Field(default=None, description="instants per run, at most")
    commands: Commands = Field(default="held", description="held at their present value, or known over the horizon")


class Grid(Strict):
    """`[grid]`: amounts of data and repetitions; every model gets a cell at each."""

    N_D: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1, description="runs for training")]
    seeds: Annotated[list[NonNegativeInt], Field(min_length=1)] = [0]


class Claims(Strict):
    """`[claims]`: families that the findings of the method speak of: R1-R4 at full scale, S1-S7 in simulation."""

    accurate: str | None = Field(default=None, description="with `inaccurate`: findings R1-R4")
    inaccurate: str | None = None
    moderate: str | None = Field(default=None, description="with `high`: findings S1-S7")
    high: str | None = None
    nominal: str | None = Field(default=None, description="the base as it is: the floor, in no claim")
    aside: list[str] = Field(default=[], description="families that saw the test runs: shown, but in no claim")

    @model_validator(mode="after")
    def _pairs(self) -> Claims:
        for one, other in (("accurate", "inaccurate"), ("moderate", "high")):
            if (getattr(self, one) is None) != (getattr(self, other) is None):
                raise ValueError(f"`{one}` and `{other}` go together")
        return self

    @property
    def roles(self) -> dict[str, str]:
        """Role -> family, of the roles that are given."""
        every = ("accurate", "inaccurate", "moderate", "high", "nominal")
        return {role: getattr(self, role) for role in every if getattr(self, role) is not None}

    @property
    def not_judged(self) -> set[str]:
        """Families that no claim and no sentence of the answer counts among degraded models."""
        return {*self.aside, *([self.nominal] if self.nominal else [])}


class Published(Strict):
    """`[published]`: the input envelope that others report, to be shown beside the study's own."""

    source: Annotated[str, Field(min_length=3)]
    envelope: dict[str, list[FiniteFloat]] = Field(description="key -> [min, mean, max]")

    @model_validator(mode="after")
    def _sensible(self) -> Published:
        for key, limits in self.envelope.items():
            if key not in PUBLISHED:
                raise ValueError(f"envelope.{key} is no input: {choices(key, PUBLISHED)}")
            if len(limits) != 3 or limits != sorted(limits):
                raise ValueError(f"envelope.{key}: give [min, mean, max], found {limits}")
        return self


class Study(Strict):
    """A whole study document."""

    question: Annotated[str, Field(min_length=3)]
    description: str | None = None
    seed: NonNegativeInt = Field(default=0, description="another world: other manoeuvres, families, data, training")
    truth: Truth | None = None
    data: Data | None = None
    split: Split
    prediction: Prediction
    grid: Grid
    recipe: dict[str, Any] = {"kind": "fast"}
    claims: Claims | None = None
    published: Published | None = None
    family: Annotated[list[Family], Field(min_length=1)]

    @model_validator(mode="after")
    def _one_world(self) -> Study:
        if (self.truth is None) == (self.data is None):
            raise ValueError("give either [truth] (simulation) or [data] (recorded runs)")
        return self

    def in_its_world(self) -> Study:
        """Return the study with `WORLDS` times its top-level seed added to the seeds of truth, split, grid, families.

        Seed 0 leaves all as they are; recorded runs stay the same in every world.
        """
        shift = WORLDS * self.seed
        truth = self.truth and self.truth.model_copy(update={"seed": self.truth.seed + shift})
        split = self.split.model_copy(update={"seed": self.split.seed + shift})
        grid = self.grid.model_copy(update={"seeds": [seed + shift for seed in self.grid.seeds]})
        family = [one.model_copy(update={"seed": one.seed + shift}) for one in self.family]
        return self.model_copy(update={"truth": truth, "split": split, "grid": grid, "family": family})


@dataclass(frozen=True)
class Model:
    """A foundation of the study: a variant of a vessel, or no physics at all (`variant` is None).

    identify : what is identified from the runs of each batch before anything is compensated; None: nothing.
    compensated : whether a compensator is trained on it; else it predicts alone.
    """

    name: str
    family: str
    member: int
    variant: Variant | None
    vessel: Vessel | None
    description: str = ""
    identify: Identify | None = None
    compensated: bool = True


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
    """A study ready to run: checked document, models before any redraw, recipe and batches.

    study : the checked document with the seeds of its world; `document` holds them as written.
    truth : the vessel that makes the truth, with the blocks that the study adds; None where runs were recorded.
    vessels : every vessel that the document names, by that name.
    sources : digests of the mapping, log or dataset that recorded runs come from.
    changes : what `--set` changed, already in the document.
    """

    name: str
    file: str
    document: Document
    study: Study
    models: tuple[Model, ...]
    recipe: Recipe
    batches: tuple[Batch, ...]
    truth: Vessel | None = None
    vessels: Mapping[str, Vessel] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    changes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def standing(self) -> list[Vessel]:
        """The vessel of the truth, if there is one, and those of the models."""
        return [vessel for vessel in (self.truth, *(model.vessel for model in self.models)) if vessel is not None]

    @property
    def digest(self) -> str:
        """Digest of the document, every vessel, the data's sources and the recipe in full: what results depend on."""
        return self._digest(self.document)

    @property
    def digest_in_any_world(self) -> str:
        """The same digest without the top-level seed: equal for repetitions of one study."""
        return self._digest({key: value for key, value in self.document.items() if key != "seed"})

    def _digest(self, document: Document) -> str:
        vessels = sorted({vessel.digest for vessel in self.standing})
        depends = {"vessels": vessels, "sources": dict(self.sources), "recipe": self.recipe.model_dump()}
        return documents.digest({"study": document, **depends})

    @property
    def identified(self) -> set[str]:
        """Families whose numbers, and so their A, depend on the data of the batch."""
        return {model.family for model in self.models if model.identify is not None}

    @property
    def aside(self) -> set[str]:
        """Families that are shown, but that no claim and no sentence of the answer counts."""
        claims = self.study.claims
        alone = {model.family for model in self.models if not model.compensated}
        return alone | (claims.not_judged if claims else set())

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
    for path, value in (changes or {}).items():
        try:
            document = documents.replace(document, {path: value})
        except (ValueError, IndexError, TypeError, AttributeError):
            message = f"--set cannot reach this path: {choices(path, known)}"
            raise DocumentError(message, file=file, path=path) from None
    return build_plan(document, file, changes=changes)


def build_plan(
    document: Document,
    file: Path,
    vessels: Mapping[str, Vessel] | None = None,
    sources: Mapping[str, str] | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Plan:
    """Check a study document and expand it into models and batches; known `vessels` and `sources` need no file."""
    study = documents.parse(Study, document, file).in_its_world()
    known = dict(vessels or {})
    models = _models(study, file, known)
    _check_claims(study, models, file)
    recipe = _recipe(study, file)
    batches = tuple(
        Batch(amount, seed)
        for amount in sorted(set(study.grid.N_D), reverse=True)
        for seed in sorted(set(study.grid.seeds))
    )
    truth = None
    if study.truth is not None:
        _check_amounts(study, study.truth, file)
        truth = _truth_vessel(study.truth, file, known)
        try:
            check_truth(study.truth, truth)
        except DocumentError as error:
            raise DocumentError(error.message, file=file, path=error.path) from None
    found = _sources(study.data, file) if sources is None and study.data is not None else sources
    return Plan(
        file.stem, str(file), document, study, models, recipe, batches, truth, known, found or {}, changes or {}
    )


def beside(folder: Path, name: str) -> Path:
    """A file that a study names: from the study's folder, else from the working folder."""
    return folder / name if (folder / name).exists() else Path(name)


def mapping_of(data: Data, file: Path) -> str | None:
    """The mapping that a study names: a bundled name as it is, a path from the study's folder on."""
    named = data.mapping
    return str(beside(file.parent, named)) if named is not None and named.endswith(".toml") else named


def _sources(data: Data, file: Path) -> dict[str, str]:
    """Digests of what the runs come from; a file that is not there is told when it is read."""
    mapping = mapping_of(data, file)
    found = {} if mapping is None else {"mapping": read_mapping(mapping).digest}
    for key, name in (("log", data.log), ("dataset", data.dataset)):
        if name is not None and beside(file.parent, name).is_file():
            found[key] = sha256_of(beside(file.parent, name))
    return found


def _check_amounts(study: Study, truth: Truth, file: Path) -> None:
    """Refuse a truth with too few manoeuvres for the grid, or too short ones for the horizon."""
    test, most, ahead = study.split.test, max(study.grid.N_D), study.prediction.horizon * study.prediction.step
    if not isinstance(test, int):
        raise DocumentError("runs of a [truth] are drawn: give the number of test runs", file=file, path="split.test")
    pool = truth.manoeuvres - test
    if pool < 2:
        message = f"{test}: of {truth.manoeuvres} manoeuvres at most {truth.manoeuvres - 2} can test"
        raise DocumentError(message, file=file, path="split.test")
    if pool < most:
        message = f"{most}: {truth.manoeuvres} manoeuvres less {test} test runs leave {pool}"
        raise DocumentError(message, file=file, path="grid.N_D")
    if truth.duration < ahead:
        message = f"{truth.duration:g} s: shorter than the horizon of {ahead:g} s"
        raise DocumentError(message, file=file, path="truth.duration")


def _truth_vessel(truth: Truth, file: Path, known: dict[str, Vessel]) -> Vessel:
    """The vessel that makes the truth, with the blocks that the study adds: what is wrong there is told there."""
    vessel = _vessel(truth.vessel, file, "truth.vessel", known)
    try:
        return vessel.with_values(truth.set) if truth.set else vessel
    except DocumentError as error:
        raise DocumentError(error.message, file=file, path=f"truth.set.{error.path}") from None
    except (ValueError, IndexError, TypeError, AttributeError):
        message = f"a path runs through a number of {truth.vessel}: see `shipid vessel show {truth.vessel}`"
        raise DocumentError(message, file=file, path="truth.set") from None


def _vessel(name: str, file: Path, path: str, known: dict[str, Vessel]) -> Vessel:
    """A vessel that the study names at a path: one that is known, or read now and known from now on."""
    if name not in known:
        try:
            found = documents.find(name, "models", file.parent)
        except DocumentError as error:
            raise DocumentError(f"{name!r}: {error.message}", file=file, path=path) from None
        known[name] = load_vessel(str(found))
    return known[name]


def _models(study: Study, file: Path, known: dict[str, Vessel]) -> tuple[Model, ...]:
    found: list[Model] = []
    for index, family in enumerate(resolve(study.family, file)):
        assert family.base is not None  # written out by resolve
        if family.name == NO_MODEL:
            raise DocumentError(
                "this name is taken by the model without physics", file=file, path=f"family.{index}.name"
            )
        vessel = _vessel(family.base, file, f"family.{index}.base", known)
        words = family.description or ""
        drawn = members(family, vessel, file)
        settings = _identify(study, family, index, vessel, file)
        found += [Model(v.name, v.family, v.member, v, vessel, words) for v in drawn]
        for suffix, way in WAYS.items() if settings is not None else ():
            told = ", ".join(filter(None, (words, way)))
            found += [
                Model(f"{v.name}{suffix}", f"{v.family}{suffix}", v.member, v, vessel, told, settings, suffix == BOTH)
                for v in drawn
            ]
    names = [model.name for model in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DocumentError(f"two models would be called {twice!r}: rename a family", file=file, path="family")
    return (*found, Model(NO_MODEL, NO_MODEL, 0, None, None, "pure data-driven: no physics"))


def _identify(study: Study, family: Family, index: int, vessel: Vessel, file: Path) -> Identify | None:
    """What a family identifies, with the horizon, step and method of the study's own prediction unless it says else."""
    if family.identify is None:
        return None
    ahead, prefix = study.prediction, f"family.{index}.identify"
    own = {"horizon": ahead.horizon * ahead.step, "step": ahead.step, "method": ahead.method}
    settings: Identify = documents.parse(Identify, own | family.identify, file, prefix)
    try:
        unknowns(vessel, settings)
    except DocumentError as error:
        where = (error.path or "identify").replace("identify", prefix, 1)
        raise DocumentError(error.message, file=file, path=where) from None
    return settings


def _recipe(study: Study, file: Path) -> Recipe:
    """The named recipe with the changes of its block."""
    block = dict(study.recipe)
    kind = str(block.pop("kind", "fast"))
    try:
        fields = Recipe.kind(kind).model_fields
        unknown = next((key for key in block if key not in fields), None)
        if unknown is not None:
            raise DocumentError(f"unknown key of {kind!r}: {choices(unknown, fields)}", path=f"recipe.{unknown}")
        return Recipe.preset(kind, **block)
    except DocumentError as error:
        raise DocumentError(error.message, file=file, path=error.path) from None


def _check_claims(study: Study, models: tuple[Model, ...], file: Path) -> None:
    """Refuse claims about families that are not there, or that are not what their role needs."""
    if study.claims is None:
        return
    families = [model.family for model in models if model.family != NO_MODEL]
    named = [*study.claims.roles.items(), *(("aside", name) for name in study.claims.aside)]
    for role, name in named:
        if name not in families:
            message = f"{name!r} is not a family: {choices(name, set(families))}"
            raise DocumentError(message, file=file, path=f"claims.{role}")
    roles = study.claims.roles
    for role in ("accurate", "inaccurate", "nominal"):
        count = families.count(roles.get(role, ""))
        if count > 1:
            use = (
                "the nominal row is the base as it is"
                if role == "nominal"
                else "the findings compare one model with one"
            )
            raise DocumentError(f"{roles[role]!r} has {count} members: {use}", file=file, path=f"claims.{role}")
    rivals = (("accurate", "inaccurate"), ("moderate", "high"), ("moderate", "nominal"), ("high", "nominal"))
    for one, other in rivals:
        if one in roles and roles[one] == roles.get(other):
            raise DocumentError(f"the same family as claims.{one}", file=file, path=f"claims.{other}")
    nominal = next((model for model in models if model.family == roles.get("nominal")), None)
    if nominal is not None and nominal.variant is not None and nominal.variant.values:
        message = f"{nominal.name!r} is perturbed: the nominal row is the base as it is"
        raise DocumentError(message, file=file, path="claims.nominal")
