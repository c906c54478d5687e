"""Noise as a few numbers: which parameters a fit may change, and the derivatives of the likelihood by them.

Parameters are natural logs: of factors on the sds of groups of rows, of all fixes or of one class
(``position_class_1``), on the densities of groups of process noise, on sd and time constant of a Gauss–Markov error of
the fixes; and the change of the exponent of a reported sd (``position_exponent``). Parameters at 0 change nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.linear_run.likelihood import Gradient, NoiseHypothesis, evaluate
from tuner.linear_run.linearized_run import NOISE_GROUPS

ROW_GROUPS: dict[str, tuple[int, ...]] = {
    "position_horizontal": (0, 1),
    "position_vertical": (2,),
    "velocity_horizontal": (3, 4),
    "velocity_vertical": (5,),
}
"""Groups of the rows of a fix that share a factor on their sd."""
BLOCKS: dict[str, tuple[int, ...]] = {"position": (0, 1, 2), "velocity": (3, 4, 5)}
"""The same, coarser."""
MARKOV_AXES = {"markov": slice(0, 3), "markov_horizontal": slice(0, 2), "markov_vertical": slice(2, 3)}
"""Axes of the Gauss–Markov error of the fixes that share a factor on their sd."""
MARKOV_TIME = "markov_time"
"""Name of the factor on its time constant."""
_ROW_GROUPS = ROW_GROUPS | BLOCKS
"""All groups of rows by name."""
EXPONENT_ENDING = "_exponent"
"""Ending of the name of the change of the exponent of a reported sd."""
_CLASS_MARK = "_class_"
"""Separator of block and class number in the name of a factor."""
TIME_CONSTANT_STEP = 1e-4
"""Step of the log of the time constant for a numerical derivative: large against rounding, small against its sd."""


@dataclass(frozen=True)
class NoiseParameters:
    """Parameters of a fit.

    Attributes
    ----------
    names : tuple of str
        What each parameter is called.
    change : callable
        (noise, parameters (q,)) → noise.
    slopes : callable
        (noise, parameters (q,), gradient at the changed noise) → derivatives of ln L, (q,).
    of_part : callable
        (fixes of a part of the run) → the same parameters for the part.
    """

    names: tuple[str, ...]
    change: Callable[[NoiseHypothesis, FloatArray], NoiseHypothesis]
    slopes: Callable[[NoiseHypothesis, FloatArray, Gradient], FloatArray]
    of_part: Callable[[slice], NoiseParameters]


@dataclass(frozen=True)
class ReportedLevels:
    """Reported sds by block: class and log of the level of every fix, (k,), and the log of a typical level."""

    classes: Mapping[str, NDArray[np.int64]]
    logs: Mapping[str, FloatArray]
    typical: Mapping[str, float]

    def rows(self, which: slice) -> ReportedLevels:
        """Return those of some fixes."""
        return ReportedLevels(
            {name: of[which] for name, of in self.classes.items()},
            {name: of[which] for name, of in self.logs.items()},
            self.typical,
        )


NO_LEVELS = ReportedLevels({}, {}, {})


def names_of_block(names: Iterable[str], block: str) -> tuple[str, ...]:
    """Return the names that begin with that of a block."""
    return tuple(name for name in names if name.startswith(block))


def weights(name: str, count: int, levels: ReportedLevels) -> FloatArray:
    """Return the derivative of ln sd of every row by a parameter; shape (count, 6).

    Parameters
    ----------
    name : str
        Of `ROW_GROUPS` or `BLOCKS`, with ``_class_C`` behind it, or of `BLOCKS` with `EXPONENT_ENDING`.
    count : int
        Number of fixes.
    levels : ReportedLevels
        Levels that the receiver reports.
    """
    base, _, number = name.removesuffix(EXPONENT_ENDING).partition(_CLASS_MARK)
    block, out = base.partition("_")[0], np.zeros((count, 6))
    if name.endswith(EXPONENT_ENDING):
        out[:, _ROW_GROUPS[base]] = (levels.logs[block] - levels.typical[block])[:, None]
    else:
        out[:, _ROW_GROUPS[base]] = (levels.classes[block] == int(number))[:, None] if number else 1.0
    return out


def noise_parameters(names: tuple[str, ...], levels: ReportedLevels = NO_LEVELS) -> NoiseParameters:
    """Return noise parameters by name: those of `weights`, `NOISE_GROUPS`, `MARKOV_AXES` and `MARKOV_TIME`."""

    def change(noise: NoiseHypothesis, logs: FloatArray) -> NoiseHypothesis:
        sd, scale = noise.sd.copy(), noise.process_noise_scale.copy()
        markov, time = noise.markov_sd.copy(), noise.markov_time
        for name, factor in zip(names, np.exp(logs).tolist(), strict=True):
            if _of_rows(name):
                sd *= factor ** weights(name, len(sd), levels)
            elif name in NOISE_GROUPS:
                scale[NOISE_GROUPS.index(name)] *= factor
            elif name in MARKOV_AXES:
                markov[MARKOV_AXES[name]] *= factor
            else:
                time *= factor
        return replace(noise, sd=sd, process_noise_scale=scale, markov_sd=markov, markov_time=time)

    def slopes(noise: NoiseHypothesis, logs: FloatArray, gradient: Gradient) -> FloatArray:
        out = np.zeros(len(names))
        for j, name in enumerate(names):
            if _of_rows(name):
                out[j] = float(np.sum(gradient.by_sd * weights(name, len(noise.sd), levels)))
            elif name in NOISE_GROUPS:
                out[j] = gradient.by_process_noise_scale[NOISE_GROUPS.index(name)]
            elif name in MARKOV_AXES:
                out[j] = gradient.by_markov_sd[MARKOV_AXES[name]].sum()
            else:
                here = change(noise, logs)
                longer = replace(here, markov_time=here.markov_time * float(np.exp(TIME_CONSTANT_STEP)))
                out[j] = (evaluate(longer).value - gradient.value) / TIME_CONSTANT_STEP
        return out

    return NoiseParameters(names, change, slopes, lambda which: noise_parameters(names, levels.rows(which)))


def _of_rows(name: str) -> bool:
    return name.removesuffix(EXPONENT_ENDING).partition(_CLASS_MARK)[0] in _ROW_GROUPS


def present(
    noise: NoiseHypothesis, names: tuple[str, ...], levels: ReportedLevels = NO_LEVELS
) -> tuple[str, ...]:
    """Return those of the names of rows and of `NOISE_GROUPS` that the run has rows or noise of."""
    counted = noise.counted

    def there(name: str) -> bool:
        if _of_rows(name):
            return bool(np.any(weights(name, len(counted), levels)[counted]))
        return bool(noise.linearized.noise[name].any())

    return tuple(name for name in names if there(name))
