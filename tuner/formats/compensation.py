"""What is taken out of a drive, as documents have it: ``CAUSE.NAME`` and a value, SI."""

from __future__ import annotations

from collections.abc import Mapping

from models.effects.drive import EFFECTS
from tuner.formats.codec import store, structured
from tuner.formats.document_errors import refuse
from tuner.types import Compensation, Parameter
from tuner.types.number_ranges import Finite


def _load_compensation(content: object) -> Compensation:
    """Return a compensation; a cause or a parameter that is not declared is refused."""
    values = structured(content, Mapping[str, Finite])
    for text in values:
        cause, _, name = text.partition(".")
        effect = EFFECTS.get(cause)
        if effect is None or not name:
            refuse(f"CAUSE.NAME, with a cause of a drive ({', '.join(EFFECTS)})", repr(text), text)
        if not effect.is_parameter_of_compensation(name):
            refuse(f"a parameter of '{cause}' that can be taken out of a drive", repr(text), text)
    return Compensation({Parameter.parse(text): value for text, value in values.items()})


store(Compensation, dump=Compensation.as_text, load=_load_compensation)
