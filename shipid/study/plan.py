"""From a study document to batches of cells: what will be computed, before anything is."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import tomlkit

from shipid import document as documents
from shipid.arguments import check_mapping
from shipid.capacity import excess_memory_words
from shipid.document import Document
from shipid.errors import DataError, DocumentError, placed_errors, suggest_name
from shipid.files import quote_argument
from shipid.foundations.function import SimulatorFunction
from shipid.hybrid.simulated import Simulator
from shipid.logs.importing import file_digest, log_digest
from shipid.logs.mapping import read_mapping
from shipid.plugins import TRIED_FILES, is_user_code, users_code
from shipid.simulation.families import expand_families
from shipid.simulation.manoeuvre import KINDS
from shipid.simulation.truth import LONGEST, Truth, check_truth, truth_vessel
from shipid.study.declared import (
    NO_MODEL,
    Foundation,
    StudyMethod,
    check_claims,
    check_cost,
    check_file_names,
    foundations_of,
    methods_of,
    named_simulators,
    named_vessel,
)
from shipid.study.schema import Data, Study
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import Family, resolve_families
from shipid.vessel.ranges import UNUSUAL
from shipid.vessel.schema import equation_functions

WITH = "+"  # between a foundation and a method
OF_PART = "/"  # between the name of a part and that of its source
OF_PARTS = ("repeat", "condition")  # keys that make several studies of one
METHOD_CODE, TERM_CODE, FUNCTION_CODE = "code of the method", "code of the term", "code of the function"
"""Entries of a session: name -> digest."""


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
    vessels, simulators : every vessel and simulator that the document names, by that name.
    sources : digests of the mapping, log or dataset that recorded runs come from; `PART/dataset` where a part has
        another one.
    changes : what `--set` changed, already in the document.
    families : of the study, those that extend another written out.
    parts : name -> a complete study for every repetition in every condition; empty where there is neither. If there
        are parts, they are run in place of this study.
    """

    name: str
    file: str
    document: Document = field(repr=False)
    study: Study = field(repr=False)
    foundations: tuple[Foundation, ...] = field(repr=False)
    methods: tuple[StudyMethod, ...] = field(repr=False)
    batches: tuple[Batch, ...] = field(repr=False)
    truth: Vessel | None = None
    vessels: Mapping[str, Vessel] = field(default_factory=dict, repr=False)
    simulators: Mapping[str, Simulator] = field(default_factory=dict, repr=False)
    sources: Mapping[str, str] = field(default_factory=dict)
    changes: Mapping[str, Any] = field(default_factory=dict)
    families: tuple[Family, ...] = field(default=(), repr=False)
    parts: Mapping[str, Part] = field(default_factory=dict, repr=False)

    @cached_property
    def pairs(self) -> tuple[tuple[str, StudyMethod], ...]:
        """Every foundation with every method that it meets: a cell each at every amount of data and seed."""
        met = {way.name: {*way.foundations} for way in self.methods}
        return tuple((f.name, way) for f in self.foundations for way in self.methods if f.name in met[way.name])

    @cached_property
    def units(self) -> tuple[Unit, ...]:
        """All work, the largest amounts of data first; a unit repeats hardly anything that another one does."""
        groups = _shared_pairs(self.foundations, self.pairs)
        return tuple(
            Unit(batch, group, batch.key if len(groups) == 1 else batch.cell(*group[0]))
            for batch in self.batches
            for group in groups
        )

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.batches) * len(self.pairs)

    @cached_property
    def digest(self) -> str:
        """Of the document, every vessel, the sources and the methods in full: what results depend on."""
        methods = [{"kind": way.kind, **way.method.model_dump(mode="json", exclude_none=True)} for way in self.methods]
        simulators = {one.digest for one in self.simulators.values()}
        vessels = sorted({vessel.digest for vessel in vessels_of(self)} | simulators)
        return documents.digest_document(
            {"study": self.document, "vessels": vessels, "sources": dict(self.sources), "methods": methods}
        )


