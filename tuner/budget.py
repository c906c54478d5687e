"""Where the errors of a filter come from: the share of every source, and what that says of a bad score.

Linear covariance along the noise-free flight (`tuner.navigation.sources`): the variance of every error is a
sum over sources, V = Σ_g V_g. If the truth differs from the belief by a factor f_g in the variance of one
source, a score that should be 1 is::

    E s = 1 + (f_g − 1) V_g/V

`attribute` finds the one source, and its factor, that explains the scores of a check best.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from models.gnss import perfect_fixes
from tuner.consistency import BLOCKS, SETTLING, Consistency, Score
from tuner.navigation.engine import layout
from tuner.navigation.settings import FilterSettings
from tuner.navigation.simulate import Scenario
from tuner.navigation.sources import kept_trace

FloatArray = NDArray[np.float64]

HORIZONS = (10.0, 60.0, 300.0)
TOGETHER = {
    "bias noise of gyros and accelerometers": ("gyro bias noise", "accelerometer bias noise"),
    "all sensor noise": (
        "gyro white noise",
        "accelerometer white noise",
        "gyro bias noise",
        "accelerometer bias noise",
        "gyro bias random walk",
        "accelerometer bias random walk",
    ),
    "position and velocity fixes": ("position fixes", "velocity fixes"),
}
"""Sources that may be wrong by one factor together."""
LARGEST = math.log(1e4)
"""Largest factor in the variance of a source that is considered, as a logarithm."""
LEVEL_SCATTER = 0.05
"""Scatter of a score that linear covariance cannot explain (ladder for flicker, curvature)."""


@dataclass(frozen=True)
class Budget:
    """Variance by source.

    Attributes
    ----------
    sources : tuple of str
        Names, g of them.
    t : ndarray, shape (k,)
        Times of the fixes, s.
    variance : ndarray, shape (k, g, 15)
        Of position, velocity, attitude errors and total biases, by source.
    total : ndarray, shape (k, 15)
        Their sum: the filter's own.
    innovation : ndarray, shape (k, g, 6)
        Of innovations, by source.
    outages : ndarray, shape (w, 2)
        Begin and end of outages, s.
    information : ndarray, shape (15,)
        sd at the end ÷ sd at the start: small is observed, 1 is not.
    """

    sources: tuple[str, ...]
    t: FloatArray
    variance: FloatArray
    total: FloatArray
    innovation: FloatArray
    outages: FloatArray
    information: FloatArray

    def share(self, epochs: FloatArray | NDArray[np.intp], block: slice) -> FloatArray:
        """Return the share of every source in the variance of a block, mean over epochs; shape (g,), sum 1."""
        parts = self.variance[epochs][:, :, block]
        whole = self.total[epochs][:, None, block]
        return np.asarray((parts / whole).mean(axis=(0, 2)))

    def aided(self) -> NDArray[np.intp]:
        """Return the settled epochs with fixes."""
        good = self.t >= self.t[0] + SETTLING
        for begin, end in self.outages:
            good &= (self.t <= begin) | (self.t >= end + SETTLING)
        return np.flatnonzero(good)

    def after(self, horizon: float) -> NDArray[np.intp]:
        """Return the epochs so long after the begin of an outage, s."""
        goals = [b + horizon for b, e in self.outages if e - b >= horizon]
        return np.array([int(np.argmin(np.abs(self.t - goal))) for goal in goals], dtype=np.intp)


@dataclass(frozen=True)
class Cause:
    """A source whose true variance would explain the scores: true ÷ believed sd, and the misfit left over."""

    source: str
    ratio: float
    misfit: float


def table(budget: Budget) -> list[tuple[str, FloatArray]]:
    """Return the shares by source: aided and after 10, 60 and 300 s; rows of (name, (sources, 3)).

    The columns are position, velocity and attitude.
    """
    cases: list[tuple[str, NDArray[np.intp]]] = [("aided", budget.aided())]
    cases += [(f"{h:g} s without fixes", budget.after(h)) for h in HORIZONS]
    answer = []
    for name, epochs in cases:
        if len(epochs):
            blocks = [budget.share(epochs, slice(3 * i, 3 * i + 3)) for i in range(3)]
            answer.append((name, np.stack(blocks, axis=-1)))
    return answer


def error_budget(settings: FilterSettings, plan: Scenario) -> Budget:
    """Return the variance of every error by source along a scenario.

    Parameters
    ----------
    settings : FilterSettings
        The filter.
    plan : Scenario
        Trajectory, fixes and outages.
    """
    at, n = settings.model.layout, settings.size
    initial = np.diag(settings.initial_sd**2)
    believed = settings.position_sd or plan.receiver.position_sd
    velocity_sd = settings.velocity_sd or plan.receiver.velocity_sd or (1.0, 1.0, 1.0)
    white_all = np.concatenate([settings.model.gyro_density, settings.model.accel_density]) ** 2
    drive_all = settings.model.driving_density**2
    sd_all = np.array([*believed, *velocity_sd])
    names: list[str] = ["all"]
    p, white, drive, sd = [initial], [white_all], [drive_all], [sd_all]

    def add(
        name: str,
        states: Sequence[slice] = (),
        *,
        sensors: slice | None = None,
        fixes: slice | None = None,
        start: bool = True,
        driven: bool = True,
    ) -> None:
        own_p, own_white, own_drive, own_sd = np.zeros((n, n)), np.zeros(6), np.zeros(n), np.zeros(6)
        for block in states:
            if start:
                own_p[block, block] = initial[block, block]
            if driven:
                own_drive[block] = drive_all[block]
        if sensors is not None:
            own_white[sensors] = white_all[sensors]
        if fixes is not None:
            own_sd[fixes] = sd_all[fixes]
        names.append(name)
        p.append(own_p)
        white.append(own_white)
        drive.append(own_drive)
        sd.append(own_sd)

    add("gyro white noise", sensors=slice(0, 3))
    add("accelerometer white noise", sensors=slice(3, 6))
    for sensor, title in (("gyro", "gyro"), ("accel", "accelerometer")):
        if f"{sensor}_markov" in at:
            add(f"{title} bias noise", [at[f"{sensor}_markov"]])
        add(f"{title} bias random walk", [at[f"{sensor}_bias"]], start=False)
        add(f"{title} turn-on bias", [at[f"{sensor}_bias"]], driven=False)
    add("start", [slice(0, 9)])
    add("position fixes", fixes=slice(0, 3))
    add("velocity fixes", fixes=slice(3, 6))
    if "gnss_position" in at:
        add("correlated fixes", [at["gnss_position"]])
    known = {"position", "velocity", "attitude", "gyro_bias", "accel_bias", "gyro_markov", "accel_markov"}
    for name, _ in at.blocks:
        if name not in known | {"gnss_position"}:
            add(name.replace("_", " "), [at[name]])

    k, g = len(plan.times), len(names)
    out, out_s = np.zeros((k, g, 15, 15)), np.zeros((k, g, 6))
    llh, vel_n = perfect_fixes(plan.motion, plan.times, lever_arm=settings.lever_arm)
    withheld = np.zeros(k, dtype=bool)
    for begin, end in plan.outages:
        withheld |= (plan.times > begin) & (plan.times <= end)
    has_velocity = settings.velocity_sd is not None
    kept_trace(
        layout(settings),
        np.concatenate([plan.start.llh, plan.start.vel_n, plan.start.quat_nb]),
        np.stack(p),
        np.stack(white),
        np.stack(drive),
        np.stack(sd),
        plan.steps.dt,
        plan.steps.increments,
        plan.after,
        np.concatenate([llh, vel_n], axis=1),
        np.full(k, 1 + has_velocity, dtype=np.int64),
        withheld,
        out,
        out_s,
    )
    diagonal = np.einsum("kgii->kgi", out)
    first = np.concatenate([settings.initial_sd[:9], _bias_sd(settings)])
    return Budget(
        tuple(names[1:]),
        plan.times,
        diagonal[:, 1:],
        diagonal[:, 0],
        out_s[:, 1:],
        plan.outages,
        np.sqrt(diagonal[-1, 0]) / np.where(first > 0.0, first, 1.0),
    )


def attribute(found: Consistency, budget: Budget) -> tuple[Cause, ...]:
    """Return the sources, best first, that alone would explain the scores of a check.

    Every score counts with its own scatter; a factor in the variance of one source moves all of them by its
    shares. Returned are causes that take away half of the misfit and whose own is within twice that of the
    best; none where no single source explains the scores.

    Parameters
    ----------
    found : Consistency
        Scores of simulated runs of the filter.
    budget : Budget
        Of the same filter and scenario.
    """
    scores, shares = _table(found, budget)
    if not scores:
        return ()
    observed = np.array([s.mean / s.dof for s in scores])
    scatter = np.sqrt(2.0 / np.array([s.effective for s in scores]) + LEVEL_SCATTER**2)
    causes = []
    columns = {name: shares[:, j] for j, name in enumerate(budget.sources)}
    for name, parts in TOGETHER.items():
        if all(part in columns for part in parts):
            columns[name] = sum((columns[part] for part in parts), np.zeros(len(scores)))
    nothing = float(np.sum((np.log(observed) / scatter) ** 2))
    for name, column in columns.items():

        def misfit(log_factor: float, column: FloatArray = column) -> float:
            expected = 1.0 + (math.exp(log_factor) - 1.0) * column
            return float(np.sum((np.log(observed / expected) / scatter) ** 2))

        grid = np.linspace(-LARGEST, LARGEST, 81)
        best = grid[int(np.argmin([misfit(float(x)) for x in grid]))]
        step = float(grid[1] - grid[0])
        fit = minimize_scalar(misfit, bounds=(best - step, best + step), method="bounded")
        causes.append(Cause(name, math.exp(0.5 * float(fit.x)), float(fit.fun)))
    causes.sort(key=lambda cause: cause.misfit)
    limit = min(2.0 * causes[0].misfit, 0.5 * nothing)
    return tuple(cause for cause in causes if cause.misfit <= limit)


def _table(found: Consistency, budget: Budget) -> tuple[list[Score], FloatArray]:
    """Return the scores that the budget speaks of, and the shares of the sources in each, shape (s, g)."""
    scores, rows = [], []
    aided = budget.aided()
    for block in found.blocks:
        i = BLOCKS.index(block.name)
        scores.append(block)
        rows.append(budget.share(aided, slice(3 * i, 3 * i + 3)))
    for nis in found.nis:
        own = {"nis_position": slice(0, 3), "nis_velocity": slice(3, 6)}.get(nis.name)
        if own is not None:
            parts = budget.innovation[aided][:, :, own]
            scores.append(nis)
            rows.append((parts / parts.sum(axis=1, keepdims=True)).mean(axis=(0, 2)))
    for outage in found.outages:
        epochs = budget.after(outage.seconds)
        parts = budget.variance[epochs][:, :, :3].sum(axis=2)
        scores.append(outage.score)
        rows.append((parts / parts.sum(axis=1, keepdims=True)).mean(axis=0))
    return scores, np.array(rows)


def _bias_sd(settings: FilterSettings) -> FloatArray:
    from tuner.navigation.settings import total_bias

    m = total_bias(settings.model)[9:]
    return np.asarray(np.sqrt(m**2 @ settings.initial_sd**2))
