"""Families of perturbed vessels: a variant is a named patch on a base vessel with a given digest.

Each independent draw comes from hash(seed, family, member, path, counter), so that adding a member, a parameter or a
family never changes another draw. A Latin hypercube changes whole with the number of members. A Sobol sample keeps its
members where more are added, changes with the parameters before, and is balanced where they are a power of 2.
"""

from __future__ import annotations

import hashlib
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, Self, runtime_checkable

import tomlkit
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PrivateAttr,
    create_model,
    model_validator,
)

from shipid import document as documents
from shipid.arguments import check_class, check_whole_number
from shipid.checked import CheckedModel
from shipid.errors import DocumentError, suggest_name
from shipid.physics.grammar import hull_derivative, service_deviation
from shipid.vessel.load import LONGEST_CHAIN, Vessel
from shipid.vessel.ranges import UNUSUAL

_CONDITION = re.compile(r"(?P<pattern>[^\[\]]+)(?:\[\s*order\s*(?P<relation>>=|<=|==|>|<)\s*(?P<order>\d+)\s*\])?")
_BETWEEN = "\x1f"  # of the parts of a key
_RELATIONS = {">=": operator.ge, "<=": operator.le, "==": operator.eq, ">": operator.gt, "<": operator.lt}


@runtime_checkable
class PerturbedBase(Protocol):
    """What a family changes: a vessel, or a simulator of somebody else."""

    @property
    def key(self) -> str:
        """Name."""

    @property
    def digest(self) -> str:
        """Digest of all that its paths depend on."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Dotted path -> number."""

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """Return the base with other numbers."""


@dataclass(frozen=True)
class PerturbationRule:
    """One way of changing numbers, named by its key in a `[[family.perturb]]` block.

    argument : type of the key's value, for pydantic.
    change : (number, argument, u) -> new number; u is uniform in [0, 1), drawn for each number and member.
    drawn : whether this argument makes a draw, so that members differ.
    places : (argument, base, file, path in the document) -> path of each number to change and the argument for it; None
        where the block's `parameters` select the numbers and every one has the same argument.
    note : what the argument is, for the schema.
    """

    argument: Any
    change: Callable[[float, Any, float], float]
    drawn: Callable[[Any], bool] = lambda _: False
    places: Callable[[Any, PerturbedBase, Any, str], Mapping[str, Any]] | None = None
    note: str = ""


WITHOUT = 'a rule changes numbers; a whole term goes by structure = {"wind.off" = true} of the family'


def _checked_values(values: Mapping[str, float], base: PerturbedBase, file: Any, where: str) -> Mapping[str, float]:
    unknown = next((path for path in values if path not in base.parameters), None)
    if unknown is not None:
        switch = unknown.rpartition(".")[2] in ("off", "kind")
        hint = WITHOUT if switch else suggest_name(unknown, base.parameters)
        raise DocumentError(f"{base.key} has no parameter {unknown!r}: {hint}", file=file, path=where)
    return values


def _number_between(ends: float | tuple[float, float], u: float) -> float:
    low, high = ends if isinstance(ends, tuple) else (ends, ends)
    return low + (high - low) * u


def check_rising(value: Any) -> Any:
    """A number as it is, or a pair [low, high]; ValueError if the first is above the second."""
    if isinstance(value, tuple) and value[0] > value[1]:
        raise ValueError(f"low > high: give [low, high], not {list(value)}")
    return value


RULES: dict[str, PerturbationRule] = {
    "remove": PerturbationRule(
        list[str],
        lambda _number, _none, _u: 0.0,
        places=lambda patterns, base, file, where: dict.fromkeys(select_paths(patterns, base.parameters, file, where)),
        note="paths whose value becomes 0; * and [order >= 3]",
    ),
    "set": PerturbationRule(
        dict[str, FiniteFloat], lambda _number, value, _u: value, places=_checked_values, note="path -> new value"
    ),
    "factor": PerturbationRule(
        Annotated[FiniteFloat | tuple[FiniteFloat, FiniteFloat], AfterValidator(check_rising)],
        lambda number, ends, u: number * _number_between(ends, u),
        drawn=lambda ends: isinstance(ends, tuple),
        note="a number is fixed, a pair is a range drawn from uniformly",
    ),
    "bias": PerturbationRule(
        Annotated[FiniteFloat | tuple[FiniteFloat, FiniteFloat], AfterValidator(check_rising)],
        lambda number, ends, u: number + _number_between(ends, u),
        drawn=lambda ends: isinstance(ends, tuple),
        note="added, in the unit of the number: fixed, or a pair drawn from uniformly",
    ),
    "range": PerturbationRule(
        Annotated[tuple[FiniteFloat, FiniteFloat], AfterValidator(check_rising)],
        lambda _number, ends, u: _number_between(ends, u),
        drawn=lambda _: True,
        note="[low, high] of a new value, in the unit of the number, drawn uniformly",
    ),
}
"""Key -> rule; a block with several applies them in this order. To add one, write its change and name it here."""


