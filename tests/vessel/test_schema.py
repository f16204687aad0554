from __future__ import annotations

import copy
import importlib.util
import sys
from pathlib import Path
from typing import Any

import casadi as ca
import pytest

from shipid.errors import DocumentError, ShipidError
from shipid.physics import ACTUATORS, TERMS, Term
from shipid.units import unit_fault
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from shipid.vessel.schema import (
    bind_document,
    check_term,
    function_parameters,
    function_signals,
    parameter_units,
    split_keys,
    term_parameters,
)
from tests.cli.running import ended
from tests.documented import code


@pytest.mark.parametrize("kind", list(ACTUATORS))
def test_an_actuator_is_a_pair_of_pure_functions(kind: str) -> None:
    """`output(state)` and `advance(command, state, dt)`; a reached command stays reached."""
    memory = ACTUATORS[kind]
    assert function_signals(memory.output) == ("state",)
    assert function_signals(memory.advance) == ("command", "state", "dt")
    numbers = {p.name: 1.0 for p in function_parameters(memory.advance) if p.default is None}
    assert float(memory.advance(ca.SX(0.7), ca.SX(0.7), ca.SX(0.5), **numbers)) == pytest.approx(0.7)


@pytest.mark.parametrize("key", [key for key, term in TERMS.items() if term.gives])
def test_what_a_term_gives_has_its_parameters_in_the_same_block(key: str) -> None:
    """Those that only the wash takes are keys of the block too, and the force does not list them."""
    term = TERMS[key]
    names = [parameter.name for parameter in term_parameters(term)]
    assert len(names) == len(set(names))
    for function in (term.function, *term.gives.values()):
        assert {parameter.name for parameter in function_parameters(function)} <= set(names)
    if key == "thruster.quadratic":
        assert "c_uu" in set(names) - {parameter.name for parameter in function_parameters(term.function)}


HEAD = """
import math
import sys
from collections.abc import Mapping
from typing import Annotated

import casadi as ca
import numpy as np
from casadi import SX

from shipid.physics import Term
from shipid.physics.frames import wrench_of_force


def wrench(Y):
    return wrench_of_force(SX(0), SX(0), SX(0), SX(0), Y)


def plain(nu_r: SX, *, C: Annotated[SX, "kg m^-1"]) -> SX:
    return wrench(-C * nu_r[1] * ca.fabs(nu_r[1]))


"""
DRAG = """
def drag(nu_r: SX, *, C: Annotated[SX, "kg m^-1"]) -> SX:  # begins
    v = nu_r[1]
    Y = -C * v * ca.fabs(v)
    {}  # body
TERM = Term(drag)
"""
SHIPS = {
    "hull": "[hull.{kind}]\nC = 100.0\n",
    "thruster": '[thruster.{kind}]\nkind = "{kind}"\nC = 100.0\n',
    "wind": '[wind]\nkind = "{kind}"\nC = 100.0\n',
    "radiation": "[radiation.{kind}]\nC = 100.0\n",
}


def signature(arguments: str) -> str:
    """A term with other arguments."""
    return f"def drag({arguments}) -> SX:  # begins\n    return SX(6, 1)\nTERM = Term(drag)\n"


def with_states(states: str, rates: str) -> str:
    """A term with additional states."""
    return f"""
def rates(nu: SX, state: SX) -> SX:  # rates
    return {rates}
def states(block):  # states
    return {states}
def drag(nu_r: SX, state: SX, *, C: Annotated[SX, "kg m^-1"]) -> SX:  # begins
    return wrench(-C * nu_r[1] * state[0])
TERM = Term(drag, states=states, rates=rates)
"""


def sums(components: str, more: str = "") -> str:
    """A sum over components."""
    return f"""
def parts():  # parts
    return {components}
def drag(nu_r: SX, share: SX, *, C: Annotated[SX, "kg m^-1"]{more}) -> SX:  # begins
    return wrench(-C * nu_r[1] * share)
TERM = Term(drag, components=parts)
"""


