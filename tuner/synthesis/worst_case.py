"""What the noise is at its worst: advice beside the settings, not part of them.

The settings describe the power that the filter meets over the whole record: a burst or a noisy stretch counts by its
share of the time, through the Allan variance. While it lasts the noise is larger; by how much is said here. Two causes
of one excess are not multiplied: of all factors on one quantity the largest holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tuner.synthesis.findings import settled_inflations
from tuner.types import Diagnosis, Enlargement, FilterConfig, Quantity
from tuner.types.records import Record


def worst_case(
    diagnosis: Diagnosis, config: FilterConfig, records: Sequence[Record] = ()
) -> tuple[Enlargement, ...]:
    """Return the largest enlargement of each quantity that the findings of a static log give.

    Parameters
    ----------
    diagnosis : Diagnosis
        Findings on the log of the configuration.
    config : FilterConfig
        Settings without these enlargements.
    records : sequence of Record, optional
        Those that the settings are of.
    """
    largest: dict[Quantity, Enlargement] = {}
    for enlargement in settled_inflations(diagnosis, config, records):
        known = largest.get(enlargement.quantity)
        if known is None or enlargement.factor > known.factor:
            causes = () if known is None else known.causes
            largest[enlargement.quantity] = replace(
                enlargement, causes=tuple(dict.fromkeys((*enlargement.causes, *causes)))
            )
    return tuple(largest.values())