class Perturbation(CheckedModel, BaseModel):
    """One `[[family.perturb]]` block: keys of `RULES`, and which numbers they change.

    `given` holds what the block says for each rule, by its key.
    """

    model_config = ConfigDict(extra="allow")
    parameters: list[str] = Field(default=[], description="dotted paths; * and [order >= 3] select")
    together: bool = Field(default=False, description="one draw for all parameters of the block")
    change_sign: bool = Field(default=False, description="allows a range of factors that holds 0 or less")

    @model_validator(mode="before")
    @classmethod
    def _by_rules(cls, raw: Any) -> Any:
        """Check the keys and values of rules, so that a complaint names key and value."""
        if isinstance(raw, cls):
            return raw
        return _block_model(tuple(RULES.items())).model_validate(raw).model_dump(exclude_unset=True)

    @model_validator(mode="after")
    def _one_meaning(self) -> Perturbation:
        selecting = [key for key, rule in RULES.items() if rule.places is None]
        empty = all(value in ([], {}) for value in self.given.values())
        if empty or bool(self.parameters) != any(key in self.given for key in selecting):
            others = ", ".join(key for key in RULES if key not in selecting)
            raise ValueError(f"give `parameters` together with {' or '.join(selecting)}, or one of {others}")
        factor = self.given.get("factor")
        if isinstance(factor, tuple) and factor[0] <= 0 and not self.change_sign:
            raise ValueError(
                f"factor {list(factor)} holds 0 or less: +-30 % is [0.7, 1.3]; change_sign = true allows it"
            )
        return self

    @classmethod
    def keys(cls) -> list[str]:
        """Keys that a block may have."""
        return [*cls.model_fields, *RULES]

    @property
    def given(self) -> dict[str, Any]:
        """Key of each rule that the block uses -> its argument, in the order of `RULES`."""
        extra = self.model_extra or {}
        return {key: extra[key] for key in RULES if extra.get(key) is not None}

    @property
    def drawn(self) -> bool:
        """Whether members differ by this block."""
        return any(RULES[key].drawn(argument) for key, argument in self.given.items())


@cache
def _block_model(rules: tuple[tuple[str, PerturbationRule], ...]) -> type[BaseModel]:
    """Model of a `[[family.perturb]]` block whose keys are these rules, with the types of their arguments."""
    fields: dict[str, Any] = {
        key: (Annotated[rule.argument | None, Field(description=rule.note)], None) for key, rule in rules
    }
    shared: dict[str, Any] = {"parameters": (list[str], []), "together": (bool, False), "change_sign": (bool, False)}
    return create_model("perturbation", __config__=ConfigDict(extra="forbid"), **shared, **fields)


