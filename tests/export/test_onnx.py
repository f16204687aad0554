"""ONNX: the networks alone, in both precisions."""

from __future__ import annotations

import json

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.export.model import build_model
from shipid.export.write import export_predictor
from shipid.hybrid.features import feature_table
from tests.export.strange import drawn


@pytest.mark.parametrize("kind", ["one-step", "path-trained"])
def test_networks_run_elsewhere(kind, tmp_path):
    pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    strange = drawn(kind, 5, count=7, vessel="mariner")
    corrector, physics = strange.predictor.corrector, strange.predictor.physics
    if kind == "one-step":
        table = feature_table(strange.instants.columns, corrector.commands)
        expected = np.mean([head.acceleration(table) for head in corrector.heads], axis=0)
    else:
        table = corrector.inputs.table(physics, strange.instants)
        expected = corrector.compensation(table).transpose(1, 0, 2)
    for single, near in ((False, 1e-12), (True, 1e-3)):
        (file,) = export_predictor(strange.predictor, "onnx", tmp_path / f"{single}.onnx", single=single)
        session = runtime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
        names = json.loads(session.get_modelmeta().custom_metadata_map["inputs"])
        rows = np.stack([table[name] for name in names], axis=1).astype(np.float32 if single else np.float64)
        (computed,) = session.run(None, {"inputs": rows})
        np.testing.assert_allclose(computed, expected, rtol=0, atol=near * np.abs(expected).max())


def test_what_has_no_networks_is_refused_in_one_line(tmp_path):
    """Before the package onnx is asked for."""
    with pytest.raises(ShipidError, match="ONNX takes path-trained and one-step"):
        export_predictor(drawn("alone", 5, vessel="mariner").predictor, "onnx", tmp_path / "a.onnx")
    assert build_model(drawn("alone", 5, vessel="mariner").predictor).layout.now
