"""Correlated errors of the velocity fixes: a Gauss–Markov process beside their white part.

A receiver smooths its velocities, or derives them from positions that reflected signals move: for minutes they err
alike by centimetres a second, which a filter that takes each for new integrates. The test is that of correlated
positions (`correlated_gnss`) with the rows of positions and velocities exchanged, which the model does not tell apart;
what is found becomes the state ``correlated_velocity`` of the filter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.filter_states.built_in import CORRELATED_VELOCITY
from tuner.diagnosis.drive.cause_test import CauseTest, not_significant
from tuner.diagnosis.drive.causes.base import NoiseCause
from tuner.diagnosis.drive.causes.correlated_gnss import CORRELATED_GNSS, correlated_gnss
from tuner.diagnosis.drive.hypothesis import FilterRun, Hypothesis
from tuner.linear_run.likelihood import NoiseHypothesis, evaluate
from tuner.types import Coefficient, FilterConfig

CAUSE_CODE = "correlated_velocity"
"""Code of the cause."""
EXCHANGED = [3, 4, 5, 0, 1, 2]
"""Rows of a fix, its velocity first."""
STATE = CORRELATED_VELOCITY.name


def exchanged(noise: NoiseHypothesis) -> NoiseHypothesis:
    """Return a noise hypothesis with the rows of positions and velocities exchanged."""
    run, rows = noise.linearized, EXCHANGED
    run = replace(
        run,
        H=np.ascontiguousarray(run.H[:, rows]),
        innovation=np.ascontiguousarray(run.innovation[:, rows]),
        sd=np.ascontiguousarray(run.sd[:, rows]),
        reported_sd=run.reported_sd[:, rows],
        available=np.ascontiguousarray(run.available[:, rows]),
        used=np.ascontiguousarray(run.used[:, rows]),
        D=np.ascontiguousarray(run.D[:, rows]),
    )
    return replace(
        noise,
        linearized=run,
        sd=np.ascontiguousarray(noise.sd[:, rows]),
        rows=np.ascontiguousarray(noise.rows[:, rows]),
    )


def correlated_velocity(noise: NoiseHypothesis) -> CauseTest:
    """Test velocity fixes for a correlated error; the noise of the outcome has the rows of a fix exchanged."""
    turned = exchanged(noise)
    found = correlated_gnss(turned, evaluate(turned))
    result = replace(found.result, cause=CAUSE_CODE, name="likelihood ratio of correlated velocity errors")
    return replace(found, result=result, describe=lambda: _in_velocity_units(found.describe()))


def _in_velocity_units(found: Mapping[str, Coefficient]) -> dict[str, Coefficient]:
    return {name: one if name == "time_constant" else replace(one, unit="m/s") for name, one in found.items()}


def without_correlated_velocity(config: FilterConfig) -> FilterConfig:
    """Return a configuration without the state of velocities that err for a while."""
    constants = {name: sd for name, sd in config.constants.items() if name != STATE}
    times = {name: time for name, time in config.time_constants.items() if name != STATE}
    return replace(config, constants=constants, time_constants=times)


class CorrelatedVelocity(NoiseCause):
    """Velocity errors of the receiver that are correlated in time."""

    cause = CAUSE_CODE
    channels = ("gnss",)
    meaning = "errors of the velocities stay from fix to fix, for some {time_constant}, with sd {sd}"
    consequence = "the state correlated_velocity of the filter beside the white error"
    joins = "states"
    rivals = (CORRELATED_GNSS,)
    covers = ("vertical_velocity",)
    view = "slow means"

    @classmethod
    def test(cls, run: FilterRun, noise: NoiseHypothesis, threshold: float) -> tuple[CauseTest, ...]:  # noqa: ARG003
        """Test for a Gauss–Markov error of the velocity fixes; none where the filter has its state."""
        if STATE in run.hypothesis.config.constants:
            title = "likelihood ratio of correlated velocity errors"
            return (not_significant(CAUSE_CODE, noise, 1.0, 0.0, title),)
        return (correlated_velocity(noise),)

    @classmethod
    def accepted(cls, run: FilterRun, test: CauseTest) -> Hypothesis:
        """Return the hypothesis of a run with the state, and with the white parts that were fitted beside it."""
        found = test.noise
        white = replace(exchanged(found), linearized=run.linearized, markov_sd=np.zeros(3))
        then = run.hypothesis.with_noise(run.linearized, replace(test, noise=white))
        sd = float(np.sqrt(np.mean(found.markov_sd[:2] ** 2))) or float(found.markov_sd[2])
        config = replace(
            then.config,
            constants={**then.config.constants, STATE: sd},
            time_constants={**then.config.time_constants, STATE: float(found.markov_time)},
        )
        return replace(then, config=config)

    @classmethod
    def without(cls, final: Hypothesis, base: Hypothesis) -> Hypothesis:
        """Return the final hypothesis with the state of the first one, if it has it."""
        config, first = without_correlated_velocity(final.config), base.config
        if STATE in first.constants:
            config = replace(
                config,
                constants={**config.constants, STATE: first.constants[STATE]},
                time_constants={**config.time_constants, **first.time_constants},
            )
        return replace(final, config=config)
