"""How wrong a noise may be before any score shows it: the shares of one source in the variances decide."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tuner.consistency.error_budget import blind_spots


def spots(*shares: float) -> dict[str, tuple[float, float]]:
    """Sources with these shares in every variance, while aided."""
    budget = SimpleNamespace(
        aided=np.arange(3),
        after={},
        sources=tuple(f"source {i}" for i in range(len(shares))),
        share=lambda epochs, rows: np.array(shares),
    )
    return blind_spots(budget)


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0])
def test_ten_per_cent_of_an_error_is_seen(share):
    """An sd f times too small raises the error by √(1 + (f² − 1) a), one f times too large lowers it likewise."""
    small, large = spots(share)["source 0"]
    assert math.sqrt(1.0 + (small**2 - 1.0) * share) == pytest.approx(1.1)
    assert 1.0 / math.sqrt(1.0 + (large**-2 - 1.0) * share) == pytest.approx(1.1)


def test_a_small_share_is_never_too_large_to_be_seen():
    """Without the source the error falls by √(1 − a) only: below a share of 1 − 1/1.1² no factor shows."""
    limit = 1.0 - 1.1**-2
    below, above = spots(0.99 * limit, 1.01 * limit).values()
    assert below[1] == math.inf
    assert math.isfinite(above[1])
    assert spots(0.0)["source 0"] == (pytest.approx(math.sqrt(1.0 + 0.21 / 1e-12)), math.inf)
