"""From a study document to batches of cells: what will be computed, before anything is."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, NonNegativeInt, model_validator

from shipid import document as documents
from shipid.arguments import by_name, steps_in
from shipid.data.windows import Commands, PathSource
from shipid.document import Document
from shipid.engine.integrate import Method as Integrator
from shipid.errors import DataError, DocumentError, choices
from shipid.files import as_argument
from shipid.hybrid.method import Method
from shipid.hybrid.methods import method_of
from shipid.identification.settings import Identify, unknowns
from shipid.logs.importing import digest_of, sha256_of
from shipid.logs.mapping import read_mapping
from shipid.observer import Observer, bank
from shipid.physics.signals import SIGNALS, named
from shipid.predictor import MOST_STEPS
from shipid.simulation.truth import Truth, check_truth, old_keys, vessel_of
from shipid.study.ranges import LONGEST_NAME, Cut, check_memory, check_ranges, check_seeds
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, Variant, members, resolve

NO_MODEL = "none"
WITH = "+"  # between a foundation and a method
NAME = r"^[A-Za-z][A-Za-z0-9_.-]*$"
OF_PARTS = ("repeat", "condition")  # keys that make several studies of one
IDENTIFIED, OBSERVED = "identified from the runs of each cell", "with an observer"
USER_SCRIPT = "my.py"  # a user's script with a method, where its name is unknown
WORLDS = 1000  # top-level `seed` times this is added to every other seed
FEEDBACK = ("zigzag", "reverse_spiral", "station_keeping")  # kinds of manoeuvres whose orders react to the ship
INPUTS = ("u", "v", "r", "u_rw", "v_rw")  # what a correction may see beside the commands


def published_keys() -> dict[str, tuple[str, float]]:
    """Key of a published envelope -> signal, factor to SI: `n`, and `n_rpm` in the unit that sailors read."""
    names = (*INPUTS, *named("command"))
    read = {name: SIGNALS[name] for name in names if SIGNALS[name].shown}
    in_words = {f"{name}_{row.read_in.partition('/')[0]}": (name, row.factor) for name, row in read.items()}
    return {name: (name, 1.0) for name in names} | in_words


def _script() -> str:
    """The user's script that is the command line of this process; empty for another command line, or none."""
    return sys.argv[0] if sys.argv[0].endswith(".py") and sys.argv[1:2] == ["study"] else ""


class Strict(BaseModel):
    """A block with no key but those declared."""

    model_config = ConfigDict(extra="forbid")


class Data(Strict):
    """`[data]`: real runs, from a dataset (Parquet) or a raw log with its mapping."""

    mapping: str | None = Field(default=None, description="bundled name or path; the log is fetched if `log` is absent")
    log: str | None = Field(default=None, description="raw log, if not the public original")
    dataset: str | None = Field(default=None, description="Parquet file written by `shipid data import`")
    without: list[str] = Field(default=[], description="repairs of the mapping to leave out")
    causal: list[str] = Field(
        default=[], description="columns interpolated between fixes: inputs hold the last fix, such as u and v"
    )
    path: PathSource = Field(
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

    ahead: Annotated[FiniteFloat, Field(gt=0, description="s, a multiple of the step")]
    step: Annotated[FiniteFloat, Field(gt=0, description="s")] = 1.0
    integrator: Integrator = "euler"
    interval: Annotated[FiniteFloat, Field(gt=0, description="s between instants of prediction")] = 1.0
    past: Annotated[
        FiniteFloat, Field(ge=0, description="s of a run before its first instant; more if a method needs")
    ] = 0.0
    samples: Annotated[int, Field(ge=1)] | None = Field(default=None, description="instants per run, at most")
    commands: Commands = Field(default="held", description="held at their present value, or known over the horizon")

    @model_validator(mode="after")
    def _whole_steps(self) -> Prediction:
        if not 2 <= steps_in(self.ahead, self.step) <= MOST_STEPS:
            most = f"{MOST_STEPS:,}"
            raise ValueError(f"ahead = {self.ahead:g} s must be 2 to {most} steps of {self.step:g} s")
        return self

    @property
    def horizon(self) -> int:
        """Number of steps T."""
        return round(self.ahead / self.step)


class Grid(Strict):
    """`[grid]`: amounts of data and repetitions; every model gets a cell at each."""

    N_D: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1, description="runs for training")]
    seeds: Annotated[list[NonNegativeInt], Field(min_length=1)] = [0]


class BandsBlock(Strict):
    """`[bands]`: how far off a prediction may be."""

    level: Annotated[FiniteFloat, Field(gt=0, le=0.99, description="share of true paths that a band holds whole")] = 0.9
    refits: Annotated[int, Field(ge=0)] = Field(
        default=0,
        description="further fits, each without a share of the runs, of methods and identified families that need them "
        "for a band; 5 is enough, 0: no band for those",
    )