class Family(CheckedModel, BaseModel):
    """A `[[family]]` block of a document: so many members of one base, perturbed by the same rules."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_.+-]{0,79}$")]
    base: str | None = None
    predictions: Annotated[list[str], Field(min_length=1)] | str | None = Field(
        default=None, description="tables of paths in place of a base, a member each"
    )
    function: str | None = Field(
        default=None, description='a function of Python in place of a base, such as "my_ship:simulate"'
    )
    fmu: str | None = Field(default=None, description="an FMU, or the document of its table, in place of a base")
    similar: Annotated[int, Field(ge=1, le=100)] | None = Field(
        default=None, description="so many ships most like the base, scaled to its length, in its place: a member each"
    )
    ships: str | None = Field(default=None, description="a folder of vessels of one's own among which `similar` looks")
    extends: str | None = Field(default=None, description="a family whose base and perturbations come first")
    members: Annotated[int, Field(ge=1, le=100000)] = 1
    seed: int = 0
    sample: Literal["independent", "latin-hypercube", "sobol"] = Field(
        default="independent", description="how members are spread over the ranges; the latter two fill them evenly"
    )
    redraw: bool = Field(
        default=False, description="draws a member that diverges on training windows again; by default it stays"
    )
    equal: bool = Field(default=False, description="allows several members that nothing drawn tells apart")
    description: str | None = None
    structure: dict[str, Any] = Field(
        default={}, description='dotted path -> value of the base before any rule, such as {"wind.off" = true}'
    )
    perturb: list[Perturbation] = []
    seen: list[str] = Field(
        default=[], description="runs that its numbers were set from: where one of them tests, no claim is about it"
    )
    observer: dict[str, Any] | None = Field(
        default=None, description="an observer filters the start and adds slow forces: an [observer] block"
    )
    identify: dict[str, Any] | None = Field(
        default=None, description="numbers identified from the training runs of each batch: an [identify] block"
    )
    _inherited: int = PrivateAttr(default=0)  # how many blocks of `perturb` come from the family that it extends


class FamilyDocument(BaseModel):
    """A document of families."""

    model_config = ConfigDict(extra="forbid")
    description: str | None = None
    vessel: str | None = Field(default=None, description="base of the families that name none and extend none")
    family: Annotated[list[Family], Field(min_length=1)]
    lock: dict[str, Any] | None = Field(default=None, description="what was drawn, as `shipid family export` writes it")


@dataclass(frozen=True)
class Variant:
    """A named patch on a digested base.

    values : dotted path -> new value. factors : path -> new / old, where the old value is not 0.
    structure : what was changed in the named base before; the digest is that of the changed base.
    counter : 0, or how often this member was redrawn because it diverged on training windows.
    """

    name: str
    family: str
    member: int
    base: str
    base_digest: str
    values: Mapping[str, float]
    factors: Mapping[str, float]
    counter: int = 0
    seed: int = 0
    base_parameters: Mapping[str, float] = field(default_factory=dict, repr=False)
    structure: Mapping[str, Any] = field(default_factory=dict)

    @property
    def parameters(self) -> list[float]:
        """Values of all parameters in the order of the base vessel's."""
        return [self.values.get(path, value) for path, value in self.base_parameters.items()]

    def document(self) -> str:
        """The patch as TOML: `load_vessel` on it rebuilds the variant exactly."""
        source = f"family {self.family!r}, member {self.member}, seed {self.seed}, redrawn {self.counter} times"
        return patch_text(self.name, self.base, self.base_digest, source, self.values, structure=self.structure)


def patch_text(
    name: str,
    base: str,
    base_digest: str,
    source: str,
    values: Mapping[str, float],
    provenance: Mapping[str, Any] | None = None,
    unusual: Sequence[str] = (),
    structure: Mapping[str, Any] | None = None,
) -> str:
    """A patch document as TOML: a base, by bundled name or by path from the patch, and new values by dotted path.

    unusual : paths of numbers that would be refused where the patch is read. structure : changes of the base that come
        before the digest is taken.
    """
    patch = tomlkit.document()
    patch.update({"name": name, "base": base, "base_digest": base_digest, "source": source})
    if unusual:
        patch[UNUSUAL] = list(unusual)
    for table, content in {"structure": structure, "set": values, "provenance": provenance}.items():
        if content or table == "set":
            patch[table] = dict(content or {})
    return tomlkit.dumps(patch)


SOURCES = ("base", "predictions", "function", "fmu")
"""Keys of a family, one of which says where its paths come from."""


