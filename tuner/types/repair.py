"""What is wrong with a stream of a recording, and what mends it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Repair:
    """A fault of a stream, found before any filter runs.

    Attributes
    ----------
    stream : str
        Which: ``gyro``, ``accelerometer``, ``fixes``, ``velocities``, ``clocks``, …
    fault : str
        What is wrong, as the rest of a sentence that begins with the stream.
    done : str
        What mends it, as done in the mended recording; empty where nothing can.
    nats : float
        Gain of the log-likelihood by it, less the price of the claim; infinite where it is counted, not inferred.
    over_next : float
        By how much that is more than of the next explanation, nats.
    size : float or None
        How large it is, in `unit`.
    interval : tuple of 2 floats, or None
        95 % interval of the size.
    unit : str
        Unit of the size.
    begin, end : float or None
        Where it holds, s since the first inertial sample; None from the start, to the end.
    """

    stream: str
    fault: str
    done: str
    nats: float = math.inf
    over_next: float = math.inf
    size: float | None = None
    interval: tuple[float, float] | None = None
    unit: str = ""
    begin: float | None = None
    end: float | None = None
