"""One slow shape in all axes of a sensor: one temperature, one lag, one warm-up, rather than another name in each.

Errors of a thermometer and the noise of an axis decide between near twins by a few nats, differently in each axis. So
axes in which something smooth was found are judged together: each shape is fitted to all of them, what time constant
it has in common, and that of most evidence in all of them is taken by those that lose no more than `NEAR_TWIN_NATS`. An
axis that shows one of two shapes alone keeps that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.causes.temperature_times_time import UNNAMED
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, extended, with_extensions
from tuner.diagnosis.static.outcome import NEAR_TWIN_NATS, Accepted
from tuner.diagnosis.static.search import SearchResult, with_joint_estimates
from tuner.diagnosis.static.slow_shapes import (
    SMOOTH,
    Shapes,
    evidence,
    judged,
    sets,
    smooth,
    without_smooth,
    worth,
)
from tuner.types import Alternative


def with_shared_shape(outcomes: Mapping[str, SearchResult]) -> dict[str, SearchResult]:
    """Return the outcomes of axes of one clock that a smooth shape they share explains as well as their own.

    Parameters
    ----------
    outcomes : mapping of str to SearchResult
        What was found in each axis; axes that already agree on something measured, or of which one alone shows a
        smooth shape, stay.

    Returns
    -------
    dict of str to SearchResult
        Those that change.
    """
    concerned = {axis: one for axis, one in outcomes.items() if smooth(one.accepted)}
    kinds = {tuple(sorted(x.cause for x in smooth(one.accepted))) for one in concerned.values()}
    agreed = len(kinds) == 1 and Warmup.cause not in next(iter(kinds))
    measured = all(COVARIATE in one.final.channel.covariates for one in concerned.values())
    if len(concerned) < 2 or agreed or not measured:
        return {}
    bare = {axis: without_smooth(one.final) for axis, one in concerned.items()}
    own = {axis: evidence(one.final) for axis, one in concerned.items()}
    tried = [
        (shapes, {axis: extended(b, *shapes) for axis, b in bare.items()})
        for shapes in sets(list(bare.values()))
    ]

    def total(of: tuple[Shapes, dict[str, FittedChannel]]) -> float:
        """Return the evidence of all axes with shapes; one that loses `NEAR_TWIN_NATS` by them keeps its own."""
        return sum(max(evidence(fit), own[axis] - NEAR_TWIN_NATS) for axis, fit in of[1].items())

    shapes, fits = max(tried, key=total)
    fits = {axis: fit for axis, fit in fits.items() if evidence(fit) > own[axis] - NEAR_TWIN_NATS}
    if len(fits) < 2:
        return {}
    return {
        axis: _changed(outcomes[axis], bare[axis], fit, shapes, worth(concerned[axis].final))
        for axis, fit in fits.items()
        if not {x.cause for x in smooth(outcomes[axis].accepted)} <= {x.cause for x in shapes}
    }


def _changed(
    outcome: SearchResult, bare: FittedChannel, fit: FittedChannel, shapes: Shapes, own: float
) -> SearchResult:
    """Return an outcome with the shared shapes in place of its own, which stay among the alternatives."""
    given = len(outcome.final.extensions) - len(outcome.accepted)
    kept = [a for a in outcome.accepted if not isinstance(a.extension, SMOOTH)]
    weight = float(np.exp(min(own - worth(fit), 0.0)))
    causes = {x.cause for x in shapes}
    others = tuple(
        Alternative(x.cause, weight) for x in smooth(outcome.accepted) if x.named and x.cause not in causes
    )
    refits = fit
    if len(shapes) == 1:
        refits = with_extensions(fit, (*bare.extensions, shapes[0].refit(fit, len(bare.extensions))))
    final = with_joint_estimates(refits)
    name = f"likelihood ratio of {' and '.join(x.cause for x in shapes)}, as other axes have it"
    result = judged(bare, fit, shapes, name)
    new = [
        Accepted(x, replace(result, cause=x.cause), others) for x in final.extensions[len(bare.extensions) :]
    ]
    kept = [replace(a, extension=x) for a, x in zip(kept, final.extensions[given:], strict=False)]
    left = tuple(result for result in outcome.unexplained if result.cause != UNNAMED)
    return SearchResult(outcome.base, final, (*kept, *new), left)
