"""Noise as a few numbers: which parameters a fit may change, and what the likelihood says of their change.

Parameters are natural logs: of factors on the sds of groups of rows, on the drives of groups of process noise, on sd
and time constant of a Gauss–Markov error of the fixes. Parameters at 0 change nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.drives.likelihood import Belief, Gradient, evaluate
from tuner.diagnosis.drives.record import GROUPS

FloatArray = NDArray[np.float64]

ROWS: dict[str, tuple[int, ...]] = {
    "position_horizontal": (0, 1),
    "position_vertical": (2,),
    "velocity_horizontal": (3, 4),
    "velocity_vertical": (5,),
}
"""Groups of the rows of a fix that share a factor on their sd."""
BLOCKS: dict[str, tuple[int, ...]] = {"position": (0, 1, 2), "velocity": (3, 4, 5)}
"""The same, coarser."""
MARKOV = {"markov": slice(0, 3), "markov_horizontal": slice(0, 2), "markov_vertical": slice(2, 3)}
"""Axes of the Gauss–Markov error of the fixes that share a factor on their sd."""
TIME = "markov_time"
"""Name of the factor on its time constant."""
_ROWS = ROWS | BLOCKS
STEP = 1e-3
"""Half-width of the difference that stands for the derivative by the time constant."""


@dataclass(frozen=True)
class Scales:
    """Parameters of a fit.

    Attributes
    ----------
    names : tuple of str
        What each parameter is called.
    change : callable
        (belief, parameters (q,)) → belief.
    slopes : callable
        (belief, parameters (q,), gradient at the changed belief) → derivatives of ln L, (q,).
    """

    names: tuple[str, ...]
    change: Callable[[Belief, FloatArray], Belief]
    slopes: Callable[[Belief, FloatArray, Gradient], FloatArray]


def factors(names: tuple[str, ...]) -> Scales:
    """Return the logs of factors: names of `ROWS`, `BLOCKS`, `GROUPS`, `MARKOV` and `TIME`."""

    def change(belief: Belief, logs: FloatArray) -> Belief:
        sd, drive = belief.sd.copy(), belief.drive.copy()
        markov, time = belief.markov_sd.copy(), belief.markov_time
        for name, factor in zip(names, np.exp(logs).tolist(), strict=True):
            if name in _ROWS:
                sd[:, _ROWS[name]] *= factor
            elif name in GROUPS:
                drive[GROUPS.index(name)] *= factor
            elif name in MARKOV:
                markov[MARKOV[name]] *= factor
            else:
                time *= factor
        return replace(belief, sd=sd, drive=drive, markov_sd=markov, markov_time=time)

    def slopes(belief: Belief, logs: FloatArray, gradient: Gradient) -> FloatArray:
        out = np.zeros(len(names))
        for j, name in enumerate(names):
            if name in _ROWS:
                out[j] = gradient.by_sd[:, _ROWS[name]].sum()
            elif name in GROUPS:
                out[j] = gradient.by_drive[GROUPS.index(name)]
            elif name in MARKOV:
                out[j] = gradient.by_markov_sd[MARKOV[name]].sum()
            else:
                here = change(belief, logs)
                up, down = (
                    evaluate(replace(here, markov_time=here.markov_time * float(np.exp(step)))).value
                    for step in (STEP, -STEP)
                )
                out[j] = (up - down) / (2.0 * STEP)
        return out

    return Scales(names, change, slopes)


def present(belief: Belief, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return those of the names of `ROWS`, `BLOCKS` and `GROUPS` that the record has anything of."""
    counted = belief.counted
    return tuple(
        name
        for name in names
        if (counted[:, _ROWS[name]].any() if name in _ROWS else belief.record.noise[name].any())
    )
