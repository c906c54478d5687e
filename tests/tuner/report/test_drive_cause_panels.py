"""The picture of a constant error draws what a run leaves of it, also where a drive has few innovations or none."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from tuner.report.drive_cause_panels import draw_effect
from tuner.types import Compensation, Parameter

DELAY = Parameter("time_offset", "delay")


def drawn(count, compensated):
    rng = np.random.default_rng(1)
    slope = rng.normal(size=(count, 1))
    residual = slope[:, 0] * (0.5 - compensated)
    found = SimpleNamespace(
        whitened=SimpleNamespace(slope=slope, residual=residual),
        linearized=SimpleNamespace(parameters=(DELAY,)),
        hypothesis=SimpleNamespace(compensation=Compensation({DELAY: compensated})),
    )
    panel = Figure().subplots()
    draw_effect(panel, found, "before", {DELAY: 0.5})
    return panel


@pytest.mark.parametrize("compensated", [0.0, 0.2, 0.5])
def test_the_line_is_what_the_run_has_not_taken_out(compensated):
    panel = drawn(300, compensated)
    line = next(one for one in panel.get_lines() if str(one.get_label()).startswith("predicted"))
    x, y = line.get_data()
    np.testing.assert_allclose(y, (1.0 - compensated / 0.5) * x, atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2, 14, 31])
def test_few_innovations_are_drawn_and_none_is_said(count):
    texts = [text.get_text() for text in drawn(count, 0.0).texts]
    assert any("no fix counts" in text for text in texts) == (count < 2)
