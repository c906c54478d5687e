"""Paper 1, figure 4: a MEMS gyro before and after a low-pass filter of one pole.

Filtered white noise is a Gauss–Markov process of time constant 1/(2π f_c): its Allan deviation rises, peaks at
f_c τ = 0.301, and joins N/√τ from below::

    σ²(τ) = N²/τ · {1 − (T/2τ)(3 − 4 e^{−τ/T} + e^{−2τ/T})},     T = 1/(2π f_c)

At f_c τ = 1, 3, 10 the deviation is 0.873, 0.959, 0.988 of N/√τ: read beyond 10/f_c, N is right to 1.2 %.
"""

from __future__ import annotations

import numpy as np

from examples.papers.results import Claim, Curve, Item, Panel, Picture, exact, judge
from examples.papers.sampling import Settings, estimate, scaled
from examples.papers.subjects import RING_LASER_PAPER
from models.arrays import FloatArray
from models.noise import GaussMarkov, NoiseModel
from models.units import DEG_PER_HOUR
from tuner.catalogue.grades import load_grade
from tuner.curves import curve
from tuner.curves.allan import overlapping_allan
from tuner.diagnosis import diagnose
from tuner.identification import identify_channel
from tuner.simulation.static import Channel, simulate
from tuner.types import AllanCurve, ChannelIdentification, Coefficient
from tuner.types.records import Record

CUTOFF_FREQUENCY, SAMPLE_RATE, RECORD_PIECES = 5.0, 100.0, 50
"""Hz, Hz; parts of the record by whose scatter ratios are judged."""


def lowpass_n(settings: Settings) -> Item:
    """Return figure 4, the same noise without and with the filter."""
    model = load_grade("mpu9250").noise_model("gyro")
    duration = float(settings.size(14_400, 3_600))
    seed = int(settings.rng("lowpass-n").integers(1 << 31))
    before, after = (
        simulate({"gyro_x": Channel(model)}, duration=duration, rate=SAMPLE_RATE, seed=seed, effects=effects)[
            0
        ][0]
        for effects in ((), (f"lowpass@gyro_x:cutoff={CUTOFF_FREQUENCY:g}",))
    )
    density = model.white_density()
    filtered = identify_channel(after, "gyro_x")
    curves = {label: curve(r, "oadev", noise=model) for label, r in (("before", before), ("after", after))}
    peak = _peak(curves["after"])
    claims = (
        judge(
            "f_c τ where the curve of the filtered gyro peaks",
            "an N-shaped part, from the filter",
            exact(peak * CUTOFF_FREQUENCY, "1"),
            claimed=(0.2, 0.45),
            why="filtered white noise peaks at f_c τ = 0.301: the shape shows the cutoff, not the gyro",
        ),
        *(_ratio(before, after, model, times) for times in (1.0, 3.0, 10.0)),
        judge(
            "Gauss–Markov terms identified in the filtered record",
            "not Markov",
            exact(float(sum(term.present for term in filtered.terms if term.name == GaussMarkov.name)), "1"),
            claimed=0.0,
            why=_terms_text(filtered),
        ),
        _named(model, seed + 1),
        _density(filtered, density),
    )
    tau = curves["before"].tau
    panel = Panel(
        f"MPU-9250 gyro, low-pass {CUTOFF_FREQUENCY:g} Hz",
        "cluster time τ, s",
        "deg/h",
        (
            *(_shown(found, label, group) for group, (label, found) in enumerate(curves.items())),
            Curve(tau, density / np.sqrt(tau) / DEG_PER_HOUR, "N/√τ", "dashed", group=5),
        ),
        marks=((0.3012 / CUTOFF_FREQUENCY, "0.301/f_c"), (10.0 / CUTOFF_FREQUENCY, "10/f_c")),
    )
    title = f"{RING_LASER_PAPER}: figure 4, 2.3 (6)"
    return Item("lowpass-n", title, claims, Picture((panel,), columns=1))


def _ratio(before: Record, after: Record, model: NoiseModel, times: float) -> Claim:
    """Compare the deviations of the same noise at τ = times/f_c, by the scatter of parts of the record."""
    m = round(times / CUTOFF_FREQUENCY * SAMPLE_RATE)
    pairs = [
        [float(overlapping_allan(part, [m])[0]) for part in np.array_split(r.y[:, 0], RECORD_PIECES)]
        for r in (after, before)
    ]
    alone = float(filtered_share(np.array([m / SAMPLE_RATE]))[0])
    white = (
        model.white_density() ** 2
        * SAMPLE_RATE
        / m
        / float(model.allan_variance(np.array([m / SAMPLE_RATE]))[0])
    )
    expected = float(np.sqrt(1.0 - white * (1.0 - alone**2)))
    return judge(
        f"deviation with ÷ without filter at τ = {times:g}/f_c",
        "none: only for unfiltered data",
        estimate(np.array(pairs).T, lambda p: np.sqrt(p[:, 0].mean() / p[:, 1].mean())),
        claimed=None,
        derived=(expected - 0.003, expected + 0.003),
        why=f"expected {expected:.3f}: white noise, {100.0 * white:.0f} % of the variance here, falls to {alone:.3f}"
        + ("; N can be read from filtered data" if times >= 10.0 else ""),
    )


def _named(model: NoiseModel, seed: int) -> Claim:
    """Ask the diagnosis what a short filtered record contains."""
    text, paper = "cause that the diagnosis names", "the filter, not a Markov process"
    effects = (f"lowpass@gyro_x:cutoff={CUTOFF_FREQUENCY:g}",)
    records, _ = simulate(
        {"gyro_x": Channel(model)}, duration=600.0, rate=SAMPLE_RATE, seed=seed, effects=effects
    )
    found = diagnose(records).findings
    named = ", ".join(finding.cause for finding in found) or "nothing"
    if named != "lowpass":
        return Claim(
            text, paper, Coefficient(None, None, None, "", named), "not reproduced", f"named: {named}"
        )
    cutoff = found[0].parameters["cutoff"]
    return judge(
        text, paper, cutoff, claimed=CUTOFF_FREQUENCY, why=f"{named}, of {CUTOFF_FREQUENCY:g} Hz: as found"
    )


def _density(found: ChannelIdentification, true: float) -> Claim:
    term = found.term("white")
    assert term is not None
    return judge(
        "white noise identified from the filtered record ÷ true",
        "none: only for unfiltered data",
        scaled(term.coefficients["density"], 1.0 / true, "1"),
        claimed=None,
        derived=(0.985, 1.015),
        why="clusters that the filter reaches are left out by themselves; N of the longer ones is unbiased",
    )


def filtered_share(tau: FloatArray) -> FloatArray:
    """Return the Allan deviation of filtered white noise ÷ N/√τ."""
    constant = 1.0 / (2.0 * np.pi * CUTOFF_FREQUENCY)
    process = GaussMarkov(float(np.sqrt(0.5 / constant)), constant)
    return np.asarray(np.sqrt(process.allan_variance(tau) * tau))


def _peak(found: AllanCurve) -> float:
    """Return τ of the highest point of the curve beyond the first samples."""
    return float(found.tau[np.argmax(found.deviation()[:, 0])])


def _terms_text(found: ChannelIdentification) -> str:
    return "; ".join(found.warnings) or "the base terms suffice"


def _shown(found: AllanCurve, label: str, group: int) -> Curve:
    low, high = (limit[:, 0] / DEG_PER_HOUR for limit in found.interval())
    return Curve(found.tau, found.deviation()[:, 0] / DEG_PER_HOUR, label, "line", low, high, group)
