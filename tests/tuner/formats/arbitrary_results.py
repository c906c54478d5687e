"""Results of any content, as hypothesis draws them."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from models.filter_states import named_states
from models.noise import TERMS, GaussMarkov, NoiseModel, Term
from models.units import unit_of_samples
from tuner.types import (
    AllanCurve,
    Alternative,
    AppliedNoiseScale,
    ArmaFit,
    BoundUsed,
    Candidate,
    ChannelIdentification,
    ChannelNoise,
    Coefficient,
    Compensation,
    Correlogram,
    Enlargement,
    FilterConfig,
    Finding,
    Gain,
    GnssNoise,
    Identification,
    InitialUncertainty,
    NoiseScaleEstimate,
    Quantity,
    Spectrum,
    TermEstimate,
    Unexplained,
)
from tuner.types.consistency import Outage, Score
from tuner.types.number_ranges import largest_reading
from tuner.types.verdict import Explanation, ExplanationKind, Severity, Verdict, VerdictCode

texts = st.text(max_size=12)

units = texts.filter(lambda unit: largest_reading(unit) == math.inf)  # no sensor reads 1e300 m/s

numbers = st.floats(allow_nan=False, allow_infinity=False)

perhaps_undefined = st.floats(allow_infinity=False)

positive = st.floats(min_value=1e-300, max_value=1e300)

sampling_intervals = st.floats(min_value=1e-7, max_value=86400.0)

deviations = st.floats(min_value=1e-150, max_value=1e150)

intervals = st.tuples(numbers | st.just(-math.inf), numbers | st.just(math.inf))


def within(one: Coefficient) -> Coefficient:
    """Return a coefficient whose value is within its interval."""
    if one.value is None or one.interval is None:
        return one
    low, high = sorted(one.interval)
    return dataclasses.replace(one, value=min(max(one.value, low), high), interval=(low, high))


coefficients = st.builds(
    Coefficient, st.none() | numbers, st.none() | intervals, st.none() | numbers, units, st.none() | texts
).map(within)

known = coefficients.filter(lambda c: c.value is not None)

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=6,
)

plain_mappings = st.dictionaries(texts, plain, max_size=3)


def columns(m: int, values: st.SearchStrategy[float], k: int = 1) -> st.SearchStrategy[Any]:
    return hnp.arrays(np.float64, (m, k), elements=values)


@st.composite
def noise_terms(draw: st.DrawFn) -> Term:
    kind = TERMS[draw(st.sampled_from(["quantization", "white", "bias_instability", "gauss_markov"]))]
    return kind(**{name: draw(positive) for name in kind.PARAMETERS})


models = st.lists(noise_terms(), max_size=4).map(NoiseModel)


@st.composite
def estimates(draw: st.DrawFn) -> tuple[TermEstimate, ...]:
    names = draw(st.lists(st.sampled_from(["white", "ramp", "random_walk"]), unique=True))
    names += ["gauss_markov"] * draw(st.integers(0, 2))
    return tuple(TermEstimate(n, {p: draw(known) for p in TERMS[n].PARAMETERS}) for n in names)


@st.composite
def allan_curves(draw: st.DrawFn, axes: tuple[str, ...] = ("gyro_x",)) -> AllanCurve:
    m = draw(st.integers(0, 3))
    tau = draw(hnp.arrays(np.float64, m, elements=positive))
    variance = draw(columns(m, deviations, len(axes))) ** 2
    dof = draw(columns(m, st.floats(0.5, 1e6), len(axes)))
    notes = tuple(draw(st.lists(texts, max_size=2)))
    return AllanCurve(draw(texts), tau, variance, dof, "rad/s", axes, notes)


@st.composite
def dimensionless(draw: st.DrawFn) -> tuple[Coefficient, ...]:
    some = st.builds(Coefficient, st.none() | numbers, st.none() | intervals, st.none(), st.just("1")).map(
        within
    )
    return tuple(draw(st.lists(some, max_size=2)))


armas = st.builds(
    ArmaFit,
    ar=dimensionless(),
    ma=dimensionless(),
    variance=positive,
    interval=positive,
    unit=texts,
    criterion=texts,
    scores=st.dictionaries(st.tuples(st.integers(0, 3), st.integers(0, 3)), perhaps_undefined, max_size=2),
    white=st.booleans(),
    steps=st.lists(texts, max_size=2).map(tuple),
)


@st.composite
def channels(draw: st.DrawFn, axis: str) -> ChannelIdentification:
    names = tuple(draw(st.lists(texts, max_size=2)))
    curve = dataclasses.replace(draw(allan_curves()), axes=(axis,))
    return ChannelIdentification(
        axis=axis,
        unit="rad/s",
        interval=draw(positive | st.just(0.0)),
        span=draw(numbers),
        method=draw(texts),
        model=draw(models),
        terms=draw(estimates()),
        parameters=names,
        covariance=draw(columns(len(names), numbers, len(names))),
        mean=draw(coefficients),
        sigma_10s=draw(coefficients),
        minimum=draw(coefficients),
        floor=draw(coefficients),
        minimum_tau=draw(perhaps_undefined),
        allan=curve,
        candidates=tuple(
            draw(st.lists(st.builds(Candidate, st.lists(texts).map(tuple), numbers, texts), max_size=2))
        ),
        arma=draw(st.none() | armas),
        warnings=tuple(draw(st.lists(texts, max_size=2))),
    )


@st.composite
def identifications(draw: st.DrawFn) -> Identification:
    axes = sorted(draw(st.sets(st.sampled_from(["gyro_x", "accel_y", "wheel"]), max_size=2)))
    found = {axis: draw(channels(axis)) for axis in axes}
    return Identification(draw(plain_mappings), found, tuple(draw(st.lists(texts, max_size=2))))


quantities = st.builds(Quantity, st.sampled_from(["gyro_x", "gnss"]), texts.filter(bool))

codes = st.lists(texts, max_size=2).map(tuple)

enlargements = st.builds(Enlargement, quantities, numbers, texts, codes)

inflations = (
    st.builds(BoundUsed, quantities, numbers, texts)
    | enlargements
    | st.builds(AppliedNoiseScale, quantities, numbers, texts, st.none() | intervals, codes)
)

states = st.lists(st.builds(GaussMarkov, positive, positive), max_size=3).map(tuple)

sizes = st.floats(min_value=0.0, allow_nan=False, allow_infinity=False)

noise_sizes = st.floats(min_value=0.0, max_value=1e5)

noise_states = st.lists(
    st.builds(GaussMarkov, st.floats(min_value=1e-300, max_value=1e5), positive), max_size=3
).map(tuple)

triples = st.tuples(sizes, sizes, sizes)

reasons = st.dictionaries(texts, texts, max_size=3)

named_numbers = st.dictionaries(texts, numbers, max_size=2)


@st.composite
def channel_noises(draw: st.DrawFn) -> dict[str, ChannelNoise]:
    axes = draw(st.sets(st.sampled_from(["gyro_x", "gyro_z", "accel_y", "wheel"]), max_size=3))
    return {
        axis: ChannelNoise(
            axis,
            unit_of_samples(axis),
            draw(noise_sizes),
            draw(noise_states),
            draw(noise_sizes),
            draw(noise_sizes),
            draw(noise_sizes),
            draw(estimates()),
            draw(reasons),
        )
        for axis in sorted(axes)
    }


configs = st.builds(
    FilterConfig,
    texts,
    sampling_intervals,
    channel_noises(),
    st.builds(InitialUncertainty, sizes, sizes, sizes, sizes, reasons),
    st.none()
    | st.builds(
        GnssNoise, triples, st.none() | triples, sampling_intervals, positive, states, texts, positive
    ),
    st.lists(inflations, max_size=3).map(tuple),
    plain_mappings,
    codes,
    st.lists(plain_mappings, max_size=2).map(tuple),
    st.dictionaries(
        st.sampled_from(["time_offset.delay", "lever_arm.x", "lever_arm.z"]), numbers, max_size=2
    ).map(Compensation.parse),
    st.dictionaries(st.sampled_from(named_states()), sizes, max_size=2),
).flatmap(
    lambda config: st.builds(
        dataclasses.replace,
        st.just(config),
        time_constants=st.dictionaries(
            st.sampled_from(sorted(config.constants) or ["gravity"]), positive
        ).map(lambda known: {name: value for name, value in known.items() if name in config.constants}),
    )
)

pairs = st.tuples(perhaps_undefined, perhaps_undefined)

gains = st.builds(
    Gain,
    texts,
    numbers,
    numbers,
    perhaps_undefined,
    st.dictionaries(texts, pairs, max_size=2),
    st.dictionaries(texts, pairs, max_size=2),
)

by_name = st.dictionaries(texts, coefficients, max_size=2)

findings = st.builds(
    Finding,
    cause=texts,
    channels=codes,
    statistic=texts,
    value=perhaps_undefined,
    p_value=perhaps_undefined,
    parameters=by_name,
    text=texts,
    consequence=texts,
    extension=plain_mappings,
    gain=st.none() | gains,
    alternatives=st.lists(st.builds(Alternative, texts, numbers), max_size=2).map(tuple),
    inflations=st.lists(enlargements, max_size=2).map(tuple),
    by_channel=st.dictionaries(texts, by_name, max_size=2),
)

some_findings = st.lists(findings, max_size=2).map(tuple)

unexplained = st.lists(st.builds(Unexplained, texts, codes, perhaps_undefined), max_size=2).map(tuple)

models_by_axis = st.dictionaries(texts, models, max_size=2)

noise_scales = st.builds(
    NoiseScaleEstimate,
    texts,
    st.none() | st.floats(-1e100, 1e100),
    texts,
    coefficients,
    coefficients,
    codes,
    st.booleans(),
    texts,
)

positive_scores = st.floats(0.0, 1e100)

codes_of_verdicts = st.sampled_from(list(VerdictCode))


def scores(name: str) -> st.SearchStrategy[Score]:
    bands = st.tuples(positive_scores, positive_scores | st.just(math.inf))
    return st.builds(Score, st.just(name), positive_scores, st.integers(1, 30), positive_scores, bands)


def some_scores(*names: str) -> st.SearchStrategy[tuple[Score, ...]]:
    return st.tuples(*(scores(name) for name in names)) | st.just(())


explanations = st.builds(
    Explanation,
    st.sampled_from(list(ExplanationKind)),
    texts,
    numbers,
    intervals,
    numbers,
    st.none() | numbers,
)

explanations = explanations | st.builds(
    dataclasses.replace, explanations, equivalent=st.none() | explanations
)

ratios = numbers | st.integers(0, 9) | st.just(math.inf)

verdicts = st.builds(
    Verdict,
    codes_of_verdicts,
    st.sampled_from(list(Severity)),
    texts,
    st.dictionaries(texts, ratios | st.lists(numbers, max_size=3).map(tuple), max_size=2),
    st.lists(explanations, max_size=2).map(tuple),
)

outages = st.builds(
    Outage,
    positive_scores,
    numbers,
    numbers,
    scores("outage 60 s"),
    st.integers(0, 9),
    st.just((0.5, math.inf)) | st.just((0.9, 2.4)),
)


@st.composite
def curves(draw: st.DrawFn) -> AllanCurve | Spectrum | Correlogram:
    axes = ("gyro_x", "gyro_y")
    m = draw(st.integers(0, 3))
    x = draw(hnp.arrays(np.float64, m, elements=positive))
    kind = draw(st.sampled_from(["allan", "psd", "acf"]))
    if kind == "psd":
        dof = draw(hnp.arrays(np.float64, m, elements=st.floats(0.5, 1e6)))
        return Spectrum(x, draw(columns(m, deviations, 2)), dof, "rad/s", axes)
    if kind == "acf":
        return Correlogram("acf", x, draw(columns(m, st.floats(-1.0, 1.0), 2)), draw(positive), axes)
    return dataclasses.replace(draw(allan_curves(axes)), estimator="oadev")