def _shared_pairs(
    foundations: Iterable[Foundation], pairs: Iterable[tuple[str, StudyMethod]]
) -> list[tuple[tuple[str, str], ...]]:
    """The cells of a batch in groups: one group shares a fit of several foundations, or one to the runs."""
    known = {one.name: one for one in foundations}
    of_means = {name for one in known.values() if one.mean_of for name in (one.name, *one.mean_of)}
    above: dict[Any, Any] = {}  # of a cell, or of what cells share: a forest, a tree for each group

    def root(node: Any) -> Any:
        while above.setdefault(node, node) != node:
            node = above[node]
        return node

    for name, way in pairs:
        one = known[name]
        shares: set[Any] = {way.name} if way.method.together else set()
        if one.identify is not None and one.variant is not None:
            shares.add((one.variant.name, one.identify.model_dump_json()))
        elif one.fitted:
            shares.add(one.name)
        shares |= {(part, way.name) for part in (name, *one.mean_of)} if name in of_means else set()
        for share in shares:
            above[root((name, way.name))] = root(share)
    groups: dict[Any, list[tuple[str, str]]] = {}
    for name, way in pairs:
        groups.setdefault(root((name, way.name)), []).append((name, way.name))
    return [tuple(cells) for cells in groups.values()]


def vessels_of(plan: Plan) -> list[Vessel]:
    """The vessel of the truth, if there is one, and the bases of the foundations, of all parts too."""
    every = (plan.truth, *(foundation.base for foundation in plan.foundations))
    of_parts = (vessel for part in plan.parts.values() for vessel in vessels_of(part.plan))
    return [*(vessel for vessel in every if isinstance(vessel, Vessel)), *of_parts]


def input_files(plan: Plan) -> list[Path]:
    """Files that the study is read from: the document, vessels, simulators, the mapping, the log and the dataset."""
    data, here = plan.study.data, Path(plan.file)
    named = [] if data is None else [mapping_of(data, here), data.log, data.dataset]
    vessels = [Path(one.file) for one in plan.vessels.values()]
    vessels += [Path(one.file) for one in plan.simulators.values() if one.file]
    of_parts = (name for part in plan.parts.values() for name in input_files(part.plan))
    mine = (path_from_study(here.parent, name) for name in named if name is not None)
    return list(dict.fromkeys([here, *vessels, *mine, *of_parts]))


def default_folder(plan: Plan) -> Path:
    """Folder of a run that was not given one: `results/<study>-<first digits of the digest>`."""
    return Path("results") / f"{plan.name}-{plan.digest[:8]}"


def program_of(plan: Plan) -> str:
    """The command line that knows methods and terms: `shipid`, with the files that the user tries."""
    return " ".join(["shipid", *(f"--with {quote_argument(file)}" for file in TRIED_FILES if own_code(plan))])


def own_code(plan: Plan) -> dict[str, dict[str, str]]:
    """What the user wrote: `code of the method`, by its name, and `code of the term`, by its key -> digest.

    A method has the code of its corrector too, a term that of all its functions. What has none is left out.
    KeyError for a term of a vessel that TERMS of this process lacks.
    """
    kinds = {way.name: type(way.method) for way in plan.methods}
    every: dict[str, Mapping[str, tuple[Callable[..., Any], ...]]] = {
        METHOD_CODE: {name: (kind, getattr(kind, "corrector", kind)) for name, kind in kinds.items()},
        TERM_CODE: {key: held for one in vessels_of(plan) for key, held in equation_functions(one.document).items()},
    }
    own = {
        what: {name: users_code(held) for name, held in named.items() if any(map(is_user_code, held))}
        for what, named in every.items()
    }
    simulators = plan.simulators.items()
    own[FUNCTION_CODE] = {key: one.code_digest for key, one in simulators if isinstance(one, SimulatorFunction)}
    return {what: digests for what, digests in own.items() if digests}


