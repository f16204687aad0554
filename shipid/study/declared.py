"""What a study document declares: its foundations, the methods that they meet, and its claims, each checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shipid import document as documents
from shipid.errors import DocumentError, suggest_name
from shipid.hybrid.method import Method
from shipid.hybrid.methods import method_of
from shipid.identification.settings import Identify, free_factors
from shipid.observer import Observer, filter_bank
from shipid.study.schema import ROLES, Study
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, Variant, draw_members, resolve_families

NO_MODEL = "none"
NO_METHOD = "alone"  # of the rows of A in comparisons of runs, whose N_D is 0: no data improve it
IDENTIFIED, OBSERVED = "identified from the runs of each cell", "with an observer"


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
            raise DocumentError(f"{name!r}: {error.message}", file=file, path=path) from None
        known[name] = load_vessel(str(document))
    return known[name]


def foundations_of(study: Study, file: Path, known: dict[str, Vessel]) -> tuple[Foundation, ...]:
    """Every member of every family; an identified family has the members of the family that it extends."""
    families = resolve_families(study.family, file)
    foundations: list[Foundation] = []
    for index, family in enumerate(families):
        assert family.base is not None  # written out by resolve
        if family.name.lower() == NO_MODEL:
            message = "this name is taken by the foundation without physics"
            raise DocumentError(message, file=file, path=f"family.{index}.name")
        vessel = named_vessel(family.base, file, f"family.{index}.base", known)
        words = family.description or ""
        if family.identify is None and family.observer is None:
            foundations += [
                Foundation(v.name, v.family, v.member, v, vessel, words) for v in draw_members(family, vessel, file)
            ]
            continue
        root = _root(study.family, index, file)
        parent = families[root]
        settings = None if family.identify is None else _identify(study, family, index, vessel, file)
        observer = None if family.observer is None else _observer(study, family, index, vessel, file)
        ways = (IDENTIFIED if settings else "", OBSERVED if observer else "")
        described = words or ", ".join(filter(None, (parent.description, *ways)))
        for variant in draw_members(parent, vessel, file):
            name = family.name if parent.members == 1 else f"{family.name}-{variant.member + 1}"
            foundations.append(
                Foundation(name, family.name, variant.member, variant, vessel, described, settings, observer)
            )
    if twice := names_of_one_file([foundation.name for foundation in foundations]):
        raise DocumentError(f"two models would be called {twice}: rename a family", file=file, path="family")
    return (*foundations, Foundation(NO_MODEL, NO_MODEL, 0, None, None, "no physics: data alone"))


def names_of_one_file(names: Sequence[str]) -> str:
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
            raise DocumentError(
                "an identified or observed family must be a separate family: remove the block here and add "
                f'[[family]] name = "{one.name}-new", extends = "{one.name}" with the block [family.{block}]',
                file=file,
                path=f"family.{index}.{block}",
            )
        index = by_name[one.extends]
    return index


def _observer(study: Study, family: Family, index: int, vessel: Vessel, file: Path) -> Observer:
    """Settings of an observer of this vessel; DocumentError with the path of a wrong key or value.

    Where velocities make the true path, positions are too coarse to be measurements; then no current can be seen.
    """
    coarse = study.data is not None and study.data.path == "velocity"
    default: dict[str, Any] = {"measured": ["psi", "u", "v", "r"], "current": 0.0} if coarse else {}
    settings: Observer = documents.parse_model(
        Observer, default | (family.observer or {}), file, f"family.{index}.observer"
    )
    try:
        filter_bank(vessel, settings)
    except DocumentError as error:
        raise DocumentError(error.message, file=file, path=f"family.{index}.observer") from None
    return settings


def _identify(study: Study, family: Family, index: int, vessel: Vessel, file: Path) -> Identify:
    """What a family identifies; horizon, step and method are those of the study's prediction unless it says else."""
    ahead, prefix = study.prediction, f"family.{index}.identify"
    default = {"horizon": ahead.ahead, "step": ahead.step, "method": ahead.integrator}
    settings: Identify = documents.parse_model(Identify, default | (family.identify or {}), file, prefix)
    try:
        free_factors(vessel, settings)
    except DocumentError as error:
        where = (error.path or "identify").replace("identify", prefix, 1)
        raise DocumentError(error.message, file=file, path=where) from None
    return settings


def methods_of(study: Study, foundations: Sequence[Foundation], file: Path) -> tuple[StudyMethod, ...]:
    """The methods with their settings checked, and the foundations that each meets."""
    ways: list[StudyMethod] = []
    families = list(dict.fromkeys(foundation.family for foundation in foundations))
    for index, block in enumerate(study.method):
        path = f"method.{index}"
        if twice := names_of_one_file([*(way.name for way in ways), block.name]):
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
            matching = documents.match_paths(pattern, families)
            if not matching:
                message = f"{pattern!r} is no family: {suggest_name(pattern, families)}"
                raise DocumentError(message, file=file, path=f"{path}.families")
            met.update(matching)
        if not method.meets_none:
            met -= {NO_MODEL}
        left_out = tuple(f.name for f in foundations if f.family in met & refused)
        taken = tuple(f.name for f in foundations if f.family in met - refused)
        bases = {f.family: f.base for f in foundations if f.name in taken and f.base is not None}
        for family, base in bases.items():
            if words := method.unfit(base):
                raise DocumentError(f"{family} with {block.kind}: {words}", file=file, path=path)
        ways.append(StudyMethod(block.name, block.kind, method, taken, left_out))
    met_by_any = {name for way in ways for name in way.foundations} | {NO_MODEL}
    idle = next((foundation.name for foundation in foundations if foundation.name not in met_by_any), None)
    if idle is not None:
        observed = any(idle in way.left_out for way in ways)
        remedy = "add one that takes an observer, such as alone" if observed else "name its family in `families`"
        raise DocumentError(f"no method meets {idle!r}: {remedy}", file=file, path="method")
    return tuple(ways)


def check_claims(study: Study, models: Sequence[Foundation], file: Path) -> None:
    """Refuse claims about families that are not there, or that are not what their role needs."""
    if study.claims is None:
        return
    families = [model.family for model in models if model.family != NO_MODEL]
    named = [*study.claims.roles.items(), *(("aside", name) for name in study.claims.aside)]
    for role, name in named:
        if name not in families:
            message = f"{name!r} is not a family: {suggest_name(name, set(families))}"
            raise DocumentError(message, file=file, path=f"claims.{role}")
    names = [block.name for block in study.method]
    if study.claims.method is not None and study.claims.method not in names:
        message = f"{study.claims.method!r} is not a method: {suggest_name(study.claims.method, names)}"
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
