"""How small an effect may be and still be found: stated amplitudes, each hidden many times.

``python tests/challenge/amplitudes.py [--sets 20] [--seed 1]``

Each amplitude is a promise; the table says in how many of the sets it was kept. The reference is 1 h at 100 Hz
of one axis with slow noise, ramp and lattice drawn as in the challenge, without quantization noise. Sizes are
in white sd σ (with that of the lattice), z is an amplitude over its own sd in the noise of that record.
Rows are printed as they are finished.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent))

from challenge.generator.effect import Effect, Place, UnreachableError
from challenge.generator.files import log
from challenge.generator.items import Hidden, Item
from challenge.generator.laws import Burst, HeavyTails, Spikes
from challenge.generator.means import Line, Step, Temperature, Warmup
from challenge.generator.sampling import Duplicates
from challenge.generator.scene import Scene, scene
from challenge.generator.spectra import Colour, LowPass, Vibration
from challenge.tables import rate as rated

from tuner.diagnosis import diagnose
from tuner.types.records import Record

AXIS = "gyro_x"
NATS_OF_Z8 = 32.0
"""½ z² of a mean that is eight times its own sd."""


@dataclass(frozen=True)
class Promise:
    """An amplitude at which an effect is to be found.

    Attributes
    ----------
    cause, words : str
    make : callable
        The effect in a place.
    lattice : float, optional
        Lattice step in white sd, else drawn.
    samples : int
    """

    cause: str
    words: str
    make: Callable[[Place], Effect]
    lattice: float | None = None
    samples: int = 360_000


def line(size: float) -> Callable[[Place], Effect]:
    """Return a line of so many sd."""

    def make(place: Place) -> Effect:
        self = Line()
        self.draw(place)
        self.size, self.nats = size * _scale(place), 0.25 * place.scene.samples * size**2
        return self

    return make


def heavy_tails(kurtosis: float) -> Callable[[Place], Effect]:
    """Return tails such that the samples as written have the excess kurtosis."""

    def make(place: Place) -> Effect:
        self = HeavyTails()
        self.nu, self.nats = 4.0 + 6.0 / (kurtosis * _scale(place) ** 4), 0.0
        return self

    return make


def colour(phi: float) -> Callable[[Place], Effect]:
    """Return neighbours of the white noise correlated by −phi."""

    def make(place: Place) -> Effect:
        self = Colour()
        self.phi, self.nats = -phi * _scale(place) ** 2, 0.0
        return self

    return make


def lowpass(pole: float) -> Callable[[Place], Effect]:
    """Return a filter whose samples are correlated by `pole`, exp(−2π cutoff ÷ rate)."""

    def make(place: Place) -> Effect:
        self = LowPass()
        self.order, self.nats = 1, 0.0
        self.cutoff = -place.scene.rate * np.log(pole * _scale(place) ** 2) / (2.0 * np.pi)
        return self

    return make


def burst(extra: float) -> Callable[[Place], Effect]:
    """Return a twentieth of the record louder by a share of the variance."""

    def make(place: Place) -> Effect:
        self, span = Burst(), place.scene.span
        self.duration, self.nats = 0.05 * span, 0.0
        self.start = place.scene.start + float(place.rng.uniform(0.0, 0.95)) * span
        self.ratio = 1.0 + extra * _scale(place) ** 2
        return self

    return make


def spikes(place: Place) -> Effect:
    """Return two samples off by 6 … 20 sd, each on top of the noise of its own."""
    self = Spikes()
    self.number, self.size, self.nats = 2, float(place.rng.uniform(6.0, 20.0)) * _scale(place), 0.0
    self.rate = self.number / place.scene.span
    return self


def duplicates(share: float) -> Callable[[Place], Effect]:
    """Return a share of held readings."""

    def make(place: Place) -> Effect:
        self = Duplicates()
        self.number, self.nats = round(share * place.scene.samples), 0.0
        return self

    return make


def vibration(size: float) -> Callable[[Place], Effect]:
    """Return a resonance of quality 30 with so many sd."""

    def make(place: Place) -> Effect:
        self, rate = Vibration(), place.scene.rate
        self.frequency, self.quality = float(place.rng.uniform(0.05, 0.45)) * rate, 30.0
        self.memory = self.quality / (np.pi * self.frequency)
        self.size, self.nats = size, 0.0
        return self

    return make


def _scale(place: Place) -> float:
    """Return σ over the sd of the white noise without the lattice."""
    return place.white / place.scene.axes[place.axis].white


PROMISES = (
    Promise("line", "0.018 σ", line(0.018)),
    Promise("line", "0.011 σ, 1e6 samples", line(0.011), samples=1_000_000),
    Promise("step", "z = 8", lambda place: Step.hide(place, NATS_OF_Z8)),
    Promise("warmup", "z = 8", lambda place: Warmup.hide(place, NATS_OF_Z8)),
    Promise("temperature", "z = 8", lambda place: Temperature.hide(place, NATS_OF_Z8)),
    Promise("heavy_tails", "excess kurtosis 0.045", heavy_tails(0.045)),
    Promise("lowpass", "pole 0.010", lowpass(0.010)),
    Promise("colour", "correlation −0.010", colour(0.010)),
    Promise("burst", "variance + 11 % in 5 % of the record", burst(0.11)),
    Promise("spikes", "2 of 6 … 20 σ", spikes),
    Promise("duplicates", "0.5 %, lattice σ/2", duplicates(0.005), 0.5),
    Promise("duplicates", "0.05 %, lattice σ/3000", duplicates(0.0005), 1.0 / 3000.0),
    Promise("vibration", "0.06 σ, quality 30", vibration(0.06)),
)


def reference(rng: np.random.Generator, promise: Promise) -> Scene:
    """Draw a scene of 100 Hz and one axis."""
    while True:
        drawn = scene(rng, samples=promise.samples, width=1)
        if drawn.rate == 100.0 and drawn.profile not in ("none", "constant"):
            break
    noise = replace(drawn.axes[AXIS], quantum=0.0)
    if promise.lattice is not None:
        noise = replace(noise, step=promise.lattice * noise.white)
    return replace(drawn, axes={AXIS: noise})


def told(promise: Promise, seed: int) -> tuple[str, ...]:
    """Return the causes named in one set, and ``unexplained`` where an alarm has none."""
    rng = np.random.default_rng(seed)
    while True:
        drawn = reference(rng, promise)
        try:
            effect = promise.make(Place(drawn, AXIS, drawn.felt(np.random.default_rng([seed, 0, 0])), rng))
            break
        except UnreachableError:
            continue
    arrays = log(Item("reference", "single", seed, drawn, (Hidden(effect, (AXIS,)),)))
    record = Record(
        "gyro", arrays["t"], arrays[AXIS][:, None], (AXIS,), "rad/s", drawn.interval,
        covariates={"temperature": arrays["temperature"]},
    )  # fmt: skip
    found = diagnose(record)
    causes = [finding.cause for finding in found.findings]
    return tuple(causes + ["unexplained"] * bool(found.unexplained))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    head = ("effect", "amplitude", "found", "named first")
    sys.stdout.write("| " + " | ".join(head) + " |\n|" + "---|" * len(head) + "\n")
    for number, promise in enumerate(PROMISES):
        answers = []
        for item in range(args.sets):
            answers.append(told(promise, 100_000 * args.seed + 1000 * number + item))
            sys.stderr.write(f"\r{promise.cause} {item + 1} of {args.sets} ")
        found = sum(bool(answer) for answer in answers)
        named = sum(answer[:1] == (promise.cause,) for answer in answers)
        row = (promise.cause, promise.words, rated(found, args.sets), rated(named, found))
        sys.stdout.write("| " + " | ".join(row) + " |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