def run_command(plan: Plan) -> str:
    """The command that runs this study, with its changes: by name if bundled, else by its file."""
    name = (
        plan.name
        if documents.bundled_documents("studies").get(plan.name) == Path(plan.file)
        else quote_argument(plan.file)
    )
    changes = (f"--set {shlex.quote(f'{path}={json.dumps(value)}')}" for path, value in plan.changes.items())
    return " ".join([program_of(plan), "study run", name, *changes])


def plan_text(plan: Plan) -> str:
    """The resolved document as TOML."""
    return tomlkit.dumps(plan.document)


def past_steps(plan: Plan) -> int:
    """Steps of the past that every window holds: the run-up, what the study asks for, or more for a method."""
    prediction, truth = plan.study.prediction, plan.study.truth
    run_up = 0.0 if truth is None else truth.run_up
    seconds = max(run_up, prediction.past, *(way.method.past for way in plan.methods))
    return math.ceil(seconds / prediction.step - 1e-9)


def grid_seeds(plan: Plan) -> tuple[int, ...]:
    """Seeds of the grid, those of its world, each once, the least first."""
    return tuple(sorted({batch.seed for batch in plan.batches}))


def verdict_method(plan: Plan) -> str:
    """Name of the method that findings and the answer speak of."""
    named = plan.study.claims.method if plan.study.claims else None
    learning = [way for way in plan.methods if way.method.compensates]
    physics = [way for way in learning if way.foundations != (NO_MODEL,)]
    return named or next((way.name for way in (*physics, *learning)), plan.methods[0].name)


def plain_rival(plan: Plan) -> str | None:
    """Name of the method that predicts without physics and without mirror symmetry, if there is one."""
    judged = verdict_method(plan)
    alone = [way for way in plan.methods if way.foundations == (NO_MODEL,) and way.name != judged]
    return next((way.name for way in alone if way.method.traits.mirror is False), None)


def learning_methods(plan: Plan) -> list[str]:
    """Names of the methods that learn from data, but for the plain rival without physics."""
    plain = plain_rival(plan)
    return [way.name for way in plan.methods if way.method.compensates and way.name != plain]


def fitted_families(plan: Plan) -> set[str]:
    """Families whose numbers or observer, and so their A, depend on the data of the batch."""
    return {foundation.family for foundation in plan.foundations if foundation.fitted}


def learns_from_runs(plan: Plan, family: str, method: str) -> bool:
    """Whether other training runs would change what a method predicts with a family: either of them is fitted."""
    return family in fitted_families(plan) or any(way.method.compensates for way in plan.methods if way.name == method)


def uncounted_families(plan: Plan) -> set[str]:
    """Families that are shown, but that no claim and no sentence of the answer counts."""
    return plan.study.claims.not_judged if plan.study.claims else set()


def families_set_from(plan: Plan, runs: Iterable[str]) -> list[str]:
    """Families whose numbers were set from any of these runs."""
    return [family.name for family in plan.families if not set(family.seen).isdisjoint(runs)]


def unfair_reason(plan: Plan, tests: Iterable[str]) -> str:
    """Why R1-R4 and S1-S7 are not judged on these test runs; empty where no family of theirs saw any of them."""
    roles = plan.study.claims.roles.values() if plan.study.claims else ()
    saw = [name for name in families_set_from(plan, tests) if name in roles]
    return f"the numbers of {', '.join(saw)} were set from runs that test: name another in [claims]" if saw else ""


def model_label(plan: Plan, foundation: str, method: str) -> str:
    """Name of a model for people: the foundation, with the method where that is not the one judged."""
    return foundation if method == verdict_method(plan) else f"{foundation} {WITH} {method}"


