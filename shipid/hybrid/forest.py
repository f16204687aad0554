"""Forest: a random forest of what is known at the instant gives the compensation of the path.

The targets are the errors of the path on polynomials of time, as in `kernel`; the trees of scikit-learn are kept as
plain arrays, so that a predictor does not need it. Breiman (2001); for manoeuvring models: Mei et al. (2019).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveInt

from shipid.errors import ShipidError
from shipid.hybrid.compensator import PathCorrector, flatten_paths, weigh_shapes
from shipid.hybrid.features import Memory, select_inputs
from shipid.hybrid.method import Array, Index
from shipid.hybrid.search import LearningProblem, PathProblem, Point, SearchedAlone, seed_of
from shipid.hybrid.stored import StoredData
from shipid.hybrid.units import VaryingInputs

Leaf = Annotated[float, Field(ge=1.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
LEAF = -1  # the child of a node that has none


@dataclass(frozen=True)
class Trees(StoredData):
    """Regression trees as arrays of nodes, one tree after the other.

    first : (trees,) root of each tree. left, right : (nodes,) children, -1 for a leaf; a sample goes left where its
        input `feature` is at most `threshold`. value : (nodes, outputs).
    """

    first: NDArray[np.int64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]
    feature: NDArray[np.int64]
    threshold: Array
    value: Array

    @classmethod
    def of(cls, trees: list[Any]) -> Self:
        """Take over the trees of scikit-learn."""
        first = np.cumsum([0, *(tree.node_count for tree in trees)])

        def children(name: str) -> NDArray[np.int64]:
            parts = [getattr(tree, name) for tree in trees]
            return np.concatenate([np.where(c == LEAF, LEAF, c + at) for c, at in zip(parts, first[:-1], strict=True)])

        return cls(
            first[:-1].astype(np.int64),
            children("children_left").astype(np.int64),
            children("children_right").astype(np.int64),
            np.concatenate([tree.feature for tree in trees]).astype(np.int64),
            np.concatenate([tree.threshold for tree in trees]),
            np.concatenate([tree.value[:, :, 0] for tree in trees]),
        )

    def predict(self, inputs: Array) -> Array:
        """Mean over the trees (S, outputs) for inputs (S, d), which scikit-learn compares in single precision."""
        largest = float(np.finfo(np.float32).max)
        seen = np.clip(inputs, -largest, largest).astype(np.float32)
        total = np.zeros((len(seen), self.value.shape[1]))
        rows = np.arange(len(seen))
        for root in self.first:
            node = np.full(len(seen), root)
            while (inner := self.left[node] != LEAF).any():
                low = seen[rows, np.where(inner, self.feature[node], 0)] <= self.threshold[node]
                node = np.where(inner, np.where(low, self.left[node], self.right[node]), node)
            total += self.value[node]
        return total / len(self.first)


@dataclass(frozen=True)
class ForestCorrector(PathCorrector):
    """Trees that give the compensation of the path.

    names : inputs that the trees take, in order.
    basis : (T, r) shapes over the horizon [m] that the outputs x_1 ... x_r, y_1 ... y_r weigh.
    """

    names: tuple[str, ...]
    basis: Array
    trees: Trees
    hyperparameters: Mapping[str, float]

    def compensation(self, table: Mapping[str, Array]) -> Array:
        """Return the compensation (T, S, 2) [m] in the frame (11), from inputs (S,) by name."""
        return weigh_shapes(self.basis, self.trees.predict(select_inputs(table, self.names)))


class ForestProblem(PathProblem, LearningProblem):
    """A foundation whose inputs and errors of the path, on the basis, are the samples of forests."""

    def solve(self, number: int, point: Point, windows: Index) -> ForestCorrector:
        """Return a forest grown on some windows."""
        method, seed = self.method, seed_of(self.task.seed, number)
        here = self.rows(windows)
        seen, outputs = VaryingInputs.of(here, method.mirror), flatten_paths(self.weights[:, windows])
        if seen.reflection is not None:
            outputs = np.concatenate([outputs, outputs * np.repeat([1.0, -1.0], len(self.basis.T))])
        grower = _new_forest(method.trees, round(point["leaf"]), point["share"], seed)
        forest = grower.fit(seen.samples(here), outputs)
        trees = Trees.of([tree.tree_ for tree in forest.estimators_])
        return ForestCorrector(self.inputs, seen.normaliser.names, self.basis, trees, dict(point))


def _new_forest(trees: int, leaf: int, share: float, seed: int) -> Any:
    """A forest of scikit-learn, not grown yet; ShipidError where it is not installed."""
    try:
        from sklearn.ensemble import RandomForestRegressor
    except ImportError:
        raise ShipidError("the method forest needs scikit-learn: pip install 'shipid[forest]'") from None
    return RandomForestRegressor(trees, min_samples_leaf=leaf, max_features=share, random_state=seed % 2**32, n_jobs=1)


class Forest(SearchedAlone):
    """A random forest on the errors of the path; it needs scikit-learn, `pip install shipid[forest]`.

    Parameters
    ----------
    trials : sets of hyperparameters tried per foundation, judged on the validation windows.
    trees : trees of a forest.
    leaf : training windows in a leaf, at least; a range is searched by its logarithm, and rounded.
    share : share of the inputs that a split chooses from.
    terms : the compensation is a polynomial of time with so many terms.
    mirror : whether every window counts with its image of port and starboard too, where the inputs allow it.
    memory : what the inputs hold of the past.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = ("leaf", "share")
    problem: ClassVar[type[LearningProblem]] = ForestProblem
    corrector: ClassVar[type[Any]] = ForestCorrector

    trials: PositiveInt = 6
    trees: PositiveInt = 60
    leaf: Leaf | tuple[Leaf, Leaf] = (1.0, 16.0)
    share: Share | tuple[Share, Share] = (0.4, 1.0)
    terms: PositiveInt = 6
    mirror: bool = True
    memory: Memory = Memory()
