"""What a study document declares: its foundations, the methods that they meet, and its claims, each checked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, get_args

from shipid import document as documents
from shipid.data.dataset import Dataset
from shipid.errors import DocumentError, ShipidError, placed_errors, suggest_name
from shipid.foundations import SIMULATORS
from shipid.hybrid.method import Method, misfit_words
from shipid.hybrid.methods import method_of
from shipid.hybrid.physics import Needs
from shipid.hybrid.simulated import Simulator
from shipid.identification.settings import Identify, free_factors
from shipid.observer import Observer, filter_bank
from shipid.study.schema import KINDS_OF_PHYSICS, PAIRED_ROLES, MeanBlock, Study
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, Variant, change_structure, draw_members, resolve_families
from shipid.vessel.similar import read_ships, similar_vessels, vessel_particulars

NO_MODEL = "none"
NO_METHOD = "alone"  # of the rows of A in comparisons of runs, whose N_D is 0: no data improve it
IDENTIFIED, OBSERVED = "identified from the runs of each cell", "with an observer"


@dataclass(frozen=True)
class Foundation:
    """What the physics says: a variant of a vessel, a variant identified from the runs of each batch, or nothing.

    variant : the numbers on the base; None is no physics at all.
    base : the vessel, or the simulator of somebody else, that the variant changes.
    identify : what is identified from the runs of each batch; None: nothing.
    observer : what filters the start of the physics and adds slow forces; None: nothing.
    mean_of : foundations of whose compensated paths it is the mean, without physics of its own.
    by_left_out : whether runs left out weigh them.
    """

    name: str
    family: str
    member: int
    variant: Variant | None
    base: Vessel | Simulator | None
    description: str = ""
    identify: Identify | None = None
    observer: Observer | None = None
    mean_of: tuple[str, ...] = ()
    by_left_out: bool = False

    @property
    def fitted(self) -> bool:
        """Whether its numbers or the settings of its observer come from the runs of each batch."""
        return self.identify is not None or (self.observer is not None and self.observer.choose)

    @property
    def vessel(self) -> Vessel | None:
        """The vessel with the numbers of the variant; None where it has no equations."""
        source = self.source
        return source if isinstance(source, Vessel) else None

    def with_runs(self, dataset: Dataset) -> Foundation:
        """Return the foundation with the runs that a simulator may have to go along."""
        return replace(self, base=self.base.with_runs(dataset)) if isinstance(self.base, Simulator) else self

    @property
    def source(self) -> Vessel | Simulator | None:
        """The base with the numbers of the variant."""
        if self.base is None or self.variant is None:
            return None
        return self.base.with_values(self.variant.values) if self.variant.values else self.base


@dataclass(frozen=True)
class StudyMethod:
    """A method of the study under its name.

    foundations : those that it meets, by name. left_out : those with an observer that its families would include, but
        that its kind cannot take.
    """

    name: str
    kind: str
    method: Method
    foundations: tuple[str, ...]
    left_out: tuple[str, ...] = ()


def named_vessel(name: str, file: Path, path: str, known: dict[str, Vessel]) -> Vessel:
    """A vessel that the study names at a path: one that is known, or read now and known from now on."""
    if name not in known:
        try:
            document = documents.find_document(name, "models", file.parent)
        except DocumentError as error:
            raise DocumentError(f"{name!r}: {error.message}", path=path) from None
        known[name] = load_vessel(str(document))
    return known[name]


def bases_of(
    family: Family, file: Path, path: str, known: dict[str, Vessel], simulators: dict[str, Simulator], trust: bool
) -> list[Vessel | Simulator]:
    """What the members of a family change: a vessel, a function, or tables, of which each is a member.

    simulators : those that are known, by `key`, to which those that are read now are added.
    """
    if family.base is not None:
        vessel = change_structure(family, named_vessel(family.base, file, f"{path}.base", known))
        return [*_similar_bases(family, vessel, file, f"{path}.similar", known)] if family.similar else [vessel]
    kind, value = next((kind, value) for kind in SIMULATORS if (value := getattr(family, kind)) is not None)
    found = named_simulators(kind, value, file, f"{path}.{kind}", simulators, trust)
    if family.structure or (family.perturb and kind == "predictions"):
        raise DocumentError(
            f"goes with a vessel{'' if family.structure else ' or a function'}, not with {kind}: leave it out",
            path=f"{path}.{'structure' if family.structure else 'perturb'}",
        )
    return [*found]


def _similar_bases(family: Family, own: Vessel, file: Path, path: str, known: dict[str, Vessel]) -> Iterator[Vessel]:
    """The ships most like a family's base, scaled: known ones, or found now and known from now on."""
    count = family.similar or 0
    names = [f"{own.key} {own.digest}: similar {place} of {count}, {family.ships}" for place in range(count)]
    if any(name not in known for name in names):
        places = [] if family.ships is None else [file.parent / family.ships, Path(family.ships)]
        try:
            ships = read_ships(next((place for place in places if place.is_dir()), places[-1] if places else None))
            if own.length is None:
                raise ShipidError("the base gives no particulars.L_pp, to which ships are scaled")
            found = [*islice(similar_vessels(vessel_particulars(own), ships, own), count)]
            if len(found) < count:
                raise ShipidError(f"{len(found)} ships can be scaled: ask for fewer, or name a folder `ships`")
        except ShipidError as error:
            raise DocumentError(f"{error.file}: {error.message}" if error.file else error.message, path=path) from None
        known |= {name: vessel for name, (_, vessel) in zip(names, found, strict=True)}
    return (known[name] for name in names)