class Role(NamedTuple):
    """What a family must be that `[claims]` gives a role.

    pair : the role that must be given, too. unlike : roles before this one that the same family may not have.
    single : why the family may have one member only; empty: it may have any number.
    """

    pair: str = ""
    unlike: tuple[str, ...] = ()
    single: str = ""


ROLES: dict[str, Role] = {
    "accurate": Role("inaccurate", single="the findings compare one model with one"),
    "inaccurate": Role("accurate", ("accurate",), single="the findings compare one model with one"),
    "moderate": Role("high"),
    "high": Role("moderate", ("moderate",)),
    "nominal": Role(unlike=("moderate", "high"), single="the nominal row is the base as it is"),
}
"""Name of a role, a key of `[claims]`, -> what its family must be."""


class Claims(Strict):
    """`[claims]`: the families, and the method, that findings speak of: R1-R4, S1-S7, and B1-B2 in both."""

    method: str | None = Field(default=None, description="default: the first method that learns from data")

    accurate: str | None = Field(default=None, description="with `inaccurate`: findings R1-R4")
    inaccurate: str | None = None
    moderate: str | None = Field(default=None, description="with `high`: findings S1-S7")
    high: str | None = None
    nominal: str | None = Field(default=None, description="the base as it is: the floor, in no claim")
    aside: list[str] = Field(default=[], description="families that saw the test runs: shown, but in no claim")

    @model_validator(mode="after")
    def _pairs(self) -> Claims:
        lone = next((name for name in self.roles if ROLES[name].pair not in ("", *self.roles)), None)
        if lone is not None:
            one, other = (name for name in ROLES if name in (lone, ROLES[lone].pair))
            raise ValueError(f"give both `{one}` and `{other}`, or neither")
        return self

    @property
    def roles(self) -> dict[str, str]:
        """Role -> family, of the roles that are given."""
        return {role: getattr(self, role) for role in ROLES if getattr(self, role) is not None}

    @property
    def not_judged(self) -> set[str]:
        """Families that no claim and no sentence of the answer counts among degraded models."""
        return {*self.aside, *([self.nominal] if self.nominal else [])}


class Published(Strict):
    """`[published]`: the input envelope that others report, to be shown beside that of the study."""

    source: Annotated[str, Field(min_length=3)]
    envelope: dict[str, list[FiniteFloat]] = Field(description="key -> [min, mean, max]")

    @model_validator(mode="after")
    def _sensible(self) -> Published:
        for key, limits in self.envelope.items():
            if key not in published_keys():
                raise ValueError(f"envelope.{key} is no input of a study: {choices(key, published_keys())}")
            if len(limits) != 3 or limits != sorted(limits):
                raise ValueError(f"envelope.{key}: give [min, mean, max], not {limits}")
        return self


class Condition(Strict):
    """`[[condition]]`: the changes of one part of a study that has several parts."""

    name: Annotated[str, Field(pattern=NAME)]
    set: dict[str, Any] = Field(default={}, description="dotted path -> value")


