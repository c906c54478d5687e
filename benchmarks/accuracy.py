"""Identification against the statistical limit: error over the Cramér–Rao bound, coverage, terms, ARMA.

    python benchmarks/accuracy.py [--runs 300] [--seed 0] [SECTION …]

Sections: ``fixed`` (terms given), ``selected`` (terms chosen), ``inventions``, ``wavelet`` (white noise,
Gauss–Markov and random walk at a million samples), ``arma``. The four sensors of the first two are sampled at
100 Hz for an hour: white noise of density 1 with

    S1  Gauss-Markov 0.3, 100 s        S2  random walk, corner 60 s
    S3  flicker 0.476, walk 0.0245     S4  flicker 0.476, walk 0.06

The bound is that of the Whittle likelihood at the Fourier frequencies; intervals of proportions are Wilson's.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from models.noise import BiasInstability, GaussMarkov, NoiseModel, Quantization, RandomWalk, Term, White
from tuner.identification.arma_whittle import fit_orders
from tuner.identification.intervals import interval
from tuner.identification.likelihood import LikelihoodFit
from tuner.identification.objective import Objective
from tuner.identification.periodogram import cosine_periodogram
from tuner.identification.selection import select_periodogram

FloatArray = NDArray[np.float64]

INTERVAL = 0.01
N = 360_000
SENSORS: dict[str, tuple[Term, ...]] = {
    "S1": (White(1.0), GaussMarkov(0.3, 100.0)),
    "S2": (White(1.0), RandomWalk(np.sqrt(3.0) / 60.0)),
    "S3": (White(1.0), BiasInstability(0.476), RandomWalk(0.0245)),
    "S4": (White(1.0), BiasInstability(0.476), RandomWalk(0.06)),
}


def wilson(hits: int, runs: int, z: float = 1.96) -> str:
    """Return a proportion in per cent with its 95 % Wilson interval."""
    p, weight = hits / runs, 1.0 + z**2 / runs
    middle = (p + 0.5 * z**2 / runs) / weight
    half = z * np.sqrt(p * (1.0 - p) / runs + 0.25 * z**2 / runs**2) / weight
    return f"{100 * p:5.1f} [{100 * (middle - half):.1f}, {100 * (middle + half):.1f}]"


def parameters(terms: Sequence[Term]) -> tuple[list[str], FloatArray]:
    """Return names and values of the parameters."""
    pairs = [(f"{t.name}.{p}", getattr(t, p)) for t in terms for p in t.PARAMETERS]
    return [name for name, _ in pairs], np.array([value for _, value in pairs])


def bound(terms: Sequence[Term]) -> FloatArray:
    """Return the Cramér–Rao bound of the standard deviation of the log of each parameter."""
    f = np.arange(1, N // 2) / (N * INTERVAL)
    spectrum = np.sum([t.psd(f, interval=INTERVAL) for t in terms], axis=0)
    gradient = np.concatenate([t.psd_gradient(f, interval=INTERVAL) for t in terms]) / spectrum
    return np.sqrt(np.diag(np.linalg.inv(gradient @ gradient.T)))


def relative_error(name: str, estimate: FloatArray, truth: float) -> float:
    """Return the root mean square of estimate/truth - 1, or of the log for a time constant."""
    ratio = estimate / truth
    return float(np.sqrt(np.mean((np.log(ratio) if name.endswith("time_constant") else ratio - 1.0) ** 2)))


def fixed(runs: int, seed: int) -> None:
    print("## Terms given: rmse over the Cramér–Rao bound, coverage of 95 and 50 % intervals [Wilson 95 %]")
    for sensor, terms in SENSORS.items():
        names, truth = parameters(terms)
        limit = bound(terms)
        rng = np.random.default_rng((seed, 1))
        estimates, hits, cpu = [], np.zeros((2, len(truth)), dtype=int), 0.0
        for _ in range(runs):
            y = NoiseModel(terms).sample(N, INTERVAL, rng)
            start = time.process_time()
            objective = Objective.of(cosine_periodogram([y], INTERVAL), [t.name for t in terms])
            theta = objective.maximum()
            cpu += time.process_time() - start
            estimates.append(np.exp(theta))
            for row, level in enumerate((0.95, 0.5)):
                ends = [interval(objective, theta, j, level=level) for j in range(len(truth))]
                hits[row] += [low <= value <= high for value, (low, high) in zip(truth, ends, strict=True)]
        for j, name in enumerate(names):
            ratio = relative_error(name, np.array(estimates)[:, j], truth[j]) / limit[j]
            shown = f"{sensor}  {name:28s} {ratio:.3f} ± {ratio / np.sqrt(2 * runs):.3f}"
            print(f"{shown}   {wilson(hits[0, j], runs)}   {wilson(hits[1, j], runs)}")
        print(
            f"{sensor}  transform and fit {1e3 * cpu / runs:.1f} ms of processor time; {runs} runs",
            flush=True,
        )


def selected(runs: int, seed: int) -> None:
    print("## Terms chosen: how often the true sum, and errors and coverage where a term was found")
    for sensor, terms in SENSORS.items():
        names, truth = parameters(terms)
        limit = bound(terms)
        rng = np.random.default_rng((seed, 2))
        sums: Counter[str] = Counter()
        found: dict[str, list[tuple[float, bool]]] = {name: [] for name in names}
        held: dict[str, list[bool]] = {name: [] for name in names}
        cpu = 0.0
        for _ in range(runs):
            y = NoiseModel(terms).sample(N, INTERVAL, rng)
            start = time.process_time()
            choice = select_periodogram(cosine_periodogram([y], INTERVAL))
            cpu += time.process_time() - start
            sums["+".join(choice.fit.terms)] += 1
            for name, value in zip(names, truth, strict=True):
                if name in choice.fit.names:
                    low, high = choice.fit.interval(name)
                    found[name].append((choice.fit.value(name), low <= value <= high))
                for limited in choice.bounded:
                    if f"{limited.name}.{limited.parameter}" == name:
                        held[name].append(limited.upper >= value)
        print(f"{sensor}  " + ", ".join(f"{name} {100 * k / runs:.1f} %" for name, k in sums.most_common(6)))
        for j, name in enumerate(names):
            values, covered = np.array(found[name]).reshape(-1, 2).T
            if len(values):
                ratio = relative_error(name, values, truth[j]) / limit[j]
                share = wilson(int(covered.sum()), len(values))
                print(f"{sensor}  {name:28s} found {len(values):4d}: {ratio:.3f}, {share}")
            if held[name]:
                holds = wilson(sum(held[name]), len(held[name]))
                print(f"{sensor}  {name:28s} bounded {len(held[name]):4d}: limit holds {holds}")
        print(f"{sensor}  {1e3 * cpu / runs:.0f} ms of processor time a record; {runs} runs", flush=True)


def inventions(runs: int, seed: int) -> None:
    print("## Records with a term too many, per cent [Wilson 95 %], an hour at 10 Hz")
    truths: dict[str, tuple[Term, ...]] = {
        "white": (White(1.0),),
        "quantization+white": (Quantization(0.05), White(1.0)),
        "white+bias_instability": (White(1.0), BiasInstability(0.476)),
        "white+random_walk": SENSORS["S2"],
        "white+bias_instability+random_walk": SENSORS["S4"],
    }
    for label, terms in truths.items():
        rng = np.random.default_rng((seed, 3))
        extra: Counter[str] = Counter()
        invented = 0
        for _ in range(runs):
            y = NoiseModel(terms).sample(36_000, 0.1, rng)
            fitted: LikelihoodFit = select_periodogram(cosine_periodogram([y], 0.1)).fit
            more = [name for name in fitted.terms if name not in label.split("+")]
            extra.update(more)
            invented += bool(more)
        print(f"{label:38s} {wilson(invented, runs)}  {dict(extra)}; {runs} runs", flush=True)


def wavelet(runs: int, seed: int) -> None:
    print("## White 1, Gauss–Markov φ = 0.999, q = 2e-5, random walk 1e-8, a million samples")
    q, phi, walk, n = 2e-5, 0.999, 1e-8, 1_000_000
    truth = (
        White(1.0),
        GaussMarkov(np.sqrt(q / (1.0 - phi**2)), -1.0 / np.log(phi)),
        RandomWalk(np.sqrt(walk)),
    )
    names, values = parameters(truth)
    rng = np.random.default_rng((seed, 4))
    estimates, cpu = [], 0.0
    for _ in range(runs):
        y = NoiseModel(truth).sample(n, 1.0, rng)
        start = time.process_time()
        objective = Objective.of(cosine_periodogram([y], 1.0), [t.name for t in truth])
        estimates.append(np.exp(objective.maximum()))
        cpu += time.process_time() - start
    for j, name in enumerate(names):
        error = np.array(estimates)[:, j] / values[j] - 1.0
        print(f"{name:28s} relative rmse {100 * np.sqrt(np.mean(error**2)):.2f} %")
    print(f"{1e3 * cpu / runs:.0f} ms of processor time a record; {runs} runs", flush=True)


def arma(runs: int, seed: int) -> None:
    from statsmodels.tsa.arima.estimators.innovations import innovations_mle

    print("## ARMA(2,2) = (.75, -.25; .65, .35): order by BIC, rmse over that of the innovations likelihood")
    truth = np.array([0.75, -0.25, 0.65, 0.35])
    rng = np.random.default_rng((seed, 5))
    for n, compared in ((10_000, runs), (100_000, max(runs // 10, 10))):
        right, cpu, ours, exact = 0, 0.0, [], []
        for run in range(runs):
            y = simulated_arma(truth[:2], truth[2:], n, rng)
            start = time.process_time()
            fits = fit_orders([y])
            cpu += time.process_time() - start
            right += min(fits, key=lambda order: fits[order].score(np.log(n))) == (2, 2)
            if run < compared:
                ours.append([*fits[2, 2].ar, *fits[2, 2].ma])
                mle, _ = innovations_mle(y, order=(2, 0, 2))
                exact.append([*mle.ar_params, *mle.ma_params])
        rms = [np.sqrt(np.mean((np.array(e) - truth) ** 2, axis=0)) for e in (ours, exact)]
        print(f"n = {n}: right order {wilson(right, runs)}; {1e3 * cpu / runs:.0f} ms for 16 orders")
        print(f"n = {n}: rmse ratio {np.round(rms[0] / rms[1], 3)}; {compared} runs", flush=True)
    for n in (2000, 20_000):
        white = 0
        for _ in range(runs):
            fits = fit_orders([simulated_arma([0.476425], [-0.455909], n, rng)])
            white += min(fits, key=lambda order: fits[order].score(np.log(n))) == (0, 0)
        print(
            f"ARMA(1,1) of the third paper, n = {n}: called white {wilson(white, runs)}; {runs} runs",
            flush=True,
        )


def simulated_arma(
    ar: Sequence[float] | FloatArray, ma: Sequence[float] | FloatArray, n: int, rng: np.random.Generator
) -> FloatArray:
    """Return n samples after a start of 1000."""
    noise = rng.standard_normal(n + 1000)
    return np.asarray(lfilter(np.append(1.0, ma), np.append(1.0, np.negative(ar)), noise)[1000:])


SECTIONS = {"fixed": fixed, "selected": selected, "inventions": inventions, "wavelet": wavelet, "arma": arma}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sections", nargs="*", help=f"any of {', '.join(SECTIONS)}; default all")
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for name in given.sections or SECTIONS:
        SECTIONS[name](given.runs, given.seed)


if __name__ == "__main__":
    main()