def orders_may_react(plan: Plan) -> bool:
    """Whether orders may have reacted to the ship: recorded runs, or made manoeuvres that steer by its heading."""
    truth = plan.study.truth
    return truth is None or any(KINDS[one.kind].reacts() for one in truth.manoeuvre)


def drawn_conditions(plan: Plan) -> dict[str, Any] | None:
    """What decides orders and weather of simulated runs, whatever the ship; None for recorded runs."""
    truth = plan.study.truth
    weather = {"wind_speed", "gusts", "waves", "current_speed", "environment"}
    return truth.model_dump(include={"seed", "manoeuvre", *weather}) if truth else None


def read_plan(name: str | Path, changes: Mapping[str, Any] | None = None, *, trust: bool = False) -> Plan:
    """Read a study by bundled name or path, with `--set` changes applied, and check all that can be checked now.

    trust : whether code that the document names may run, such as that of a function.

    Raises DocumentError with file, dotted path and remedy.
    """
    check_mapping("changes", changes or {}, "a dotted path to a value", DocumentError)
    file = documents.find_document(str(name), "studies")
    document = expand_families(documents.read_document(file), file)  # so that changes reach them
    try:
        document = expand_families(_changed_document(document, changes or {}, "", Study.model_fields), file)
    except DocumentError as error:
        raise DocumentError(f"--set: {error.message}", file=file, path=error.path) from None
    return build_plan(document, file, changes=changes, trust=trust)


def build_plan(
    document: Document,
    file: Path,
    vessels: Mapping[str, Vessel] | None = None,
    sources: Mapping[str, str] | None = None,
    changes: Mapping[str, Any] | None = None,
    simulators: Mapping[str, Simulator] | None = None,
    trust: bool = False,
) -> Plan:
    """Check a study document and expand it; known `vessels`, `sources` and `simulators` need no file."""
    try:
        return _check_and_expand(document, file, vessels, sources, changes, dict(simulators or {}), trust)
    except DocumentError as error:
        raise _error_by_name(error, document, tuple(changes or ()), str(file)) from None


def _error_by_name(error: DocumentError, document: Document, changes: Sequence[str], file: str) -> DocumentError:
    """The error with paths by which a person finds the block, families and methods by name; whether --set made it."""
    path = error.path and documents.path_with_names(document, error.path)
    others = [
        _error_by_name(other, document, changes, file) for other in error.others if isinstance(other, DocumentError)
    ]
    changed = any(f"{place}.".startswith(f"{change}.") for place in (error.path, path) for change in changes)
    message = f"--set: {error.message}" if changed else error.message
    return type(error)(message, file=error.file or file, path=path, others=others)


def _check_and_expand(
    document: Document,
    file: Path,
    vessels: Mapping[str, Vessel] | None,
    sources: Mapping[str, str] | None,
    changes: Mapping[str, Any] | None,
    simulators: dict[str, Simulator],
    trust: bool,
) -> Plan:
    documents.check_values(document, file)
    study = documents.parse_model(Study, document, file).in_its_world()
    check_ranges(document)
    known = dict(vessels or {})
    foundations = foundations_of(study, file, known, simulators, trust)
    methods = methods_of(study, foundations)
    check_claims(study, foundations)
    check_cost(study, foundations)
    batches = tuple(
        Batch(amount, seed) for amount in sorted(set(study.grid.N_D), reverse=True) for seed in study.seeds_of(amount)
    )
    truth = None
    if study.truth is not None:
        _check_amounts_of_truth(study, study.truth)
        base = named_vessel(study.truth.vessel, file, "truth.vessel", known)
        truth = truth_vessel(study.truth, base)
        check_truth(study.truth, truth)
        _check_memory(study.truth, truth)
        if study.truth.fmu is not None:
            named_simulators("fmu", study.truth.fmu, file, "truth.fmu", simulators, trust)
    digests = _sources(study.data, file) if sources is None else sources
    mine = {name: digest for name, digest in digests.items() if OF_PART not in name}
    families = tuple(resolve_families(study.family, file))
    plan = Plan(
        *(file.stem, str(file), document, study, foundations, methods, batches, truth, known, simulators, mine),
        changes=changes or {},
        families=families,
    )
    plan = replace(plan, parts=_parts(plan, file, known, sources, trust))
    theirs = {
        f"{name}{OF_PART}{source}": digest
        for name, part in plan.parts.items()
        if part.plan.study.data != study.data
        for source, digest in part.plan.sources.items()
    }
    return replace(plan, sources={**mine, **theirs})


