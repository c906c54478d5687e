"""Records that tempt, a few of each kind: minutes. The build fails on what chance cannot excuse."""

from __future__ import annotations

import pytest
from challenge.beyond import judged, records
from challenge.generator.beyond import KINDS, record
from challenge.tables import wilson

from tuner.diagnosis import diagnose

pytestmark = pytest.mark.slow

NUMBER = 8
WITHOUT_CAUSE = {"glitches", "clean_filtered"}
"""Kinds of which some are known to have another name, or to leave a misfit."""
ERRING_INPUT = {"poor_thermometer"}
"""Kinds whose input errs: what it foretells of the part held out errs by that, whatever the name."""


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in WITHOUT_CAUSE])
def test_a_tempting_record_has_its_name_or_none(kind):
    """The lower bound of wrong names and of negative gains is below 3 %, the upper one of what is listed above 98 %."""
    made = [record(kind, "study", number) for number in range(NUMBER)]
    verdicts = [judged(one, diagnose(records(one))) for one in made]
    for what in ("wrong", *(() if kind in ERRING_INPUT else ("gain < 0",))):
        assert wilson(sum(v[what] for v in verdicts), NUMBER)[0] <= 0.03, what
    if not kind.startswith("clean"):
        assert wilson(sum(v["shortlist"] for v in verdicts), NUMBER)[1] >= 0.98
        assert wilson(sum(v["silent"] for v in verdicts), NUMBER)[0] <= 0.05
    else:
        assert not any(v["unexplained"] or v["wrong"] for v in verdicts)
