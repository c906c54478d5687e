"""Records of numbers that are not the plain estimate, as documents have them: quantity, kind, factor and reason.

The key ``kind`` tells the three types apart: ``bound_used``, ``enlargement`` and ``noise_scale``. Documents of
version 0.1 lack it; their kind follows from what only one of the three has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from tuner.formats.codec import store, structured
from tuner.formats.document_errors import refuse, shown
from tuner.types import AppliedNoiseScale, BoundUsed, Enlargement, Inflation, Quantity
from tuner.types.number_ranges import Finite, Share

Kind = Literal["bound_used", "enlargement", "noise_scale"]


@dataclass(frozen=True)
class _InflationForm:
    """Any of the three types."""

    quantity: Quantity
    factor: Finite
    reason: str
    kind: Kind | None = None
    interval: tuple[float, float] | None = None
    causes: tuple[str, ...] = ()
    time_share: Share | None = None


def _load_inflation(content: object) -> Inflation:
    form = structured(content, _InflationForm)
    kind = form.kind or _kind_of(form)
    if kind == "bound_used":
        return BoundUsed(form.quantity, form.factor, form.reason)
    if kind == "enlargement":
        return _enlargement(form)
    return AppliedNoiseScale(form.quantity, form.factor, form.reason, form.interval, form.causes)


def _kind_of(form: _InflationForm) -> Kind:
    """Return the kind of a record of version 0.1."""
    if form.reason.startswith("bounded"):
        return "bound_used"
    return "noise_scale" if form.interval or form.causes or form.factor == 1.0 else "enlargement"


def _load_enlargement(content: object) -> Enlargement:
    return _enlargement(structured(content, _InflationForm))


def _enlargement(form: _InflationForm) -> Enlargement:
    return Enlargement(form.quantity, form.factor, form.reason, form.causes, form.time_share)


def _dump_as(kind: Kind) -> Any:
    def dump_inflation(one: Inflation) -> dict[str, Any]:
        entries = vars(one)
        content = {
            "quantity": one.quantity,
            "kind": kind,
            "factor": one.factor,
            "interval": entries.get("interval"),
            "causes": entries.get("causes", ()),
            "reason": one.reason,
        }
        if entries.get("time_share") is not None:
            content["time_share"] = entries["time_share"]
        return content

    return dump_inflation


def _load_quantity(content: object) -> Quantity:
    try:
        return Quantity.parse(structured(content, str))
    except ValueError:
        refuse("a quantity named OWNER.FIELD, such as gyro_x.white_density", shown(content))


store(Quantity, dump=str, load=_load_quantity)
store(BoundUsed, dump=_dump_as("bound_used"))
store(Enlargement, dump=_dump_as("enlargement"), load=_load_enlargement)
store(AppliedNoiseScale, dump=_dump_as("noise_scale"))
store(Inflation, load=_load_inflation)
