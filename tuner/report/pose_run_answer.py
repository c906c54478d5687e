"""What a run with poses shows, in words and numbers: the four numbers at rest and in the run, and why they differ."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.table import Table

from tuner.formats.customary_units import amount, digits, percent
from tuner.limits import LOST_SHARE
from tuner.poses.run_with_poses import UNITS, Cause, RunWithPoses
from tuner.report.titled_table import table_of
from tuner.types import Coefficient
from tuner.types.coefficient import apart, times

NUMBERS = {"white": "white noise", "walk": "random walk"}
"""Names of the numbers."""
NONE = Coefficient.known(0.0, 0.0, 0.0, "1")
"""What an offset or a drift is compared with."""


def pose_run_lines(run: RunWithPoses) -> list[Table | str]:
    """Return what was compared, the table of the numbers, and what makes them larger."""
    of_gyro, of_accel = (one.beside.reference for one in run.sensors)
    clock = "no offset of the clocks found"
    if apart(run.delay, NONE):
        later = "later" if (run.delay.value or 0.0) < 0.0 else "earlier"
        clock = f"pose stamps {amount(times(_size(run.delay), 1e3, 'ms'))} {later} than those of the samples"
    if apart(run.drift, NONE):
        faster = "faster" if (run.drift.value or 0.0) < 0.0 else "slower"
        clock += f", their clock {faster} by {amount(times(_size(run.drift), 1e6, 'ppm'))}"
    low, high = run.size.interval or (1.0, 1.0)
    scaled = not low <= 1.0 <= high and not run.accel.unexplained
    size = f"; position scale {amount(run.size)} by gravity: positions were divided by it" * scaled
    lost = f"; {percent(run.left_out)} of the poses left out, wild or beside gaps" * (
        run.left_out > LOST_SHARE
    )
    head = (
        f"{run.name}: {digits(run.span)} s compared with poses at {digits(1.0 / run.interval, 2)} Hz; white noise of a "
        f"pose {amount(of_gyro)}, {amount(times(of_accel, 1e3, 'mm'))} (1σ an axis); {clock}{size}{lost}"
    )
    own = " and ".join(one.sensor for one in run.sensors if one.follows)
    dependent = (
        f"The poses agree with the {own} better than the noise at rest allows: they were made with this IMU, or that "
        "noise is stated too large; the settings keep the values at rest"
    )
    reasons = [dependent] if run.dependent else [*_reasons(run)]
    return [head, *_declared(run), _numbers(run), *reasons]


def _declared(run: RunWithPoses) -> Iterator[str]:
    """Yield what the poses declare beside what they err by."""
    both = list(zip(run.sensors, run.declared, (1.0, run.size.value or 1.0), strict=True))
    if all(sd > 0.0 and one.beside.reference.value for one, sd, _ in both):
        sds = " and ".join(
            amount(Coefficient(sd, None, None, one.beside.reference.unit)) for one, sd, _ in both
        )
        ratios = " and ".join(amount(times(one.beside.reference, size / sd, "1")) for one, sd, size in both)
        yield f"Pose covariances state {sds} (1σ): true ÷ declared {ratios}, time-correlated errors not counted"


def growth_table(run: RunWithPoses) -> Table:
    """Return errors of the prediction over windows ÷ those that the noise at rest and the poses predict."""
    windows = dict.fromkeys(window for one in run.sensors for window in one.growth)
    rows = (
        [
            digits(window),
            *(" ".join(digits(x, 2) for x in one.growth.get(window, ())) or "–" for one in run.sensors),
        ]
        for window in windows
    )
    heads = ("window, s", "angle, x y z", "velocity, x y z")
    return table_of(heads, rows, title="Error ÷ prediction of the noise at rest and of the poses")


def _numbers(run: RunWithPoses) -> Table:
    """Return the four numbers: at rest, in the run without all causes, and in the settings."""
    rows = []
    for place, (number, name) in enumerate(NUMBERS.items()):
        for one in run.sensors:
            unit = UNITS[one.sensor][place]
            rest = one.rest.white_density if number == "white" else one.rest.bias
            said = amount(times(one.factors[number], rest, unit))
            factor = 1.0 if run.dependent else one.larger.get(number, 1.0)
            entered = f"{amount(Coefficient(float(digits(rest * factor)), None, None, unit))} (× {digits(factor, 2)})"
            settings = entered if factor > 1.0 else "as at rest"
            rows.append([f"{one.sensor} {name}", amount(Coefficient(rest, None, None, unit)), said, settings])
    return table_of(("", "at rest", "in the run", "settings"), rows)


def _reasons(run: RunWithPoses) -> Iterator[str]:
    """Yield why numbers are larger in the run, and which of them are not in the settings."""
    for one in run.sensors:
        if one.causes:
            causes = "; ".join(map(_cause_text, one.causes))
            yield (
                f"{one.sensor}: {causes}. A filter that does not estimate this needs the larger white noise; once this"
                " is corrected, the value at rest"
            )
        if one.shaken:
            scatter = digits(one.scatter, 2)
            yield (
                f"{one.sensor}: high-frequency noise of the samples is {scatter} × that at rest: vibration, or another "
                "IMU"
            )
    more = [f"{one.sensor} {NUMBERS[number]}" for one in run.sensors for number in one.unexplained]
    if more:
        yield (
            f"The poses show more {', '.join(more)} than the samples and errors of the sensors explain. "
            "Time-correlated errors of the poses look the same: the settings do not hold it"
        )


def _cause_text(cause: Cause) -> str:
    """Return a cause with its size."""
    one, ahead = _size(cause.size), (cause.size.value or 0.0) > 0.0
    if cause.name == "delay":
        return f"the samples {'lead' if ahead else 'lag'} those of the gyroscopes by {amount(times(one, 1e3, 'ms'))}"
    if cause.name == "turn":
        return f"misalignment with the gyroscopes {amount(one)}"
    if cause.name == "scale":
        return f"scale factor and misalignment errors, the surest {amount(times(one, 100.0, '%'))}"
    low, high = one.interval or (0.0, 0.0)  # a low-pass: half of the squared time constant
    ends = (1.0 / (2.0 * math.pi * math.sqrt(2.0 * max(x, 1e-12))) for x in (one.value or 0.0, high, low))
    value, least, most = ends
    return f"low-pass, −3 dB at {amount(Coefficient.known(value, least, most, 'Hz'))}"


def _size(one: Coefficient) -> Coefficient:
    """Return a number without its sign."""
    if one.value is None or one.interval is None or one.value >= 0.0:
        return one
    return Coefficient.known(-one.value, -one.interval[1], -one.interval[0], one.unit)
