"""What results are computed with: versions, engine, processor, device and users' code, noted before any is stored."""

from __future__ import annotations

import logging
import platform
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from shipid.capacity import processor_name, usable_cores
from shipid.engine.native import engine_description, noted_engine
from shipid.errors import ShipidError
from shipid.hybrid.device import vector_instructions
from shipid.study import store
from shipid.study.code import code_digest
from shipid.study.plan import USER_SCRIPT, Plan, own_code
from shipid.version import __version__

PACKAGES = (
    *("casadi", "numpy", "scipy", "scikit-learn", "torch", "optuna", "pandas", "pyarrow"),
    *("dask", "distributed", "plotly"),
)

Code = Mapping[str, Mapping[str, str]]  # what a user wrote, as `Plan.code`
MAIN = "__main__"  # module of a script, a cell or a console

log = logging.getLogger(__name__)


def note_sessions(folder: Path, *sessions: Mapping[str, Any]) -> None:
    """Note what this process or a worker computes with by now; a warning for a session that is new to the folder."""
    for session in sessions:
        known = session in store.provenance(folder)["sessions"]
        if not known and (changed := store.note_session(folder, session)):
            log.warning("computed otherwise in this process or a worker: %s", "; ".join(changed))


def session_by_now(begun: Mapping[str, Any]) -> dict[str, Any]:
    """A session of this process with its engine of now: another one from when on a model could not be compiled."""
    return {**begun, "engine": noted_engine() or begun["engine"]}


def session_on(device: str, code: Code) -> dict[str, Any]:
    """What results depend on beside the plan, to the last digit: versions, engine, processor, device, users' code."""
    computer = machine()
    others = {name: version for name, version in computer["packages"].items() if name != "shipid"}
    return {
        "shipid": f"{__version__}, code {code_digest()}",  # the code may differ and the version not
        "engine": engine_description(),
        "processor": computer["processor"],
        "python": computer["python"],
        "device": device,
        "packages": others,
        **code,
    }


def machine() -> dict[str, Any]:
    """What the results were computed with: interpreter, packages, machine."""
    packages = {"shipid": __version__}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):  # an extra that is not installed
            packages[name] = version(name)
    system = {"python": sys.version.split()[0], "system": platform.platform(terse=True), "machine": platform.machine()}
    return {
        **system,
        "processor": f"{processor_name()}, {vector_instructions()}",
        "cores": usable_cores(),
        "packages": packages,
    }


def code_at_worker(plan: Plan, code: Code) -> dict[str, dict[str, str]]:
    """What the user wrote as a worker has it; `code` is that of the process that gave the work.

    A method of that process's script has no file on another machine. Raises ShipidError where the worker lacks a term.
    """
    imported = replace(plan, methods=tuple(way for way in plan.methods if type(way.method).__module__ != MAIN))
    try:
        here = own_code(imported)
    except KeyError as unknown:
        words = f"workers lack the term {unknown}: write its line TERMS[...] = ... into a script, as {USER_SCRIPT} in"
        more = 'docs/extending.md, above its line `if __name__ == "__main__":`; start those of Dask with --preload'
        raise ShipidError(f"{words} {more}") from None
    return {what: {**code.get(what, {}), **here.get(what, {})} for what in {**code, **here}}