def resolve_families(families: Sequence[Family], file: str | Path | None = None) -> list[Family]:
    """Families with `extends` written out; unknown or circular ones, and missing bases, raise DocumentError."""
    places: dict[str, int] = {}
    for index, family in enumerate(families):
        if family.name in places:
            raise DocumentError(f"two families are called {family.name!r}", file=file, path=f"family.{index}.name")
        places[family.name] = index

    def written_out(family: Family, above: tuple[str, ...]) -> Family:
        where = f"family.{places[family.name]}"
        if family.name in above:
            raise DocumentError(f"extends itself by way of {' -> '.join(above)}", file=file, path=f"{where}.extends")
        if len(above) >= LONGEST_CHAIN:
            fault = f"a chain of more than {LONGEST_CHAIN} families: write the rules out"
            raise DocumentError(fault, file=file, path=f"{where}.extends")
        parent = Family(name="empty")
        if family.extends is not None:
            if family.extends not in places:
                hint = suggest_name(family.extends, places)
                raise DocumentError(f"no family {family.extends!r}: {hint}", file=file, path=f"{where}.extends")
            parent = written_out(families[places[family.extends]], (*above, family.name))
        own = {key: value for key in SOURCES if (value := getattr(family, key)) is not None}
        if len(own) > 1:
            fault = f"stands beside {next(iter(own))!r}: give one of {', '.join(SOURCES)}"
            raise DocumentError(fault, file=file, path=f"{where}.{[*own][1]}")
        changes = {
            **{key: getattr(family if own else parent, key) for key in SOURCES},
            "extends": None,
            "similar": family.similar or parent.similar,
            "ships": family.ships or parent.ships,
            "structure": parent.structure | family.structure,
            "perturb": [*parent.perturb, *family.perturb],
            "redraw": parent.redraw or family.redraw,
            "seen": [*parent.seen, *family.seen],
            "identify": parent.identify if family.identify is None else family.identify,
            "observer": parent.observer if family.observer is None else family.observer,
        }
        resolved = family.model_copy(update=changes)
        resolved._inherited = len(parent.perturb)
        if all(getattr(resolved, key) is None for key in SOURCES):
            raise DocumentError("missing: name a base vessel, or a family to extend", file=file, path=f"{where}.base")
        if resolved.similar and resolved.base is None:
            raise DocumentError(
                "needs a `base`, to which it looks for similar ships", file=file, path=f"{where}.similar"
            )
        drawn = any(block.drawn for block in resolved.perturb)
        if resolved.members > 1 and not (resolved.equal or resolved.identify or resolved.observer or drawn):
            raise DocumentError(
                f"the {family.members} members are equal: give a range to draw from; equal = true allows it",
                file=file,
                path=f"{where}.members",
            )
        return resolved

    return [written_out(family, ()) for family in families]


def draw_variant(
    family: Family, member: int, base: PerturbedBase, counter: int = 0, file: str | Path | None = None
) -> Variant:
    """Draw one member of a resolved family, redrawn so often; see `draw_members`."""
    return draw_members(family, base, file, [member], counter)[0]


def change_structure(family: Family, base: Vessel) -> Vessel:
    """The base of a family with its `structure`; DocumentError where that makes no valid vessel."""
    try:
        return base.with_values(family.structure) if family.structure else base
    except DocumentError as error:
        raise DocumentError(
            f"{error.path}: {error.message}" if error.path else error.message, path=f"family.{family.name}.structure"
        ) from None


Step = tuple[str, Callable[[float, Any, float], float], Any, str | None]
"""Dotted path of a number, change of a rule, argument of the rule, and the key of its draw; None where none is made."""


def draw_members(
    family: Family,
    base: PerturbedBase,
    file: str | Path | None = None,
    numbers: Iterable[int] | None = None,
    counter: int = 0,
) -> list[Variant]:
    """Members of a resolved family, all or those of the given numbers from 0; the same on every machine to the bit.

    Ranges are uniform; a path drawn by several blocks is drawn anew in each and the factors multiply.

    base : with the `structure` of the family, see `change_structure`. counter : how often each was redrawn.

    Raises ShipidError where a number is no whole one, DocumentError for a path that the base lacks or a member that is
    no valid vessel.
    """
    steps, original, result = _draw_steps(family, base, file), base.parameters, list[Variant]()
    counter, numbers = check_whole_number("counter", counter), range(family.members) if numbers is None else numbers
    if not isinstance(numbers, Iterable):
        raise DocumentError(f"numbers must be several whole numbers, such as [0, 1], not {numbers!r}")
    draw = _unit_draws(family, (key for *_, key in steps if key is not None), counter)
    for number in (check_whole_number("member", number) for number in numbers):  # of 1.0 is another hash
        if family.sample != "independent" and number >= family.members:
            raise DocumentError(f"no member {number}: a {family.sample} sample has {family.members}, from 0")
        values: dict[str, float] = {}
        for path, change, argument, key in steps:
            u = 0.0 if key is None else draw(number, key)
            values[path] = change(values.get(path, original[path]), argument, u)
        try:
            base.with_values(values)
        except DocumentError as error:
            message = f"member {number + 1} would not be a valid vessel: {error.path}: {error.message}"
            message += f": {WITHOUT}" if values.get(error.path or "") == 0 else ""
            raise DocumentError(message, file=file, path=f"family.{family.name}") from None
        changed = {path: value for path, value in values.items() if original[path] != 0}
        factors = {path: value / original[path] + 0.0 for path, value in changed.items()}  # + 0.0: none is -0.0
        name = family.name if family.members == 1 else f"{family.name}-{number + 1}"
        drawn = (values, factors, counter, family.seed, original, family.structure)
        result.append(Variant(name, family.name, number, family.base or base.key, base.digest, *drawn))
    return result


