"""What can hide in the data of an inertial sensor, as generative models with SI parameters.

`models.effects.static` is the front door to the causes that a sensor at rest can show: their classes by cause code
(`EFFECTS`), `parse` and `draw` to get one, `hide` to put several into a block of `Samples`. Temperature curves are in
`models.effects.static.temperature_profiles`. `models.effects.drive` is the same for what a drive can show: inertial
samples and satellite fixes together (`models.effects.drive.base`).

The fields of an effect bear the names under which a finding reports them, so that what was hidden and
what was found can be laid side by side.
"""

from __future__ import annotations

from models.effects.static import EFFECTS, draw, hide, parse
from models.effects.static.base import Effect, Samples

__all__ = ["EFFECTS", "Effect", "Samples", "draw", "hide", "parse"]
