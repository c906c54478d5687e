"""One axis: from identified noise terms to the settings of the filter, with the handling of every term.

===================  ======================================================================================
term                 handling
===================  ======================================================================================
white                drives angle or velocity with N²
low_pass_white       white at its density
quantization         kept out of N: its angle (velocity) error stays within Q however long one waits
bias_instability     Gauss–Markov states by the chosen rule (`tuner.synthesis.bias_states`)
gauss_markov         one state each; white noise where its time constant is shorter than the sampling interval
random_walk          drives the bias with K²
sinusoid             slow: one Gauss–Markov state; fast: a bound on the angle (velocity) it can reach
ramp                 a state of constant bias rate where it matters within the horizon, else a bound
arma                 shaping states offered, not added: they describe the same noise once more
any other            one Gauss–Markov state whose spectrum lies above the term's (`tuner.synthesis.bias_states`)
===================  ======================================================================================

A term the data only bound enters with half of its 95 % upper limit, white noise that a quantizer hides with all of it,
as motion shows it. The rule ``bound`` takes upper limits throughout, the ladder for flicker, and `bounding_state` for
identified Gauss–Markov terms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from models.noise import (
    TERMS,
    BiasInstability,
    GaussMarkov,
    LowPassWhite,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    White,
)
from models.noise.bias_instability import ALLAN_FLOOR
from models.noise.bounded_white_noise import BOUNDED_SHARE, largest_white_density
from tuner.synthesis.bias_states import BOUND, RULES, FlickerView, bounding_state, spectrum_bound
from tuner.synthesis.error_growth import structure_function
from tuner.types import (
    ArmaFit,
    BoundUsed,
    ChannelIdentification,
    ChannelNoise,
    Enlargement,
    Inflation,
    Quantity,
    TermEstimate,
)
from tuner.types.coefficient import HIDDEN

SLOW_PERIOD = 10.0
"""A sinusoid slower than this, s, is a bias to the filter; a faster one averages out."""


@dataclass(frozen=True)
class _Task:
    """One axis and how it is to be modelled; `white` is known once the white terms are done."""

    channel: ChannelIdentification
    rule: str
    horizon: float
    white: float = 0.0


@dataclass(frozen=True)
class _Share:
    """What one term contributes to the filter: its handling in words, and figures (variances add)."""

    handling: str
    inflations: tuple[Inflation, ...] = ()
    white_variance: float = 0.0
    walk_variance: float = 0.0
    markov: tuple[GaussMarkov, ...] = ()


def channel_noise(
    channel: ChannelIdentification, *, rule: str, horizon: float, constant_sd: float
) -> tuple[ChannelNoise, tuple[Inflation, ...]]:
    """Choose the noise settings of one axis of the filter.

    Parameters
    ----------
    channel : ChannelIdentification
        Identified terms.
    rule : str
        A key of `RULES`, or ``bound``.
    horizon : float
        Longest time the filter must predict, s.
    constant_sd : float
        Prior sd of the turn-on constant, unit.

    Returns
    -------
    noise : ChannelNoise
        Positive white density; every term has its handling.
    inflations : tuple of Inflation
        Every figure that is not the estimate itself.
    """
    task = _Task(channel, rule, horizon)
    terms = [term for term in channel.terms if _has_size(term)]
    empty = [(term.name, _Share(_WITHOUT_SIZE)) for term in channel.terms if not _has_size(term)]
    white = [(t.name, _white(task, t)) for t in terms if t.name in _WHITE_TERMS]
    fast = [t for t in terms if _is_over_within_a_sample(channel, t)]
    white += [(t.name, _white_of_fast_process(task, t)) for t in fast]
    if not any(share.white_variance for _, share in white):
        white.append((White.name, _white_from_curve(channel)))
    density = math.sqrt(sum(share.white_variance for _, share in white))
    task = replace(task, white=density)
    slow = [
        (t.name, _SLOW_TERMS.get(t.name, _other)(task, t))
        for t in terms
        if t.name not in _WHITE_TERMS and t.name != Ramp.name and t not in fast
    ]
    shares = empty + white + slow
    noise = ChannelNoise(
        channel.axis,
        channel.unit,
        white_density=density,
        markov=tuple(state for _, share in slow for state in share.markov),
        random_walk_density=math.sqrt(sum(share.walk_variance for _, share in slow)),
        constant_sd=constant_sd,
        identified=channel.terms,
    )
    ramp = next((term for term in terms if term.name == Ramp.name), None)
    if ramp is not None:
        share, rate = _ramp(task, ramp, wander=math.sqrt(structure_function(noise, horizon)))
        shares.append((Ramp.name, share))
        noise = replace(noise, ramp_sd=rate)
    if channel.arma is not None:
        shares.append(("arma", _Share(_arma_handling(channel.arma))))
    handling: dict[str, str] = {}
    for name, share in shares:
        handling[name] = f"{handling[name]}; {share.handling}" if name in handling else share.handling
    return replace(noise, handling=handling), tuple(i for _, share in shares for i in share.inflations)


def _has_size(term: TermEstimate) -> bool:
    """Tell whether the amplitude of a term has a positive value or limit."""
    amplitude = next(iter(term.coefficients.values()))
    return bool(amplitude.value or amplitude.upper)


def _figure(task: _Task, term: TermEstimate, name: str) -> tuple[float, tuple[Inflation, ...]]:
    """Return the figure the filter takes for a coefficient, and how it differs from the estimate."""
    coefficient = term.coefficients[name]
    quantity = Quantity(task.channel.axis, f"{term.name}.{name}")
    if coefficient.value is None:
        reason = coefficient.reason or "no value in the data"
        whole = term.name == White.name and reason.startswith(HIDDEN)
        share, part = (1.0, "the whole") if whole else (BOUNDED_SHARE, "half of the")
        why = f"bounded: {part} 95 % upper limit ({reason})"
        return share * (coefficient.upper or 0.0), (BoundUsed(quantity, share, why),)
    value = abs(coefficient.value)
    if task.rule == BOUND and coefficient.interval is not None and value > 0.0:
        top = max(abs(x) for x in coefficient.interval)
        return top, (Enlargement(quantity, top / value, "rule bound: upper end of the 95 % interval"),)
    return value, ()


def _white(task: _Task, term: TermEstimate) -> _Share:
    density, inflations = _figure(task, term, "density")
    state = "angle" if task.channel.unit == "rad/s" else "velocity"
    return _Share(f"drives the {state} with N² = {density**2:.4g}", inflations, white_variance=density**2)


def _is_over_within_a_sample(channel: ChannelIdentification, term: TermEstimate) -> bool:
    time_constant = term.coefficients["time_constant"].value if term.name == GaussMarkov.name else None
    return time_constant is not None and time_constant < channel.interval


def _white_of_fast_process(task: _Task, term: TermEstimate) -> _Share:
    """Return the density of a Gauss–Markov process without memory from sample to sample: of its samples at f = 0."""
    sd, inflations = _figure(task, term, "sd")
    time_constant, _ = _figure(task, term, "time_constant")
    density = float(GaussMarkov(sd, time_constant).psd(0.0, interval=task.channel.interval))
    handling = f"white noise, N² = {density:.4g}: its time constant is shorter than the sampling interval"
    return _Share(handling, inflations, white_variance=density)


def _white_from_curve(channel: ChannelIdentification) -> _Share:
    """Bound white noise by the Allan curve where no term says anything: N ≤ σ(τ) √τ at every τ."""
    density = BOUNDED_SHARE * largest_white_density(channel.allan.tau, channel.allan.variance[:, 0])
    why = "bounded: half of the smallest σ(τ)√τ of the Allan curve, as no white term was identified"
    inflation = BoundUsed(Quantity(channel.axis, "white.density"), BOUNDED_SHARE, why)
    return _Share(why, (inflation,), white_variance=density**2)


def _quantization(task: _Task, term: TermEstimate) -> _Share:
    increment, _ = _figure(task, term, "increment_sd")
    unit = "rad" if task.channel.unit == "rad/s" else "m/s"
    handling = (
        f"kept out of the white density: the integral errs by {increment:.4g} {unit}, which does not grow"
    )
    return _Share(handling)


def _flicker(task: _Task, term: TermEstimate) -> _Share:
    channel = task.channel
    level, inflations = _figure(task, term, "level")
    minimum = channel.minimum.value or channel.minimum.upper or ALLAN_FLOOR * level
    chosen = RULES["ladder" if task.rule == BOUND else task.rule]
    view = FlickerView(level, task.white, minimum, channel.minimum_tau, task.horizon, channel.interval)
    states = chosen.states(view)
    times = ", ".join(f"{state.time_constant:.4g}" for state in states)
    return _Share(f"{chosen.describe()}; time constants {times} s", inflations, markov=states)


def _gauss_markov(task: _Task, term: TermEstimate) -> _Share:
    sd, time_constant = term.coefficients["sd"], term.coefficients["time_constant"]
    if task.rule == BOUND and sd.value and sd.interval and time_constant.interval:
        state = bounding_state(sd.interval, time_constant.interval)
        why = "rule bound: spectrum above every spectrum within the intervals of sd and time constant"
        inflations: tuple[Inflation, ...] = (
            Enlargement(Quantity(task.channel.axis, "gauss_markov.sd"), state.sd / sd.value, why),
        )
    else:
        level, inflations = _figure(task, term, "sd")
        state = GaussMarkov(level, time_constant.value or time_constant.upper or task.horizon)
    return _Share(
        f"one state: sd {state.sd:.4g} {task.channel.unit}, {state.time_constant:.4g} s",
        inflations,
        markov=(state,),
    )


def _random_walk(task: _Task, term: TermEstimate) -> _Share:
    density, inflations = _figure(task, term, "density")
    return _Share(f"drives the bias with K² = {density**2:.4g}", inflations, walk_variance=density**2)


def _sinusoid(task: _Task, term: TermEstimate) -> _Share:
    amplitude, inflations = _figure(task, term, "amplitude")
    frequency = term.coefficients["frequency"].value
    if frequency is not None and 1.0 / frequency >= SLOW_PERIOD:
        state = GaussMarkov(amplitude / math.sqrt(2.0), 1.0 / (2.0 * math.pi * frequency))
        handling = f"slow line, one state: sd {state.sd:.4g} {task.channel.unit}, {state.time_constant:.4g} s"
        return _Share(handling, inflations, markov=(state,))
    return _Share("fast line: no state, as its integral stays bounded; to be removed at its source")


def _other(task: _Task, term: TermEstimate) -> _Share:
    """Give a term without a rule of its own the Gauss–Markov state that bounds its spectrum, or say why not."""
    axis, unit = task.channel.axis, task.channel.unit
    figures = {name: _figure(task, term, name) for name in term.coefficients}
    inflations = tuple(one for _, records in figures.values() for one in records)
    if missing := [name for name, (value, _) in figures.items() if not value]:
        return _Share(f"left out of the filter: no value of {', '.join(missing)} and no limit")
    try:
        noise = TERMS[term.name](**{name: value for name, (value, _) in figures.items()})
        state = spectrum_bound(noise)
    except (TypeError, ValueError) as error:
        return _Share(f"left out of the filter: {error}")
    ratio = state.sd / math.sqrt(float(noise.autocovariance(0.0)))
    reason = "first-order state in place of the term: its spectrum lies above the term's at every frequency"
    larger = Enlargement(Quantity(axis, f"{term.name}.{next(iter(figures))}"), ratio, reason)
    return _Share(
        f"one state that bounds its spectrum: sd {state.sd:.4g} {unit} ({ratio:.3g} times the term's), "
        f"{state.time_constant:.4g} s",
        (*inflations, larger),
        markov=(state,),
    )


def _ramp(task: _Task, term: TermEstimate, *, wander: float) -> tuple[_Share, float]:
    """Give the ramp a state where the data contain it, or where half its limit outruns all else."""
    rate, inflations = _figure(task, term, "rate")
    unit = task.channel.unit
    reach = rate * task.horizon
    if term.present or reach > wander:
        return _Share(f"a state of constant bias rate, prior sd {rate:.4g} {unit}/s", inflations), rate
    handling = (
        f"no state: at half its limit it reaches {reach:.4g} {unit} in {task.horizon:g} s, "
        f"less than the {wander:.4g} the other bias states wander"
    )
    return _Share(handling), 0.0


def _arma_handling(fit: ArmaFit) -> str:
    p, q = fit.order
    if fit.white:
        return f"ARMA({p},{q}) is not distinguishable from white noise: nothing to add"
    return (
        f"ARMA({p},{q}) describes the noise of the other terms a second time: "
        "offered as shaping states (tuner.synthesis.shaping_states), not added"
    )


_WITHOUT_SIZE = "left out: the identification gives neither a value nor a limit"
_WHITE_TERMS = frozenset({White.name, LowPassWhite.name})
_SLOW_TERMS: Mapping[str, Callable[[_Task, TermEstimate], _Share]] = {
    Quantization.name: _quantization,
    BiasInstability.name: _flicker,
    GaussMarkov.name: _gauss_markov,
    RandomWalk.name: _random_walk,
    Sinusoid.name: _sinusoid,
}
"""Terms with a rule of their own; every other term is handled by `_other`."""
