"""The mirror of port and starboard on the inputs of a method."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from shipid.physics.signals import mirror_sign, orders_thrust, steers

Array = NDArray[np.float64]
SIDES = {"port": "starboard", "starboard": "port", "left": "right", "right": "left"}  # words in names of components
ACROSS = {"bow", "tunnel"}  # units whose shaft may drive sideways


def reflection(table: Mapping[str, Array], features: Mapping[str, tuple[str, ...]]) -> Array | None:
    """The mirror (d, d) on inputs, a signed permutation: image = inputs @ it; None where a column has no image."""
    standing = {column: name for name, columns in features.items() for column in columns}
    names = list(features)
    matrix = np.zeros((len(names), len(names)))
    for column, values in table.items():
        component, _, signal = column.rpartition(".")
        words = re.split("([^a-z]+)", component)
        turns = any(steers(other) for other in table if other.startswith(f"{component}."))
        if orders_thrust(column) and ACROSS & set(words) and not turns:
            return None
        partner = ".".join(filter(None, ("".join(SIDES.get(word, word) for word in words), signal)))
        sign = mirror_sign(column)
        if column in standing and partner in standing:
            matrix[names.index(standing[partner]), names.index(standing[column])] = sign
        elif column in standing or partner not in table or not np.allclose(values, sign * table[partner]):
            return None
    return matrix if (np.abs(matrix).sum(axis=0) == 1).all() and (np.abs(matrix).sum(axis=1) == 1).all() else None
