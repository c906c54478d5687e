"""A line whose amplitude swells is one finding with the frequency and depth of that; three other lines are three."""

from __future__ import annotations

import numpy as np

from models.effects.static.spectral import Line
from tuner.diagnosis import diagnose
from tuner.types.records import Record

RATE, COUNT = 100.0, 30_000
TIME = np.arange(COUNT) / RATE


def found(*lines: Line, swing: float = 0.0) -> list:
    """Return the findings of white noise with lines at times that swing by a part of 7.3 Hz, rad."""
    rng = np.random.default_rng(61)
    time = TIME + swing / (2.0 * np.pi * 7.3) * np.sin(0.5 * np.pi * TIME)
    y = rng.standard_normal(COUNT) + sum(line.signal(time) for line in lines)
    record = Record("gyro", TIME, 1e-3 * y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE)
    return [f for f in diagnose(record).findings if f.cause == "line"]


def test_a_line_that_swells_is_one_finding_with_its_modulation():
    """Carrier of 0.3 sd at 7.3 Hz that swells by 60 % with a period of 4 s: the intervals hold all four numbers."""
    (line,) = found(Line(7.3, 0.3, 1.0, 0.25, 0.6))
    truth = {"frequency": 7.3, "amplitude": 0.3e-3, "modulation_frequency": 0.25, "modulation_depth": 0.6}
    for name, value in truth.items():
        low, high = line.parameters[name].interval
        assert low - 0.5 * (high - low) < value < high + 0.5 * (high - low), name
        assert high - low < 0.5 * value
    assert line.gain.nats > 250.0


def test_lines_that_do_not_lie_evenly_or_differ_in_size_stay_apart():
    """One ordinate off; amplitudes of 0.06 and 0.10 sd, three of their errors apart; harmonics 1 : 2 : 3 in phase."""
    off = 1.0 / TIME[-1]
    assert len(found(Line(7.3, 0.3, 1.0), Line(7.05, 0.1, 1.0), Line(7.55 + off, 0.1, 1.0))) == 3
    unlike = Line(7.3, 0.3, 1.0), Line(7.05, 0.06, 1.0), Line(7.55, 0.1, 1.0)
    harmonics = Line(10.0, 0.1, 1.0), Line(20.0, 0.3, 1.0), Line(30.0, 0.1, 1.0)
    assert len(found(*unlike, *harmonics)) == 6


def test_a_frequency_that_swings_is_no_amplitude_that_swells():
    """The phase of the carrier swings by 0.6 rad with a period of 4 s: as large sidebands, of other phases."""
    assert len(found(Line(7.3, 0.3, 1.0), swing=0.6)) == 3
