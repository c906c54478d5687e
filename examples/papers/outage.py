"""Paper 1, 2.3 (8): a filter with white noise and bias instability only, against filters with fewer and more terms.

One axis of an MPU-9250 sees its angle to 0.3° once a second for an hour and then predicts. Truth is white noise,
flicker (a fine ladder from 0.3 s to 10⁷ s) and rate random walk. Five filters differ in their bias states; the
covariance of the true error is exact (`examples.papers.mismatched_filter`). The ARMA sequence is the one that an hour
at 1 Hz tends to by likelihood: the least of Σ ln S' + S/S' over the frequencies of the record, S the true spectrum,
with two real poles and zeros each. Run times are measured on simulated runs of the whole navigation filter.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.optimize import minimize

from examples.papers.mismatched_filter import AIDED_MEASUREMENTS, Linear, axis, outage_errors, shaped
from examples.papers.results import Claim, Curve, Item, Panel, Picture, Table, exact, judge
from examples.papers.sampling import Settings, estimate
from examples.papers.subjects import RING_LASER_PAPER
from models.arrays import FloatArray
from models.noise import BiasInstability, GaussMarkov, NoiseModel, RandomWalk, White
from models.noise.arma import Arma
from models.noise.bias_instability import flicker_ladder
from models.trajectory.catalogue import figure_eight
from models.units import DEG
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import sensor_of_grade
from tuner.simulation.monte_carlo import simulate
from tuner.simulation.scenario import scenario
from tuner.synthesis import RULES, synthesize
from tuner.synthesis.bias_states import FlickerView
from tuner.types import ChannelNoise

ANGLE_SD, JUDGED_OUTAGE = 0.3 * DEG, 60.0
"""Sd of a measured angle, rad; outage that is judged, s."""
OUTAGES = np.array([3.0, 10.0, 30.0, 60.0, 100.0, 300.0, 1000.0])
"""Lengths of outage whose errors are computed, s."""
SHOWN_OUTAGES = (10.0, 60.0, 300.0, 1000.0)
"""Outages of the table, s."""


@dataclass(frozen=True)
class _Comparison:
    """Five filters in outages.

    Attributes
    ----------
    states : mapping of str to int
        Bias states an axis, by the name of the filter.
    loss, ratio : mapping of str to ndarray, shape (q,)
        True error ÷ best possible, and ÷ predicted sd, after each of `OUTAGES`.
    """

    states: Mapping[str, int]
    loss: Mapping[str, FloatArray]
    ratio: Mapping[str, FloatArray]


def kf_parameters(settings: Settings) -> Item:
    """Return the comparison of five filters."""
    found = _compared(load_grade("mpu9250").noise_model("gyro"))
    taken = run_times(tuple(found.states.values()), settings.size(20, 6))
    title = f"{RING_LASER_PAPER}: 2.3 (8)"
    return Item("kf-parameters", title, _claims(found, taken), _picture(found, taken))


def _compared(model: NoiseModel) -> _Comparison:
    """Return the errors of the filters in outages of a sensor with this noise."""
    density, level, walk = (_amplitude(model, kind) for kind in (White, BiasInstability, RandomWalk))
    tau = np.geomspace(1.0, 1e5, 2000)
    deviation = np.sqrt(model.allan_variance(tau))
    at = int(np.argmin(deviation))
    view = FlickerView(level, density, float(deviation[at]), float(tau[at]), horizon=1000.0, interval=0.01)

    constant = 0.1 * DEG

    def channel(markov: tuple[GaussMarkov, ...], drive: float) -> ChannelNoise:
        return ChannelNoise("gyro_x", "rad/s", density, markov, drive, constant_sd=constant)

    fine = flicker_ladder(level, 0.3, 1e7, per_decade=3)
    truth = axis(channel(tuple(GaussMarkov(g.sd, g.time_constant) for g in fine), walk))
    paper, ladder = RULES["level"].states(view), RULES["ladder"].states(view)
    sequence = likeliest(model)
    filters: Mapping[str, Linear] = MappingProxyType(
        {
            "white noise, constant": axis(channel((), 0.0)),
            "and Markov (the paper)": axis(channel(paper, 0.0)),
            "and random walk": axis(channel(paper, walk)),
            "ladder and random walk": axis(channel(ladder, walk)),
            "ARMA(2,2) shaping, constant": shaped(sequence, constant_sd=constant),
        }
    )
    states = (0, len(paper), len(paper), len(ladder), len(sequence.transition()[0]))
    best = outage_errors(truth, truth, ANGLE_SD, OUTAGES.tolist())[0]
    found = {name: outage_errors(truth, one, ANGLE_SD, OUTAGES.tolist()) for name, one in filters.items()}
    return _Comparison(
        dict(zip(filters, states, strict=True)),
        {name: true / best for name, (true, _) in found.items()},
        {name: true / predicted for name, (true, predicted) in found.items()},
    )


def _claims(found: _Comparison, taken: FloatArray) -> tuple[Claim, ...]:
    """Return what the paper says of its filter, judged; `taken` are run times, s, of each run and filter."""
    loss, ratio, states = found.loss, found.ratio, tuple(found.states.values())
    judged = int(np.argmin(np.abs(OUTAGES - JUDGED_OUTAGE)))
    bare, markov, _, every, arma = found.states
    return (
        judge(
            f"error after {JUDGED_OUTAGE:g} s: ARW and BI ÷ best possible",
            "more terms do not improve accuracy notably: 1",
            exact(loss[markov][judged], "1"),
            claimed=(1.0, 1.1),
            why=f"one Markov process comes close; with every term {loss[every][judged]:.3f}",
        ),
        judge(
            f"error after {JUDGED_OUTAGE:g} s: ARW and a constant ÷ best possible",
            "ARW and BI are both needed: above 1",
            exact(loss[bare][judged], "1"),
            claimed=(1.1, np.inf),
            why="without the Markov process the filter stops learning the bias",
        ),
        judge(
            f"ARW and BI: true error ÷ predicted sd after {JUDGED_OUTAGE:g} s",
            "right for the filter: 1",
            exact(ratio[markov][judged], "1"),
            claimed=(0.9, 1.1),
            derived=(1.1, 2.0),
            why="a process of variance B² has less power than flicker at periods both shorter and longer than its own: "
            "the angle is nearly as good, its predicted sd is not",
        ),
        judge(
            f"flicker as ladder, random walk: true error ÷ predicted sd after {JUDGED_OUTAGE:g} s",
            f"more terms gain nothing: {ratio[markov][judged]:.3f}, as ARW and BI",
            exact(ratio[every][judged], "1"),
            claimed=float(ratio[markov][judged]),
            derived=(0.9, 1.1),
            why="processes a decade apart carry the power of flicker: this is what the further terms are for",
        ),
        judge(
            f"error after {JUDGED_OUTAGE:g} s: ARMA(2,2) shaping ÷ ARW and BI",
            "more terms do not improve accuracy notably: 1",
            exact(loss[arma][judged] / loss[markov][judged], "1"),
            claimed=(0.9, 1.1),
            why=f"{states[-1]} states instead of {states[1]} gain nothing; true error ÷ predicted sd "
            f"{ratio[arma][judged]:.2f} after {JUDGED_OUTAGE:g} s but {ratio[arma][-1]:.2f} after {OUTAGES[-1]:g} s: "
            "an hour at 1 Hz says little of so long times",
        ),
        judge(
            "run time of the navigation filter: ladder and random walk ÷ ARW and BI",
            "may fall markedly in efficiency: above 1",
            estimate(taken, lambda rows: float(rows[:, 3].mean() / rows[:, 1].mean())),
            claimed=(1.0, np.inf),
            why=f"{states[3]} bias states an axis against {states[1]}; 10 minutes at 100 Hz, the simulation included, "
            f"still take {taken[:, 3].mean():.2g} s",
        ),
    )


def _picture(found: _Comparison, taken: FloatArray) -> Picture:
    """Return the errors over the length of the outage, and a table with the run times."""
    loss, ratio = found.loss, found.ratio
    relative = taken.mean(axis=0) / taken.mean(axis=0)[1]
    panels = tuple(
        Panel(
            title,
            "time since the last measurement, s",
            label,
            tuple(Curve(OUTAGES, values, name, group=g) for g, (name, values) in enumerate(of.items())),
        )
        for title, label, of in (
            ("accuracy", "true error ÷ best possible", loss),
            ("ratio", "true error ÷ predicted sd", ratio),
        )
    )
    columns = (
        "run time",
        *(f"error, {seconds:g} s" for seconds in SHOWN_OUTAGES),
        *(f"÷sd, {seconds:g} s" for seconds in SHOWN_OUTAGES),
    )
    chosen = np.searchsorted(OUTAGES, SHOWN_OUTAGES)
    cells = np.array(
        [
            [cost, *loss[name][chosen], *ratio[name][chosen]]
            for name, cost in zip(found.states, relative, strict=True)
        ]
    )
    rows = tuple(f"{name} ({count})" for name, count in found.states.items())
    numbers = Table(
        "run time ÷ the paper's; true error ÷ best possible, and ÷ predicted sd (in brackets: bias states an axis)",
        rows,
        columns,
        cells,
        ratios=True,
    )
    return Picture((*panels, numbers))


def likeliest(model: NoiseModel) -> Arma:
    """Return the ARMA(2,2) sequence that an hour of a sensor at 1 Hz tends to by likelihood."""
    f = np.arange(1, AIDED_MEASUREMENTS // 2 + 1) / AIDED_MEASUREMENTS
    true = model.psd(f, interval=1.0)

    def sequence(x: FloatArray) -> Arma:
        poles, zeros = np.exp(-np.exp(-x[:2])), np.exp(-np.exp(-x[2:]))
        one = Arma(
            (float(poles.sum()), -float(poles.prod())), (-float(zeros.sum()), float(zeros.prod())), 1.0, 1.0
        )
        return replace(one, variance=float(np.mean(true / one.psd(f))))

    def misfit(x: FloatArray) -> float:
        return float(np.sum(np.log(sequence(x).psd(f))))

    start = np.log([30.0, 1000.0, 15.0, 500.0])
    found = minimize(
        misfit, start, method="Nelder-Mead", options={"maxiter": 4000, "xatol": 1e-4, "fatol": 1e-6}
    )
    return sequence(found.x)


def _amplitude(model: NoiseModel, kind: type[White] | type[BiasInstability] | type[RandomWalk]) -> float:
    """Return the amplitude of the term of a kind."""
    (term,) = (term for term in model.terms if isinstance(term, kind))
    return float(getattr(term, term.PARAMETERS[0]))


def run_times(states: tuple[int, ...], runs: int) -> FloatArray:
    """Return the run times, s, of navigation filters with so many bias states an axis, run in turn; (runs, q)."""
    grade, receiver = load_grade("mpu9250"), load_gnss("dgnss")
    plan, sensor = scenario(figure_eight(600.0), receiver, 0.01), sensor_of_grade(grade)
    config = synthesize(grade_identification(grade), gnss=receiver)
    settings = [
        filter_settings(
            replace(
                config,
                channels={
                    name: replace(
                        c, markov=tuple(GaussMarkov(c.constant_sd, 10.0 * (j + 1)) for j in range(count))
                    )
                    for name, c in config.channels.items()
                },
            )
        )
        for count in states
    ]
    taken = np.empty((runs + 1, len(states)))
    for k in range(runs + 1):  # the first loads the compiled code
        for j, one in enumerate(settings):
            begin = time.perf_counter()
            simulate(one, sensor, plan, runs=1, seed=k)
            taken[k, j] = time.perf_counter() - begin
    return taken[1:]
