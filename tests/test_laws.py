"""One law, all members: every term of the physics obeys these, and a new term is tested unasked."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from shipid import document as documents
from shipid.engine.torch import lower_function
from shipid.physics import GIVEN, MOTION, TERMS
from shipid.physics.grammar import Grammar
from shipid.physics.signals import SIGNALS, rows_of_role
from shipid.simulation.weather import wave_loads
from shipid.vessel.load import Vessel, check_document, load_vessel
from shipid.vessel.perturb import uniform_draw
from shipid.vessel.schema import (
    SHARED,
    bind_document,
    function_parameters,
    function_signals,
    structural_keys,
    term_blocks,
    term_parameters,
)
from tests.drawn import seeds

ALL = pytest.mark.parametrize("key", list(TERMS))
DRAWN = settings(max_examples=15, deadline=None, derandomize=True, database=None)

VECTORS = ("eta", "nu", "nu_r")
WASH = np.array([[-1.0, 0.0, 0.2], [6.0, 9.0, 3.0]])  # m/s, m/s, m: least and most of the flow at a rudder
STATE = 0.5  # range of what a term remembers
MOTION_RANGE = np.array([6.0, 1.5, 0.3, 0.1, 0.05, 0.15])  # m/s, rad/s; surge is drawn from -1/3 of it
RANGES = {name: row.reach for name, row in SIGNALS.items()}
MIRROR = {  # port <-> starboard: sign of each signal, then of each wrench entry
    "eta": np.array([1, -1, 1, -1, 1, -1]),
    **dict.fromkeys(("nu", "nu_r"), np.array([1, -1, 1, -1, 1, -1])),
    **{name: row.mirror for name, row in SIGNALS.items()},
}
MIRRORED_WRENCH = np.array([1, -1, 1, -1, 1, -1])
MIRROR_OF_A_TERM = {  # a tunnel's shaft drives sideways, so the mirrored unit turns the other way
    "thruster.tunnel": {"n": -1},
    "radiation.roll": {"state": -1},
}
WHOLE_CIRCLE = {"beta_deg": [-180.0, -65.0, 20.0, 110.0, 180.0], "C_T": [-0.5, -0.7, 0.9, 0.4, -0.5]}
EXAMPLES = {"thruster.quadratic": "naval-51"}  # a vessel other than the first that has the term
SCALE_OF_STATES = {"radiation.heave_pitch": [1.0] * 6 + [0.0] * 6}  # metres, then radians
DRAWN_COMPONENTS = ("waves.first_order", "waves.drift")  # forces of the sea: not zero at rest, no numbers
DISSIPATIVE = ("hull.crossflow", "hull.resistance")
AT_REST = 0.1  # N: what the floor of the shaft speed (1e-3 rev/s) leaves of a thruster at n = 0


@dataclass(frozen=True)
class Example:
    """A term with the numbers of a bundled vessel (else made-up ones) as one SX function.

    function : signals in order, then parameters -> wrench (6).
    """

    function: ca.Function
    signals: tuple[str, ...]
    sizes: Mapping[str, int]
    paths: tuple[str, ...]
    values: np.ndarray
    units: tuple[str, ...]

    def wrench(self, drawn: Mapping[str, Any], values: np.ndarray | None = None) -> np.ndarray:
        given = [drawn[name] for name in self.signals]
        return np.array(self.function(*given, self.values if values is None else values)).ravel()


@cache
def example(key: str) -> Example:
    vessel, path = _with_term(key)
    block = documents.value_at_path(vessel.document, path)
    binding = bind_document(vessel.document)[path]
    paths = tuple(dict.fromkeys(p for target in binding.values() for p in _paths(target)))
    symbols = ca.SX.sym("parameters", len(paths))
    value_of = dict(zip(paths, ca.vertsplit(symbols), strict=True))
    term = TERMS[key]
    columns = _columns(key, block)
    names = tuple(name for name in function_signals(term.function) if name not in columns)
    sizes = {**dict.fromkeys(VECTORS, 6), "wash": 3, "state": len(term.states(block)) if term.states else 0}
    inputs = {name: ca.SX.sym(name, sizes.get(name, 1)) for name in names}
    mine = {parameter.name for parameter in function_parameters(term.function)}
    others = [*term.gives.values(), *([term.rates] if term.rates else [])]
    elsewhere = {parameter.name for function in others for parameter in function_parameters(function)} - mine
    keywords = {keyword: _symbols(target, value_of) for keyword, target in binding.items() if keyword not in elsewhere}
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)] or [{}]
    wrench = sum((term.function(**inputs, **row, **keywords) for row in rows), ca.SX(6, 1))
    function = ca.Function(
        key.replace(".", "_"), [*inputs.values(), symbols], [ca.densify(wrench)], [*names, "parameters"], ["wrench"]
    )
    values = np.array([vessel.parameters[path] for path in paths])
    return Example(function, names, sizes, paths, values, tuple(vessel.units[path] for path in paths))


def _columns(key: str, block: Mapping[str, Any]) -> dict[str, Any]:
    """Component argument -> its values: those of the term, or two wave components as drawn for one ship."""
    term = TERMS[key]
    keys = {name: block[name] for name in structural_keys(term)}
    if term.components:
        return dict(term.components(**keys))
    if not term.drawn:
        return {}
    drawn = {"omega": [[1.1, 1.7]], "amplitude": [[0.3, 0.2]], "epsilon": [[0.4, 2.0]], "chi": [[0.7, 0.8]]}
    vessel = load_vessel("gunnerus-28.9-6dof")
    entries = wave_loads(vessel, {name: np.array(values) for name, values in drawn.items()})[key][0]
    widths = term.drawn(**keys)
    parts = np.split(entries, np.cumsum(list(widths.values()))[:-1], axis=1)
    return dict(zip(widths, [[ca.DM(row) for row in part] for part in parts], strict=True))


@cache
def _all_on(name: str) -> Vessel:
    """A bundled vessel with every term switched on."""
    document = load_vessel(name).document
    off = [path for path, value in documents.document_leaves(document) if path.endswith(".off") and value]
    return check_document(documents.replace_values(document, dict.fromkeys(off, False)), name)


def _with_term(key: str) -> tuple[Vessel, str]:
    """A vessel that has this term, switched on, and where; made up if no bundled vessel has one."""
    for name in sorted(documents.bundled_documents("models"), key=lambda name: name != EXAMPLES.get(key)):
        vessel = _all_on(name)
        for path, term_key, _ in term_blocks(vessel.document):
            if term_key == key:
                return vessel, path
    group, kind = key.split(".")
    path = {"hull": key, "wind": "wind"}.get(group, f"{group}.{kind}")
    base = load_vessel(next(iter(documents.bundled_documents("models"))))
    lacking = {
        f"{SHARED[name]}.{name}": 0.5 + uniform_draw(key, name)
        for name in (parameter.name for parameter in term_parameters(TERMS[key]))
        if name in SHARED and name not in base.document[SHARED[name]]
    }
    return check_document(documents.replace_values(base.document, {path: _made_up(key), **lacking}), "made up"), path


def _made_up(key: str) -> dict[str, Any]:
    group, kind = key.split(".")
    block: dict[str, Any] = {} if group == "hull" else {"kind": kind}
    block |= dict.fromkeys(structural_keys(TERMS[key]), 5)
    candidates = ["X_u|u|", "Y_v", "Y_v|v|", "N_r", "N_rrr", "X_udot", "Y_vdot", "1", "J", "yy"]
    for parameter in function_parameters(TERMS[key].function):
        name = parameter.name
        if isinstance(parameter.unit, Grammar):
            accepted = {c: -0.5 - uniform_draw(key, name, c) for c in candidates if _accepts(parameter.unit, c)}
            block |= accepted if parameter.kind == "open" else {name: accepted}
        elif parameter.kind == "list":
            block[name] = [0.0, 45.0, 90.0, 135.0, 180.0] if name.endswith("_deg") else [0.0, 0.7, 0.9, 0.4, 0.0]
            block[name] = WHOLE_CIRCLE.get(name, block[name])
        elif name not in SHARED:
            block[name] = (-1 if name == "x_aft" else 1) * (0.5 + uniform_draw(key, name))
    return block


def _accepts(grammar: Grammar, name: str) -> bool:
    try:
        grammar.check([name])
    except ValueError:
        return False
    return True


def _paths(target: Any) -> list[str]:
    if isinstance(target, str):
        return [target]
    if isinstance(target, list):
        return target
    return list(target.values()) if isinstance(target, dict) else []


def _symbols(target: Any, value_of: Mapping[str, ca.SX]) -> Any:
    if isinstance(target, str):
        return value_of[target]
    if isinstance(target, list):
        return [value_of[path] for path in target]
    return {k: value_of[path] for k, path in target.items()} if isinstance(target, dict) else target


def rest(case: Example) -> dict[str, Any]:
    return {name: np.zeros(case.sizes[name]) if name in case.sizes else 0.0 for name in case.signals}


def random_signals(case: Example, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    low = MOTION_RANGE * [-1 / 3, -1, -1, -1, -1, -1]

    def one(name: str) -> Any:
        if name in VECTORS:
            return rng.uniform(low, MOTION_RANGE)
        if name == "wash":
            return rng.uniform(*WASH)
        return rng.uniform(-STATE, STATE, case.sizes[name]) if name == "state" else rng.uniform(*RANGES[name])

    return {name: one(name) for name in case.signals}


@st.composite
def envelope(draw: st.DrawFn, case: Example) -> dict[str, Any]:
    """Signals anywhere in the envelope; hypothesis likes its corners and zeros."""

    def one(name: str) -> Any:
        if name == "wash":
            return np.array([draw(st.floats(*limits)) for limits in WASH.T])
        if name in case.sizes:
            limits = MOTION_RANGE if name in VECTORS else np.full(case.sizes[name], STATE)
            return np.array([draw(st.floats(-limit, limit)) for limit in limits])
        return draw(st.floats(*RANGES[name]))

    return {name: one(name) for name in case.signals}


@cache
def jacobian(key: str) -> ca.Function:
    """Signals and parameters -> d(wrench)/d(signals, parameters) (6, count)."""
    f = example(key).function
    inputs = [ca.SX.sym(f.name_in(i), f.size1_in(i)) for i in range(f.n_in())]
    return ca.Function("jacobian", inputs, [ca.jacobian(f(*inputs), ca.vertcat(*inputs))])


def jacobian_at(key: str, drawn: Mapping[str, Any]) -> np.ndarray:
    case = example(key)
    return np.array(jacobian(key)(*(drawn[name] for name in case.signals), case.values))


def test_the_signals_of_every_term_are_declared() -> None:
    declared = {*MOTION, *rows_of_role("command"), *rows_of_role("environment"), *GIVEN}
    assert {name for key in TERMS for name in example(key).signals} <= declared
    assert declared <= {*VECTORS, *RANGES, "state", "wash"}


@pytest.mark.parametrize("key", [key for key, term in TERMS.items() if term.gives])
def test_what_a_term_gives_takes_signals_of_the_term(key: str) -> None:
    term = TERMS[key]
    for name, function in term.gives.items():
        assert name in {*GIVEN, *rows_of_role("output")}
        assert set(function_signals(function)) <= set(function_signals(term.function))


OUTPUTS = [(key, name) for key, term in TERMS.items() for name in term.gives if name in rows_of_role("output")]


def output(key: str, name: str, drawn: Mapping[str, Any], mirrored: bool = False) -> float | None:
    """What an instrument shows, in drawn signals; mirrored: with numbers of the two sides exchanged."""
    vessel, path = _with_term(key)
    numbers = {p: ca.SX(vessel.parameters[p]) for p in vessel.parameters}
    function = TERMS[key].gives[name]
    others = {p.name for p in term_parameters(TERMS[key])} - {p.name for p in function_parameters(function)}
    keywords = {k: _symbols(v, numbers) for k, v in bind_document(vessel.document)[path].items() if k not in others}
    if mirrored:
        plus = {k: v for k, v in keywords.items() if k.endswith(("_plus", "_minus"))}
        keywords |= {
            k: plus[k[: -len(end)] + other]
            for k in plus
            for end, other in (("_plus", "_minus"), ("_minus", "_plus"))
            if k.endswith(end)
        }
        keywords |= {k: -keywords[k] for k in ("y",) if k in keywords}
    value = function(*(ca.SX(drawn[signal]) for signal in function_signals(function)), **keywords)
    return None if value is None else float(ca.evalf(value))


@pytest.mark.parametrize(("key", "name"), OUTPUTS)
@pytest.mark.parametrize("seed", seeds(1, 3))
def test_an_output_is_mirrored_as_its_row_says(key: str, name: str, seed: int) -> None:
    drawn = random_signals(example(key), seed)
    signs = {**MIRROR, **MIRROR_OF_A_TERM.get(key, {})}
    mirrored = {signal: value * signs.get(signal, 1) for signal, value in drawn.items()}
    value = output(key, name, drawn)
    if value is None:
        assert name == "torque"  # no bundled vessel has K_Q
        return
    assert value != 0
    assert output(key, name, mirrored, mirrored=True) == pytest.approx(SIGNALS[name].mirror * value, rel=1e-9)


@pytest.mark.parametrize(("key", "name"), OUTPUTS)
def test_the_force_on_the_ship_is_that_of_the_output_less_what_the_hull_takes(key: str, name: str) -> None:
    """X = (1 - t_P) T of a screw ahead; Y of a tunnel; Y = -(1 + a_H) F_N cos(delta) of a rudder (MMG eqs. 12, 18).

    Of a rudder by coefficients F_N is the force across the blade, X and Y together.
    """
    found = example(key)
    drawn = random_signals(found, 7) | {"n": 2.0} if "n" in found.signals else random_signals(found, 7)
    value, wrench, (vessel, path) = output(key, name, drawn), found.wrench(drawn), _with_term(key)
    if value is None:
        return
    if name == "thrust":
        t_P = vessel.parameters.get(f"{path}.t_P", 0.0)
        turn = drawn.get("alpha", 0.0)
        assert wrench[0] * np.cos(turn) + wrench[1] * np.sin(turn) == pytest.approx((1 - t_P) * value, rel=1e-9)
    elif name == "side_force":
        assert wrench[1] == pytest.approx(value, rel=1e-9)
        assert wrench[5] == pytest.approx(vessel.parameters[f"{path}.x"] * value, rel=1e-9)
    elif key == "thruster.rudder_coefficients":
        across = np.array([np.sin(drawn["delta"]), np.cos(drawn["delta"])])
        assert across @ wrench[:2] == pytest.approx(-value, rel=1e-9)
    else:
        a_H = vessel.parameters[f"{path}.a_H"]
        assert wrench[1] == pytest.approx(-(1 + a_H) * value * np.cos(drawn["delta"]), rel=1e-9)


CALM = pytest.mark.parametrize("key", [key for key in TERMS if key not in DRAWN_COMPONENTS])


@CALM
@pytest.mark.parametrize("seed", seeds(2, 5))
def test_mirror_port_starboard(key: str, seed: int) -> None:
    case = example(key)
    drawn = random_signals(case, seed)
    signs = {**MIRROR, **MIRROR_OF_A_TERM.get(key, {})}
    mirrored = {name: value * signs.get(name, 1) for name, value in drawn.items()}
    sideways = [path.endswith(".y") and unit == "m" for path, unit in zip(case.paths, case.units, strict=True)]
    flipped = np.where(sideways, -case.values, case.values)[[_other_side(path, case.paths) for path in case.paths]]
    wrench = case.wrench(drawn)
    assert np.abs(wrench).max() > 0
    expected = MIRRORED_WRENCH * wrench
    np.testing.assert_allclose(case.wrench(mirrored, flipped), expected, rtol=1e-9, atol=1e-9 * np.abs(wrench).max())


def _other_side(path: str, paths: tuple[str, ...]) -> int:
    """Place of the number of the other side: a screw that turns the other way has its wake and flow mirrored."""
    turned = re.sub("_plus$|_minus$", lambda end: "_minus" if end[0] == "_plus" else "_plus", path)
    return paths.index(turned)


@CALM
def test_zero_at_rest(key: str) -> None:
    case = example(key)
    assert np.abs(case.wrench(rest(case))).max() < AT_REST


@ALL
def test_finite_at_rest(key: str) -> None:
    case = example(key)
    assert np.isfinite(case.wrench(rest(case))).all()
    assert np.isfinite(jacobian_at(key, rest(case))).all()


@ALL
@DRAWN
@given(data=st.data())
def test_finite_everywhere(key: str, data: st.DataObject) -> None:
    case = example(key)
    drawn = data.draw(envelope(case))
    assert np.isfinite(case.wrench(drawn)).all()
    assert np.isfinite(jacobian_at(key, drawn)).all()


@ALL
@pytest.mark.parametrize("seed", seeds(2, 5))
def test_derivative_is_finite_difference(key: str, seed: int) -> None:
    case = example(key)
    drawn = random_signals(case, seed)
    point = np.concatenate([*(np.atleast_1d(drawn[name]) for name in case.signals), case.values])
    sizes = np.cumsum([case.function.size1_in(i) for i in range(case.function.n_in() - 1)])

    def wrench(at: np.ndarray) -> np.ndarray:
        return np.array(case.function(*np.split(at, sizes))).ravel()

    exact = jacobian_at(key, drawn)
    for column, value in enumerate(point):
        h = 1e-6 * max(abs(value), 1e-2)
        ahead, behind = point.copy(), point.copy()
        ahead[column] += h
        behind[column] -= h
        slope = (wrench(ahead) - wrench(behind)) / (2 * h)
        scale = np.abs(exact[:, column]).max() + 1e-9 * np.abs(wrench(point)).max() / h
        np.testing.assert_allclose(slope, exact[:, column], rtol=0, atol=1e-5 * scale, err_msg=f"{column}")


@pytest.mark.parametrize("key", DISSIPATIVE)
@DRAWN
@given(data=st.data())
def test_drag_takes_energy(key: str, data: st.DataObject) -> None:
    case = example(key)
    drawn = data.draw(envelope(case))
    assert case.wrench(drawn) @ drawn["nu_r"] <= 1e-9


def _powers(unit: str) -> tuple[float, float, float]:
    """Exponents of mass, length and time in a unit, such as `kg m^-1` or `m/s`; angles and pure numbers have none."""
    base = {"kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "N": (1, 1, -2)}
    total = np.zeros(3)
    over, _, under = unit.partition("/")
    for token in (*over.split(), *(f"{part}^-1" for part in under.split())):
        symbol, power = re.fullmatch(r"([a-zA-Z-]+)(?:\^(-?\d+))?", token).groups()  # type: ignore[union-attr]
        total += np.array(base.get(symbol, (0, 0, 0))) * int(power or 1)
    return tuple(total)


FROUDE = (25.0**3, 25.0, 25.0**0.5)  # of a ship 25 times as long: mass, length, time


@CALM
@pytest.mark.parametrize("scale", [FROUDE, (2.0, 1.0, 1.0), (1.0, 3.0, 1.0), (1.0, 1.0, 0.7)])
def test_forces_follow_the_units(key: str, scale: tuple[float, float, float]) -> None:
    """Mass, length and time in other units, by those that parameters and signals claim: forces and moments follow."""
    case = example(key)

    def factor(*powers: float) -> float:
        return float(np.prod(np.power(scale, powers)))

    def of(unit: str) -> float:
        return factor(*_powers(unit))

    values = case.values * [of(unit) for unit in case.units]
    motion = np.repeat([of("m/s"), of("rad/s")], 3)
    signal = {name: of(row.unit) for name, row in SIGNALS.items()} | {"nu": motion, "nu_r": motion}
    signal |= {"eta": np.repeat([of("m"), 1.0], 3), "wash": np.array([of("m/s"), of("m/s"), of("m")])}
    signal |= {"state": of("m") ** np.array(SCALE_OF_STATES.get(key, 0.0))}
    drawn = random_signals(case, 0)
    for name in VECTORS:
        if name in drawn:
            drawn[name][0] = abs(drawn[name][0]) + 2.0  # far above the floors of speed, which do not scale
    if "wash" in drawn:
        drawn["wash"][:2] = np.abs(drawn["wash"][:2]) + 2.0
    scaled = {name: value * signal.get(name, 1.0) for name, value in drawn.items()}
    expected = case.wrench(drawn) * np.repeat([of("N"), of("N m")], 3)
    np.testing.assert_allclose(case.wrench(scaled, values), expected, rtol=1e-4, atol=1e-9 * np.abs(expected).max())


@ALL
def test_lowered_equals_casadi(key: str) -> None:
    """Values to rounding, and PyTorch's gradient against CasADi's, for a batch with rest and corners in it."""
    case = example(key)
    batch = [rest(case), *(random_signals(case, seed) for seed in range(20))]
    lowered = lower_function(case.function)
    signal_tensors = [
        torch.tensor(np.stack([np.atleast_1d(drawn[name]) for drawn in batch], axis=-1)).requires_grad_()
        for name in case.signals
    ]
    parameter_tensor = torch.tensor(case.values)[:, None]
    channels = lowered(*signal_tensors, parameter_tensor)
    wrench = torch.stack([torch.as_tensor(c, dtype=torch.float64).expand(len(batch)) for c in channels])
    expected = np.stack([case.wrench(drawn) for drawn in batch], axis=-1)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(wrench.detach().numpy(), expected, rtol=1e-12, atol=1e-12 * scale)

    exact = np.stack([jacobian_at(key, drawn) for drawn in batch], axis=-1)  # (6, inputs, batch)
    for row in np.flatnonzero([c.requires_grad for c in wrench]):
        gradients = torch.autograd.grad(wrench[row].sum(), signal_tensors, retain_graph=True, allow_unused=True)
        pairs = zip(gradients, signal_tensors, strict=True)
        derivatives = np.concatenate([(torch.zeros_like(x) if g is None else g).numpy() for g, x in pairs])
        columns = exact[row, : len(derivatives), 1:]  # at rest kinks have no one derivative
        np.testing.assert_allclose(derivatives[:, 1:], columns, rtol=1e-9, atol=1e-9 * np.abs(columns).max())
