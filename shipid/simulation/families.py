"""Families of vessels in documents of their own: read, drawn, simulated in one rollout, locked and verified.

A document has a `vessel` and `[[family]]` blocks, as a study has. A lock is a document of one family that also holds
its values, digests to cite, and the members that diverge; as a patch set of pyhf it lists, digests and verifies them,
and the patch documents beside it apply each to the base.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import tomlkit
from pydantic import BaseModel, ConfigDict, Field

from shipid import document as documents
from shipid.arguments import check_choice, whole_steps
from shipid.engine.rollout import SPEED_LIMIT, Trajectories, rollout
from shipid.errors import DocumentError, ShipidError
from shipid.files import make_folder, write_set
from shipid.simulation.approach import Controls, NotStraight
from shipid.simulation.perform import rollout_inputs
from shipid.simulation.standard import define_standard
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, Variant, change_structure, draw_members, resolve_families

LOCK_TRIAL: tuple[str, tuple[float, float]] = ("zigzag", (20.0, 20.0))
"""Manoeuvre in which a lock looks for members that diverge; angles in deg."""
RULE_KEYS = {"name", "members", "seed", "sample", "equal", "structure", "perturb"}


class FamilyDocument(BaseModel):
    """A document of families."""

    model_config = ConfigDict(extra="forbid")
    description: str | None = None
    vessel: str | None = Field(default=None, description="base of the families that name none and extend none")
    family: Annotated[list[Family], Field(min_length=1)]
    lock: dict[str, Any] | None = Field(default=None, description="what was drawn, as `shipid family export` writes it")


@dataclass(frozen=True, eq=False)
class VesselFamily:
    """A family on its vessel.

    rules : the family, with `extends` written out. base : the vessel that the members change, with their `structure`.
    """

    rules: Family
    base: Vessel

    @cached_property
    def members(self) -> tuple[Variant, ...]:
        """All members, as the seed of the rules draws them."""
        return tuple(draw_members(self.rules, self.base))

    def draw(self, seed: int) -> VesselFamily:
        """The family with the members that another seed draws."""
        return replace(self, rules=self.rules.model_copy(update={"seed": seed}))

    def table(self) -> pd.DataFrame:
        """A row for each member by its name; for each dotted path that the rules change the columns `factor`, `value`.

        Columns have two levels, path and kind: `table["inertia.m", "factor"]`, or `table.xs("factor", axis=1, level=1)`
        for all factors. Values are in SI units, see `base.units`; a number that is 0 in the base has no factor.
        """
        rows = [
            {(path, kind): numbers.get(path, np.nan) for path in one.values for kind, numbers in kinds}
            for one in self.members
            for kinds in [(("factor", one.factors), ("value", one.values))]
        ]
        return pd.DataFrame(rows, index=pd.Index([one.name for one in self.members], name="member"))

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
        """Motion of all members from the same start by the same commands, in one rollout; 30 s by default.

        start, commands, environment : name -> a number, or an array as of `shipid.rollout`. States and wind that are
        absent are 0. more : further arguments of it. Result: (records, members, samples, channels).
        """
        model, samples = vessel_dynamics(self.base), max(map(np.size, start.values()), default=1)
        still, calm = (dict.fromkeys(names, 0.0) for names in (model.state, model.environment))
        given = [
            {name: np.full(samples, value) if np.ndim(value) == 0 else value for name, value in numbers.items()}
            for numbers in (still | dict(start), commands, calm | dict(environment or {}))
        ]
        parameters = np.array([one.parameters for one in self.members])
        return rollout(self.base, *given, step=step, num_steps=num_steps, parameters=parameters, **more)

    def trajectories(
        self,
        manoeuvre: str,
        angles: Sequence[float] | float = (),
        *,
        approach: str | None = None,
        engine: str = "repeated",
        **more: Any,
    ) -> Trajectories:
        """A standard manoeuvre of all members in one rollout, for `figures.spread`; arguments as of `measure_standard`.

        All begin as the approach of the base ends, with its shaft speed, one ship length before the first order: until
        then each changes towards a speed of its own. A zigzag reverses the helm at the heading of each member.
        """
        controls = Controls(self.base)
        try:
            chosen = define_standard(self.base, manoeuvre, angles, approach=approach or "steady", **more)
            how: dict[str, Any] = {"step": chosen.step, "method": "rk4", "engine": engine}
            every, helmsman = whole_steps(chosen.interval, chosen.step), chosen.manoeuvre.helmsman(controls)
            num_steps = every * round(chosen.manoeuvre.length / chosen.interval)
            commands, begun = rollout_inputs(controls, helmsman, [chosen.manoeuvre], num_steps, how)
        except NotStraight:
            if approach is not None:
                raise
            return self.trajectories(manoeuvre, angles, approach="helmsman", engine=engine, **more)
        how |= {"num_steps": num_steps, "every": every, "keep": tuple(begun["start"])}
        return self.rollout(commands=commands, **begun, **how)


def read_family_document(name: str | Path, relative_to: Path | None = None) -> tuple[Path, documents.Document]:
    """File and content of a document of families, of a lock, or of a study, whose families alone are taken.

    Families that name no base and extend none have the `vessel` of the document. DocumentError for what is not valid.
    """
    file = documents.find_document(name, "studies", relative_to)
    document = documents.read_document(file)
    if "prediction" in document:  # a study
        document = {"family": expand_families(document, file).get("family", [])}
    content: FamilyDocument = documents.parse_model(FamilyDocument, document, file)
    default = {} if content.vessel is None else {"base": content.vessel}
    return file, document | {
        "family": [block if "extends" in block else default | block for block in document["family"]]
    }


def expand_families(document: documents.Document, file: Path) -> documents.Document:
    """A study with the families of the document that it names as `families` before its own.

    A base that is a path from that document becomes one from the study's folder, or from the working folder.
    """
    named = document.get("families")
    if not isinstance(named, str):
        return document
    source, content = read_family_document(named, file.parent)
    family = [*content["family"], *document.get("family", [])]
    for block in content["family"]:
        if block.get("base", "").endswith(".toml") and (source.parent / block["base"]).is_file():
            block["base"] = (Path(named).parent / block["base"]).as_posix()
    return {key: value for key, value in document.items() if key != "families"} | {"family": family}


def read_families(document: str | Path) -> dict[str, VesselFamily]:
    """Name -> family of a document of families, of a lock or of a study, by bundled name or path.

    DocumentError for what is not there or not valid.
    """
    file, content = read_family_document(document)
    families = resolve_families([Family.model_validate(block) for block in content["family"]], file)
    bases = [change_structure(one, load_vessel(str(one.base), file.parent)) for one in families]
    return {one.name: VesselFamily(one, base) for one, base in zip(families, bases, strict=True)}


def read_family(document: str | Path, name: str | None = None) -> VesselFamily:
    """The family of a document, see `read_families`; `name` may be left out where there is one only."""
    families = read_families(document)
    if name is None and len(families) > 1:
        raise DocumentError(f"has {len(families)} families: choose one of {', '.join(families)}", file=document)
    check_choice("family", name or next(iter(families)), families, DocumentError)
    return families[name or next(iter(families))]


def motion_table(family: VesselFamily, trajectories: Trajectories) -> pd.DataFrame:
    """Motion of each member in the first sample as rows: member, t [s], and the channels; no numbers if it diverges."""
    states = np.where(trajectories.diverged[:, :1, None], np.nan, trajectories.states[:, :, 0].swapaxes(0, 1))
    times = trajectories.interval * np.arange(states.shape[1])
    index = pd.MultiIndex.from_product([[one.name for one in family.members], times], names=["member", "t"])
    return pd.DataFrame(states.reshape(len(index), -1), index, list(trajectories.names)).reset_index()


def divergence_times(family: VesselFamily, trajectories: Trajectories) -> dict[str, float]:
    """Name -> time [s] of the first record in which a member that diverges is no ship, or of the last record."""
    speeds = np.abs([trajectories[name][:, :, 0] for name in ("u", "v")]).max(axis=0)
    fast = ~(speeds <= SPEED_LIMIT)  # or no number
    fast[-1] = True
    times = trajectories.interval * fast.argmax(axis=0)
    return {family.members[place].name: float(times[place]) for place in np.flatnonzero(trajectories.diverged[:, 0])}


def family_content(family: VesselFamily) -> documents.Document:
    """What a family is: digest of its base, rules without words, and path -> values of the members in their order."""
    table = {path: [one.values[path] for one in family.members] for path in family.members[0].values}
    rules = family.rules.model_dump(mode="json", include=RULE_KEYS, exclude_defaults=True)
    return {"base": family.base.digest, "rules": rules, "values": table}


def compare_contents(one: Any, other: Any) -> dict[str, tuple[Any, Any]]:
    """Dotted path -> value in two documents, of each leaf that they do not share; None where one has it not."""
    first, second = (dict(documents.document_leaves(content)) for content in (one, other))
    pairs = {path: (first.get(path), second.get(path)) for path in first | second}
    return {path: pair for path, pair in pairs.items() if pair[0] != pair[1]}


def lock_family(family: VesselFamily) -> documents.Document:
    """The `[lock]` of a family: its digest, those of base, rules and members, values, and what diverges in a trial."""
    content = family_content(family)
    members = [documents.digest_document([family.base.digest, one.values]) for one in family.members]
    result = content | {"rules": documents.digest_document(content["rules"]), "members": members}
    try:
        lost = divergence_times(family, family.trajectories(*LOCK_TRIAL))
        result |= {"trial": " ".join(map(str, LOCK_TRIAL)), "diverges_at_s": lost}
    except ShipidError as error:  # a ship without helm, or one that does not go straight
        result |= {"trial": f"none: {error.message}"}
    return {"digest": documents.digest_document(result)} | result


def export_family(family: VesselFamily, folder: Path) -> Path:
    """Write a lock, and a patch document for each member that makes a vessel of it; return the file of the lock."""
    make_folder(folder)
    base = str(family.rules.base)
    base = os.path.relpath(family.base.file, folder) if base.endswith(".toml") else base
    lock = folder / f"{family.rules.name}.lock.toml"
    content = {"vessel": base, "family": [family_content(family)["rules"]], "lock": lock_family(family)}
    patches = {folder / f"{one.name}.toml": replace(one, base=base).document() for one in family.members}
    write_set({lock: tomlkit.dumps(content)} | patches)
    return lock


def verify_lock(file: Path) -> tuple[str, dict[str, tuple[Any, Any]]]:
    """Draw and simulate the family of a lock again: its digest; path -> value locked and now, where they differ.

    DocumentError for a file that is no lock, or whose base is not there.
    """
    stored = read_family_document(file)[1].get("lock")
    if stored is None:
        raise DocumentError("holds no [lock]: `shipid family export` writes one", file=file)
    return str(stored.get("digest")), compare_contents(stored, lock_family(read_family(file)))
