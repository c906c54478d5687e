"""How well the settings of each axis predict the record they came from, as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tuner.formats.documents import plain
from tuner.types import FilterConfig
from tuner.types.prediction import PredictedBlock


def predictions_json(predictions: Mapping[str, PredictedBlock]) -> dict[str, Any]:
    """Return the comparisons of all axes, the curves included; SI."""
    return {axis: prediction_json(found, curve=True) for axis, found in predictions.items()}


def settings_json(config: FilterConfig, predictions: Mapping[str, PredictedBlock]) -> dict[str, Any]:
    """Return the noise settings of every axis, SI, each with its comparison where the record was long enough."""
    return {
        axis: {
            "unit": noise.unit,
            "white_density": plain(noise.white_density),
            "markov": [{"sd": plain(s.sd), "time_constant": plain(s.time_constant)} for s in noise.markov],
            "random_walk_density": plain(noise.random_walk_density),
            "prediction": prediction_json(predictions[axis], curve=False) if axis in predictions else None,
        }
        for axis, noise in config.channels.items()
    }


def prediction_json(found: PredictedBlock, *, curve: bool) -> dict[str, Any]:
    """Return the comparison of one axis; SI.

    ``ratio`` is predicted ÷ measured Allan deviation, with the smallest and the largest over all cluster times that
    are judged; of forecasts it is true ÷ predicted rms error, with the bounds for a record of this length.
    ``bounded`` are errors of the integral (rad, m/s) that do not grow and that no state of a filter carries: the sd of
    quantization noise, and that of lines and resonances.
    """
    content: dict[str, Any] = {
        "source": found.source.value,
        "passes": found.passes,
        "ratio": {
            "lowest": plain(float(found.curve.ratio.min())),
            "highest": plain(float(found.curve.ratio.max())),
            "shortest_tau": plain(float(found.curve.tau[0])),
            "longest_tau": plain(float(found.curve.tau[-1])),
        },
        "forecasts": [
            {
                "seconds": f.horizon,
                "ratio": plain(f.ratio),
                "band": [plain(f.lowest), plain(f.highest)],
                "passes": f.passes,
            }
            for f in found.forecasts
        ],
        "bounded": {
            "quantization_sd": plain(found.block.increment_sd),
            "oscillation_sd": plain(found.block.oscillation_sd),
        },
    }
    if found.without:
        content["without"] = list(found.without)
    if found.rejected is not None:
        content["rejected"] = {
            "ratio": plain(found.rejected.worst),
            "tau": plain(found.rejected.worst_tau),
            "forecasts": [{"seconds": f.horizon, "ratio": plain(f.ratio)} for f in found.rejected_forecasts],
        }
    if curve:
        predicted = found.block.allan_variance(found.measured.tau, found.measured.interval)
        content["allan"] = {
            "tau": plain(found.measured.tau),
            "measured": plain(np.sqrt(found.measured.variance)),
            "predicted": plain(np.sqrt(predicted)),
        }
    return content
