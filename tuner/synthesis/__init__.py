"""Synthesis: from the noise of a sensor to the settings of a filter.

::

    config = synthesize(identification, horizon=1000.0, gnss=load_gnss("rtk"))
"""

from __future__ import annotations

from tuner.synthesis.bias_states import BOUND, RULES, bounding_state
from tuner.synthesis.error_growth import structure_function
from tuner.synthesis.initial_covariance import turn_on_spread
from tuner.synthesis.process_noise import axis_states, axis_system, shaping_states
from tuner.synthesis.projection import Aiding, errors_by_prediction, projected
from tuner.synthesis.synthesize import inflate, synthesize

__all__ = [
    "BOUND",
    "RULES",
    "Aiding",
    "axis_states",
    "axis_system",
    "bounding_state",
    "errors_by_prediction",
    "inflate",
    "projected",
    "shaping_states",
    "structure_function",
    "synthesize",
    "turn_on_spread",
]
