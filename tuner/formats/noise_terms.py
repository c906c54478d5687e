"""Coefficients and noise models as documents have them.

A coefficient is ``{"value", "interval", "upper", "unit"}`` in SI, with the ``reason`` where there is one; a null value
with ``upper`` is only bounded. A noise model is its terms by name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

from models.noise import TERMS, NoiseModel
from tuner.formats.codec import dump, store, structured
from tuner.formats.document_errors import refuse, shown
from tuner.types import Coefficient, TermEstimate
from tuner.types.number_ranges import largest_reading


def coefficient_json(coefficient: Coefficient) -> dict[str, Any]:
    """Return a number with its interval or bound as plain values."""
    content: dict[str, Any] = dump(coefficient)
    return content


def noise_model(terms: tuple[TermEstimate, ...]) -> NoiseModel:
    """Return the sum of the terms that have values."""
    return NoiseModel(
        tuple(
            TERMS[term.name](**{name: c.value for name, c in term.coefficients.items()})
            for term in terms
            if term.present
        )
    )


def require_declared(name: str, coefficients: Iterable[str], *path: str) -> None:
    """Refuse a term that is not declared, or a coefficient that its class does not have; `path` leads to the term."""
    if name not in TERMS:
        refuse(f"terms among {', '.join(TERMS)}", repr(name), *path)
    known = [field.name for field in fields(TERMS[name])]
    for coefficient in coefficients:
        if coefficient not in known:
            refuse(f"coefficients of '{name}' among {', '.join(known)}", repr(coefficient), *path)


def require_possible(number: float | None, unit: str, *path: str) -> None:
    """Refuse a density, an sd or a rate beyond every reading of a sensor; `path` leads to it."""
    if number is not None and abs(number) > (limit := largest_reading(unit)):
        refuse(f"a number up to {limit:g} {unit}, as no sensor reads more", shown(number), *path)


def require_possible_terms(coefficients: Mapping[str, Coefficient], *path: str) -> None:
    """Refuse coefficients beyond every reading of a sensor; `path` leads to their term."""
    for name, one in coefficients.items():
        require_possible(one.value, one.unit, *path, name, "value")
        require_possible(one.upper, one.unit, *path, name, "upper")
        low, high = one.interval or (-math.inf, math.inf)
        if one.value is not None and not low <= one.value <= high:
            refuse(
                f"a number within its interval, {low:g} to {high:g}", shown(one.value), *path, name, "value"
            )


def _dump_coefficient(coefficient: Coefficient) -> dict[str, Any]:
    content = dict(vars(coefficient))
    if coefficient.reason is None:
        del content["reason"]
    return content


def _load_model(content: object) -> NoiseModel:
    return NoiseModel.from_dict(structured(content, Mapping[str, Any]))


def _dump_term(term: TermEstimate) -> dict[str, Any]:
    return {"term": term.name, **term.coefficients}


def _load_term(content: object) -> TermEstimate:
    entries = dict(structured(content, Mapping[str, Any]))
    if not isinstance(name := entries.pop("term", None), str):
        refuse("a key 'term' with the name of a noise term", shown(content))
    require_declared(name, entries)
    coefficients = structured(entries, Mapping[str, Coefficient])
    require_possible_terms(coefficients)
    return TermEstimate(name, coefficients)


store(Coefficient, dump=_dump_coefficient)
store(NoiseModel, dump=NoiseModel.as_dict, load=_load_model)
store(TermEstimate, dump=_dump_term, load=_load_term)
