"""A quantizer coarser than the noise of a drive is reported; a finer one is not."""

from __future__ import annotations

import numpy as np

from tuner.diagnosis.drive.causes.quantizer import coarse_quantizer_notes
from tuner.types.records import Drive, Gnss


def rounded(step: float) -> Drive:
    rng, t = np.random.default_rng(0), np.arange(6000) / 100.0
    rates = rng.standard_normal((6000, 6)) * 3e-3
    rates[:, :3] = np.round(rates[:, :3] / step) * step if step else rates[:, :3]
    still = np.zeros((60, 3))
    gnss = Gnss(np.arange(60.0), still, still, still + 1.0, still + 0.1)
    return Drive("bench", t, rates, gnss)


def test_a_quantizer_coarser_than_the_noise_is_reported() -> None:
    (note,) = coarse_quantizer_notes(rounded(0.01))
    assert note.startswith("gyro")
    assert "0.01 rad/s" in note


def test_a_fine_quantizer_is_not_reported() -> None:
    assert not coarse_quantizer_notes(rounded(1e-3))
    assert not coarse_quantizer_notes(rounded(0.0))
