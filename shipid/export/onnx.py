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
from shipid.hybrid.mean import DeployedMethod
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
    predictor = model.predictor
    plain = not getattr(predictor.corrector, "of_torch", False)
    networks, result = _networks_to_write(predictor) if plain else ([], "compensation")
    try:
        from onnx import checker, helper, load, save
    except ImportError:
        raise ShipidError("an ONNX file needs the package onnx: pip install 'shipid[export]'") from None
    from shipid.hybrid import network  # with PyTorch

    trained: Any = predictor.corrector
    whole = network.MeasuredLayers(networks, single) if plain else network.MeasuredNetworks(trained.networks)
    with replace_whole(file) as temporary:
        network.trace_module(whole, result, temporary, OPSET)
        traced, provenance = load(str(temporary)), json.dumps(dict(predictor.provenance), default=str)
        traced.graph.name, traced.producer_name, traced.producer_version = name, "shipid", __version__
        helper.set_model_props(traced, {"inputs": json.dumps(whole.names), "provenance": provenance})
        checker.check_model(traced)
        save(traced, str(temporary))
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


def _networks_to_write(predictor: DeployedMethod) -> tuple[list[tuple[Normaliser, Layers, Array | None]], str]:
    """The networks, each with the basis that its outputs weigh, if any, and the name of what they add."""
    corrector = predictor.corrector
    if isinstance(corrector, OneStepCorrector):
        heads = [(head.units, head.surge, head.sway_yaw) for head in corrector.heads]
        return [(parts[0].normaliser, layers_of_units(*parts), None) for parts in heads], "acceleration"
    if not isinstance(corrector, Compensator):
        raise ShipidError(
            f"the method {predictor.method} has no networks of its inputs alone: ONNX takes "
            "path-trained and one-step; export this one to c, fmu or casadi",
            path="--to",
        )
    return [(one.normaliser, one.layers, one.basis) for one in corrector.networks], "compensation"
