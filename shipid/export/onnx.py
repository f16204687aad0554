"""ONNX: the networks of a predictor alone, from their inputs by name to what they add to the path."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shipid.errors import ShipidError
from shipid.export.model import ExportModel
from shipid.files import replace_whole
from shipid.hybrid.compensator import Compensator
from shipid.hybrid.one_step import OneStepCorrector
from shipid.hybrid.units import Units
from shipid.version import __version__

Array = np.ndarray
OPSET = 17


class _Nodes:
    """Nodes and constants of a graph in one precision."""

    def __init__(self, helper: Any, numpy_helper: Any, kind: type) -> None:
        self.helper, self.numpy_helper, self.kind = helper, numpy_helper, kind
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, values: Any, kind: type | None = None) -> str:
        name = f"c{len(self.constants)}"
        array: Any = np.asarray(values, dtype=kind or self.kind)
        self.constants.append(self.numpy_helper.from_array(array, name))
        return name

    def node(self, operation: str, *inputs: str, **attributes: Any) -> str:
        name = f"v{len(self.nodes)}"
        self.nodes.append(self.helper.make_node(operation, list(inputs), [name], **attributes))
        return name

    def layer(self, x: str, weight: Array, bias: Array, tanh: bool) -> str:
        y = self.node("Add", self.node("MatMul", x, self.constant(weight)), self.constant(bias))
        return self.node("Tanh", y) if tanh else y

    def chosen(self, x: str, every: Sequence[str], wanted: Sequence[str]) -> str:
        places = self.constant([every.index(name) for name in wanted], np.int64)
        return self.node("Gather", x, places, axis=1)

    def z_score(self, x: str, mean: Array, std: Array) -> str:
        return self.node("Div", self.node("Sub", x, self.constant(mean)), self.constant(std))

    def mean(self, values: Sequence[str]) -> str:
        total = values[0]
        for value in values[1:]:
            total = self.node("Add", total, value)
        return self.node("Div", total, self.constant(float(len(values)))) if len(values) > 1 else total


def write_onnx(model: ExportModel, name: str, file: Path, *, single: bool) -> Path:
    """Write the networks; ShipidError for a method without networks, or where onnx is not installed.

    Inputs (S, d) are those of the method, in the order that the metadata `inputs` says. The output of a compensator is
    `compensation` (S, T, 2) [m], of `one-step` `acceleration` (S, 3) [m/s^2, rad/s^2].
    """
    try:
        from onnx import TensorProto, checker, helper, numpy_helper, save
    except ImportError:
        raise ShipidError("an ONNX file needs the package onnx: pip install 'shipid[export]'") from None
    corrector = model.predictor.corrector
    nodes = _Nodes(helper, numpy_helper, np.float32 if single else np.float64)
    if isinstance(corrector, Compensator):
        names, output, shape = _compensation_nodes(nodes, corrector, model.layout.horizon)
    elif isinstance(corrector, OneStepCorrector):
        names, output, shape = _acceleration_nodes(nodes, corrector)
    else:
        raise ShipidError(
            f"the method {model.predictor.method} has no networks of its inputs alone: ONNX takes path-drawn, "
            "path-trained, calibrator and one-step; export this one to c, fmu or casadi"
        )
    kind = TensorProto.FLOAT if single else TensorProto.DOUBLE
    final = "compensation" if isinstance(corrector, Compensator) else "acceleration"
    nodes.nodes.append(helper.make_node("Identity", [output], [final]))
    graph = helper.make_graph(
        nodes.nodes,
        name,
        [helper.make_tensor_value_info("inputs", kind, ["S", len(names)])],
        [helper.make_tensor_value_info(final, kind, ["S", *shape])],
        nodes.constants,
    )
    opset = [helper.make_opsetid("", OPSET)]
    made = helper.make_model(graph, opset_imports=opset, producer_name="shipid", producer_version=__version__)
    made.ir_version = 8
    helper.set_model_props(
        made,
        {"inputs": json.dumps(names), "provenance": json.dumps(dict(model.predictor.provenance), default=str)},
    )
    checker.check_model(made)
    with replace_whole(file) as temporary:
        save(made, str(temporary))
    return file


def _compensation_nodes(nodes: _Nodes, corrector: Compensator, horizon: int) -> tuple[list[str], str, list[int]]:
    names = list(dict.fromkeys(name for network in corrector.networks for name in network.normaliser.names))
    paths = []
    for network in corrector.networks:
        x = nodes.chosen("inputs", names, network.normaliser.names)
        x = nodes.z_score(x, network.normaliser.mean, network.normaliser.std)
        for i, (weight, bias) in enumerate(network.layers):
            x = nodes.layer(x, weight, bias, i + 1 < len(network.layers))
        terms = network.basis.shape[1]
        shapes = np.zeros((2 * terms, horizon, 2))
        shapes[:terms, :, 0], shapes[terms:, :, 1] = network.basis.T, network.basis.T
        paths.append(nodes.node("MatMul", x, nodes.constant(shapes.reshape(2 * terms, -1))))
    shape = nodes.constant([-1, horizon, 2], np.int64)
    return names, nodes.node("Reshape", nodes.mean(paths), shape), [horizon, 2]


def _acceleration_nodes(nodes: _Nodes, corrector: OneStepCorrector) -> tuple[list[str], str, list[int]]:
    names = list(dict.fromkeys(name for head in corrector.heads for name in head.units.normaliser.names))
    terms = []
    for head in corrector.heads:
        units = head.units
        even, odd = _even_odd_units(nodes, units, nodes.chosen("inputs", names, units.normaliser.names))
        # weights carry all factors: runtimes fuse one beside a product, and keep it in single precision
        size = len(units.offset) ** 0.5 * (1 if units.reflection is None else 2)
        first = 1 if units.reflection is None else 0
        surge = nodes.layer(even, head.surge[1:] / size, head.surge[0], False)
        bias = head.sway_yaw[0] if first else np.zeros(2)
        sway_yaw = nodes.layer(odd, head.sway_yaw[first:] / size, bias, False)
        terms.append(nodes.node("Concat", surge, sway_yaw, axis=1))
    return names, nodes.mean(terms), [3]


def _even_odd_units(nodes: _Nodes, units: Units, x: str) -> tuple[str, str]:
    """Even and odd hidden units, without their factors."""
    z = nodes.z_score(x, units.normaliser.mean, units.normaliser.std)
    plain = nodes.layer(z, units.weight, units.offset, True)
    if units.reflection is None:
        return plain, plain
    image = nodes.layer(z, units.reflection @ units.weight, units.offset, True)
    return nodes.node("Add", plain, image), nodes.node("Sub", plain, image)