def _parts(
    plan: Plan, file: Path, known: dict[str, Vessel], sources: Mapping[str, str] | None, trust: bool
) -> dict[str, Part]:
    """Every repetition in every condition: `constant-1`, ...; DocumentError with the path of the cause."""
    repeat, conditions = plan.study.repeat, plan.study.condition
    if not repeat and not conditions:
        return {}
    check_file_names([condition.name for condition in conditions], "condition.*.name", "conditions")
    bare = {key: value for key, value in plan.document.items() if key not in OF_PARTS}
    blocks = Study.model_fields.keys() - OF_PARTS
    turns = [dict(zip(repeat, values, strict=True)) for values in product(*repeat.values())]
    parts: dict[str, Part] = {}
    for place, condition in enumerate(conditions or [None]):
        for number, turn in enumerate(turns, start=1):
            words = [*([condition.name] if condition else []), *([str(number)] if repeat else [])]
            name = "-".join(words)
            mine: dict[str, Any] = {} if condition is None else condition.set
            changed = _changed_document(bare, mine, f"condition.{place}.set.", blocks)
            changed = _changed_document(changed, turn, "repeat.", blocks)
            part = build_plan(changed, file, known, plan.sources, simulators=plan.simulators, trust=trust)
            if part.study.data != plan.study.data:
                part = replace(part, sources=_of_part(name, part, sources))
            twin = next((other for other, done in parts.items() if done.plan.study == part.study), None)
            if twin is not None:
                message = f"{name} has the settings of {twin}: equal studies are no more evidence than one"
                raise DocumentError(message, path=f"condition.{place}.set" if conditions else "repeat")
            whole: dict[str, Any] = {"repeat": {}, "condition": []}
            parts[name] = Part(
                condition.name if condition else "", replace(part, changes={**plan.changes, **whole, **mine, **turn})
            )
    return parts


def _of_part(name: str, part: Plan, stored: Mapping[str, str] | None) -> Mapping[str, str]:
    """Digests of the sources of a part with data of its own: as stored, or of its files."""
    if stored is None:
        return _sources(part.study.data, Path(part.file))
    begins = f"{name}{OF_PART}"
    return {key.removeprefix(begins): digest for key, digest in stored.items() if key.startswith(begins)}


def _changed_document(document: Document, changes: Mapping[str, Any], where: str, blocks: Collection[str]) -> Document:
    """A document with changes; DocumentError that names `where` and the path of a change that reaches nothing."""
    for path, value in changes.items():
        head = str(path).split(".", 1)[0]
        with placed_errors(DocumentError, path=f"{where}{path}"):
            if head not in blocks:
                raise DocumentError(f"no such block: {suggest_name(head, blocks)}")
            document = documents.replace_values(document, {path: value})
    return document


def path_from_study(folder: Path, name: str) -> Path:
    """A file that a study names: from the study's folder, else from the working folder."""
    return folder / name if (folder / name).exists() else Path(name)


def mapping_of(data: Data, file: Path) -> str | None:
    """The mapping that a study names: a bundled name as it is, a path from the study's folder on."""
    named = data.mapping
    return str(path_from_study(file.parent, named)) if named is not None and named.endswith(".toml") else named


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
                digests["log"] = log_digest(mapping, path_from_study(file.parent, data.log))
    if data.dataset is not None and path_from_study(file.parent, data.dataset).is_file():
        digests["dataset"] = file_digest(path_from_study(file.parent, data.dataset))
    return digests


