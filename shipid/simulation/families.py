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
from typing import Any

import numpy as np
import pandas as pd
import tomlkit

from shipid import document as documents
from shipid.arguments import check_choice, check_mapping, check_whole_number, whole_steps
from shipid.engine.rollout import SPEED_LIMIT, Trajectories, rollout
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.files import make_folder, write_set
from shipid.notebooks import NotebookView
from shipid.simulation.approach import Controls
from shipid.simulation.perform import rollout_inputs
from shipid.simulation.standard import define_standard
from shipid.units import plural_word
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, FamilyDocument, Variant, change_structure, draw_members, resolve_families

LOCK_TRIAL: tuple[str, tuple[float, float]] = ("zigzag", (20.0, 20.0))
"""Manoeuvre in which a lock looks for members that diverge; angles in deg."""
UNLOCKED_KEYS = {"base", "extends", "description"}
"""Keys of a family that its lock leaves out: the base is locked by its digest, what is extended is written out."""


@dataclass(frozen=True, eq=False, repr=False)
class VesselFamily(NotebookView, shown=("rules.name", "base.name", "rules.members", "table")):
    """A family on its vessel.

    rules : the family, with `extends` written out. base : the vessel that the members change, with their `structure`.
    file : the document that errors name.
    """

    rules: Family
    base: Vessel
    file: Path | None = None

    @cached_property
    def members(self) -> tuple[Variant, ...]:
        """All members, as the seed of the rules draws them."""
        return tuple(draw_members(self.rules, self.base, self.file))

    def draw(self, seed: int) -> VesselFamily:
        """The family with the members that another seed draws."""
        return replace(self, rules=self.rules.model_copy(update={"seed": check_whole_number("seed", seed)}))

    def table(self) -> pd.DataFrame:
        """A row for each member by its name; for each dotted path that the rules change the columns `factor`, `value`.

        Columns have two levels, path and kind: `table["inertia.m", "factor"]`, or `table.xs("factor", axis=1, level=1)`
        for all factors. Values are in SI units, see `base.units`; a number that is 0 in the base has no factor.
        """
        rows = [
            [numbers.get(path, np.nan) for path in one.values for numbers in (one.factors, one.values)]
            for one in self.members
        ]
        columns = pd.MultiIndex.from_product([self.members[0].values, ("factor", "value")], names=["path", "kind"])
        return pd.DataFrame(rows, pd.Index([one.name for one in self.members], name="member"), columns)

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
        check_mapping("start", start, "a name to a number or an array")
        model, samples = vessel_dynamics(self.base), max(map(np.size, start.values()), default=1)
        still, calm = (dict.fromkeys(names, 0.0) for names in (model.state, model.environment))
        given = [
            {name: np.full(samples, value) if np.ndim(value) == 0 else value for name, value in numbers.items()}
            for numbers in (still | dict(start), commands, calm | dict(environment or {}))
        ]
        more |= {"parameters": np.array([one.parameters for one in self.members])}
        return rollout(self.base, *given, step=step, num_steps=num_steps, **more)

    def trajectories(
        self,
        manoeuvre: str,
        angles: Sequence[float] | float = (),
        *,
        approach: str = "helmsman",
        engine: str = "auto",
        **more: Any,
    ) -> Trajectories:
        """A standard manoeuvre of all members in one rollout, for `figures.spread`; arguments as of `define_standard`.

        All begin as the approach of the base ends, with its shaft speed, one ship length before the first order: until
        then each changes towards a speed of its own. A zigzag reverses the helm at the heading of each member.
        """
        chosen = define_standard(self.base, manoeuvre, angles, approach=approach, **more)
        every, helmsman = whole_steps(chosen.interval, chosen.step), chosen.manoeuvre.helmsman(Controls(self.base))
        num_steps = every * int(chosen.manoeuvre.length / chosen.interval + 1e-9)
        how: dict[str, Any] = {"step": chosen.step, "method": "rk4", "engine": engine}
        commands, begun = rollout_inputs(Controls(self.base), helmsman, [chosen.manoeuvre], num_steps, how)
        how |= {"num_steps": num_steps, "every": every, "keep": tuple(begun["start"])}
        return self.rollout(commands=commands, **begun, **how)

    def motion_table(self, trajectories: Trajectories) -> pd.DataFrame:
        """Motion in the first sample as rows: member, t [s] and the channels, no numbers for a member that diverges."""
        states = np.where(trajectories.diverged[:, :1, None], np.nan, trajectories.states[:, :, 0].swapaxes(0, 1))
        times = trajectories.interval * np.arange(states.shape[1])
        index = pd.MultiIndex.from_product([[one.name for one in self.members], times], names=["member", "t"])
        return pd.DataFrame(states.reshape(len(index), -1), index, list(trajectories.names)).reset_index()

    def divergence_times(self, trajectories: Trajectories) -> dict[str, float]:
        """Name of each member that diverges in the first sample -> time [s] of its first record that is no ship's."""
        speeds = np.abs([trajectories[name][:, :, 0] for name in ("u", "v")]).max(axis=0)
        times = trajectories.interval * (speeds <= SPEED_LIMIT).sum(axis=0)
        return {self.members[place].name: float(times[place]) for place in np.flatnonzero(trajectories.diverged[:, 0])}

    def content(self) -> documents.Document:
        """Digest of the base, rules without words, and path -> values of the members in their order."""
        values = {path: [one.values[path] for one in self.members] for path in self.members[0].values}
        rules = self.rules.model_dump(mode="json", exclude=UNLOCKED_KEYS, exclude_defaults=True)
        return {"base": self.base.digest, "rules": rules, "values": values}

    def lock(self) -> documents.Document:
        """Digests of all, of base, rules and each member; values; and which members diverge in a trial, and when."""
        content = self.content()
        result = content | {
            "rules": documents.digest_document(content["rules"]),
            "members": [documents.digest_document([self.base.digest, one.values]) for one in self.members],
        }
        try:
            lost = self.divergence_times(self.trajectories(*LOCK_TRIAL))
            result |= {"trial": " ".join(map(str, LOCK_TRIAL)), "diverges_at_s": lost}
        except ShipidError as error:  # such as a ship without helm
            result |= {"trial": f"none: {error.message}"}
        return {"digest": documents.digest_document(result)} | result

    def export(self, folder: str | Path) -> Path:
        """Write a lock, and a patch document for each member that makes a vessel of it; return the file of the lock.

        DataError, and nothing is written, where one of these files exists; OSError where the folder is a file.
        """
        base, lock = str(self.rules.base), Path(folder) / f"{self.rules.name}.lock.toml"
        base = os.path.relpath(self.base.file, folder) if base.endswith(".toml") else base
        patches = {Path(folder) / f"{one.name}.toml": replace(one, base=base).document() for one in self.members}
        if taken := [file for file in (lock, *patches) if file.exists()]:
            raise DataError("exists already and is not written over: name another folder", file=taken[0])
        content = {"vessel": base, "family": [self.content()["rules"]], "lock": self.lock()}
        make_folder(Path(folder))
        write_set({lock: tomlkit.dumps(content)} | patches)
        return lock


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
    if "families" in documents.read_document(documents.find_document(named, "studies", file.parent)):
        raise DocumentError(f"{named} takes its families from elsewhere itself: name that", file=file, path="families")
    source, content = read_family_document(named, file.parent)
    own = document.get("family", [])  # what is no list is left to the schema
    family = [*content["family"], *own] if isinstance(own, list) else own
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
    if other := next((one.name for one in families if one.base is None or one.similar), None):
        raise DocumentError(
            "its members are no variants of one vessel: only a family with a base alone is drawn here",
            file=file,
            path=f"family.{other}",
        )
    bases = [change_structure(one, load_vessel(str(one.base), file.parent)) for one in families]
    return {one.name: VesselFamily(one, base, file) for one, base in zip(families, bases, strict=True)}


