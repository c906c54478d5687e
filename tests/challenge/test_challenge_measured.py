"""Known effects hidden in real recordings are named; what the recordings contain by themselves is still found."""

from __future__ import annotations

import pytest
from challenge.generator.sampling import Duplicates
from challenge.measured import RECORDINGS, folder, samples, told, with_effect

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(folder() is None, reason="TUNER_DATA does not name a folder with recordings"),
]


@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda r: f"{r.file}-{r.array}")
def test_an_effect_of_sixty_nats_is_named_in_a_real_recording(recording):
    """Held readings apart: in coloured noise their test is shy (docs/challenge.md). One weak finding may change."""
    where = folder()
    assert where is not None
    y = samples(recording, where)
    control, _ = told(y, recording)
    for effect in (effect for effect in recording.effects if effect is not Duplicates):
        found, _ = told(with_effect(y, recording, effect), recording)
        assert effect.cause in found, effect.cause
        assert len(set(found) - set(control) - {effect.cause}) <= 1, effect.cause
