"""The keys of a study document: blocks as pydantic models."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from shipid.arguments import whole_steps
from shipid.data.windows import Commands, PathSource
from shipid.engine.integrate import Method as Integrator
from shipid.errors import suggest_name
from shipid.physics.signals import SIGNALS, rows_of_role
from shipid.predictor import MOST_HORIZON_STEPS
from shipid.simulation.truth import Truth
from shipid.vessel.perturb import Family

NAME = r"^[A-Za-z][A-Za-z0-9_.-]{0,79}$"  # a cell has two such names, and file systems allow 255 characters
Seed = Annotated[int, Field(ge=0, le=2_000_000_000)]  # with 1000 times `seed` below 2^32
MOST_DRAWS = (
    3  # of the runs of one amount of data, where a study names no seeds: more cost more than they tell (record worlds)
)
WORLDS = 1000  # top-level `seed` times this is added to every other seed
INPUTS = ("u", "v", "r", "u_rw", "v_rw")  # what a correction may see beside the commands


def published_keys() -> dict[str, tuple[str, float]]:
    """Key of a published envelope -> signal, factor to SI: `n`, and `n_rpm` in the unit that sailors read."""
    names = (*INPUTS, *rows_of_role("command"))
    read = {name: SIGNALS[name] for name in names if SIGNALS[name].shown}
    in_words = {f"{name}_{row.read_in.partition('/')[0]}": (name, row.factor) for name, row in read.items()}
    return {name: (name, 1.0) for name in names} | in_words


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
    seed: Seed = 0


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
        if not 2 <= whole_steps(self.ahead, self.step) <= MOST_HORIZON_STEPS:
            most = f"{MOST_HORIZON_STEPS:,}"
            raise ValueError(f"ahead = {self.ahead:g} s must be 2 to {most} steps of {self.step:g} s")
        return self

    @property
    def horizon(self) -> int:
        """Number of steps T."""
        return round(self.ahead / self.step)

    @property
    def known(self) -> bool:
        """Whether the commands of the horizon are known."""
        return self.commands == "known"


class Grid(Strict):
    """`[grid]`: amounts of data and repetitions; every model gets a cell at each."""

    N_D: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1, description="runs for training")]
    seeds: Annotated[list[Seed], Field(min_length=1)] | None = Field(
        default=None, description="draws of the runs, at every amount; default: several where few runs are drawn"
    )


class BandsBlock(Strict):
    """`[bands]`: how far off a prediction may be."""

    level: Annotated[FiniteFloat, Field(gt=0, le=0.99, description="share of true paths that a band holds whole")] = 0.9
    refits: Annotated[int, Field(ge=0)] = Field(
        default=0,
        description="further fits, each without a share of the runs, of methods and identified families that need them "
        "for a band; 5 is enough, 0: no band for those",
    )


PAIRED_ROLES = (("accurate", "inaccurate"), ("moderate", "high"))  # keys of `[claims]`: both are given, or neither
ROLES = (*(role for pair in PAIRED_ROLES for role in pair), "nominal")


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
        for one, other in PAIRED_ROLES:
            if (one in self.roles) != (other in self.roles):
                raise ValueError(f"give both `{one}` and `{other}`, or neither")
            if one in self.roles and self.roles[one] == self.roles[other]:
                raise ValueError(f"`{one}` and `{other}` are the same family: name two different families")
        return self

    @property
    def roles(self) -> dict[str, str]:
        """Role -> family, of the roles that are given."""
        return {role: getattr(self, role) for role in ROLES if getattr(self, role) is not None}

    @property
    def not_judged(self) -> set[str]:
        """Families that no claim and no sentence of the answer counts among degraded models."""
        return {*self.aside, *([self.nominal] if self.nominal else [])}


KINDS_OF_PHYSICS = ("nominal", "damping", "mass", "thrust", "missing", "moderate", "high", "template", "sister")
"""What may be wrong with the physics of a ship that the law of exchange knows; nominal: nothing."""
Price = Annotated[FiniteFloat, Field(ge=0)]


class Cost(Strict):
    """`[cost]`: what data and physics cost, in money or hours, and the goal they are bought for."""

    unit: Annotated[str, Field(min_length=1, max_length=20, description="of every price, such as EUR or h")]
    run: Annotated[FiniteFloat, Field(gt=0, description="of one recorded run")]
    mobilisation: Price = Field(default=0.0, description="paid once, before the first run")
    per_metre: Annotated[FiniteFloat, Field(gt=0)] | None = Field(
        default=None, description="what a metre of mean error at the horizon costs"
    )
    H_end_required: Annotated[FiniteFloat, Field(gt=0)] | None = Field(
        default=None, description="m, mean error at the horizon that is good enough"
    )
    foundations: dict[str, Price] = Field(
        default={}, description="price of each physics, by family or by kind: template, sister, ...; no physics is free"
    )

    @model_validator(mode="after")
    def _one_goal(self) -> Cost:
        if (self.per_metre is None) == (self.H_end_required is None):
            raise ValueError("give either `per_metre` or `H_end_required`")
        return self


class PublishedEnvelope(Strict):
    """`[published]`: the input envelope that others report, to be shown beside that of the study."""

    source: Annotated[str, Field(min_length=3)]
    envelope: dict[str, list[FiniteFloat]] = Field(description="key -> [min, mean, max]")

    @model_validator(mode="after")
    def _sensible(self) -> PublishedEnvelope:
        for key, limits in self.envelope.items():
            if key not in published_keys():
                raise ValueError(f"envelope.{key} is no input of a study: {suggest_name(key, published_keys())}")
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


class MeanBlock(Strict):
    """`[[model]]`: the mean of the compensated paths of several foundations, for each method that meets them all."""

    name: Annotated[str, Field(pattern=NAME)]
    mean_of: Annotated[list[str], Field(min_length=1, description="families with physics; * matches any text")]
    weights: Literal["equal", "left-out"] = Field(
        default="left-out", description="left-out: those that err least on runs left out, from 0 on, of sum 1"
    )


class Study(Strict):
    """A whole study document."""

    question: Annotated[str, Field(min_length=3)]
    description: str | None = None
    seed: int = Field(
        default=0, ge=0, le=2_000_000, description="another world: other manoeuvres, families, data, training"
    )
    truth: Truth | None = None
    data: Data | None = None
    split: Split
    prediction: Prediction
    grid: Grid
    method: Annotated[list[MethodBlock], Field(min_length=1)] = [MethodBlock(name="kernel", kind="kernel")]
    claims: Claims | None = None
    published: PublishedEnvelope | None = None
    cost: Cost | None = None
    bands: BandsBlock = BandsBlock()
    unusual: list[str] = Field(default=[], description="dotted paths of numbers that may lie outside their range")
    families: str | None = Field(default=None, description="a document of families that come first: a path, or a study")
    family: Annotated[list[Family], Field(description="at least one with [truth]; else data alone, as `none`")] = []
    model: list[MeanBlock] = []
    repeat: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(
        default={}, description="dotted path -> values: the study is done for each; the comparison pools them"
    )
    condition: list[Condition] = Field(default=[], description="the study is done in each; shown side by side")

    @model_validator(mode="after")
    def _one_world(self) -> Study:
        if (self.truth is None) == (self.data is None):
            raise ValueError("give either [truth] (simulation) or [data] (recorded runs)")
        if self.truth is not None and not self.family:
            raise ValueError("missing [[family]]: only recorded runs can be studied without physics")
        return self

    def in_its_world(self) -> Study:
        """Return the study with `WORLDS` times its top-level seed added to the seeds of truth, split, grid, families.

        Seed 0 leaves all as they are; recorded runs stay the same in every world.
        """
        shift = WORLDS * self.seed
        truth = self.truth and self.truth.model_copy(update={"seed": self.truth.seed + shift})
        split = self.split.model_copy(update={"seed": self.split.seed + shift})
        seeds = self.grid.seeds and [seed + shift for seed in self.grid.seeds]
        grid = self.grid.model_copy(update={"seeds": seeds})
        family = [one.model_copy(update={"seed": one.seed + shift}) for one in self.family]
        return self.model_copy(update={"truth": truth, "split": split, "grid": grid, "family": family})

    def seeds_of(self, N_D: int) -> list[int]:
        """Seeds of the draws of an amount of data, those of its world, each once, the least first.

        Where the study names none: the root of how often the largest amount holds this one, at most `MOST_DRAWS`.
        """
        most = min(MOST_DRAWS, math.ceil((max(self.grid.N_D) / N_D) ** 0.5))
        return sorted(set(self.grid.seeds or range(WORLDS * self.seed, WORLDS * self.seed + most)))
