"""Sensors side by side: logs, stored identifications, datasheets and built-in grades, or the parts of one log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from tuner.catalogue.grades import grade_names
from tuner.identification.comparison import Comparison, compare_identifications
from tuner.identification.identify import identify
from tuner.identification.identify_source import SOURCE, identify_source, records_name
from tuner.readers import read
from tuner.readers.source_kind import is_file, is_log, source_name, unit_of_log
from tuner.segments.conditions import still_parts, temperature_parts
from tuner.types import Identification
from tuner.types.arguments import expect_records
from tuner.types.progress import Progress, silent
from tuner.types.records import DataError, Record

Source = str | Path | Identification | Sequence[Record]


def compare_sources(
    *sources: Source,
    by: Literal["still", "temperature"] | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Compare sensors coefficient by coefficient; ratios are of the last source to the first.

    Parameters
    ----------
    *sources : str, Path, Identification or sequence of Record
        Two or more of what `tuner.identification.identify_source` takes, or identifications.
    by : str, optional
        Compares the parts of one log instead: the stretches at rest between motions (``still``), or three bins of
        temperature (``temperature``).
    progress : callable, optional
        Called with one line at each step.

    Raises
    ------
    DataError
        For fewer than two sources or parts, or a source that cannot be identified.
    """
    if by is not None:
        return _compare_parts(sources, by, progress)
    for one in sources:
        if isinstance(one, str | Path) and is_file(one) and not unit_of_log(one)[0].exists():
            raise DataError(f"{one}: no such file")
    if len(sources) < 2:
        raise DataError(
            f"compare: expected two sources or more, found {' '.join(map(_shown, sources)) or 'none'}; add a log or a "
            f"grade ({' '.join(grade_names())}), or take one log apart (by: still, temperature)"
        )
    found = [
        one if isinstance(one, Identification) else identify_source(one, arma=None, progress=progress)
        for one in sources
    ]
    return compare_identifications([_name(one) for one in sources], found)


def _compare_parts(
    sources: Sequence[Source], by: Literal["still", "temperature"], progress: Progress
) -> Comparison:
    """Compare the parts of one log that were recorded under different conditions."""
    if len(sources) == 1 and isinstance(source := sources[0], str | Path) and is_log(source):
        records: Sequence[Record] = read(source)
    elif len(sources) == 1 and not isinstance(sources[0], str | Path | Identification):
        records = expect_records(sources[0], "compare")
    else:
        found = " ".join(map(_shown, sources)) or "none"
        raise DataError(f"compare: by {by}: expected one log, found {found}")
    parts = still_parts(records) if by == "still" else temperature_parts(records)
    progress(f"identifying {len(parts)} parts")
    return compare_identifications(
        [part.name for part in parts], [identify(part.records, arma=None) for part in parts]
    )


def _shown(source: Source) -> str:
    """Return a source as its user names it."""
    return str(source) if isinstance(source, str | Path) else _name(source)


def _name(source: Source) -> str:
    """Return the name of a source in the comparison."""
    if isinstance(source, str | Path):
        return source_name(source)
    if isinstance(source, Identification):
        return str(source.source.get("name", "unnamed"))
    return records_name(expect_records(source, "compare", SOURCE))
