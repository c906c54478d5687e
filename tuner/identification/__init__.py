"""What noise is in a sensor: a sum of terms with intervals, from samples at rest.

`identify` answers for all channels of a log, `identify_channel` for one. The parts: `likelihood`, `allan_leastsquares`
and `slopes` give coefficients; `selection` chooses the terms; `arma_preprocess` and `arma` make the time-series model;
`mean_and_earth_rate` judges the means; `several_logs` pools several logs of one sensor.
"""

from __future__ import annotations

from tuner.identification.identify import identify
from tuner.identification.identify_channel import METHODS, identify_channel

__all__ = ["METHODS", "identify", "identify_channel"]
