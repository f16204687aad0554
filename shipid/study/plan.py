"""From a study document to batches of cells: what will be computed, before anything is."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import tomlkit

from shipid import document as documents
from shipid.arguments import by_name
from shipid.data.windows import Commands
from shipid.document import Document
from shipid.errors import DataError, DocumentError, choices
from shipid.files import as_argument
from shipid.logs.importing import digest_of, sha256_of
from shipid.logs.mapping import read_mapping
from shipid.simulation.manoeuvre import KINDS
from shipid.simulation.truth import Truth, check_truth, vessel_of
from shipid.study.code import users_code
from shipid.study.declared import (
    NO_MODEL,
    Foundation,
    Way,
    check_claims,
    foundations_of,
    methods_of,
    named_vessel,
    same_file,
)
from shipid.study.ranges import LONGEST_NAME, check_memory, check_ranges, check_seeds, window_numbers
from shipid.study.schema import Claims, Data, Published, Study, check_version
from shipid.users import of_users
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import Family, resolve
from shipid.vessel.schema import functions

WITH = "+"  # between a foundation and a method
OF_PART = "/"  # between the name of a part and that of its source
OF_PARTS = ("repeat", "condition")  # keys that make several studies of one
METHOD_CODE, TERM_CODE = "code of the method", "code of the term"  # entries of a session: name -> digest
USER_SCRIPT = "my.py"  # a user's script with a method or a term, where its name is unknown


def _script() -> str:
    """The user's script that is the command line of this process; empty for another command line, or none."""
    return sys.argv[0] if sys.argv[0].endswith(".py") and sys.argv[1:2] == ["study"] else ""


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
    sources : digests of the mapping, log or dataset that recorded runs come from; `PART/dataset` where a part has
        another one.
    changes : what `--set` changed, already in the document.
    parts : name -> a complete study for every repetition in every condition; empty where there is neither. If there
        are parts, they are run in place of this study.
    """

    name: str
    file: str
    document: Document = field(repr=False)
    study: Study = field(repr=False)
    foundations: tuple[Foundation, ...] = field(repr=False)
    methods: tuple[Way, ...] = field(repr=False)
    batches: tuple[Batch, ...] = field(repr=False)
    truth: Vessel | None = None
    vessels: Mapping[str, Vessel] = field(default_factory=dict, repr=False)
    sources: Mapping[str, str] = field(default_factory=dict)
    changes: Mapping[str, Any] = field(default_factory=dict)
    parts: Mapping[str, Part] = field(default_factory=dict, repr=False)

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
        of_parts = (name for part in self.parts.values() for name in part.plan.inputs)
        mine = (beside(here.parent, name) for name in named if name is not None)
        return list(dict.fromkeys([here, *vessels, *mine, *of_parts]))

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
        """The command line that knows methods and terms: `shipid`, or the user's script where the user wrote one."""
        return "shipid" if not self.code else shlex.join(["python", _script() or USER_SCRIPT])

    @property
    def code(self) -> dict[str, dict[str, str]]:
        """What the user wrote: `code of the method`, by its name, and `code of the term`, by its key -> digest.

        A method has the code of its corrector too, a term that of all its functions. What has none is left out.
        KeyError for a term of a vessel that TERMS of this process lacks.
        """
        kinds = {way.name: type(way.method) for way in self.methods}
        of_method = {name: (kind, getattr(kind, "corrector", kind)) for name, kind in kinds.items()}
        of_term = {key: held for vessel in self.used_vessels for key, held in functions(vessel.document).items()}
        every: dict[str, Mapping[str, tuple[Callable[..., Any], ...]]] = {METHOD_CODE: of_method, TERM_CODE: of_term}
        found = {
            what: {name: users_code(held) for name, held in named.items() if any(map(of_users, held))}
            for what, named in every.items()
        }
        return {what: digests for what, digests in found.items() if digests}

    @property
    def command(self) -> str:
        """The command that runs this study, with its changes: by name if bundled, else by its file.

        A line before it says what the script is where the user wrote a part and no script has started this process.
        """
        name = self.name if documents.bundled("studies").get(self.name) == Path(self.file) else as_argument(self.file)
        changes = (f"--set {shlex.quote(f'{path}={json.dumps(value)}')}" for path, value in self.changes.items())
        words = " ".join([self.program, "study run", name, *changes])
        missing = self.program != "shipid" and not _script()
        note = f"# {USER_SCRIPT}: your script that puts methods into METHODS or terms into TERMS and calls main\n"
        return note + words if missing else words

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

    def learns(self, family: str, method: str) -> bool:
        """Whether other training runs would change what a method predicts with a family: either of them is fitted."""
        return family in self.fitted or any(way.method.compensates for way in self.methods if way.name == method)

    @property
    def aside(self) -> set[str]:
        """Families that are shown, but that no claim and no sentence of the answer counts."""
        return self.study.claims.not_judged if self.study.claims else set()

    def saw(self, runs: Iterable[str]) -> list[str]:
        """Families whose numbers were set from any of these runs."""
        return [family.name for family in self.families if not set(family.seen).isdisjoint(runs)]

    def unfair(self, tests: Iterable[str]) -> str:
        """Why R1-R4 and S1-S7 are not judged on these test runs; empty where no family of theirs saw any of them."""
        roles = self.claims.roles.values() if self.claims else ()
        saw = [name for name in self.saw(tests) if name in roles]
        return f"the numbers of {', '.join(saw)} were set from runs that test: name another in [claims]" if saw else ""

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
        return next((way.name for way in alone if way.method.traits.mirror is False), None)

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
        return truth is None or any(KINDS[one.kind].reacts() for one in truth.manoeuvre)

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
        raise _named(error, document, tuple(changes or ())) from None


