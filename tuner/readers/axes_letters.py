"""Axes named by letters: ENU, NWU, ECEF for a world frame, FLU, RFU for a body; and the rotations to ours."""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from tuner.types.records import DataError

WORLD_LETTERS = {
    "N": (1, 0, 0),
    "S": (-1, 0, 0),
    "E": (0, 1, 0),
    "W": (0, -1, 0),
    "D": (0, 0, 1),
    "U": (0, 0, -1),
}
"""Directions in north-east-down."""
BODY_LETTERS = {
    "F": (1, 0, 0),
    "B": (-1, 0, 0),
    "R": (0, 1, 0),
    "L": (0, -1, 0),
    "D": (0, 0, 1),
    "U": (0, 0, -1),
}
"""Directions in forward-right-down."""


def axes_rotation(letters: str, known: dict[str, tuple[int, int, int]], *, option: str) -> FloatArray:
    """Return the rotation from axes named by three letters to ours, shape (3, 3).

    Raises
    ------
    DataError
        Letters that are unknown, or do not name a right-handed frame.
    """
    word = letters.strip().upper()
    columns = [known.get(letter) for letter in word]
    mat = np.array([column for column in columns if column is not None], dtype=float).T
    if len(word) != 3 or mat.shape != (3, 3) or not np.isclose(np.linalg.det(mat), 1.0):
        raise DataError(
            f"{option} {letters}: expected three letters out of {' '.join(known)} that name the directions of right-"
            f"handed axes, such as {'ENU or NWU' if 'N' in known else 'FLU or RFU'}"
        )
    return mat
