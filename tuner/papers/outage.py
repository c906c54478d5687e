"""Paper 1, 2.3 (8): a filter with white noise and bias instability only, against filters with fewer and more terms.

One axis of an MPU-9250 sees its angle to 0.3° once a second for an hour and then predicts. Truth is white noise,
flicker (a fine ladder from 0.3 s to 10⁷ s) and rate random walk. Four filters differ in their bias states. Truth and
estimate are one linear system, so that the covariance of the true error is exact::

    truth       x ← Φ x + w                        estimate    x̂ ← Φ' x̂,   x̂ ← x̂ + G (h x + v − h' x̂)

with Φ', G those of the filter, from its own beliefs. Nothing is sampled. Run times are measured on simulated flights
of the whole navigation filter.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from models.statespace import flicker_ladder
from models.trajectories import figure_eight
from models.units import DEG
from tuner.grades import grade_identification, load_gnss, load_grade
from tuner.navigation.sensor import sensor_of_grade
from tuner.navigation.settings import filter_settings
from tuner.navigation.simulate import scenario, simulate
from tuner.papers.results import Curve, Item, Panel, Picture, exact, judge
from tuner.papers.sampling import Settings, estimate
from tuner.results import ChannelNoise, Coefficient, MarkovState
from tuner.synthesis import RULES, step_noise, synthesize
from tuner.synthesis.markov import FlickerView
from tuner.synthesis.process_noise import axis_system

FloatArray = NDArray[np.float64]

HEADING, AIDED, LOST = 0.3 * DEG, 3600, 60.0
"""Sd of a measured angle, rad; how long it is measured; outage that is judged, s."""
OUTAGES = np.array([3.0, 10.0, 30.0, 60.0, 100.0, 300.0, 1000.0])


def kf_parameters(settings: Settings) -> Item:
    """Return the comparison of four filters."""
    model = load_grade("mpu9250").noise_model("gyro")
    density, level, walk = (_amplitude(model, kind) for kind in (White, BiasInstability, RandomWalk))
    tau = np.geomspace(1.0, 1e5, 2000)
    deviation = np.sqrt(model.allan_variance(tau))
    at = int(np.argmin(deviation))
    view = FlickerView(level, density, float(deviation[at]), float(tau[at]), horizon=1000.0, interval=0.01)

    def channel(markov: tuple[MarkovState, ...], drive: float) -> ChannelNoise:
        return ChannelNoise("gyro_x", "rad/s", density, markov, drive, constant_sd=0.1 * DEG)

    fine = flicker_ladder(level, 0.3, 1e7, per_decade=3)
    truth = channel(tuple(MarkovState(g.sd, g.time_constant) for g in fine), walk)
    paper, ladder = RULES["level"].states(view), RULES["ladder"].states(view)
    filters: Mapping[str, ChannelNoise] = MappingProxyType(
        {
            "white noise, constant": channel((), 0.0),
            "and Markov (the paper)": channel(paper, 0.0),
            "and random walk": channel(paper, walk),
            "ladder and random walk": channel(ladder, walk),
        }
    )
    best = outage_errors(truth, truth)[0]
    found = {name: outage_errors(truth, believed) for name, believed in filters.items()}
    judged = int(np.flatnonzero(OUTAGES == LOST)[0])
    loss = {name: true / best for name, (true, _) in found.items()}
    honest = {name: true / predicted for name, (true, predicted) in found.items()}
    bare, markov, _, every = filters
    claims = (
        judge(
            f"error after {LOST:g} s: ARW and BI ÷ best possible",
            "more terms do not improve accuracy notably: 1",
            exact(loss[markov][judged], "1"),
            claimed=(1.0, 1.1),
            why=f"one Markov process comes close; with every term {loss[every][judged]:.3f}",
        ),
        judge(
            f"error after {LOST:g} s: ARW and a constant ÷ best possible",
            "ARW and BI are both needed: above 1",
            exact(loss[bare][judged], "1"),
            claimed=(1.1, np.inf),
            why="without the Markov process the filter stops learning the bias",
        ),
        judge(
            f"ARW and BI: true error ÷ predicted sd after {LOST:g} s",
            "right for the filter: 1",
            exact(honest[markov][judged], "1"),
            claimed=(0.9, 1.1),
            derived=(1.1, 2.0),
            why="a process of variance B² has less power than flicker at periods both shorter and longer than its own: "
            "the angle is nearly as good, the filter's belief in it is not",
        ),
        judge(
            f"flicker as ladder, random walk: true error ÷ predicted sd after {LOST:g} s",
            "no value",
            exact(honest[every][judged], "1"),
            claimed=None,
            derived=(0.9, 1.1),
            why="processes a decade apart carry the power of flicker: this is what the further terms are for",
        ),
        judge(
            "run time of the navigation filter: ladder and random walk ÷ ARW and BI",
            "may fall markedly in efficiency: above 1",
            _run_time(settings.size(20, 6)),
            claimed=(1.0, np.inf),
            why="39 states against 24 cost time; a flight of 10 minutes at 100 Hz still takes a fraction of a second",
        ),
    )
    panels = tuple(
        Panel(
            title,
            "time since the last measurement, s",
            label,
            tuple(Curve(OUTAGES, values, name, group=g) for g, (name, values) in enumerate(ratio.items())),
        )
        for title, label, ratio in (
            ("accuracy", "true error ÷ best possible", loss),
            ("honesty", "true error ÷ predicted sd", honest),
        )
    )
    title = "Li Qi et al., noise of ring laser gyroscopes by Allan variance: 2.3 (8)"
    return Item("kf-parameters", title, claims, Picture(panels))


def outage_errors(truth: ChannelNoise, believed: ChannelNoise) -> tuple[FloatArray, FloatArray]:
    """Return true rms and predicted sd of the angle after each outage, rad, shape (q,).

    Parameters
    ----------
    truth, believed : ChannelNoise
        The axis as it is, and as the filter takes it.
    """
    (phi_true, noise_true), (phi, noise) = step_noise(truth, 1.0), step_noise(believed, 1.0)
    n, m = len(phi_true), len(phi)
    h_true, h = np.eye(1, n)[0], np.eye(1, m)[0]
    p = axis_system(believed).P0
    joint = np.zeros((n + m, n + m))  # of true state and estimate
    joint[:n, :n] = axis_system(truth).P0
    advance, drive, update = (np.zeros((n + m, n + m)) for _ in range(3))
    advance[:n, :n], advance[n:, n:], drive[:n, :n], update[:n, :n] = phi_true, phi, noise_true, np.eye(n)
    for _ in range(AIDED):
        p = phi @ p @ phi.T + noise
        gain = p @ h / (h @ p @ h + HEADING**2)
        update[n:, :n], update[n:, n:] = np.outer(gain, h_true), np.eye(m) - np.outer(gain, h)
        p = update[n:, n:] @ p
        step = update @ advance
        joint = step @ joint @ step.T + update @ drive @ update.T
        joint[n:, n:] += HEADING**2 * np.outer(gain, gain)
    true, predicted = [], []
    for seconds in OUTAGES.tolist():
        (ahead_true, added_true), (ahead, added) = step_noise(truth, seconds), step_noise(believed, seconds)
        error = np.concatenate([h_true @ ahead_true, -h @ ahead])
        true.append(np.sqrt(error @ joint @ error + added_true[0, 0]))
        predicted.append(np.sqrt((ahead @ p @ ahead.T + added)[0, 0]))
    return np.array(true), np.array(predicted)


def _amplitude(model: NoiseModel, kind: type[White] | type[BiasInstability] | type[RandomWalk]) -> float:
    """Return the amplitude of the term of a kind."""
    (term,) = (term for term in model.terms if isinstance(term, kind))
    return float(getattr(term, term.PARAMETERS[0]))


def _run_time(runs: int) -> Coefficient:
    """Return the ratio of the run times of two navigation filters, run in turn."""
    grade, receiver = load_grade("mpu9250"), load_gnss("dgnss")
    plan, sensor = scenario(figure_eight(600.0), receiver, 0.01), sensor_of_grade(grade)
    both = [
        filter_settings(synthesize(grade_identification(grade), rule=rule, gnss=receiver))
        for rule in ("ladder", "level")
    ]
    taken = np.empty((runs + 1, 2))
    for k in range(runs + 1):  # the first loads the compiled code
        for j, one in enumerate(both):
            begin = time.perf_counter()
            simulate(one, sensor, plan, runs=1, seed=k)
            taken[k, j] = time.perf_counter() - begin
    return estimate(taken[1:], lambda rows: float(rows[:, 0].mean() / rows[:, 1].mean()))