class MethodBlock(BaseModel):
    """`[[method]]`: a way to improve physics by data; every further key is a setting of its kind."""

    model_config = ConfigDict(extra="allow")
    name: Annotated[str, Field(pattern=NAME)]
    kind: str
    families: Annotated[list[str], Field(min_length=1, description="families that it meets; * matches any text")] = [
        "*"
    ]

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the kind."""
        return dict(self.model_extra or {})


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
    method: Annotated[list[MethodBlock], Field(min_length=1)] = [MethodBlock(name="drawn", kind="path-drawn")]
    claims: Claims | None = None
    published: Published | None = None
    bands: BandsBlock = BandsBlock()
    unusual: list[str] = Field(default=[], description="dotted paths of numbers that may lie outside their range")
    family: Annotated[list[Family], Field(min_length=1)]
    repeat: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(
        default={}, description="dotted path -> values: the study is done for each; the comparison pools them"
    )
    condition: list[Condition] = Field(default=[], description="the study is done in each; shown side by side")

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
class Foundation:
    """What the physics says: a variant of a vessel, a variant identified from the runs of each batch, or nothing.

    variant : the numbers on the base; None is no physics at all.
    base : the vessel that the variant changes.
    identify : what is identified from the runs of each batch; None: nothing.
    observer : what filters the start of the physics and adds slow forces; None: nothing.
    """

    name: str
    family: str
    member: int
    variant: Variant | None
    base: Vessel | None
    description: str = ""
    identify: Identify | None = None
    observer: Observer | None = None

    @property
    def fitted(self) -> bool:
        """Whether its numbers or the settings of its observer come from the runs of each batch."""
        return self.identify is not None or (self.observer is not None and self.observer.choose)

    @property
    def vessel(self) -> Vessel | None:
        """The base with the numbers of the variant."""
        if self.base is None or self.variant is None:
            return None
        return self.base.with_values(self.variant.values) if self.variant.values else self.base


@dataclass(frozen=True)
class Way:
    """A method of the study under its name.

    foundations : those that it meets, by name. left_out : those with an observer that its families would include, but
        that its kind cannot take.
    """

    name: str
    kind: str
    method: Method
    foundations: tuple[str, ...]
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Batch:
    """Every foundation with every method at one amount of data and one seed; they share windows."""

    N_D: int
    seed: int

    @property
    def key(self) -> str:
        """File-safe name."""
        return f"N{self.N_D:04d}-s{self.seed}"

    def cell(self, foundation: str, method: str) -> str:
        """Name of the cell of a foundation with a method in this batch."""
        return f"{foundation}{WITH}{method}-{self.key}"


@dataclass(frozen=True)
class Unit:
    """The unit of work: cells of a batch that share more than windows, such as a decomposition or an identification.

    pairs : names of a foundation and a method for each cell, in the order of the plan. key : file-safe name: that of
        the batch, or of the first cell where the batch has several units.
    """

    batch: Batch
    pairs: tuple[tuple[str, str], ...]
    key: str

    def foundations(self, method: str) -> tuple[str, ...]:
        """Names of the foundations that a method meets in this unit."""
        return tuple(foundation for foundation, name in self.pairs if name == method)


@dataclass(frozen=True)
class Part:
    """One repetition of a study in one condition. `condition` is empty where the study has none."""

    condition: str
    plan: Plan


@dataclass(frozen=True)
class Plan:
    """A study ready to run: checked document, foundations before any redraw, methods and batches.

    study : the checked document with the seeds of its world; `document` holds them as written.
    truth : the vessel that makes the truth, with the blocks that the study adds; None where runs were recorded.
    vessels : every vessel that the document names, by that name.
    sources : digests of the mapping, log or dataset that recorded runs come from.
    changes : what `--set` changed, already in the document.
    parts : name -> a complete study for every repetition in every condition; empty where there is neither. If there
        are parts, they are run in place of this study.
    """

    name: str
    file: str
    document: Document
    study: Study
    foundations: tuple[Foundation, ...]
    methods: tuple[Way, ...]
    batches: tuple[Batch, ...]
    truth: Vessel | None = None
    vessels: Mapping[str, Vessel] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    changes: Mapping[str, Any] = field(default_factory=dict)
    parts: Mapping[str, Part] = field(default_factory=dict)

    @property
    def used_vessels(self) -> list[Vessel]:
        """The vessel of the truth, if there is one, and the bases of the foundations."""
        every = (self.truth, *(foundation.base for foundation in self.foundations))
        of_parts = (vessel for part in self.parts.values() for vessel in part.plan.used_vessels)
        return [*(vessel for vessel in every if vessel is not None), *of_parts]

    @property
    def disturbances(self) -> tuple[str, ...]:
        """What moves the ship or its log and is no coefficient of the vessel, in words; recorded runs have waves."""
        truth = self.study.truth
        if truth is None:
            return ("waves",)
        known = {"waves": truth.waves, "gusts": truth.gusts, "noise of the sensors": truth.sensors}
        return tuple(words for words, there in known.items() if there)

    @property
    def inputs(self) -> list[Path]:
        """Files that the study is read from: the document, the vessels, the mapping, the log and the dataset."""
        data, here = self.study.data, Path(self.file)
        named = [] if data is None else [mapping_of(data, here), data.log, data.dataset]
        vessels = [Path(vessel.file) for vessel in self.vessels.values()]
        return [here, *vessels, *(beside(here.parent, name) for name in named if name is not None)]

    @property
    def digest(self) -> str:
        """Digest of the document, every vessel, the data's sources and the methods in full: what results depend on."""
        return self._digest(self.document)

    @property
    def folder(self) -> Path:
        """Folder of a run that was not given one: `results/<study>-<first digits of the digest>`."""
        return Path("results") / f"{self.name}-{self.digest[:8]}"

    @property
    def program(self) -> str:
        """The command line that knows the methods: `shipid`, or the user's script where one of them is the user's."""
        known = all(type(way.method).__module__.partition(".")[0] == "shipid" for way in self.methods)
        return "shipid" if known else shlex.join(["python", _script() or USER_SCRIPT])

    @property
    def command(self) -> str:
        """The command that runs this study, with its changes: by name if bundled, else by its file.

        A line before it says what the script is where a method is the user's and no script has started this process.
        """
        name = self.name if documents.bundled("studies").get(self.name) == Path(self.file) else as_argument(self.file)
        changes = (f"--set {shlex.quote(f'{path}={json.dumps(value)}')}" for path, value in self.changes.items())
        words = " ".join([self.program, "study run", name, *changes])
        missing = self.program != "shipid" and not _script()
        return (
            f"# {USER_SCRIPT}: your script that puts the method into METHODS and calls main\n{words}"
            if missing
            else words
        )

    @property
    def digest_in_any_world(self) -> str:
        """Digest without the top-level seed: equal for repetitions of one study."""
        return self._digest({key: value for key, value in self.document.items() if key != "seed"})

    def _digest(self, document: Document) -> str:
        vessels = sorted({vessel.digest for vessel in self.used_vessels})
        methods = [{"kind": way.kind, **way.method.model_dump(mode="json", exclude_none=True)} for way in self.methods]
        depends = {"vessels": vessels, "sources": dict(self.sources), "methods": methods}
        return documents.digest({"study": document, **depends})

    @property
    def fitted(self) -> set[str]:
        """Families whose numbers or observer, and so their A, depend on the data of the batch."""
        return {foundation.family for foundation in self.foundations if foundation.fitted}

    @property
    def aside(self) -> set[str]:
        """Families that are shown, but that no claim and no sentence of the answer counts."""
        return self.study.claims.not_judged if self.study.claims else set()

    @property
    def judged(self) -> str:
        """Name of the method that findings and the answer speak of."""
        named = self.study.claims.method if self.study.claims else None
        learning = [way for way in self.methods if way.method.compensates]
        physics = [way for way in learning if way.foundations != (NO_MODEL,)]
        return named or next((way.name for way in (*physics, *learning)), self.methods[0].name)

    @property
    def plain(self) -> str | None:
        """Name of the method that predicts without physics and without mirror symmetry, if there is one."""
        alone = [way for way in self.methods if way.foundations == (NO_MODEL,) and way.name != self.judged]
        return next((way.name for way in alone if getattr(way.method, "mirror", None) == 0.0), None)

    @property
    def learning(self) -> list[str]:
        """Names of the methods that learn from data, but for the plain rival without physics."""
        return [way.name for way in self.methods if way.method.compensates and way.name != self.plain]

    @property
    def question(self) -> str:
        """The question that the study answers."""
        return self.study.question

    @property
    def claims(self) -> Claims | None:
        """What findings compare, if the study names it."""
        return self.study.claims

    @property
    def published(self) -> Published | None:
        """A published envelope of inputs to compare with, if there is one."""
        return self.study.published

    @property
    def seed(self) -> int:
        """Seed of the world."""
        return self.study.seed

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the grid, those of its world, each once, the least first."""
        return tuple(sorted(set(self.study.grid.seeds)))

    @property
    def level(self) -> float:
        """Nominal coverage of the bands."""
        return self.study.bands.level

    @property
    def refits(self) -> int:
        """Number of fits without some runs that calibrate a band."""
        return self.study.bands.refits

    @property
    def horizon(self) -> int:
        """Number of steps ahead."""
        return self.study.prediction.horizon

    @property
    def commands(self) -> Commands:
        """Whether the commands of the horizon are `held` or `known`."""
        return self.study.prediction.commands

    @property
    def euler(self) -> bool:
        """Whether the physics takes explicit Euler steps."""
        return self.study.prediction.integrator == "euler"

    @property
    def known(self) -> bool:
        """Whether the commands of the horizon are known."""
        return self.commands == "known"

    @property
    def reacting(self) -> bool:
        """Whether orders may have reacted to the ship: recorded runs, or made manoeuvres that steer by her heading."""
        truth = self.study.truth
        return truth is None or any(getattr(one, "kind", "") in FEEDBACK for one in truth.manoeuvre)

    @property
    def draws(self) -> dict[str, Any] | None:
        """What decides orders and weather of simulated runs, whatever the ship; None for recorded runs."""
        truth = self.study.truth
        weather = {"wind_speed", "gusts", "waves", "current_speed", "environment"}
        return truth.model_dump(include={"seed", "manoeuvre", *weather}) if truth else None

    @property
    def obtaining(self) -> str:
        """What is done to obtain the runs, in words."""
        if self.study.truth is not None:
            return "simulating the truth"
        made = self.study.data is not None and self.study.data.dataset is not None
        return "reading the dataset" if made else "importing the log"

    @cached_property
    def families(self) -> tuple[Family, ...]:
        """The families of the study, those that extend another written out."""
        return tuple(resolve(self.study.family, self.file))

    @property
    def causal(self) -> tuple[str, ...]:
        """Columns whose inputs hold the last fix."""
        return tuple(self.study.data.causal) if self.study.data else ()

    @property
    def past(self) -> int:
        """Steps of the past that every window holds: the run-up, what the study asks for, or more for a method."""
        prediction, truth = self.study.prediction, self.study.truth
        run_up = 0.0 if truth is None else truth.run_up
        seconds = max(run_up, prediction.past, *(way.method.past for way in self.methods))
        return math.ceil(seconds / prediction.step - 1e-9)

    @property
    def pairs(self) -> list[tuple[str, Way]]:
        """Every foundation with every method that it meets: a cell each at every amount of data and seed."""
        return [(f.name, way) for f in self.foundations for way in self.methods if f.name in way.foundations]

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.batches) * len(self.pairs)

    @cached_property
    def units(self) -> tuple[Unit, ...]:
        """All work, the largest amounts of data first; a unit repeats hardly anything that another one does."""
        groups = self._shared()
        return tuple(
            Unit(batch, group, batch.key if len(groups) == 1 else batch.cell(*group[0]))
            for batch in self.batches
            for group in groups
        )

    def turn(self, test: str, amount: int) -> Plan:
        """Return the study with one test run and one amount of data, every seed of the grid."""
        split = self.study.split.model_copy(update={"test": [test]})
        grid = self.study.grid.model_copy(update={"N_D": [amount]})
        study = self.study.model_copy(update={"split": split, "grid": grid})
        return replace(self, study=study, batches=tuple(Batch(amount, seed) for seed in self.seeds))

    def whole(self, batch: Batch) -> Unit:
        """All cells of a batch as one unit."""
        return Unit(batch, tuple((name, way.name) for name, way in self.pairs), batch.key)

    def _shared(self) -> list[tuple[tuple[str, str], ...]]:
        """The cells of a batch in groups: one group shares a fit of several foundations, or one to the runs."""
        known = {one.name: one for one in self.foundations}
        groups: list[tuple[set[Any], list[tuple[str, str]]]] = []
        for name, way in self.pairs:
            one = known[name]
            shares: set[Any] = {way.name} if way.method.together else set()
            if one.identify is not None and one.variant is not None:
                shares.add((one.variant.name, one.identify.model_dump_json()))
            elif one.fitted:
                shares.add(one.name)
            pairs = [(name, way.name)]
            for group in [group for group in groups if group[0] & shares]:
                groups.remove(group)
                shares |= group[0]
                pairs = [*group[1], *pairs]
            groups.append((shares, pairs))
        order = {(name, way.name): place for place, (name, way) in enumerate(self.pairs)}
        return sorted((tuple(sorted(pairs, key=order.__getitem__)) for _, pairs in groups), key=lambda g: order[g[0]])

    def cut(self, columns: int) -> Cut:
        """The numbers that decide the memory of the windows, for a dataset of so many columns."""
        prediction = self.study.prediction
        rolled = len(self.foundations)
        return Cut(prediction.horizon, self.past, prediction.step, prediction.interval, columns, rolled)

    def label(self, foundation: str, method: str) -> str:
        """Name of a model for people: the foundation, with the method where that is not the one judged."""
        return foundation if method == self.judged else f"{foundation} {WITH} {method}"

    def text(self) -> str:
        """The resolved document as TOML."""
        return tomlkit.dumps(self.document)


def read_plan(name: str | Path, changes: Mapping[str, Any] | None = None) -> Plan:
    """Read a study by bundled name or path, with `--set` changes applied, and check all that can be checked now.

    Raises DocumentError with file, dotted path and remedy.
    """
    by_name("changes", changes or {}, "a dotted path to a value", DocumentError)
    file = documents.find(str(name), "studies")
    document = documents.read(file)
    for path in changes or {}:
        head = str(path).split(".", 1)[0]
        if head not in Study.model_fields:
            raise DocumentError(f"--set: no such block: {choices(head, Study.model_fields)}", file=file, path=str(path))
    try:
        document = documents.replace(document, changes or {})
    except DocumentError as error:
        raise DocumentError(f"--set: {error.message}", file=file, path=error.path) from None
    return build_plan(document, file, changes=changes)


def build_plan(
    document: Document,
    file: Path,
    vessels: Mapping[str, Vessel] | None = None,
    sources: Mapping[str, str] | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Plan:
    """Check a study document and expand it into models and batches; known `vessels` and `sources` need no file."""
    try:
        return _built(document, file, vessels, sources, changes)
    except DocumentError as error:
        raise _named(error, document) from None


def _named(error: DocumentError, document: Document) -> DocumentError:
    """The error with paths by which a person finds the block: families and methods by name."""
    path = error.path and documents.by_name(document, error.path)
    others = [_named(other, document) for other in error.others if isinstance(other, DocumentError)]
    return type(error)(error.message, file=error.file, path=path, others=others)


def _built(
    document: Document,
    file: Path,
    vessels: Mapping[str, Vessel] | None,
    sources: Mapping[str, str] | None,
    changes: Mapping[str, Any] | None,
) -> Plan:
    documents.check_values(document, file)
    _check_version(document, file)
    study = documents.parse(Study, document, file).in_its_world()
    check_ranges(document, file)
    check_seeds(study, file)
    known = dict(vessels or {})
    foundations = _foundations(study, file, known)
    methods = _methods(study, foundations, file)
    _check_claims(study, foundations, file)
    batches = tuple(
        Batch(amount, seed)
        for amount in sorted(set(study.grid.N_D), reverse=True)
        for seed in sorted(set(study.grid.seeds))
    )
    truth = None
    if study.truth is not None:
        _check_amounts(study, study.truth, file)
        base = _vessel(study.truth.vessel, file, "truth.vessel", known)
        try:
            truth = vessel_of(study.truth, base)
            check_truth(study.truth, truth)
        except DocumentError as error:
            raise DocumentError(error.message, file=file, path=error.path) from None
    digests = _sources(study.data, file) if sources is None and study.data is not None else sources
    plan = Plan(
        file.stem, str(file), document, study, foundations, methods, batches, truth, known, digests or {}, changes or {}
    )
    _check_names(plan)
    _check_memory(plan)
    return replace(plan, parts=_parts(plan, file, known))


def _parts(plan: Plan, file: Path, known: dict[str, Vessel]) -> dict[str, Part]:
    """Every repetition in every condition: `constant-1`, ...; DocumentError with the path of the cause."""
    repeat, conditions = plan.study.repeat, plan.study.condition
    if not repeat and not conditions:
        return {}
    names = [condition.name for condition in conditions]
    for place in range(len(names)):
        if twice := _twice(names[: place + 1]):
            raise DocumentError(f"two conditions are called {twice}", file=file, path=f"condition.{place}.name")
    bare = {key: value for key, value in plan.document.items() if key not in OF_PARTS}
    turns = [dict(zip(repeat, values, strict=True)) for values in product(*repeat.values())]
    parts: dict[str, Part] = {}
    for place, condition in enumerate(conditions or [None]):
        for number, turn in enumerate(turns, start=1):
            words = [*([condition.name] if condition else []), *([str(number)] if repeat else [])]
            name = "-".join(words)
            mine: dict[str, Any] = {} if condition is None else condition.set
            part = build_plan(_changed(bare, mine, f"condition.{place}.set", file), file, known, plan.sources or None)
            part = build_plan(_changed(part.document, turn, "repeat", file), file, known, plan.sources or None)
            whole: dict[str, Any] = {"repeat": {}, "condition": []}
            parts[name] = Part(
                condition.name if condition else "", replace(part, changes={**plan.changes, **whole, **mine, **turn})
            )
    return parts


def _changed(document: Document, changes: Mapping[str, Any], where: str, file: Path) -> Document:
    """A document with changes; DocumentError that names the key of the change where it reaches nothing."""
    for path, value in changes.items():
        if path.split(".", 1)[0] not in set(Study.model_fields) - set(OF_PARTS):
            message = f"no such block: {choices(path, set(Study.model_fields) - set(OF_PARTS))}"
            raise DocumentError(message, file=file, path=f"{where}.{path}")
        try:
            document = documents.replace(document, {path: value})
        except DocumentError as error:
            raise DocumentError(error.message, file=file, path=f"{where}.{path}") from None
    return document


def _check_names(plan: Plan) -> None:
    """Refuse names that are too long for the file of a cell."""
    for name, way in plan.pairs:
        longest = max(len(batch.cell(name, way.name)) for batch in plan.batches)
        if longest > LONGEST_NAME:
            message = (
                f"{name[:40]}...: the name of a cell would have {longest} characters, at most {LONGEST_NAME} can be"
            )
            raise DocumentError(f"{message}: shorten the names of families and methods", file=plan.file, path="family")


def _check_memory(plan: Plan) -> None:
    """Refuse a truth whose records or windows exceed the memory of this machine, with the number that causes it."""
    truth = plan.study.truth
    if truth is None or plan.truth is None:
        return
    commands = 2 * len(plan.truth.document.get("thruster", {}))
    columns = 8 + commands
    each = {"truth.step": commands + columns * bool(truth.sensors) + 4 * bool(truth.gusts), "truth.interval": columns}
    for path, between in (("truth.step", truth.step), ("truth.interval", truth.interval)):
        numbers = truth.manoeuvres * truth.length / between * each[path]
        words = f"{between:g} s: {truth.manoeuvres} runs of {truth.length:g} s"
        check_memory(numbers, words, path, plan.file)
    words = f"{plan.study.prediction.interval:g} s: {truth.manoeuvres} runs cut into windows at this interval"
    numbers = truth.manoeuvres * plan.cut(columns).numbers(truth.length)
    check_memory(numbers, words, "prediction.interval", plan.file)


def beside(folder: Path, name: str) -> Path:
    """A file that a study names: from the study's folder, else from the working folder."""
    return folder / name if (folder / name).exists() else Path(name)


