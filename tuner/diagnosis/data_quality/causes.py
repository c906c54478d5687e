"""Causes that lie in the samples themselves: repeated and frozen ones, time stamps, saturation, the quantizer."""

from __future__ import annotations

from models.effects.static import sampling
from tuner.diagnosis.cause import Cause


class Duplicates(Cause):
    """Readings that repeat the one before; tested as single repetitions and as stretches that are frozen."""

    cause = "duplicates"
    effect = sampling.Duplicates
    group = "samples"
    tests = 2
    meaning = "readings repeat the one before: the register is polled faster than it is filled"
    consequence = (
        "drop the repetitions: the true rate is lower, "
        "and the white density read from all samples is too small"
    )
    view = "values"


class Frozen(Duplicates):
    """Readings that stay the same for long."""

    meaning = "one reading is given over and over: the register, or the link to it, was stuck"
    consequence = (
        "leave these stretches out, as tune does with long ones: a filter that takes them for measurements assumes a "
        "sensor without noise"
    )


class RepeatedPackets(Cause):
    """Packets of samples that come twice in place of the next."""

    cause = "repeated_packets"
    group = "samples"
    meaning = "packets of samples come twice, in place of the next"
    consequence = "drop the copies: a filter that takes them for measurements counts their noise twice"
    view = "values"


class Interpolated(Cause):
    """Samples that lie on lines between their neighbours."""

    cause = "interpolated"
    group = "samples"
    meaning = "samples lie on lines between their neighbours: the log was put on a higher rate"
    consequence = (
        "log the samples as they come: density, spectrum and law of these are those of the interpolation"
    )
    view = "values"


class Timing(Cause):
    """Time stamps of an uneven clock."""

    cause = "timing"
    effect = sampling.Timing
    group = "samples"
    shares = 0
    meaning = "the time stamps are not those of an even clock"
    consequence = "put the samples on an even grid, or let the filter use their own times"
    view = "time stamps"


class ErrorCode(Cause):
    """Rows that hold a constant in place of a measurement."""

    cause = "error_code"
    group = "samples"
    shares = 0
    meaning = (
        "rows hold one constant in place of a measurement: samples were lost, or the number is an error code"
    )
    consequence = (
        "leave these rows out, or mend the driver: a filter takes each of them for a measurement; tune and identify do "
        "without them"
    )
    view = "values"


class Clipping(Cause):
    """Samples that end at rails."""

    cause = "clipping"
    effect = sampling.Clipping
    group = "samples"
    meaning = "the samples end at rails"
    consequence = "a wider range, or a likelihood that knows the rails"
    view = "values"


class Overflow(Cause):
    """Samples that wrap around the range of a register."""

    cause = "overflow"
    effect = sampling.Overflow
    group = "samples"
    meaning = "a register is too small: samples beyond one end of its range come out at the other end"
    consequence = (
        "add or subtract the range where samples jump by about that much, or use a wider register: "
        "a filter takes each of them for an error of the size of the range; tune identifies and sets the noise of "
        "samples put back, identify that of samples as they are"
    )
    view = "values"


class Quantizer(Cause):
    """A quantizer that is coarse beside the noise."""

    cause = "lattice"
    effect = sampling.Quantizer
    group = "samples"
    meaning = "the codes are too coarse for the noise to blur them, differ in width, or some never come"
    consequence = "add step²/12 to the variance of a sample; the mean between two codes is not to be trusted"
    view = "values"
