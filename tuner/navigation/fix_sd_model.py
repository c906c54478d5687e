"""Model of the standard deviations of fixes as a function of those that a receiver reports.

With r the reported sd of a row and ρ the level of its fix, the root mean square of the reported sds north and east of
its position, or of its velocity::

    sd = a f_c (ρ/ρ₀)^(b−1) r

a is a factor on all fixes, horizontal or vertical, f_c one on the fixes of class c, which begins at ρ = `edges`[c − 1]
(fixed, float and single solutions report sds that are far apart) or is that of a stated solution, b an exponent: 1
where the report is right but for a factor, 0 where it contains no information. In a compensation, for the block
``position`` or ``velocity``::

    gnss_noise_scale.BLOCK_horizontal, BLOCK_vertical                         a
    gnss_noise_scale.BLOCK_horizontal_class_C, BLOCK_vertical_class_C         f_C, from 0 on
    gnss_noise_scale.BLOCK_edge_C                                             where class C begins, from 1 on
    gnss_noise_scale.BLOCK_solution_C                                         or its number in `SOLUTIONS`, from 0 on
    gnss_noise_scale.BLOCK_exponent, BLOCK_typical                            b, ρ₀
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray

GNSS_NOISE_SCALE = "gnss_noise_scale"
AXES = ("horizontal", "vertical")
BLOCKS: Mapping[str, slice] = {"position": slice(0, 3), "velocity": slice(3, 6)}
"""Rows of a fix by block."""


@dataclass(frozen=True)
class FixSdModel:
    """Model of the sds of one block, position or velocity.

    Attributes
    ----------
    horizontal, vertical : tuple of float
        a f_c by class; a alone at the end where the classes are those of stated solutions, for others.
    edges : tuple of float
        Levels at which the classes from the second on begin, rising.
    solutions : tuple of float
        Stated solutions of the classes, in place of levels.
    exponent, typical : float
        b and ρ₀.
    """

    horizontal: tuple[float, ...] = (1.0,)
    vertical: tuple[float, ...] = (1.0,)
    edges: tuple[float, ...] = ()
    solutions: tuple[float, ...] = ()
    exponent: float = 1.0
    typical: float = 1.0

    def classes(self, level: FloatArray, solution: FloatArray) -> NDArray[np.int64]:
        """Return the class of every fix by its level and stated solution, (k,)."""
        if not self.solutions:
            return np.searchsorted(np.array(self.edges), level).astype(np.int64)
        same = solution[:, None] == np.array(self.solutions)
        return np.where(same.any(axis=1), same.argmax(axis=1), len(self.solutions)).astype(np.int64)

    def sds(self, reported: FloatArray, solution: FloatArray) -> FloatArray:
        """Return the sds north, east, down of fixes with reported ones (k, 3) and stated solutions (k,)."""
        level = sd_levels(reported)
        classes = self.classes(level, solution)
        factor = np.stack([np.array(self.horizontal)[classes], np.array(self.vertical)[classes]], axis=-1)
        return np.asarray(
            factor[:, [0, 0, 1]] * (level / self.typical)[:, None] ** (self.exponent - 1.0) * reported
        )


def sd_levels(reported: FloatArray) -> FloatArray:
    """Return the levels of fixes with reported sds north, east, down (k, 3), shape (k,)."""
    return np.asarray(np.sqrt(np.mean(reported[:, :2] ** 2, axis=1)))


def class_edges_of(values: Mapping[str, float], block: str) -> tuple[float, ...]:
    """Return the levels at which classes of a block begin, from the compensated values of ``gnss_noise_scale``."""
    names = itertools.takewhile(values.__contains__, (f"{block}_edge_{c}" for c in itertools.count(1)))
    return tuple(values[name] for name in names)


def class_solutions_of(values: Mapping[str, float], block: str) -> tuple[float, ...]:
    """Return the stated solutions that are classes of a block, from the values of ``gnss_noise_scale``."""
    names = itertools.takewhile(values.__contains__, (f"{block}_solution_{c}" for c in itertools.count()))
    return tuple(values[name] for name in names)


def class_count(values: Mapping[str, float], block: str) -> int:
    """Return how many classes a block has."""
    return len(class_solutions_of(values, block)) or len(class_edges_of(values, block)) + 1


def fix_sd_model(values: Mapping[str, float], block: str) -> FixSdModel:
    """Return the model of a block, from the values of ``gnss_noise_scale`` in a compensation by name."""
    own = f"{block}_"
    edges, solutions = class_edges_of(values, block), class_solutions_of(values, block)
    count = class_count(values, block) + bool(solutions)
    horizontal, vertical = (
        tuple(
            values.get(f"{own}{axis}", 1.0) * values.get(f"{own}{axis}_class_{c}", 1.0) for c in range(count)
        )
        for axis in AXES
    )
    return FixSdModel(
        horizontal,
        vertical,
        edges,
        solutions,
        values.get(f"{own}exponent", 1.0),
        values.get(f"{own}typical", 1.0),
    )