def mapping_of(data: Data, file: Path) -> str | None:
    """The mapping that a study names: a bundled name as it is, a path from the study's folder on."""
    named = data.mapping
    return str(beside(file.parent, named)) if named is not None and named.endswith(".toml") else named


def _sources(data: Data, file: Path) -> dict[str, str]:
    """Digests of what the runs come from, every file of it; a missing file is reported when it is read."""
    source, digests = mapping_of(data, file), dict[str, str]()
    if source is not None:
        mapping = read_mapping(source)
        digests["mapping"] = mapping.digest
        if data.log is not None:
            with suppress(DataError):
                digests["log"] = digest_of(mapping, beside(file.parent, data.log))
    if data.dataset is not None and beside(file.parent, data.dataset).is_file():
        digests["dataset"] = sha256_of(beside(file.parent, data.dataset))
    return digests


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


def _vessel(name: str, file: Path, path: str, known: dict[str, Vessel]) -> Vessel:
    """A vessel that the study names at a path: one that is known, or read now and known from now on."""
    if name not in known:
        try:
            document = documents.find(name, "models", file.parent)
        except DocumentError as error:
            raise DocumentError(f"{name!r}: {error.message}", file=file, path=path) from None
        known[name] = load_vessel(str(document))
    return known[name]


def _check_version(document: Document, file: Path) -> None:
    """Refuse a document of version 0.1: a line for each old key, with what to write instead."""
    old = [DocumentError(message, file=file, path=path) for path, message in _old_keys(document)]
    if old:
        raise DocumentError(old[0].message, file=file, path=old[0].path, others=old[1:])


