"""What a run with poses shows, in words and numbers: the four numbers at rest and in the run, and why they differ."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.table import Table

from tuner.formats.customary_units import amount, digits, percent
from tuner.limits import LOST_SHARE
from tuner.poses.run_with_poses import UNITS, Cause, RunWithPoses, SensorInRun
from tuner.report.titled_table import table_of
from tuner.types import Coefficient
from tuner.types.coefficient import apart, times

WORDS = {
    "scale": "errors of scale and right angles,",
    "turn": "axes turned against those of the gyroscopes",
    "delay": "samples against the gyroscopes",
    "filter": "a low-pass, time constant",
}
"""Names of the causes."""
NONE = Coefficient.known(0.0, 0.0, 0.0, "1")
"""What an offset or a drift is compared with."""


def pose_run_lines(run: RunWithPoses) -> list[Table | str]:
    """Return what was compared, the table of the numbers, and what makes them larger."""
    poses = ", ".join(amount(one.beside.reference) for one in run.sensors)
    stamps = "stamps on the clock of the unit"
    if apart(run.delay, NONE):
        late = "late" if (run.delay.value or 0.0) < 0.0 else "early"
        stamps = f"stamps {late} by {amount(_size(run.delay))}"
    if apart(run.drift, NONE):
        behind = "fast" if (run.drift.value or 0.0) < 0.0 else "slow"
        stamps += f", their clock {behind} by {amount(times(_size(run.drift), 1e6, '1'))} ppm"
    lost = f"; {percent(run.left_out)} of the poses left out, wild or beside gaps" * (
        run.left_out > LOST_SHARE
    )
    low, high = run.size.interval or (1.0, 1.0)
    scaled = not low <= 1.0 <= high and not run.accel.unexplained
    size = f"; their distances are {amount(run.size)} × the true ones, by gravity" * scaled
    head = (
        f"{run.name}: {digits(run.span)} s beside poses {digits(1e3 * run.interval, 2)} ms apart, "
        f"which err by {poses}, {stamps}{size}{lost}"
    )
    own = " and ".join(one.sensor for one in run.sensors if one.follows)
    dependent = (
        f"The poses agree with the {own} better than the noise at rest allows: they were made with the unit, or that "
        "noise is stated too large; the numbers are those at rest"
    )
    reasons = [dependent] if run.dependent else [line for one in run.sensors for line in _reasons(one)]
    return [head, *_declared(run), _numbers(run), *reasons]


def _declared(run: RunWithPoses) -> Iterator[str]:
    """Yield what the poses declare beside what they err by."""
    both = list(zip(run.sensors, run.declared, strict=True))
    if all(sd > 0.0 and one.beside.reference.value for one, sd in both):
        sds = " and ".join(amount(Coefficient(sd, None, None, one.beside.reference.unit)) for one, sd in both)
        ratios = " and ".join(amount(times(one.beside.reference, 1.0 / sd, "1")) for one, sd in both)
        yield f"They declare {sds}: true ÷ declared {ratios}, without errors that last"


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


def _size(one: Coefficient) -> Coefficient:
    """Return a number without its sign."""
    if one.value is None or one.interval is None or one.value >= 0.0:
        return one
    return Coefficient.known(-one.value, -one.interval[1], -one.interval[0], one.unit)


NUMBERS = {"white": "white noise", "walk": "random walk"}
"""Names of the numbers."""


def _numbers(run: RunWithPoses) -> Table:
    """Return the four numbers: at rest, in the run beside all causes, and what is written."""
    rows = []
    for place, (number, name) in enumerate(NUMBERS.items()):
        for one in run.sensors:
            unit = UNITS[one.sensor][place]
            rest = one.rest.white_density if number == "white" else one.rest.bias
            said = amount(times(one.factors[number], rest, unit))
            written = "–" if run.dependent else digits(one.larger.get(number, 1.0), 2)
            rows.append([f"{one.sensor} {name}", amount(Coefficient(rest, None, None, unit)), said, written])
    return table_of(("", "at rest", "in the run", "written ×"), rows)


def _reasons(one: SensorInRun) -> Iterator[str]:
    """Yield why numbers of a sensor are larger in the run, and which of them are not written."""
    for cause in one.causes:
        yield (
            f"{one.sensor}: {WORDS[cause.name]} {_cause_size(cause)}: white noise × {digits(cause.factor, 2)} for a "
            "filter without states for them; calibrated, it needs the number in the run"
        )
    if one.shaken:
        scatter = digits(one.scatter, 2)
        yield f"{one.sensor}: the samples scatter {scatter} × as much as at rest: vibration, or another unit"
    for number in one.unexplained:
        yield (
            f"{one.sensor} {NUMBERS[number]}: more than samples and causes explain; errors of poses that last look so: "
            "not written"
        )


def _cause_size(cause: Cause) -> str:
    """Return the size of a cause; without a unit in per cent."""
    one = _size(cause.largest)
    if cause.name == "delay":
        return f"{'late' if (cause.largest.value or 0.0) < 0.0 else 'early'} by {amount(one)}"
    if cause.name == "filter":  # half of the squared time constant
        low, high = one.interval or (0.0, 0.0)
        value, low, high = (math.sqrt(max(0.0, 2.0 * x)) for x in (one.value or 0.0, low, high))
        return amount(Coefficient.known(value, low, high, "s"))
    return f"{amount(times(one, 100.0, '1'))} %" if one.unit == "1" else amount(one)