NEWTON = "Annotated[SX, 'kg m^-1']"
WRENCH = "hull.drag must return a wrench (6), not "
FAULTS: dict[str, tuple[str, str, str, str]] = {
    # name -> key, text of the module, the line that is named, words
    "one number": ("hull.drag", DRAG.format("return Y"), "begins", f"{WRENCH}a matrix of (1, 1)"),
    "a list": ("hull.drag", DRAG.format("return [Y] * 6"), "begins", f"{WRENCH}list"),
    "nothing": ("hull.drag", DRAG.format("pass"), "begins", f"{WRENCH}NoneType"),
    "not a number": (
        "hull.drag",
        DRAG.format("return wrench(Y * np.nan)"),
        "begins",
        "hull.drag returns what is not a",
    ),
    "an error": ("hull.drag", DRAG.format("raise ValueError('no drag')"), "body", "hull.drag: ValueError: no drag"),
    "the end": ("hull.drag", DRAG.format("sys.exit('no')"), "body", "hull.drag calls sys.exit (no)"),
    "if": ("hull.drag", DRAG.format("return wrench(Y if v > 0 else -Y)"), "body", "write ca.if_else(condition, one, o"),
    "own symbols": (
        "hull.drag",
        DRAG.format("return wrench(Y * SX.sym('k'))"),
        "begins",
        "symbols of its own, k: make",
    ),
    "no unit": ("hull.drag", signature("nu_r: SX, *, C"), "begins", "its parameter 'C' has no unit: write `C: Annota"),
    "no signal": (
        "hull.drag",
        signature("nu_r: SX, depht: SX, *, C: Annotated[SX, 'kg']"),
        "begins",
        "hull.drag: its positional argument 'depht' is no signal",
    ),
    "any signals": (
        "hull.drag",
        signature("*nu: SX, C: Annotated[SX, 'kg']"),
        "begins",
        "positional argument 'nu' is no signal",
    ),
    "a unit in words": (
        "hull.drag",
        signature("nu_r: SX, *, C: Annotated[SX, 'kg/meter']"),
        "begins",
        "hull.drag: the unit 'kg/meter' of its parameter 'C' is not known: write a product of powers",
    ),
    "a table": (
        "hull.drag",
        signature("nu_r: SX, *, C: Annotated[Mapping[str, SX], 'kg']"),
        "begins",
        "'C' is a table and needs a grammar of",
    ),
    "a default": ("hull.drag", signature("*, C: Annotated[SX, 'kg'] = 'a'"), "begins", "must be a number, not 'a'"),
    "a name that is taken": ("hull.drag", signature("*, off: Annotated[SX, 'kg']"), "begins", "'off' is a key that bl"),
    "types that are not there": ("hull.drag", signature("nu_r: 'Sx'"), "begins", "cannot be read (name 'Sx' is not de"),
    "rates of another length": (
        "radiation.mine",
        with_states("('x', 'y')", "nu[0]"),
        "rates",
        "rates of radiation.mine must return 2 numbers, one for each of its states, not a matrix of (1, 1)",
    ),
    "an error in rates": ("radiation.mine", with_states("('x',)", "1 / 0"), "rates + 1", "ZeroDivisionError"),
    "no rates": ("radiation.mine", with_states("'x',", "0").replace(", rates=rates", ""), "begins", "needs both, or"),
    "components of other names": ("hull.drag", sums("{'part': [1.0]}"), "begins", "argument 'share' is no signal"),
    "one number as wash": (
        "thruster.fin",
        "def shown(nu_r: SX) -> SX:  # shown\n    return nu_r[0]\nTERM = Term(plain, gives={'wash': shown})\n",
        "shown",
        "wash of thruster.fin must return 3 numbers, not a matrix of (1, 1)",
    ),
    "another block": (
        "hul.drag",
        DRAG.format("return wrench(Y)"),
        "begins",
        "TERMS['hul.drag']: no block of a vessel document and a kind in it: write <block>.<kind>, such as TERMS[",
    ),
}


