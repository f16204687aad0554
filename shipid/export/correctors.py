"""Parts of methods that look up where NumPy does and CasADi cannot: trees, and the nearest of some points."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.hybrid.forest import ForestCorrector, Trees
from shipid.hybrid.kernel_compensator import KernelCompensator
from shipid.hybrid.method import Corrector
from shipid.hybrid.modules import Alarm, ModulesCorrector

Array = np.ndarray


def symbolic_corrector(corrector: Corrector) -> Corrector:
    """The same corrector, which also predicts from symbols."""
    if isinstance(corrector, ForestCorrector):
        return replace(corrector, trees=SymbolicTrees(**vars(corrector.trees)))
    if isinstance(corrector, ModulesCorrector):
        return replace(corrector, alarm=SymbolicAlarm(**vars(corrector.alarm)))
    if isinstance(corrector, KernelCompensator):  # else the centres over the scales of each member were written out
        members = tuple(replace(one, scales=_symbolic_constant(one.scales)) for one in corrector.members)
        return replace(corrector, centres=_symbolic_constant(corrector.centres), members=members)
    return corrector


def _symbolic_constant(values: Array) -> Any:
    """Numbers that CasADi keeps apart from what is computed with them."""
    return ca.ArrayInterface.MX(MX(ca.DM(values)), shape=values.shape)


class SymbolicTrees(Trees):
    """Trees of symbols; all go down together, a level at a time.

    Nodes are numbered anew, those of leaves last. Python compares inputs in single precision: a threshold becomes the
    greatest number in double precision that goes left.
    """

    def predict(self, inputs: Any) -> Any:
        """Mean of the leaves that inputs (1, d) come to, (1, outputs)."""
        seen, leaf = MX(inputs).T, np.asarray(self.left < 0)
        inner = int((~leaf).sum())
        number = np.where(leaf, inner + np.cumsum(leaf) - 1, np.cumsum(~leaf) - 1)
        node = MX(ca.DM(number[self.first]))
        if inner:
            children = ca.DM(number[np.stack([self.left, self.right], axis=1)[~leaf]].ravel())
            feature, threshold = ca.DM(self.feature[~leaf]), ca.DM(greatest_left(self.threshold[~leaf]))
        for _ in range(depth_of(self)):
            at = ca.fmin(node, inner - 1)
            right = seen[MX(feature)[at]] > MX(threshold)[at]
            node = ca.if_else(node >= inner, node, MX(children)[2 * at + right])
        outputs, values = self.value.shape[1], MX(ca.DM(self.value[leaf].ravel()))
        places = ca.repmat((node - inner).T * outputs, outputs, 1)
        places += ca.repmat(ca.DM(range(outputs)), 1, len(self.first))
        leaves = ca.reshape(values[ca.vec(places)], outputs, len(self.first))
        return ca.ArrayInterface(ca.sum2(leaves).T / len(self.first))


def depth_of(trees: Trees) -> int:
    """Number of comparisons from the roots to the deepest leaf."""
    level, depth = trees.first[trees.left[trees.first] >= 0], 0
    while level.size:
        level = np.concatenate([trees.left[level], trees.right[level]])
        level, depth = level[trees.left[level] >= 0], depth + 1
    return depth


def greatest_left(threshold: Array) -> Array:
    """The greatest x in double precision whose rounding to single precision is at most the threshold.

    Between f, the greatest single at most the threshold, and the next one lies their middle, which rounds to the even.
    """
    low = threshold.astype(np.float32)
    low = np.where(low > threshold, np.nextafter(low, np.float32(-np.inf)), low)
    middle = (low.astype(float) + np.nextafter(low, np.float32(np.inf)).astype(float)) / 2
    return np.asarray(np.where(middle.astype(np.float32) == low, middle, np.nextafter(middle, -np.inf)))


class SymbolicAlarm(Alarm):
    """Distances of symbols."""

    def away(self, z: Any) -> Any:
        """Distance (1,) of normalised inputs (1, d) to the nearest centre."""
        return ca.ArrayInterface.MX(distance_to_nearest(MX(z).T, self.centres), shape=(1,))


def distance_to_nearest(point: MX, centres: Array) -> MX:
    """Distance of a point (d,) to the nearest of some centres (C, d); a slope of 0 at a centre."""
    apart = ca.DM(centres.T) - ca.repmat(point, 1, len(centres))
    least = ca.mmin(ca.sum1(apart**2))
    return ca.if_else(least == 0, 0, ca.sqrt(ca.if_else(least == 0, 1, least)))