def _named(error: DocumentError, document: Document, changes: Sequence[str]) -> DocumentError:
    """The error with paths by which a person finds the block, families and methods by name; whether --set made it."""
    path = error.path and documents.by_name(document, error.path)
    others = [_named(other, document, changes) for other in error.others if isinstance(other, DocumentError)]
    changed = any(f"{place}.".startswith(f"{change}.") for place in (error.path, path) for change in changes)
    message = f"--set: {error.message}" if changed else error.message
    return type(error)(message, file=error.file, path=path, others=others)


def _built(
    document: Document,
    file: Path,
    vessels: Mapping[str, Vessel] | None,
    sources: Mapping[str, str] | None,
    changes: Mapping[str, Any] | None,
) -> Plan:
    documents.check_values(document, file)
    check_version(document, file)
    study = documents.parse(Study, document, file).in_its_world()
    check_ranges(document, file)
    check_seeds(study, file)
    known = dict(vessels or {})
    foundations = foundations_of(study, file, known)
    methods = methods_of(study, foundations, file)
    check_claims(study, foundations, file)
    batches = tuple(
        Batch(amount, seed)
        for amount in sorted(set(study.grid.N_D), reverse=True)
        for seed in sorted(set(study.grid.seeds))
    )
    truth = None
    if study.truth is not None:
        _check_amounts(study, study.truth, file)
        base = named_vessel(study.truth.vessel, file, "truth.vessel", known)
        try:
            truth = vessel_of(study.truth, base)
            check_truth(study.truth, truth)
        except DocumentError as error:
            raise DocumentError(error.message, file=file, path=error.path) from None
    digests = _sources(study.data, file) if sources is None else sources
    mine = {name: digest for name, digest in digests.items() if OF_PART not in name}
    plan = Plan(file.stem, str(file), document, study, foundations, methods, batches, truth, known, mine, changes or {})
    _check_names(plan)
    _check_memory(plan)
    plan = replace(plan, parts=_parts(plan, file, known, sources))
    theirs = {
        f"{name}{OF_PART}{source}": digest
        for name, part in plan.parts.items()
        if part.plan.study.data != study.data
        for source, digest in part.plan.sources.items()
    }
    return replace(plan, sources={**mine, **theirs})