def registered(key: str, text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module of a user whose `TERM` is in TERMS by this key; its file."""
    file = folder / "mine.py"
    file.write_text(HEAD + text)
    spec = importlib.util.spec_from_file_location("mine", file)
    module: Any = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "mine", module)
    spec.loader.exec_module(module)
    monkeypatch.setitem(TERMS, key, module.TERM)
    return file


def ship(key: str, folder: Path) -> Path:
    """The document of a ship with a block of this key."""
    group, _, kind = key.rpartition(".")
    file = folder / "ship.toml"
    block = SHIPS.get(group, SHIPS["hull"]).format(kind=kind)
    file.write_text(f'extends = "gunnerus-28.9"\n{block}')
    return file


@pytest.mark.parametrize("name", FAULTS)
def test_a_mistake_in_a_term_is_one_line(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One number was added to all six axes without a word; others were tracebacks, or blamed the document."""
    key, text, line, words = FAULTS[name]
    file = registered(key, text, tmp_path, monkeypatch)
    mark, _, further = line.partition(" + ")
    lines = file.read_text().split("\n")
    place = (
        f" in {file}, line {next(i for i, one in enumerate(lines, 1) if one.endswith(f'# {mark}')) + int(further or 0)}"
    )
    monkeypatch.chdir(tmp_path)
    status, out, err = ended("manoeuvre", ship(key, tmp_path), "turning", 35)
    assert status == 1
    assert out == ""
    assert err.count("\n") == 1, err
    assert words in err
    assert key in err
    assert place in err
    assert sorted(one.name for one in tmp_path.iterdir() if one.suffix == ".html") == []


def test_the_terms_of_the_page_pass(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = code("A term")[1] + "\nTERM = Term(skeg)\n"
    registered("hull.skeg", text, tmp_path, monkeypatch)
    assert check_term("hull.skeg").function.__name__ == "skeg"


@pytest.mark.parametrize("key", TERMS)
def test_every_listed_term_passes(key: str) -> None:
    assert check_term(key) is TERMS[key]
    assert (key.partition(".")[0], key.partition(".")[2]) in split_keys(tuple(TERMS))


@pytest.mark.parametrize("kind", ACTUATORS)
def test_units_of_actuators_are_those_of_terms_or_of_the_command(kind: str) -> None:
    units = [str(parameter.unit) for parameter in function_parameters(ACTUATORS[kind].advance)]
    assert all(unit.endswith("of the command") or not unit_fault(unit) for unit in units)


def test_a_term_that_is_put_in_later_is_checked_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a notebook, for a vessel that was read before."""
    registered("hull.drag", DRAG.format("return wrench(Y)"), tmp_path, monkeypatch)
    vessel = load_vessel(ship("hull.drag", tmp_path))
    registered("hull.drag", signature("nu_r: SX, C: Annotated[SX, 'kg m^-1']"), tmp_path, monkeypatch)
    with pytest.raises(ShipidError, match="is behind a"):
        vessel_dynamics(vessel)
    registered("hull.drag", signature(f"nu_r: SX, *, C: {NEWTON}, D: {NEWTON}"), tmp_path, monkeypatch)
    with pytest.raises(DocumentError, match=r"ship\.toml: hull\.drag\.D: missing"):
        vessel_dynamics(vessel)
    for more in (f"D: {NEWTON} = 2.0", f"L_pp: {NEWTON}"):
        registered("hull.drag", signature(f"nu_r: SX, *, C: {NEWTON}, {more}"), tmp_path, monkeypatch)
        with pytest.raises(
            ShipidError, match=r"ship\.toml: its terms take other numbers than when it was read: load it"
        ):
            vessel_dynamics(vessel)
    monkeypatch.setitem(TERMS, "hull.drag", Term(3))  # type: ignore[arg-type]
    with pytest.raises(ShipidError, match=r"^hull\.drag must be a function, not 3$"):
        vessel_dynamics(vessel)


def test_numbers_of_an_actuator_have_the_unit_of_its_command() -> None:
    """Exports and tables said `1/s of the command`."""
    document = copy.deepcopy(load_vessel("gunnerus-28.9-6dof").document)
    gear = {"kind": "first_order", "T": 2.0, "rate": 0.2, "low": -1.0, "high": 1.0}
    document["thruster"]["port"]["actuator"] = {"n": gear, "alpha": gear}
    known = parameter_units(document)
    shaft, unit = "thruster.port.actuator.n", "thruster.port.actuator.alpha"
    assert [known[f"{shaft}.{name}"] for name in ("T", "rate", "low", "high")] == ["s", "rev/s^2", "rev/s", "rev/s"]
    assert [known[f"{unit}.{name}"] for name in ("rate", "low", "high")] == ["rad/s", "rad", "rad"]
    document["thruster"]["port"] = {
        "kind": "controllable_pitch", "x": -10.0, "D_p": 1.0, "k_P": 0.4, "k_J": 0.4, "actuator": {"pitch": gear},
    }  # fmt: skip
    known = parameter_units(document)
    assert [known[f"thruster.port.actuator.pitch.{name}"] for name in ("rate", "low")] == ["1/s", "-"]


def test_shared_numbers_come_from_the_particulars() -> None:
    bound = bind_document(load_vessel("kvlcc2-l7").document)
    assert bound["hull.mmg"]["L_pp"] == "particulars.L_pp"
    assert bound["hull.mmg"]["rho"] == "constants.rho"
    assert bound["thruster.propeller"]["D_p"] == "thruster.propeller.D_p"
