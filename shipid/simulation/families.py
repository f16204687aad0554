"""Families of vessels: what a document of families declares, drawn, and all members simulated in one rollout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, overload

import numpy as np
import pandas as pd

from shipid.arguments import check_class, check_whole_number
from shipid.engine.engines import REPEATED
from shipid.engine.rollout import Trajectories, rollout
from shipid.errors import DocumentError
from shipid.simulation.approach import NotStraight
from shipid.simulation.perform import Array, perform_by_variants
from shipid.simulation.standard import define_standard
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.family import choose_family, read_family_document
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, Variant, change_structure, draw_members


@dataclass(frozen=True, eq=False, repr=False)
class VesselFamily(Sequence[Variant]):
    """The members of a family, a sequence of variants of one vessel.

    rules : the family, with `extends` written out. base : the vessel that the members change, with their structure.
    file : the document that it was read from; empty for one made in Python.
    """

    rules: Family
    base: Vessel
    file: str = ""

    def __post_init__(self) -> None:
        check_class("rules", self.rules, Family, "such as Family(name=..., perturb=[...])")
        check_class("base", self.base, Vessel, "as of `load_vessel`")

    def __repr__(self) -> str:
        return f"<family {self.rules.name}: {len(self)} of {self.base.name}, seed {self.rules.seed}>"

    def __len__(self) -> int:
        return self.rules.members

    @overload
    def __getitem__(self, index: int) -> Variant: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Variant]: ...
    def __getitem__(self, index: int | slice) -> Variant | Sequence[Variant]:
        return self.members[index]

    @cached_property
    def members(self) -> tuple[Variant, ...]:
        """All members, as the document's seed draws them."""
        return tuple(draw_members(self.rules, self.base, self.file or None))

    @property
    def parameters(self) -> Array:
        """Values (V, P) of all parameters of each member, in the order of those of the base."""
        return np.array([member.parameters for member in self.members])

    def draw(self, seed: int) -> VesselFamily:
        """The family with members of another seed."""
        return replace(self, rules=self.rules.model_copy(update={"seed": check_whole_number("seed", seed)}))

    def table(self) -> pd.DataFrame:
        """A row for each member by its name; columns `factor` and `value`, each with one column for each dotted path.

        Paths are those that the rules change. Values are in SI units, see `base.units`; the factor on a number that is
        0 in the base is not a number.
        """
        names = pd.Index([member.name for member in self.members], name="member")
        tables = {
            kind: pd.DataFrame([getattr(member, f"{kind}s") for member in self.members], index=names)
            for kind in ("factor", "value")
        }
        tables["factor"] = tables["factor"].reindex(columns=tables["value"].columns)
        return pd.concat(tables, axis=1, names=["kind", "path"])

    def rollout(
        self,
        start: Mapping[str, Any],
        commands: Mapping[str, Any],
        environment: Mapping[str, Any] | None = None,
        *,
        step: float = 0.5,
        num_steps: int = 60,
        **more: Any,
    ) -> Trajectories:
        """Motion of all members from the same start by the same commands, in one rollout: 30 s unless told otherwise.

        start, commands, environment : name -> a number, or arrays as of `shipid.rollout`; states and wind that are
        absent are 0. more : further arguments of `shipid.rollout`. Result: (num_records, members, samples, channels).
        """
        model = vessel_dynamics(self.base)
        given = [dict.fromkeys(model.state, 0.0) | dict(start), commands]
        given.append(dict.fromkeys(model.environment, 0.0) | dict(environment or {}))
        samples = max((np.size(value) for value in start.values()), default=1)
        arrays = [
            {name: np.full(samples, value) if np.ndim(value) == 0 else value for name, value in one.items()}
            for one in given
        ]
        return rollout(self.base, *arrays, step=step, num_steps=num_steps, parameters=self.parameters, **more)

    def trajectories(
        self,
        manoeuvre: str,
        angles: Sequence[float] | float = (),
        *,
        speed: float | None = None,
        side: str = "starboard",
        duration: float | None = None,
        approach: str | None = None,
        engine: str = REPEATED,
    ) -> Trajectories:
        """A standard manoeuvre of all members in one rollout, for `figures.spread`; arguments as of `measure_standard`.

        All begin in the steady approach of the base, with its shaft speed, one ship length before the first order; a
        zigzag reverses the helm at the heading of each member.
        """
        for given in (approach,) if approach else ("steady", "helmsman"):
            try:
                chosen = define_standard(
                    self.base, manoeuvre, angles, speed=speed, side=side, duration=duration, approach=given
                )
                how = {"step": chosen.step, "interval": chosen.interval}
                return perform_by_variants(self.base, chosen.manoeuvre, self.parameters, engine=engine, **how)
            except NotStraight:
                if given in (approach, "helmsman"):
                    raise
        raise AssertionError


def read_family(document: str | Path, name: str | None = None) -> VesselFamily:
    """Read a family of a document of families, of a lock or of a study, by bundled name or path.

    name : of the family, where the document has several. DocumentError for what is not there or not valid.
    """
    file, content = read_family_document(document)
    rules = choose_family(file, content, name)
    try:
        base = load_vessel(str(rules.base), file.parent)
    except DocumentError as error:
        raise DocumentError(str(error), file=file, path=f"family.{rules.name}.base") from None
    return VesselFamily(rules, change_structure(rules, base), str(file))