def named_simulators(
    kind: str, value: Any, file: Path, path: str, simulators: dict[str, Simulator], trust: bool
) -> list[Simulator]:
    """Simulators that the study names at a path: known ones, or read now and known from now on."""
    names = [value] if isinstance(value, str) else value
    if any(name not in simulators for name in names):
        try:
            simulators |= {one.key: one for one in SIMULATORS[kind].read(value, file.parent, trust)}
        except ShipidError as error:
            words = f"{error.path}: {error.message}" if error.path else error.message
            raise DocumentError(f"{error.file}: {words}" if error.file else words, path=path) from None
    return [simulators[name] for name in names]


def foundations_of(
    study: Study, file: Path, known: dict[str, Vessel], simulators: dict[str, Simulator], trust: bool = False
) -> tuple[Foundation, ...]:
    """Every member of every family; an identified family has the members of the family that it extends."""
    families = resolve_families(study.family, file)
    foundations: list[Foundation] = []
    places = {family.name: place for place, family in enumerate(families)}
    for index, family in enumerate(families):
        if family.name.lower() == NO_MODEL:
            raise DocumentError(
                f"{family.name!r} is taken by the foundation without physics: rename the family",
                path=f"family.{index}.name",
            )
        bases = bases_of(family, file, f"family.{index}", known, simulators, trust)
        parent = families[_root(study.family, places, index)]
        for block in () if isinstance(bases[0], Vessel) else ("identify", "observer"):
            if getattr(family, block) is not None:
                words = "it needs the equations of a vessel, and this family has none: take a family with a base"
                raise DocumentError(words, path=f"family.{index}.{block}")
        if len(bases) > 1:
            parent = parent.model_copy(update={"members": len(bases)})
        drawn = [
            (base, variant)
            for place, base in enumerate(bases)
            for variant in draw_members(parent, base, file, None if len(bases) == 1 else [place])
        ]
        for base, variant in drawn:
            name = variant.name
            if parent is not family:
                name = family.name if parent.members == 1 else f"{family.name}-{variant.member + 1}"
            identify = observer = None
            if isinstance(base, Vessel):
                identify = None if family.identify is None else _identify(study, family, index, base)
                observer = None if family.observer is None else _observer(study, family, index, base)
            of = base.name if isinstance(base, Vessel) and family.similar else parent.description
            ways = (of, IDENTIFIED if identify else "", OBSERVED if observer else "")
            words = family.description or ", ".join(filter(None, ways))
            foundations.append(Foundation(name, family.name, variant.member, variant, base, words, identify, observer))
    foundations += [
        _mean_of_foundations(block, f"model.{place}", foundations) for place, block in enumerate(study.model)
    ]
    check_file_names([foundation.name for foundation in foundations], "family", "models")
    return (*foundations, Foundation(NO_MODEL, NO_MODEL, 0, None, None, "no physics: data alone"))


