"""Words that several answers share, and the answer of a configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tuner.formats.assumption_words import assumed_text
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, stamp
from tuner.formats.grouping import gathered
from tuner.limits import LOST_SHARE
from tuner.report.document import Document, document
from tuner.report.noise_table import legend, states_tables
from tuner.types import ChannelIdentification, FilterConfig, Identification

SHORT_SPAN = 600.0
"""Time up to which a reader counts seconds, s."""
MIN_LEFT_OUT = 1.0
"""Time that a log is longer than what is used of it, s, from which its reader is to know."""
WITHOUT_WORDS = ("likelihood", "datasheet")
"""Methods that the line of a recording does not name: the usual one, and a sheet beside it, which the verdict names."""


def settings_answer(config: FilterConfig) -> Document:
    """Return the settings of a filter, with what the signs among them mean."""
    tables = states_tables(config)
    return document([f"{config.name}: settings of a filter", *tables, legend(*tables)])


def span_text(seconds: float) -> str:
    """Return a time in hours, in seconds where it is short."""
    if seconds >= SHORT_SPAN:
        return f"{digits(seconds / 3600.0)} h"
    return f"{seconds:.0f} s" if seconds >= 10.0 else f"{digits(seconds, 2)} s"


def recording_text(found: Identification, rest: str = "") -> str:
    """Return length and rate of what noise rests on, of which part of a log, and what was assumed of it."""

    def said(c: ChannelIdentification) -> str:
        how = "" if c.method in WITHOUT_WORDS else f", by {c.method}"
        part = used_part(found.source, c.axis)
        return f"{span_text(c.span)}{rest} at {digits(1.0 / c.interval)} Hz{part}{how}"

    channels = found.channels.values()
    spans = gathered((said(c) if c.span > 0.0 else "stated, not measured", c.axis) for c in channels)
    parts = [text if len(spans) == 1 else f"{text} ({axes_text(axes)})" for text, axes in spans.items()]
    return "; ".join(
        filter(None, (*parts, *_twice(found), assumed_text(found.source.get("assumptions", ()))))
    )


def _twice(found: Identification) -> list[str]:
    """Return how many rows of a log repeat a stamp, where a reader is to know; they are left out."""
    rows = {
        f"{one['repeated_rows']} rows repeat a stamp and are left out"
        for one in found.source.get("sensors", ())
        if (lost := one.get("repeated_rows", 0)) > LOST_SHARE * (lost + one["span_s"] * one["rate_hz"])
    }
    return sorted(rows)


def used_part(source: Mapping[str, Any], axis: str) -> str:
    """Return which part of its log an axis rests on, where some is left out, by the source of an `Identification`."""
    for sensor in source.get("sensors", ()):
        begin, end, log = sensor.get("used_s", (0.0, 0.0, 0.0))
        if axis in sensor["axes"] and log - sensor["span_s"] > MIN_LEFT_OUT:
            parts = f" in {sensor['segments']} parts" if sensor["segments"] > 1 else ""
            return f", {stamp(begin)} to {stamp(end)} s of its clock{parts}"
    return ""
