"""Known effects hidden in real recordings come back by name; what the recordings hold by themselves stays."""

from __future__ import annotations

import pytest
from challenge.measured import EFFECTS, RECORDINGS, folder, samples, told, with_effect

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(folder() is None, reason="TUNER_DATA does not name a folder with recordings"),
]


@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda r: f"{r.file}-{r.array}")
def test_an_effect_of_sixty_nats_is_named_in_a_real_recording(recording):
    where = folder()
    assert where is not None
    y = samples(recording, where)
    control, _ = told(y, recording)
    for effect in EFFECTS:
        found, _ = told(with_effect(y, recording, effect), recording)
        assert effect.cause in found, effect.cause
        assert set(found) - set(control) == {effect.cause} - set(control), effect.cause
