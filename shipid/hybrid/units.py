"""Hidden units of tanh with drawn weights, in mirrored pairs where the inputs have a mirror, and ridge regression."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from shipid.hybrid.compensator import Normaliser
from shipid.hybrid.features import Array, choose_features, input_group, select_inputs
from shipid.hybrid.stored import StoredData
from shipid.logs.guess.words import SIDE_WORDS
from shipid.physics.signals import is_command, is_steering, is_thrust_order, mirror_sign

OTHER_SIDE = {"port": "starboard", "starboard": "port"}
SIDES = {word: side for side in OTHER_SIDE for word in SIDE_WORDS[side]}  # in names of components: p, stbd, left
ENDS = frozenset().union(*map(SIDE_WORDS.__getitem__, ("bow", "stern", "fore", "aft")))  # on the middle line
ACROSS = re.compile(
    "bow|tunnel|lateral|transvers|strahl|(stern|aft|fore).*thruster|thruster.*(stern|aft|fore)"
)  # in names of units whose shaft may drive sideways, such as `bowthruster`


@dataclass(frozen=True)
class VaryingInputs:
    """Inputs that vary in training, their z-score, and their mirror.

    features : name of each input -> the columns that were equal to it in training.
    reflection : (d, d) of normalised inputs, image = values @ it; None where a column has no image in it.
    """

    features: dict[str, tuple[str, ...]]
    normaliser: Normaliser
    reflection: Array | None

    @classmethod
    def of(cls, table: Mapping[str, Array], mirror: bool) -> Self:
        """Choose inputs and take their statistics from training samples (S,) by name, with their images if mirrored."""
        features = choose_features(table)
        names = tuple(features)
        plain = cls(
            features, Normaliser(names, np.zeros(0), np.zeros(0)), mirror_matrix(table, features) if mirror else None
        )
        both = plain.samples(table)
        return replace(plain, normaliser=Normaliser(names, both.mean(axis=0), both.std(axis=0)))

    def samples(self, table: Mapping[str, Array]) -> Array:
        """Return inputs (S, d) as they are, and after them their images, (2 S, d), where there is a mirror."""
        values = select_inputs(table, self.normaliser.names)
        return values if self.reflection is None else np.concatenate([values, values @ self.reflection])

    def draw(self, point: Mapping[str, float], count: int, seed: int) -> Units:
        """Draw hidden units with the scales and the offset of a trial."""
        scales = np.array([point[f"{input_group(name)}_scale"] for name in self.normaliser.names])
        normal = np.random.default_rng(seed).standard_normal((count, len(scales) + 1))
        return Units(self.normaliser, (normal[:, :-1] / scales).T, normal[:, -1] * point["offset"], self.reflection)


@dataclass(frozen=True)
class Units(StoredData):
    """Hidden units tanh(z w + c) of normalised inputs z: `even` ones do not feel the mirror, `odd` ones change sign.

    weight : (d, M). offset : (M,). reflection : (d, d), or None: then even and odd are the same, plain units.
    """

    normaliser: Normaliser
    weight: Array
    offset: Array
    reflection: Array | None

    def parts(self, table: Mapping[str, Array]) -> tuple[Array, Array]:
        """Even units with a constant (S, M + 1), and odd ones: (S, M) with a mirror, else the even ones again."""
        size = len(self.offset) ** 0.5
        z = self.normaliser.apply(table)
        plain = np.tanh(z @ self.weight + self.offset) / size
        one = np.ones((len(plain), 1))
        if self.reflection is None:
            even = np.concatenate([one, plain], axis=1)
            return even, even
        image = np.tanh(z @ (self.reflection @ self.weight) + self.offset) / size
        return np.concatenate([one, (plain + image) / 2], axis=1), (plain - image) / 2


def mirror_matrix(table: Mapping[str, Array], features: Mapping[str, tuple[str, ...]]) -> Array | None:
    """The mirror (d, d) on inputs, a signed permutation: image = inputs @ it; None where a column has no image.

    Names of components say their sides; several that say none have no image.
    """
    standing = {column: name for name, columns in features.items() for column in columns}
    names = list(features)
    matrix = np.zeros((len(names), len(names)))
    words = {column: re.split("([^a-z]+)", column.rpartition(".")[0].lower()) for column in table}
    called = {_column_name(column, [SIDES.get(word, word) for word in words[column]]): column for column in table}
    if len(called) < len(table):
        return None
    middle: dict[str, set[str | float]] = {}  # signal -> inputs and constants of the commands that name no side
    for column, values in table.items():
        component, _, signal = column.rpartition(".")
        turns = any(is_steering(other) for other in table if other.startswith(f"{component}."))
        if is_thrust_order(column) and values.any() and ACROSS.search(component.lower()) and not turns:
            return None
        sides = [SIDES.get(word, word) for word in words[column]]
        partner = called.get(_column_name(column, [OTHER_SIDE.get(side, side) for side in sides]), "")
        if is_command(column) and partner == column and not ENDS & set(sides):
            middle.setdefault(signal, set()).add(standing.get(column) or float(values.mean()))
        sign = mirror_sign(column)
        if column in standing and partner in standing:
            matrix[names.index(standing[partner]), names.index(standing[column])] = sign
        elif column in standing or partner not in table or not np.allclose(values, sign * table[partner]):
            return None
    if any(len(several) > 1 for several in middle.values()):
        return None
    return matrix if (np.abs(matrix).sum(axis=0) == 1).all() and (np.abs(matrix).sum(axis=1) == 1).all() else None


def _column_name(column: str, words: list[str]) -> str:
    """Name of a column whose component has these words."""
    return ".".join(filter(None, ("".join(words), column.rpartition(".")[2])))


def apply_blocks(features: Array, weights: Array) -> Array:
    """Return features (S, M) @ weights (M, K); of weights (R, M, K) each takes one of R blocks of features (R S, M)."""
    if weights.ndim == 2:
        return features @ weights
    blocks: Array = features.reshape(len(weights), -1, features.shape[1]) @ weights
    return blocks.reshape(len(features), -1)


def solve_ridges(
    features: Array, targets: Array, ridge: float | Sequence[float], penalty: Array | None = None
) -> Array:
    """Weights (M, K) that minimise mean |targets - features W|^2 + ridge |penalty W|^2; of R ridges (R, M, K).

    features : (N, M). targets : (N, K). penalty : (M,) relative weights of the ridge, all above 0; default 1.
    """
    scale = np.ones(features.shape[1]) if penalty is None else penalty
    scaled = features / scale
    values, axes = np.linalg.eigh(scaled.T @ scaled / len(scaled))
    product = axes.T @ (scaled.T @ targets) / len(scaled)
    damped = np.add.outer(ridge, np.maximum(values, 0.0))[..., None]
    return np.asarray(axes @ (product / damped) / scale[:, None])