def _check_amounts_of_truth(study: Study, truth: Truth) -> None:
    """Refuse a truth with too few manoeuvres for the grid, or too short ones for the horizon."""
    test, most, ahead = study.split.test, max(study.grid.N_D), study.prediction.horizon * study.prediction.step
    if not isinstance(test, int):
        raise DocumentError("runs of a [truth] are drawn: give the number of test runs, such as 20", path="split.test")
    pool = truth.manoeuvres - test
    if pool < max(most, 2):
        message = f"{most}: {truth.manoeuvres} manoeuvres less {test} test runs leave {pool}, and 2 are the fewest"
        raise DocumentError(message, path="grid.N_D")
    if truth.duration < ahead:
        raise DocumentError(f"{truth.duration:g} s: shorter than the horizon of {ahead:g} s", path="truth.duration")


def _check_memory(truth: Truth, vessel: Vessel) -> None:
    """Refuse a truth whose records exceed the memory of this machine, with the number that causes it."""
    commands = 2 * len(vessel.document.get("thruster", {}))
    for path, between, columns in (("step", truth.step, commands), ("interval", truth.interval, 8 + commands)):
        if fault := excess_memory_words(truth.manoeuvres * truth.length / between * columns):
            words = f"{between:g} s: {truth.manoeuvres} runs of {truth.length:g} s {fault}"
            raise DocumentError(words, path=f"truth.{path}")


RANGES: dict[str, tuple[float, float, str]] = {
    "truth.duration": (0.0, LONGEST, "s"),
    "truth.run_up": (0.0, LONGEST, "s"),
    "truth.step": (1e-4, 60.0, "s"),
    "truth.interval": (1e-4, 3600.0, "s"),
    "truth.wind_speed.*": (0.0, 100.0, "m/s"),
    "truth.current_speed.*": (0.0, 20.0, "m/s"),
    "truth.waves.H_s": (0.0, 30.0, "m"),
    "truth.waves.T_p": (0.1, 60.0, "s"),
    "truth.manoeuvre.*_deg*": (-360.0, 360.0, "deg"),
    "truth.manoeuvre.*n_rpm*": (-1e5, 1e5, "rpm"),
    "truth.manoeuvre.*force*": (-1e8, 1e8, "N"),
    "truth.manoeuvre.*start_speed*": (-60.0, 60.0, "m/s"),
    "truth.manoeuvre.*_time": (0.0, LONGEST, "s"),
    "prediction.ahead": (0.0, 1e5, "s"),
    "prediction.step": (1e-3, 3600.0, "s"),
    "prediction.interval": (1e-3, 1e5, "s"),
    "prediction.past": (0.0, 1e5, "s"),
    "family.*.perturb.*.factor*": (-100.0, 100.0, "a factor"),
    "method.*.trials": (0, 1e5, "trials"),
    "method.*.epochs": (0, 1e6, "epochs"),
    "method.*.units": (0, 1e5, "units"),
}
"""Dotted path with * for any characters -> least, greatest, unit."""


def check_ranges(document: Document) -> None:
    """Raise DocumentError for a number of a study document outside `RANGES`, unless it is named in `unusual`."""
    meant = document.get(UNUSUAL, [])
    for path, value in documents.document_leaves(document):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        limits = next(
            (row for pattern, row in RANGES.items() if number and documents.match_paths(pattern, [path])), None
        )
        if limits is None or limits[0] <= value <= limits[1]:
            continue
        named = documents.path_with_names(document, path)
        if not any(documents.match_paths(str(one), [path, named]) for one in meant):
            remedy = f'if it is meant, write {UNUSUAL} = ["{named}"] at the top of the study'
            raise DocumentError(f"{value:g}: expected {limits[0]:g} to {limits[1]:g} {limits[2]}; {remedy}", path=path)