def _draw_steps(family: Family, base: PerturbedBase, file: str | Path | None) -> list[Step]:
    """What a member changes, in order; DocumentError for a path that the base does not have."""
    check_class("family", family, Family, "such as Family(name=..., perturb=[...])")
    check_class("base", base, PerturbedBase, "such as a Vessel, as of `load_vessel`")
    if family.extends is not None:
        raise DocumentError(
            f"extends {family.extends!r}, whose perturbations come first: write them out, or use `resolve_families`",
            file=file,
            path=f"family.{family.name}.extends",
        )
    original, times, result = base.parameters, dict[str, int](), list[Step]()
    for index, block in enumerate(family.perturb, start=-family._inherited):
        place = f"perturb.{index}" if index >= 0 else f"extends.perturb.{index + family._inherited}"
        where = f"family.{family.name}.{place}"
        for key, argument in block.given.items():
            rule = RULES[key]
            if rule.places is not None:
                chosen = rule.places(argument, base, file, f"{where}.{key}")
                result += [(path, rule.change, of_path, None) for path, of_path in chosen.items()]
                continue
            paths = select_paths(block.parameters, original, file, f"{where}.parameters")
            names = {path: f"together {block.parameters[0]}" if block.together else path for path in paths}
            times.update({name: times.get(name, -1) + 1 for name in names.values()})
            keys = {
                path: f"{name}{_BETWEEN}{times[name]}" if rule.drawn(argument) else None for path, name in names.items()
            }
            result += [(path, rule.change, argument, keys[path]) for path in paths]
    return result


def _unit_draws(family: Family, keys: Iterable[str], counter: int) -> Callable[[int, str], float]:
    """What gives the number in [0, 1] of a member for the key of a draw, by the sample of the family.

    Latin hypercube (McKay 1979): each member has one of as many equal parts of a range as there are members, in an
    order hashed from the key. Sobol: SciPy's sequence, a dimension for each key in their order, each rotated by a hash
    of its key (Cranley and Patterson 1976). A member that is drawn again is drawn independently.
    """
    of, count = (family.seed, family.name), family.members

    def hashed_draw(member: int, key: str) -> float:
        return uniform_draw(*of, member, key, counter)

    if counter or family.sample == "independent":
        return hashed_draw
    columns: dict[str, Any] = dict.fromkeys(keys)
    if family.sample == "latin-hypercube":
        for key in columns:
            parts = sorted(range(count), key=lambda part: uniform_draw(*of, part, key, "part"))
            columns[key] = [(part + hashed_draw(member, key)) / count for member, part in enumerate(parts)]
    else:
        from scipy.stats import qmc  # most families are drawn without it

        points = qmc.Sobol(len(columns) or 1, scramble=False).random_base2((count - 1).bit_length()).T
        shifted = zip(columns, points, strict=False)
        columns = {key: (point + uniform_draw(*of, "rotation", key)) % 1 for key, point in shifted}
    return lambda member, key: float(columns[key][member])


def uniform_draw(*key: Any) -> float:
    """A number in [0, 1) that depends on the key alone: the first 53 bits of its SHA-256."""
    digest = hashlib.sha256(_BETWEEN.join(map(str, key)).encode()).digest()
    return (int.from_bytes(digest[:8], "big") >> 11) / 2.0**53


def select_paths(patterns: Sequence[str], paths: Mapping[str, float], file: Any, where: str) -> list[str]:
    """Paths that the patterns select, each once, in the order of `paths`; DocumentError if a pattern has no match."""
    chosen: set[str] = set()
    for pattern in patterns:
        parsed = _CONDITION.fullmatch(pattern)
        if parsed is None:
            raise DocumentError(
                f"{pattern!r} is not a selection: write a dotted path with * and, if wanted, [order >= 3]",
                file=file,
                path=where,
            )
        matching = documents.match_paths(parsed["pattern"], list(paths))
        if parsed["order"] is not None:
            relation, limit = _RELATIONS[parsed["relation"]], int(parsed["order"])
            orders = {path: derivative_order(path) for path in matching}
            matching = [path for path, order in orders.items() if order is not None and relation(order, limit)]
        if not matching:
            raise DocumentError(f"{pattern!r} selects nothing: {suggest_name(pattern, paths)}", file=file, path=where)
        chosen.update(matching)
    return [path for path in paths if path in chosen]


def derivative_order(path: str) -> int | None:
    """Number of factors of a derivative of hull or rudder; None for any other number."""
    name = path.rsplit(".", 1)[-1]
    for formula in (hull_derivative, service_deviation):
        with suppress(ValueError):
            return formula(name).order
    return None
