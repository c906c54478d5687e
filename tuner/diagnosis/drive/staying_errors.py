"""Errors of a receiver that stay for seconds to minutes, as states of the filter.

A receiver smooths its fixes, and reflected signals move them while the vehicle stays among the same walls: ten fixes a
second then err alike, and a filter that takes each for new trusts their mean, or the integral of velocities that err
by centimetres a second, too much. One Gauss–Markov process of the positions and one of the velocities (the state
``correlated_velocity``) let it follow the fixes. What a configuration has of them is multiplied by factors; what it has
not begins at the sds that the receiver reports, which are of the right order for its whole error.

Errors that outlast a drive move no innovation of it. What a receiver states beyond what the settings hold is their
variance (`with_stated_rest`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.filter_states.built_in import CORRELATED_VELOCITY
from models.noise import GaussMarkov
from tuner.limits import SHOWN_CHANGE
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE, fix_sd_model
from tuner.types import FilterConfig
from tuner.types.records import Gnss

POSITION, POSITION_TIME = "position_stays", "position_stays_time"
VELOCITY, VELOCITY_TIME = "velocity_stays", "velocity_stays_time"
STAYING = (POSITION, POSITION_TIME, VELOCITY, VELOCITY_TIME)
"""Factors on sd and time constant of the two processes."""
SET = "set by trials on withheld fixes, not measured: a state for"
"""What is said of every figure that trials choose."""
OPEN = "figures of its state are ASSUMED, the likeliest: the drive does not determine them"
"""What is said of a cause whose figures a drive leaves open."""
FIRST_POSITION_TIME = 30.0
"""Time constant with which a position error that stays begins, s: between the smoothing of a receiver, seconds, and the
passing of satellites and walls, minutes."""
DOWN_OVER_HORIZONTAL = 1.5
"""Vertical ÷ horizontal error of positions under open sky: the usual ratio of dilutions of precision."""
UNKNOWN_VELOCITY_SD = 0.1
"""Sd of velocities of a receiver that reports none, m/s: that of Doppler measurements."""


def with_staying_errors(config: FilterConfig, factors: Mapping[str, float]) -> FilterConfig:
    """Return a configuration whose states for errors that last are multiplied by factors.

    The names of the factors are those of `STAYING`. A state that the configuration lacks begins with the factor times
    what the receiver reports.
    """
    gnss = config.gnss
    if gnss is None:
        return config
    constants, times = dict(config.constants), dict(config.time_constants)
    if POSITION in factors:
        typical = float(np.sqrt(np.mean(np.square(gnss.position_sd[:2]))))
        first, *others = gnss.correlated or (GaussMarkov(typical, FIRST_POSITION_TIME),)
        state = GaussMarkov(
            first.sd * factors[POSITION], first.time_constant * factors.get(POSITION_TIME, 1.0)
        )
        down = gnss.correlated_down if gnss.correlated else DOWN_OVER_HORIZONTAL
        gnss = replace(gnss, correlated=(state, *others), correlated_down=down)
    if VELOCITY in factors:
        reported = gnss.velocity_sd or (UNKNOWN_VELOCITY_SD, UNKNOWN_VELOCITY_SD, UNKNOWN_VELOCITY_SD)
        typical = float(np.sqrt(np.mean(np.square(reported[:2]))))
        name = CORRELATED_VELOCITY.name
        constants[name] = constants.get(name, typical) * factors[VELOCITY]
        times[name] = times.get(name, CORRELATED_VELOCITY.time_constant) * factors.get(VELOCITY_TIME, 1.0)
    return replace(config, gnss=gnss, constants=constants, time_constants=times)


def with_stated_rest(config: FilterConfig, gnss: Gnss) -> FilterConfig:
    """Return a configuration with one more state for what fixes state of their positions and the settings do not hold.

    It lasts as long as the drive, whose innovations do not show it; unknown is not zero. Where it would add less than
    `SHOWN_CHANGE` to the horizontal sd there is none.
    """
    reported = gnss.position_sd
    there = (reported > 0.0).all(axis=1)
    if config.gnss is None or not there.any():
        return config
    white = fix_sd_model(config.compensation.of(GNSS_NOISE_SCALE), "position").sds(reported, gnss.solution)
    own, down = config.gnss.correlated, config.gnss.correlated_down
    lasting = sum(one.sd**2 for one in own) * np.array([1.0, 1.0, down**2])
    stated, used = (np.median(sds[there] ** 2, axis=0) for sds in (reported, white))
    rest = np.maximum(stated - used - lasting, 0.0)
    level = math.sqrt(np.mean(rest[:2]))
    if np.sum(stated[:2]) <= (1.0 + SHOWN_CHANGE) ** 2 * np.sum((used + lasting)[:2]):
        return config
    state = GaussMarkov(level, float(np.ptp(gnss.t)))
    ratio = math.sqrt((lasting + rest)[2] / (lasting[0] + level**2))
    text = f"ASSUMED: {level:.2g} m of what the receiver states of its positions lasts as long as this drive"
    return replace(
        config,
        gnss=replace(config.gnss, correlated=(*own, state), correlated_down=ratio),
        notes=(*config.notes, text),
    )


def described(config: FilterConfig, factors: Mapping[str, float]) -> tuple[str, ...]:
    """Return in words which states a configuration with these factors has for errors that stay: set, not measured.

    What predicts withheld fixes best may last for minutes where the errors of the fixes last for seconds: it stands for
    all of them, and for what the filter lacks.
    """
    notes = []
    if POSITION in factors and config.gnss is not None and config.gnss.correlated:
        state = config.gnss.correlated[0]
        notes.append(f"{SET} errors of positions: {state.sd:.2g} m, {state.time_constant:.0f} s")
    if VELOCITY in factors:
        sd, time = (values[CORRELATED_VELOCITY.name] for values in (config.constants, config.time_constants))
        notes.append(f"{SET} errors of velocities: {sd:.2g} m/s, {time:.0f} s")
    return tuple(notes)
