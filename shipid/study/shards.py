"""Shards: the parts of a plan that the tasks of a job array compute, each in its own folder, and taking them in."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from shipid.errors import ResultError
from shipid.files import replace_whole, temporary_folder
from shipid.study import seals, store
from shipid.study.lock import sole_writer
from shipid.study.plan import Plan

SHARDS = "shards"


def shard_folder(folder: Path, shard: tuple[int, int]) -> Path:
    """Where shard (i, n) of a run is; ResultError unless i is 1 to n."""
    number, count = shard
    if not 1 <= number <= count:
        raise ResultError(f"{number}/{count}: must be i/n, i from 1 to n, such as 3/20", path="--shard")
    return folder / SHARDS / f"{number}-of-{count}"


def check_prepared(folder: Path, plan: Plan, names: Sequence[str]) -> None:
    """Raise ResultError unless a folder holds what shards of a plan share, under seals of these names, as written."""
    if not all(seals.is_sealed(folder, name) for name in names):
        raise ResultError("is not prepared for shards: `shipid study prepare` does that, once", file=folder)
    if store.provenance(folder)["digest"] != plan.digest:
        raise ResultError("is prepared for another study, or another version of it: choose another --out", file=folder)
    seals.check_seals(folder, names=names)


def take_in(folder: Path, plan: Plan) -> Iterator[str]:
    """Take the units of all shards into the folder of their run and remove the shards; yield a sentence each.

    Raises ResultError for a shard of another study or code of shipid, or at work, and for a unit whose results differ.
    """
    for place in sorted((folder / SHARDS).glob("*-of-*")):
        with sole_writer(place):
            _check_shard(folder, place, plan)
            yield from seals.unseal_missing(place)
            finished = store.finished_units(place, plan.units)
            for unit in finished:
                _take_unit(folder, place, unit.key)
        with temporary_folder(folder / SHARDS) as gone:  # what a kill leaves of it is no shard
            os.rename(place, gone / place.name)
        yield f"shard {place.name}: {len(finished)} units taken in"


def _check_shard(folder: Path, place: Path, plan: Plan) -> None:
    """Refuse a shard of another study, or of another code than the folder was prepared with."""
    here, there = store.provenance(folder), store.provenance(place)
    if there["digest"] != plan.digest:
        raise ResultError("is of another study: move it away, and start again", file=place)
    codes = [{str(one.get("shipid")) for one in record.get("sessions", [])} for record in (here, there)]
    if other := sorted(codes[1] - codes[0]):
        message = f"was computed with shipid {other[0]}, and the folder with {', '.join(sorted(codes[0]))}"
        raise ResultError(f"{message}: delete one of them and run it again with one version", file=place)


def _take_unit(folder: Path, place: Path, key: str) -> None:
    """Copy the files of a unit; ResultError where the folder has other results of it."""
    files = seals.named_files(place, key)
    if seals.is_sealed(folder, key):
        for name in files:
            if _content(folder / name) != _content(place / name):
                message = f"differs from {place / name}, of the same unit: delete one of the two with its seal"
                raise ResultError(message, file=folder / name)
        return
    for name in (*files, f"{store.JOURNALS}/{key}.log"):
        if (place / name).is_file():
            with replace_whole(folder / name) as temporary:
                shutil.copyfile(place / name, temporary)
    seals.write_seal(folder, key, [folder / name for name in files])


def _content(file: Path) -> Any:
    """What a file of results holds, without what a clock measured."""
    if file.suffix != ".json":
        return file.read_bytes()
    return json.loads(
        file.read_text(encoding="utf-8"),
        object_hook=lambda entry: {key: value for key, value in entry.items() if key != "seconds"},
    )
