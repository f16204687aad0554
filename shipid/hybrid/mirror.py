"""The mirror of port and starboard on the inputs of a method."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from shipid.logs.guess.words import words_of_side
from shipid.physics.signals import is_command, is_steering, is_thrust_order, mirror_sign

Array = NDArray[np.float64]
OTHER_SIDE = {"port": "starboard", "starboard": "port"}
SIDES = {
    word: side for side in OTHER_SIDE for word in words_of_side(side)
}  # words in names of components: p, stbd, left
ENDS = frozenset().union(*map(words_of_side, ("bow", "stern", "fore", "aft")))  # units there stand on the middle line
ACROSS = re.compile(
    "bow|tunnel|lateral|transvers|strahl|(stern|aft|fore).*thruster|thruster.*(stern|aft|fore)"
)  # in names of units whose shaft may drive sideways, such as `bowthruster`


def mirror_matrix(table: Mapping[str, Array], features: Mapping[str, tuple[str, ...]]) -> Array | None:
    """The mirror (d, d) on inputs, a signed permutation: image = inputs @ it; None where a column has no image.

    Names of components say their sides. Several that say none, such as `m1` and `m2`, have no image.
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