def _old_keys(document: Document) -> Iterator[tuple[str, str]]:
    """Yield the dotted path of every key of version 0.1 in a document, and what to write instead."""
    if "recipe" in document:
        kind = document["recipe"].get("kind", "fast") if isinstance(document["recipe"], dict) else "fast"
        new = {"paper": "path-trained"}.get(kind, "path-drawn")
        yield "recipe", f'write [[method]] with name = "{new}", kind = "{new}" and the other keys of [recipe] instead'
    prediction = document.get("prediction")
    if isinstance(prediction, dict) and "horizon" in prediction:
        value, step = prediction["horizon"], prediction.get("step", 1.0)
        numbers = isinstance(value, int | float) and isinstance(step, int | float)
        seconds = f"ahead = {value * step:g}" if numbers else "ahead"
        yield "prediction.horizon", f"was a number of steps: write {seconds}, in seconds"
    if isinstance(prediction, dict) and "method" in prediction:
        yield "prediction.method", "is now called `integrator`"
    truth = document.get("truth")
    if isinstance(truth, dict) and (moved := old_keys(truth)):
        yield "truth", moved
    families = document.get("family")
    for index, family in enumerate(families if isinstance(families, list) else []):
        if isinstance(family, dict) and "identify" in family and {"base", "perturb", "members"} & family.keys():
            yield f"family.{index}.identify", _separate_family(str(family.get("name", "")), "identify")