def _mean_of_foundations(block: MeanBlock, path: str, foundations: Sequence[Foundation]) -> Foundation:
    """The mean that a block declares; DocumentError where it has no parts, or such as it cannot take."""
    families = list(dict.fromkeys(one.family for one in foundations if one.base is not None))
    if block.name.lower() in {NO_MODEL, *map(str.lower, families)}:
        raise DocumentError(f"{block.name!r} is a family, or no physics: rename the mean", path=f"{path}.name")
    matched = {pattern: documents.match_paths(pattern, families) for pattern in block.mean_of}
    for pattern, found in matched.items():
        if not found:
            words = f"{pattern!r} is no family with physics: {suggest_name(pattern, families)}"
            raise DocumentError(words, path=f"{path}.mean_of")
    if len(matched) < len(block.mean_of):
        raise DocumentError("a family stands there twice: name each once", path=f"{path}.mean_of")
    parts = [one for one in foundations if any(one.family in found for found in matched.values())]
    names = tuple(one.name for one in parts)
    if len(parts) < 2 or any(one.observer is not None for one in parts):
        words = f"{', '.join(names)}: a mean takes two foundations or more, none with an observer: name other families"
        raise DocumentError(words, path=f"{path}.mean_of")
    words, by_left_out = f"mean of {', '.join(names)}", block.weights != "equal"
    return Foundation(block.name, block.name, 0, None, None, words, mean_of=names, by_left_out=by_left_out)


def check_file_names(names: Sequence[str], path: str, what: str) -> None:
    """Refuse names that would be one file, with `*` of the path as the place of the second.

    Many file systems do not tell capitals from small letters: the files of one model would replace those of the other.
    """
    first: dict[str, str] = {}
    for place, name in enumerate(names):
        other = first.get(name.lower())
        if other is not None:
            same = repr(name) if other == name else f"{other!r} and {name!r}, which are one file on many systems"
            raise DocumentError(f"two {what} are called {same}: rename one", path=path.replace("*", str(place)))
        first[name.lower()] = name


def _root(families: Sequence[Family], places: Mapping[str, int], index: int) -> int:
    """Place of the family whose members an identified or observed family takes, as far up as it extends.

    DocumentError unless the families on the way only extend: no base, perturbations or members.
    """
    while families[index].identify is not None or families[index].observer is not None:
        one, block = families[index], "identify" if families[index].identify is not None else "observer"
        if one.extends is None or one.perturb or "members" in one.model_fields_set:
            raise DocumentError(
                "an identified or observed family must be a separate family: remove the block here and add "
                f'[[family]] name = "{one.name}-new", extends = "{one.name}" with the block [family.{block}]',
                path=f"family.{index}.{block}",
            )
        index = places[one.extends]
    return index


def _observer(study: Study, family: Family, index: int, vessel: Vessel) -> Observer:
    """Settings of an observer of this vessel; DocumentError with the path of a wrong key or value.

    Where velocities make the true path, positions are too coarse to be measurements; then no current can be seen.
    """
    coarse, prefix = study.data is not None and study.data.path == "velocity", f"family.{index}.observer"
    default: dict[str, Any] = {"measured": ["psi", "u", "v", "r"], "current": 0.0} if coarse else {}
    settings: Observer = documents.parse_model(Observer, default | (family.observer or {}), None, prefix)
    with placed_errors(DocumentError, path=prefix):
        filter_bank(vessel, settings)
    return settings


def _identify(study: Study, family: Family, index: int, vessel: Vessel) -> Identify:
    """What a family identifies; horizon, step and method are those of the study's prediction unless it says else."""
    ahead, prefix = study.prediction, f"family.{index}.identify"
    default = {"horizon": ahead.ahead, "step": ahead.step, "method": ahead.integrator}
    settings: Identify = documents.parse_model(
        Identify, default | (family.identify or {}), None, prefix
    ).with_current_named()
    with placed_errors(DocumentError, path=lambda path: (path or "identify").replace("identify", prefix, 1)):
        free_factors(vessel, settings)
    return settings


