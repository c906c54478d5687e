"""The hours that the wanted accuracy of each noise term takes, beside those that are planned."""

from __future__ import annotations

from matplotlib.figure import Figure

from tuner.formats.customary_units import symbol
from tuner.identification.record_length import LONGEST_HOURS
from tuner.identification.static_test_plan import StaticTestPlan
from tuner.report.figure_files import new_figure
from tuner.report.result_figures import BAD_COLOUR, GOOD_COLOUR


def plan_figure(plans: StaticTestPlan) -> Figure:
    """Return the hours that each term takes, and those that are planned."""
    first = next(iter(plans.values()))
    hours: dict[str, float] = {}
    for axis, plan in plans.items():
        sensor = "gyros" if plans.units[axis].startswith("rad") else "accelerometers"
        for one in plan.parameters:
            name = f"{symbol(one.name)} of {sensor}"
            hours[name] = max(hours.get(name, 0.0), LONGEST_HOURS if one.hours is None else one.hours)
    with new_figure((9.4, 1.2 + 0.3 * len(hours))) as figure:
        panel = figure.subplots()
        for k, needed in enumerate(hours.values()):
            panel.plot(needed, k, "o", color=GOOD_COLOUR if needed <= first.hours else BAD_COLOUR)
        panel.axvline(first.hours, color="0.2", lw=1.0, ls="--", label=f"planned: {first.hours:g} h")
        panel.set_yticks(range(len(hours)), list(hours))
        panel.set(xscale="log", xlabel=f"hours for a relative sd of {100 * first.accuracy:g} %")
        panel.invert_yaxis()
        panel.legend(fontsize=8)
    return figure
