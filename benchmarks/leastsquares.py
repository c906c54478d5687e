"""Efficiency and coverage of the weighted least squares of an Allan curve.

Three simulated sensors at 100 Hz, one hour each (N = 1): white and random walk with a corner at 60 s
(S2); white, flicker and random walk (S3: K barely visible, S4: K clear). For every record the terms are
fitted by weighted least squares; printed are bias and rmse of estimate/truth, rmse over the Cramér-Rao
bound of the Whittle likelihood, and the coverage of the 95 % intervals with its Wilson interval. Run:
``python benchmarks/leastsquares.py [RUNS]``.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.identification.allan_leastsquares import fit
from tuner.identification.allan_octaves import OctaveCurve

INTERVAL, SAMPLES = 0.01, 360_000
CASES = {
    "S2": NoiseModel((White(1.0), RandomWalk(np.sqrt(3.0) / 60.0))),
    "S3": NoiseModel((White(1.0), BiasInstability(0.476), RandomWalk(0.0245))),
    "S4": NoiseModel((White(1.0), BiasInstability(0.476), RandomWalk(0.06))),
}


def bound(model: NoiseModel) -> np.ndarray:
    """Relative standard deviations at the Cramér-Rao bound."""
    f = np.arange(1, SAMPLES // 2) / (SAMPLES * INTERVAL)
    gradient = model.psd_gradient(f, interval=INTERVAL) / model.psd(f, interval=INTERVAL)
    return np.sqrt(np.diag(np.linalg.inv(gradient @ gradient.T)))


def wilson(hits: int, runs: int) -> tuple[float, float]:
    """95 % Wilson interval of a probability."""
    z = 1.96
    p = hits / runs
    centre = (p + z**2 / (2 * runs)) / (1 + z**2 / runs)
    reach = z * np.sqrt(p * (1 - p) / runs + z**2 / (4 * runs**2)) / (1 + z**2 / runs)
    return centre - reach, centre + reach


def study(name: str, model: NoiseModel, runs: int, *, generalised: bool) -> None:
    """Print the figures of one case."""
    truth = np.array([getattr(term, term.PARAMETERS[0]) for term in model.terms])
    ratio, inside, p_values = np.empty((runs, len(truth))), np.zeros(len(truth), dtype=int), np.empty(runs)
    started = time.perf_counter()
    for run in range(runs):
        rng = np.random.default_rng((ord(name[1]), run))
        curve = OctaveCurve.of([model.sample(SAMPLES, INTERVAL, rng)], INTERVAL)
        found = fit(curve, model, generalised=generalised)
        ratio[run] = np.exp(found.estimate) / truth
        low, high = np.array(found.intervals).T
        inside += (low <= truth) & (truth <= high)
        p_values[run] = found.p_value
    rmse = np.sqrt(np.mean((ratio - 1.0) ** 2, axis=0))
    print(f"{name} {'GLS' if generalised else 'WLS'}, {runs} records, {time.perf_counter() - started:.0f} s")
    for j, term in enumerate(model.terms):
        low, high = wilson(int(inside[j]), runs)
        print(
            f"  {term.name:17s} bias {np.mean(ratio[:, j]) - 1:+.4f}  rmse {rmse[j]:.4f}  "
            f"rmse/CRB {rmse[j] / bound(model)[j]:.2f}  coverage {inside[j] / runs:.3f} "
            f"({low:.3f} … {high:.3f})"
        )
    print(
        f"  χ² test: p < 0.05 in {np.mean(p_values < 0.05):.3f}, p < 0.001 in {np.mean(p_values < 0.001):.4f}"
    )


if __name__ == "__main__":
    RUNS = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    for case, sensor in CASES.items():
        for full in (False, True):
            study(case, sensor, RUNS, generalised=full)
