"""Axes of the gyros that are not at right angles: each of a pair turns half of the angle."""

from models.filter_states import Coupling, FilterState

PAIRS = ("xy", "xz", "yz")

NON_ORTHOGONALITY = FilterState(
    name="gyro_non_orthogonality",
    components=PAIRS,
    unit="rad",
    meaning="gyro non-orthogonality",
    couplings=tuple(
        Coupling(pair, f"gyro_{one}", times=f"rate_{other}", factor=0.5)
        for pair in PAIRS
        for one, other in (pair, pair[::-1])
    ),
    customary_unit="mrad",
)
