"""Tables: found in functions, and looked up in C with the values of their ramps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.engine import native
from shipid.engine.integrate import RolloutBatch, RolloutJob
from shipid.engine.native import compiler_target, find_compiler, run_native
from shipid.engine.tables import LEAST, InstructionGraph, TableLookup, apply_operation, even_tables, find_tables
from shipid.engine.vectors import DOUBLE, SINGLE, CompilerTarget
from shipid.physics.wind import interpolate_ramps
from shipid.vessel import dynamics as module
from shipid.vessel.dynamics import Dynamics, vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.engine.conftest import QUICK

SHIP = load_vessel("gunnerus-28.9")


def tables_of(path: str) -> list[int]:
    """Numbers of knots of the tables in the rates of a vessel, the last knot left out."""
    return sorted(len(table.knots) for table in find_tables(vessel_dynamics(load_vessel(path)).rates).values())


def test_wind_tables_of_a_ship_are_found_whole_and_nothing_else() -> None:
    document = SHIP.parameters
    knots = sum(".gamma_deg" in name for name in document)
    assert tables_of("gunnerus-28.9") == [knots - 1] * 3
    assert tables_of("mariner") == []


@pytest.mark.parametrize("size", [LEAST, LEAST + 1])
def test_a_short_table_stays_a_sum(size: int) -> None:
    x, grid, values = ca.SX.sym("x"), ca.SX.sym("grid", size), ca.SX.sym("values", size)
    found = find_tables(ca.Function("f", [x, grid, values], [interpolate_ramps(x, grid, values)]))
    assert len(found) == (size > LEAST)


def with_tables(size: int) -> Dynamics:
    """A motion whose rates are two tables of `size` knots of u, one of v on the same knots, and beyond the knots."""
    model = vessel_dynamics(SHIP)
    x, p = ca.SX.sym("state", 6), ca.SX.sym("parameters", len(SHIP.parameters))
    grid, first, second = p[:size], p[size : 2 * size], p[2 * size : 3 * size]
    beyond = first[0] + (first[1] - first[0]) / (grid[1] - grid[0]) * (x[3] - grid[0])
    for i in range(1, size - 1):
        bend = (first[i + 1] - first[i]) / (grid[i + 1] - grid[i]) - (first[i] - first[i - 1]) / (grid[i] - grid[i - 1])
        beyond += bend * ca.fmax(x[3] - grid[i], 0)
    rates = [
        interpolate_ramps(x[3], grid, first),
        interpolate_ramps(x[3], grid, second),
        interpolate_ramps(x[4], grid, first),
        beyond,
    ]
    inputs = [x, ca.SX.sym("memory", 0), ca.SX.sym("commands", 4), ca.SX.sym("environment", 2), p]
    names = [*module.INPUTS, "tau_extra"]
    return replace(
        model,
        rates=ca.Function("rates", [*inputs, ca.SX.sym("tau_extra", 3)], [ca.vertcat(*rates, 0, 0)], names, ["rates"]),
    )


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
@pytest.mark.parametrize(
    ("way", "size"),
    [("of this processor", size) for size in (LEAST + 1, 16, 17, 18, 19, 33, 34, 50)]  # on both sides of registers
    + [("lane by lane", size) for size in (LEAST + 1, 17, 18, 50)],
)
def test_a_lookup_has_the_values_of_the_ramps(
    size: int, way: str, libraries_kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Knots evenly apart, and others: at knots, between and beyond them, and where there is no number."""
    if way == "lane by lane" and compiler_target().lookup is not None:
        monkeypatch.setattr(CompilerTarget, "lookup", property(lambda wanted: TableLookup(wanted.lanes)))
    monkeypatch.setenv("XDG_CACHE_HOME", str(libraries_kept))
    monkeypatch.setattr(native, "OPTIONS", QUICK)
    rng, model = np.random.default_rng(size), with_tables(size)
    even, other = (np.linspace(low, high, size) for low, high in np.sort(rng.uniform(-5, 5, (2, 2))))
    almost = even + np.where(np.arange(size) == size // 2, 1e-6, 0)
    parameters = np.ones((4, len(SHIP.parameters)))
    for variant, knots in zip(parameters, (even, other, almost, np.sort(rng.uniform(-3, 4, size))), strict=True):
        variant[:size], variant[size : 3 * size] = knots, rng.normal(0, 2, 2 * size)
    assert len(even_tables(model.rates, parameters[:2])) == 4
    assert not even_tables(model.rates, parameters[1:3])
    u = np.concatenate([*parameters[:, :size], np.nextafter(even, 9), np.nextafter(even, -9), rng.uniform(-7, 7, 200)])
    start = np.zeros((6, len(u)))
    start[3], start[4] = u, rng.permutation(u)
    zeros: Any = np.zeros
    rates, job = model.rates.map(len(u)), RolloutJob(1.0, 1, "euler", 1, tuple(range(6)))
    for together in (parameters[:2], parameters[1:]):
        batch = RolloutBatch(
            start, zeros((0, len(u))), zeros((1, 4, len(u))), zeros((1, 2, len(u))), zeros((1, 3, len(u))), together
        )
        got, short = (run_native(model, batch, job, of)[0][1] - start.T for of in (DOUBLE, SINGLE))
        for v, numbers in enumerate(together):
            expected = np.array(rates(start, [], zeros((4, 1)), zeros((2, 1)), numbers, zeros((3, 1)))).T
            scale = np.abs(np.diff(numbers[size : 2 * size]) / np.diff(numbers[:size])).max()
            np.testing.assert_allclose(got[v], expected, rtol=1e-12, atol=1e-13 * scale)
            np.testing.assert_allclose(short[v], expected, rtol=1e-4, atol=1e-4 * scale)
        nothing = replace(batch, state=np.full_like(start, np.nan))
        assert np.isnan(run_native(model, nothing, job)[0][1, :, :, :4]).all()


@pytest.mark.skipif(
    find_compiler() is None or compiler_target().lookup is None, reason="sin and cos are not written out"
)
def test_the_source_of_a_ship_with_tables_looks_them_up() -> None:
    model = vessel_dynamics(SHIP)
    tables = even_tables(model.rates, np.array([list(SHIP.parameters.values())]))
    source = native._RolloutSource(model, 1.0, "euler", compiler_target(), tables).text()
    assert len(tables) == 3
    assert source.count("v_value(&") == 3
    assert source.count("v_place(a") == 1


def test_operands_are_the_instructions_that_compute_them() -> None:
    """Evaluated instruction by instruction, the graph gives what the function gives."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("f", [x, y], [ca.fmax(x * y, 2.0) - ca.sin(x) / y + x * y])
    graph, values, given = InstructionGraph(function), {}, (0.7, 3.1)
    for k, (operation, operands) in enumerate(zip(graph.operation, graph.operands, strict=True)):
        if operation == ca.OP_INPUT:
            values[k] = ca.SX(given[function.instruction_input(k)[0]])
        elif operation == ca.OP_CONST:
            values[k] = ca.SX(function.instruction_constant(k))
        elif operation == ca.OP_OUTPUT:
            result = values[operands[0]]
        else:
            values[k] = apply_operation(operation, [values[i] for i in operands])
    assert float(result) == float(function(*given))