def read_family(document: str | Path, name: str | None = None) -> VesselFamily:
    """The family of a document, see `read_families`; `name` may be left out where there is one only."""
    families = read_families(document)
    if name is None and len(families) > 1:
        raise DocumentError(f"has {len(families)} families: choose one of {', '.join(families)}", file=document)
    check_choice("family", name or next(iter(families)), families, DocumentError)
    return families[name or next(iter(families))]


def read_content(document: str | Path, name: str | None = None) -> documents.Document:
    """`VesselFamily.content` of a family, see `read_family`; of a lock with the base and the values that it holds."""
    content = read_family(document, name).content()
    lock = read_family_document(document)[1].get("lock", {})
    return content | {key: lock[key] for key in ("base", "values") if key in lock}


def compare_contents(one: Any, other: Any) -> dict[str, tuple[Any, Any]]:
    """Dotted path -> value in two documents, of each leaf that they do not share; None where one has it not."""
    first, second = (dict(documents.document_leaves(content)) for content in (one, other))
    paths = (path for path in first | second if first.get(path) != second.get(path))
    return {path: (first.get(path), second.get(path)) for path in paths}


def verify_lock(file: str | Path) -> str:
    """Draw and simulate the family of a lock again; return the digest of the lock.

    Patches of members that lie beside the lock are compared too; one that is absent is not missed. ShipidError with the
    first values that are others now; DocumentError for a file that is no lock, or has no base.
    """
    stored = read_family_document(Path(file))[1].get("lock")
    if stored is None:
        raise DocumentError("holds no [lock]: `shipid family export` writes one", file=file)
    family, folder = read_family(Path(file)), Path(file).parent
    patches = {f"{one.name}.toml": one.document() for one in family.members if (folder / f"{one.name}.toml").is_file()}
    then = stored | {name: documents.read_document(folder / name) for name in patches}
    now = family.lock() | {name: documents.parse_toml(text) for name, text in patches.items()}
    if changes := compare_contents(then, now):
        first = "; ".join(f"{path} {old} in the file, {new} now" for path, (old, new) in [*changes.items()][:3])
        words = f"{len(changes)} {plural_word(len(changes), 'entry is', 'entries are')} not as locked: {first}"
        raise ShipidError(f"{words}; put it back, or export the family anew", file=file)
    return str(stored["digest"])
