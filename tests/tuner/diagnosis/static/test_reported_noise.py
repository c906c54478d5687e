"""The noise that a diagnosis reports holds at long cluster times, too, whatever shapes the short ones."""

import numpy as np

from models.noise import BiasInstability, GaussMarkov, NoiseModel, RandomWalk, White
from tuner.diagnosis import diagnose
from tuner.simulation.static import simulate

TRUE = NoiseModel((White(1e-3), GaussMarkov(2e-3, 0.25), BiasInstability(3e-4), RandomWalk(1e-6)))


def test_a_process_beside_a_peak_leaves_the_slow_noise_right():
    """One Gauss–Markov process is spent at 0.25 s: a random walk alone was 1.7 times the flicker at 200 s."""
    log, _ = simulate(
        {"gyro_x": TRUE},
        duration=2000.0,
        rate=50.0,
        seed=2,
        effects=["vibration:frequency=9,quality=20,sd=3e-3"],
    )
    found = diagnose(log)
    assert [finding.cause for finding in found.findings] == ["vibration"]
    tau = np.array([1.0, 3.0, 10.0, 30.0, 100.0, 200.0, 500.0])
    reported, true = (model.allan_variance(tau, interval=0.02) for model in (found.models["gyro_x"], TRUE))
    assert np.all(np.abs(np.log(reported / true)) < 2.0 * np.log(1.2))