def _parts(plan: Plan, file: Path, known: dict[str, Vessel], sources: Mapping[str, str] | None) -> dict[str, Part]:
    """Every repetition in every condition: `constant-1`, ...; DocumentError with the path of the cause."""
    repeat, conditions = plan.study.repeat, plan.study.condition
    if not repeat and not conditions:
        return {}
    names = [condition.name for condition in conditions]
    for place in range(len(names)):
        if twice := same_file(names[: place + 1]):
            raise DocumentError(f"two conditions are called {twice}", file=file, path=f"condition.{place}.name")
    for path, values in repeat.items():
        again = [value for place, value in enumerate(values) if value in values[:place]]
        if again:
            message = f"{again[0]!r} is there twice: give each value once, equal studies are no more evidence than one"
            raise DocumentError(message, file=file, path=f"repeat.{path}")
    bare = {key: value for key, value in plan.document.items() if key not in OF_PARTS}
    turns = [dict(zip(repeat, values, strict=True)) for values in product(*repeat.values())]
    parts: dict[str, Part] = {}
    for place, condition in enumerate(conditions or [None]):
        for number, turn in enumerate(turns, start=1):
            words = [*([condition.name] if condition else []), *([str(number)] if repeat else [])]
            name = "-".join(words)
            mine: dict[str, Any] = {} if condition is None else condition.set
            part = build_plan(_changed(bare, mine, f"condition.{place}.set", file), file, known, plan.sources)
            part = build_plan(_changed(part.document, turn, "repeat", file), file, known, plan.sources)
            if part.study.data != plan.study.data:
                part = replace(part, sources=_of_part(name, part, parts, sources))
            twin = next((other for other, done in parts.items() if done.plan.study == part.study), None)
            if twin is not None:
                message = f"{name} has the settings of {twin}: equal studies are no more evidence than one"
                raise DocumentError(message, file=file, path=f"condition.{place}.set" if conditions else "repeat")
            whole: dict[str, Any] = {"repeat": {}, "condition": []}
            parts[name] = Part(
                condition.name if condition else "", replace(part, changes={**plan.changes, **whole, **mine, **turn})
            )
    return parts


def _of_part(name: str, part: Plan, made: Mapping[str, Part], stored: Mapping[str, str] | None) -> Mapping[str, str]:
    """Digests of the sources of a part with data of its own: as stored, or of its files, which are read once."""
    if stored is not None:
        begins = f"{name}{OF_PART}"
        return {key.removeprefix(begins): digest for key, digest in stored.items() if key.startswith(begins)}
    same = next((one.plan.sources for one in made.values() if one.plan.study.data == part.study.data), None)
    return _sources(part.study.data, Path(part.file)) if same is None else same


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
    numbers = truth.manoeuvres * window_numbers(
        plan.study.prediction, plan.past, columns, len(plan.foundations), truth.length
    )
    check_memory(numbers, words, "prediction.interval", plan.file)


def beside(folder: Path, name: str) -> Path:
    """A file that a study names: from the study's folder, else from the working folder."""
    return folder / name if (folder / name).exists() else Path(name)


def mapping_of(data: Data, file: Path) -> str | None:
    """The mapping that a study names: a bundled name as it is, a path from the study's folder on."""
    named = data.mapping
    return str(beside(file.parent, named)) if named is not None and named.endswith(".toml") else named


def _sources(data: Data | None, file: Path) -> dict[str, str]:
    """Digests of what the runs come from, every file of it; a missing file is reported when it is read."""
    if data is None:
        return {}
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
    if truth.manoeuvres < 3:
        message = f"{truth.manoeuvres}: a study needs 3 or more: 1 to test, 2 to train and validate"
        raise DocumentError(message, file=file, path="truth.manoeuvres")
    if pool < 2:
        message = f"{test}: of {truth.manoeuvres} manoeuvres at most {truth.manoeuvres - 2} can test"
        raise DocumentError(message, file=file, path="split.test")
    if pool < most:
        message = f"{most}: {truth.manoeuvres} manoeuvres less {test} test runs leave {pool}"
        raise DocumentError(message, file=file, path="grid.N_D")
    if truth.duration < ahead:
        message = f"{truth.duration:g} s: shorter than the horizon of {ahead:g} s"
        raise DocumentError(message, file=file, path="truth.duration")
