"""A filter's output, or a truth, in a CSV with named columns: `tuner.readers.estimate_columns`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tuner.readers.estimate_column_names import canonical_name, is_known
from tuner.readers.estimate_columns import Frames, assemble, read_columns
from tuner.readers.text_dialect import Dialect, find_dialect
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError


def names_known_columns(dialect: Dialect) -> bool:
    """Tell whether the header of a text file names a time and something that is estimated."""
    names = {canonical_name(name)[0] for name in dialect.names}
    return dialect.header and "t" in names and any(is_known(name) for name in names - {"t"})


def read_estimate_csv(
    path: Path, frames: Frames, *, columns: Mapping[str, str] | None = None
) -> FilterOutput:
    """Read a CSV, TSV or blank-separated file with a header.

    Parameters
    ----------
    path : Path
        The file.
    frames : Frames
        Axes that the names do not state.
    columns : mapping of str to str, optional
        Columns of the file by our name, a unit may follow in brackets: ``{"sd_n [cm]": "stdN"}``.

    Raises
    ------
    DataError
        What cannot be used, in one line.
    """
    dialect = find_dialect(path)
    found = chosen_columns(str(path), dialect.names, columns or {})
    places = {name: (dialect.names.index(written), unit) for name, (written, unit) in found.items()}
    return assemble(str(path), read_columns(path, dialect, places), frames)


def chosen_columns(
    source: str, names: tuple[str, ...], mapped: Mapping[str, str]
) -> dict[str, tuple[str, str | None]]:
    """Return name in the file and stated unit of every column that is used, by canonical name."""
    found: dict[str, tuple[str, str | None]] = {}
    for wanted, written in mapped.items():
        name, unit = canonical_name(wanted)
        if not is_known(name):
            raise DataError(
                f"{source}: --columns {wanted}={written}: expected a name such as lat, vn, roll or sd_vn"
            )
        if written not in names:
            raise DataError(
                f"{source}: --columns {wanted}={written}: expected one of the columns {', '.join(names)}"
            )
        found[name] = (written, unit or canonical_name(written)[1])
    for written in names:
        name, unit = canonical_name(written)
        if not is_known(name) or written in mapped.values():
            continue
        if name in found:
            if name not in {canonical_name(wanted)[0] for wanted in mapped}:
                both = f"'{found[name][0]}' and '{written}'"
                raise DataError(
                    f"{source}: columns {both} both name {name}: choose by --columns {name}=COLUMN"
                )
            continue
        found[name] = (written, unit)
    if set(found) <= {"t"}:
        raise DataError(
            f"{source}: expected columns such as t, lat, lon, height, vn, ve, vd, roll, pitch, yaw, sd_n, … found "
            f"{', '.join(names)}; name them with --columns"
        )
    return found