def _separate_family(name: str, block: str) -> str:
    return (
        "an identified or observed family must be a separate family: remove the block here and add "
        f'[[family]] name = "{name}-new", extends = "{name}" with the block [family.{block}]'
    )


def _foundations(study: Study, file: Path, known: dict[str, Vessel]) -> tuple[Foundation, ...]:
    """Every member of every family; an identified family has the members of the family that it extends."""
    families = resolve(study.family, file)
    foundations: list[Foundation] = []
    for index, family in enumerate(families):
        assert family.base is not None  # written out by resolve
        if family.name.lower() == NO_MODEL:
            message = "this name is taken by the foundation without physics"
            raise DocumentError(message, file=file, path=f"family.{index}.name")
        vessel = _vessel(family.base, file, f"family.{index}.base", known)
        words = family.description or ""
        if family.identify is None and family.observer is None:
            foundations += [
                Foundation(v.name, v.family, v.member, v, vessel, words) for v in members(family, vessel, file)
            ]
            continue
        root = _root(study.family, index, file)
        parent = families[root]
        settings = None if family.identify is None else _identify(study, family, index, vessel, file)
        observer = None if family.observer is None else _observer(study, family, index, vessel, file)
        ways = (IDENTIFIED if settings else "", OBSERVED if observer else "")
        described = words or ", ".join(filter(None, (parent.description, *ways)))
        for variant in members(parent, vessel, file):
            name = family.name if parent.members == 1 else f"{family.name}-{variant.member + 1}"
            foundations.append(
                Foundation(name, family.name, variant.member, variant, vessel, described, settings, observer)
            )
    if twice := _twice([foundation.name for foundation in foundations]):
        raise DocumentError(f"two models would be called {twice}: rename a family", file=file, path="family")
    return (*foundations, Foundation(NO_MODEL, NO_MODEL, 0, None, None, "pure data-driven: no physics"))


