"""The noise that is written for a filter must predict the record it came from.

The chain for one axis: the likelihood's block is kept where it predicts the Allan deviation of the record and the
errors of its own forecasts (`tuner.identification.predictive.criteria`); elsewhere a block fitted to the curve takes
its place (`tuner.identification.predictive.curve_fit`), if need be with bands of motion beside it; where no such
block predicts the record, that is said, with the cluster times at which it fails.
"""

from __future__ import annotations