def methods_of(study: Study, foundations: Sequence[Foundation]) -> tuple[StudyMethod, ...]:
    """The methods with their settings checked, and the foundations that each meets."""
    check_file_names([block.name for block in study.method], "method.*.name", "methods")
    ways: list[StudyMethod] = []
    families = list(dict.fromkeys(foundation.family for foundation in foundations if not foundation.mean_of))
    for index, block in enumerate(study.method):
        path = f"method.{index}"
        method = method_of(block.kind, block.settings, path)
        met: set[str] = set()
        refused = set() if method.meets_observer else {f.family for f in foundations if f.observer is not None}
        for pattern in block.families:
            matching = documents.match_paths(pattern, families)
            if pattern in refused:
                words = f"{pattern!r} has an observer, which {block.kind} does not take: name the family it extends"
                raise DocumentError(words, path=f"{path}.families")
            if not matching:
                words = f"{pattern!r} is no family: {suggest_name(pattern, families)}"
                raise DocumentError(words, path=f"{path}.families")
            met.update(matching)
        if not method.meets_none:
            met -= {NO_MODEL}
        taken = [f for f in foundations if f.family in met - refused]
        for family, base in {f.family: f.base for f in taken if f.base is not None}.items():
            given = (base.gives, None) if isinstance(base, Simulator) else (get_args(Needs), base)
            if words := misfit_words(method, *given):
                raise DocumentError(f"{family} with {block.kind}: {words}", path=path)
        left_out = tuple(f.name for f in foundations if f.family in met & refused)
        names = [f.name for f in taken]
        names += [f.name for f in foundations if f.mean_of and method.compensates and {*f.mean_of} <= {*names}]
        ways.append(StudyMethod(block.name, block.kind, method, tuple(names), left_out))
    met_by_any = {name for way in ways for name in way.foundations} | {NO_MODEL}
    idle = next((foundation.name for foundation in foundations if foundation.name not in met_by_any), None)
    if idle is not None:
        remedy = "name its family in `families`; one with an observer needs a method that takes it, such as alone"
        raise DocumentError(f"no method meets {idle!r}: {remedy}", path="method")
    return tuple(ways)


def check_claims(study: Study, models: Sequence[Foundation]) -> None:
    """Refuse claims about families that are not there, or that are not what their role needs."""
    if study.claims is None:
        return
    families, roles = [model.family for model in models if model.base is not None], study.claims.roles
    named = [(role, name, families, "family") for role, name in roles.items()]
    named += [("aside", name, families, "family") for name in study.claims.aside]
    if study.claims.method is not None:
        named.append(("method", study.claims.method, [block.name for block in study.method], "method"))
    for key, name, known, kind in named:
        if name not in known:
            raise DocumentError(f"{name!r} is not a {kind}: {suggest_name(name, set(known))}", path=f"claims.{key}")
    for role, family in roles.items():
        if role not in PAIRED_ROLES[1] and (count := families.count(family)) > 1:
            raise DocumentError(f"{family!r} has {count} members: give one", path=f"claims.{role}")
    nominal = next((model for model in models if model.family == roles.get("nominal")), None)
    if nominal is not None and nominal.variant is not None and nominal.variant.values:
        raise DocumentError(
            f"{nominal.name!r} is perturbed: the nominal model must be the base as it is", path="claims.nominal"
        )


def check_cost(study: Study, models: Sequence[Foundation]) -> None:
    """Refuse the price of physics that is no family of the study and no kind of the law of exchange."""
    known = {
        *KINDS_OF_PHYSICS,
        "model-test",
        "identified",
        *(model.family for model in models if model.base is not None),
    }
    for name in study.cost.foundations if study.cost else ():
        if name not in known:
            words = f"{name!r} is no family of this study and no kind of physics: {suggest_name(name, known)}"
            raise DocumentError(words, path=f"cost.foundations.{name}")
