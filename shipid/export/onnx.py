"""ONNX: the networks of a predictor alone, from their inputs by name to what they add to the path."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from shipid.errors import ShipidError
from shipid.export.model import ExportModel
from shipid.files import replace_whole
from shipid.hybrid.compensator import Compensator, Layers, Normaliser
from shipid.hybrid.method import Array
from shipid.hybrid.one_step import OneStepCorrector
from shipid.hybrid.units import Units
from shipid.version import __version__

OPSET = 17  # the newest of ONNX 1.12, which all runtimes of the last years have


def write_onnx(model: ExportModel, name: str, file: Path, *, single: bool = False) -> Path:
    """Write the networks; ShipidError for a method without networks, or where onnx is not installed.

    Inputs (S, d) are those of the method, in the order that the metadata `inputs` says. The output of a compensator is
    `compensation` (S, T, 2) [m], of `one-step` `acceleration` (S, 3) [m/s^2, rad/s^2]. A network of a user has the
    inputs `past` (P + 1, S, d), the oldest first, and `now` (S, e), in single precision.
    """
    trace, provenance = getattr(model.predictor.corrector, "trace_onnx", None), dict(model.predictor.provenance)
    networks, result, shape = _networks_to_write(model) if trace is None else ([], "", [])
    try:
        from onnx import TensorProto, checker, helper, load, numpy_helper, save
    except ImportError:
        raise ShipidError("an ONNX file needs the package onnx: pip install 'shipid[export]'") from None
    if trace is not None:
        with replace_whole(file) as temporary:
            inputs, traced = json.dumps(trace(temporary)), load(str(temporary))
            helper.set_model_props(traced, {"inputs": inputs, "provenance": json.dumps(provenance, default=str)})
            save(traced, str(temporary))
        return file
    kind = np.dtype(np.float32 if single else np.float64)
    names = list(dict.fromkeys(each for normaliser, _ in networks for each in normaliser.names))
    nodes: list[Any] = []
    constants: list[Any] = []

    def constant(values: Any, dtype: Any = kind) -> str:
        constants.append(numpy_helper.from_array(np.asarray(values, dtype=dtype), f"c{len(constants)}"))
        return f"c{len(constants) - 1}"

    def node(operation: str, *inputs: str, to: str = "", **attributes: Any) -> str:
        output = to or f"v{len(nodes)}"
        nodes.append(helper.make_node(operation, list(inputs), [output], **attributes))
        return output

    outputs = []
    for normaliser, layers in networks:
        places = constant([names.index(each) for each in normaliser.names], np.int64)
        x = node("Sub", node("Gather", "inputs", places, axis=1), constant(normaliser.mean))
        x = node("Div", x, constant(normaliser.std))
        for number, (weight, bias) in enumerate(layers):
            x = node("Tanh", x) if number else x
            x = node("Add", node("MatMul", x, constant(weight)), constant(bias))
        outputs.append(x)
    mean = node("Div", node("Sum", *outputs), constant(float(len(outputs))))
    node("Reshape", mean, constant([-1, *shape], np.int64), to=result)
    number_type = TensorProto.FLOAT if single else TensorProto.DOUBLE
    ends = [helper.make_tensor_value_info("inputs", number_type, ["S", len(names)])]
    results = [helper.make_tensor_value_info(result, number_type, ["S", *shape])]
    graph = helper.make_graph(nodes, name, ends, results, constants)
    opset = [helper.make_opsetid("", OPSET)]
    made = helper.make_model(graph, opset_imports=opset, producer_name="shipid", producer_version=__version__)
    made.ir_version = 8
    helper.set_model_props(made, {"inputs": json.dumps(names), "provenance": json.dumps(provenance, default=str)})
    checker.check_model(made)
    with replace_whole(file) as temporary:
        save(made, str(temporary))
    return file


def layers_of_units(units: Units, even: Array, odd: Array) -> Layers:
    """Two layers that give `Units.parts` times weights: `even` (M + 1, p), `odd` (M or M + 1, q)."""
    size = max(len(units.offset), 1) ** 0.5
    if units.reflection is None:
        weight = np.concatenate([even, odd], axis=1)
        return (units.weight, units.offset), (weight[1:] / size, weight[0])
    inner = np.concatenate([units.weight, units.reflection @ units.weight], axis=1)
    outer = np.block([[even[1:], odd], [even[1:], -odd]]) / (2 * size)
    return (inner, np.tile(units.offset, 2)), (outer, np.r_[even[0], np.zeros(odd.shape[1])])


def _networks_to_write(model: ExportModel) -> tuple[list[tuple[Normaliser, Layers]], str, list[int]]:
    """The networks with outputs that are what they add, its name, and its shape for an instant."""
    corrector, horizon = model.predictor.corrector, model.layout.horizon
    if isinstance(corrector, OneStepCorrector):
        heads = [(head.units, head.surge, head.sway_yaw) for head in corrector.heads]
        return [(parts[0].normaliser, layers_of_units(*parts)) for parts in heads], "acceleration", [3]
    if not isinstance(corrector, Compensator):
        raise ShipidError(
            f"the method {model.predictor.method} has no networks of its inputs alone: ONNX takes path-drawn, "
            "path-refined, path-trained, calibrator and one-step; export this one to c, fmu or casadi",
            path="--to",
        )
    networks = []
    for network in corrector.networks:
        *hidden, (weight, bias) = network.layers
        shapes = np.kron(np.eye(2), network.basis.T).reshape(-1, 2, horizon).swapaxes(1, 2).reshape(-1, 2 * horizon)
        networks.append((network.normaliser, (*hidden, (weight @ shapes, bias @ shapes))))
    return networks, "compensation", [horizon, 2]
