"""Differences of two states in words: one line for what axes of a sensor have alike."""

from __future__ import annotations

from tuner.diagnosis.static.compare_logs import NOISE, Difference, StateComparison
from tuner.report.state_lines import state_lines
from tuner.types import Coefficient, Diagnosis


def line(axis: str, frequency: float, size: float) -> Difference:
    place = {"frequency": Coefficient.known(frequency, frequency - 0.01, frequency + 0.01, "Hz")}
    amplitude = Coefficient.known(size, 0.9 * size, 1.1 * size, "m/s^2")
    return Difference(axis, "line", "amplitude", None, amplitude, "", place)


def noise(axis: str, before: float, after: float) -> Difference:
    known = [Coefficient.known(x, 0.9 * x, 1.1 * x, "m/s^2/√Hz") for x in (before, after)]
    return Difference(axis, NOISE, "white.density", *known, f"channels.{axis}.white_density")


def test_axes_that_differ_alike_share_a_line_with_place_size_and_entry():
    found = [line("accel_x", 37.3, 0.1), noise("accel_x", 1e-3, 2e-3), line("accel_y", 37.305, 0.2)]
    found += [line("accel_z", 61.0, 0.1), noise("accel_z", 1e-3, 3e-3)]
    head, *lines = state_lines(StateComparison(tuple(found), Diagnosis(()), Diagnosis(())))
    assert head.startswith("What differs, by cause")
    assert len(lines) == 3
    assert lines[0].startswith("  line (frequency 37.305 ± 0.010 Hz) in accel x y: new, amplitude")
    assert ", most in accel y; moves no entry" in lines[0]
    assert lines[1].startswith("  line (frequency 61.000 ±")
    assert "white density in accel x z: × 3" in lines[2]
    assert lines[2].endswith("most in accel z; moves white_density of accel x z")