def _twice(names: Sequence[str]) -> str:
    """The first two names that would be one file, in words; empty where there are none.

    Many file systems do not tell capitals from small letters: the files of one model would replace those of the other.
    """
    first: dict[str, str] = {}
    for name in names:
        key = name.lower()
        if key in first:
            same = first[key]
            return repr(name) if same == name else f"{same!r} and {name!r}, which are one file on many systems"
        first[key] = name
    return ""


def _root(families: Sequence[Family], index: int, file: Path) -> int:
    """Place of the family whose members an identified or observed family takes, as far up as it extends.

    DocumentError unless the families on the way only extend: no base, perturbations or members.
    """
    by_name = {family.name: place for place, family in enumerate(families)}
    while families[index].identify is not None or families[index].observer is not None:
        one, block = families[index], "identify" if families[index].identify is not None else "observer"
        if one.extends is None or one.perturb or "members" in one.model_fields_set:
            raise DocumentError(_separate_family(one.name, block), file=file, path=f"family.{index}.{block}")
        index = by_name[one.extends]
    return index


def _observer(study: Study, family: Family, index: int, vessel: Vessel, file: Path) -> Observer:
    """Settings of an observer of this vessel; DocumentError with the path of a wrong key or value.

    Where velocities make the true path, positions are too coarse to be measurements; then no current can be seen.
    """
    coarse = study.data is not None and study.data.path == "velocity"
    default: dict[str, Any] = {"measured": ["psi", "u", "v", "r"], "current": 0.0} if coarse else {}
    settings: Observer = documents.parse(Observer, default | (family.observer or {}), file, f"family.{index}.observer")
    try:
        bank(vessel, settings)
    except DocumentError as error:
        raise DocumentError(error.message, file=file, path=f"family.{index}.observer") from None
    return settings


