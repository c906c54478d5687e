"""Drives of other vehicles, with effects inside and outside the catalogue: half an hour of processor time."""

from __future__ import annotations

import pytest
from challenge.beyond_drives import STUDIES, judged, make, written
from challenge.drives.vehicles import KINDS as VEHICLES
from challenge.tables import wilson

from tuner.diagnosis.drive import diagnose_drive

pytestmark = pytest.mark.slow

SEED = 71
MOST_WRONG = 0.10
"""Share of drives with effects outside the catalogue that may have a wrong name without a doubt."""


@pytest.mark.parametrize("study", STUDIES)
def test_names_of_drives_are_right_or_doubted(study, tmp_path):
    """The build fails on what chance cannot excuse: bounds of 95 % intervals."""
    verdicts = []
    for vehicle in VEHICLES:
        made = make(study, vehicle, SEED)
        verdicts.append(judged(made, diagnose_drive(*written(made, tmp_path))))
    count = {what: sum(v[what] for v in verdicts) for what in verdicts[0]}
    if study == "clean":
        assert wilson(count["something said"], len(verdicts))[0] <= 0.02
    assert wilson(count["wrong and confident"], len(verdicts))[0] <= MOST_WRONG
    if study in ("single", "pair"):
        assert wilson(count["named"], len(verdicts))[1] >= 0.97