def _identify(study: Study, family: Family, index: int, vessel: Vessel, file: Path) -> Identify:
    """What a family identifies; horizon, step and method are those of the study's prediction unless it says else."""
    ahead, prefix = study.prediction, f"family.{index}.identify"
    default = {"horizon": ahead.ahead, "step": ahead.step, "method": ahead.integrator}
    settings: Identify = documents.parse(Identify, default | (family.identify or {}), file, prefix)
    try:
        unknowns(vessel, settings)
    except DocumentError as error:
        where = (error.path or "identify").replace("identify", prefix, 1)
        raise DocumentError(error.message, file=file, path=where) from None
    return settings


def _methods(study: Study, foundations: Sequence[Foundation], file: Path) -> tuple[Way, ...]:
    """The methods with their settings checked, and the foundations that each meets."""
    ways: list[Way] = []
    families = list(dict.fromkeys(foundation.family for foundation in foundations))
    for index, block in enumerate(study.method):
        path = f"method.{index}"
        if twice := _twice([*(way.name for way in ways), block.name]):
            raise DocumentError(f"two methods are called {twice}", file=file, path=f"{path}.name")
        try:
            method = method_of(block.kind, block.settings, path)
        except DocumentError as error:
            raise DocumentError(error.message, file=file, path=error.path) from None
        met: set[str] = set()
        refused = set() if method.meets_observer else {f.family for f in foundations if f.observer is not None}
        for pattern in block.families:
            if pattern in refused:
                message = f"{pattern!r} has an observer, which {block.kind} does not take: name the family it extends"
                raise DocumentError(message, file=file, path=f"{path}.families")
            matching = documents.match(pattern, families)
            if not matching:
                message = f"{pattern!r} is no family: {choices(pattern, families)}"
                raise DocumentError(message, file=file, path=f"{path}.families")
            met.update(matching)
        if not method.meets_none:
            met -= {NO_MODEL}
        left_out = tuple(f.name for f in foundations if f.family in met & refused)
        taken = tuple(f.name for f in foundations if f.family in met - refused)
        ways.append(Way(block.name, block.kind, method, taken, left_out))
    met_by_any = {name for way in ways for name in way.foundations} | {NO_MODEL}
    idle = next((foundation.name for foundation in foundations if foundation.name not in met_by_any), None)
    if idle is not None:
        observed = any(idle in way.left_out for way in ways)
        remedy = "add one that takes an observer, such as alone" if observed else "name its family in `families`"
        raise DocumentError(f"no method meets {idle!r}: {remedy}", file=file, path="method")
    return tuple(ways)


def _check_claims(study: Study, models: Sequence[Foundation], file: Path) -> None:
    """Refuse claims about families that are not there, or that are not what their role needs."""
    if study.claims is None:
        return
    families = [model.family for model in models if model.family != NO_MODEL]
    named = [*study.claims.roles.items(), *(("aside", name) for name in study.claims.aside)]
    for role, name in named:
        if name not in families:
            message = f"{name!r} is not a family: {choices(name, set(families))}"
            raise DocumentError(message, file=file, path=f"claims.{role}")
    names = [block.name for block in study.method]
    if study.claims.method is not None and study.claims.method not in names:
        message = f"{study.claims.method!r} is not a method: {choices(study.claims.method, names)}"
        raise DocumentError(message, file=file, path="claims.method")
    roles = study.claims.roles
    for role, family in roles.items():
        single, count = ROLES[role].single, families.count(family)
        if single and count > 1:
            raise DocumentError(f"{family!r} has {count} members: {single}", file=file, path=f"claims.{role}")
    for role, family in roles.items():
        same = next((other for other in ROLES[role].unlike if roles.get(other) == family), None)
        if same is not None:
            message = f"the same family as claims.{same}: name two different families"
            raise DocumentError(message, file=file, path=f"claims.{role}")
    nominal = next((model for model in models if model.family == roles.get("nominal")), None)
    if nominal is not None and nominal.variant is not None and nominal.variant.values:
        message = f"{nominal.name!r} is perturbed: the nominal model must be the base as it is"
        raise DocumentError(message, file=file, path="claims.nominal")
