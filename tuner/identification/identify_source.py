"""The noise of whatever a source is: a built-in grade, a datasheet, a stored result, an Allan curve or a log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from tuner.catalogue.datasheet import is_datasheet, read_datasheet
from tuner.catalogue.grades import grade_identification, grade_names, load_gnss, load_grade
from tuner.identification.arma import MAX_ORDER, Criterion
from tuner.identification.from_curve import identify_curve
from tuner.identification.gnss_receiver import ReceiverErrors, identify_receiver
from tuner.identification.identify import identify
from tuner.readers import is_curve, read, read_curve
from tuner.readers.gnss_log import read_fixes
from tuner.readers.source_kind import is_file, source_name
from tuner.readers.stored_identification import is_stored, read_stored
from tuner.segments.conditions import at_rest
from tuner.segments.multi_position import calibrate
from tuner.types import GnssNoise, Identification
from tuner.types.arguments import RECORDS, expect, expect_records
from tuner.types.number_ranges import ArmaOrder, Latitude
from tuner.types.progress import Progress, silent
from tuner.types.public import public
from tuner.types.records import DataError, Record

if TYPE_CHECKING:
    import pandas as pd

    from tuner.readers.logs_in_memory import Table

SOURCE = f"the path of a log or datasheet, the name of a built-in grade, or {RECORDS}"
"""What describes the noise of a sensor."""
SEVERAL_POSES = "several poses: `tuner tune` also calibrates the sensors from them"


@public("identify")
def identify_source(
    source: str | Path | Sequence[Record],
    *,
    terms: Sequence[str] | None = None,
    method: str = "likelihood",
    arma: Criterion | None = "bic",
    arma_orders: ArmaOrder = MAX_ORDER,
    latitude: Latitude | None = None,
    progress: Progress = silent,
) -> Identification:
    """Return the noise of a sensor, whatever describes it.

    Parameters
    ----------
    source : str, Path or sequence of Record
        The name of a built-in grade; the path of a datasheet, a noise.yaml, the JSON of an identification, an Allan
        curve or a log; or the records of a log.
    terms, method, arma, arma_orders, latitude
        As of `tuner.identify`; a grade, a datasheet and a stored result are taken as they are.
    progress : callable, optional
        Called with one line at each step.

    Raises
    ------
    DataError
        If the source is none of these, or cannot be identified.
    """
    if isinstance(source, str | Path):
        expect(source, (str, Path), "noise", SOURCE)
        if not is_file(source):
            if source not in grade_names():
                raise DataError(
                    f"{source}: expected a file or a built-in grade ({' '.join(grade_names())}), found neither"
                )
            return grade_identification(load_grade(str(source)))
        path = Path(source)
        if is_datasheet(path):
            return read_datasheet(path)
        if is_stored(path):
            return read_stored(path)
        if is_curve(path):
            return identify_curve(read_curve(path), source=source_name(path), terms=terms)
        source = read(path)
    source = expect_records(source, "noise", SOURCE)
    records = at_rest(source, progress)
    if calibrate(source) is not None:
        progress(SEVERAL_POSES)
    progress("identifying")
    return identify(
        records, terms=terms, method=method, arma=arma, arma_orders=arma_orders, latitude=latitude
    )


@public("identify")
def identify_log(
    log: str | Path | Sequence[Record] | Table | pd.DataFrame,
    *,
    terms: Sequence[str] | None = None,
    method: str = "likelihood",
    arma: Criterion | None = "bic",
    arma_orders: ArmaOrder = MAX_ORDER,
    latitude: Latitude | None = None,
    **reading: Any,
) -> Identification:
    """Return the noise of a log in its parts at rest, or the noise that another description of the sensor states.

    Parameters
    ----------
    log : str, Path, sequence of Record, mapping of str to array, or DataFrame
        A file or table that `tuner.read` reads, or what it returned; or, without `reading`, what else describes the
        noise of a sensor: the name of a built-in grade, a datasheet, a noise.yaml, a curve.
    terms, method, arma, arma_orders, latitude
        As of `identify`, which takes records as they are.
    **reading
        Options of `tuner.read` where it is a file or table: ``rate``, ``gyro_unit``, ``columns`` …

    Raises
    ------
    DataError
        If nothing can be read, or no part stands still.
    """
    if isinstance(log, str | Path) and not reading:
        return identify_source(
            log, terms=terms, method=method, arma=arma, arma_orders=arma_orders, latitude=latitude
        )
    known = isinstance(log, Sequence) and all(isinstance(one, Record) for one in log)
    if reading and (known or isinstance(log, Record)):
        raise DataError(
            f"identify: {next(iter(reading))}: expected with the path of a log or a table, found records, "
            "which are read already; leave it out"
        )
    records = expect_records(log, "identify") if known else read(cast(Any, log), **reading)
    return identify(
        at_rest(records), terms=terms, method=method, arma=arma, arma_orders=arma_orders, latitude=latitude
    )


def identify_fixes(log: str | Path, progress: Progress = silent) -> ReceiverErrors:
    """Return the errors of a GNSS receiver from a log of its fixes at rest (a CSV ``t,lat,lon,height,…``)."""
    progress(f"identifying the receiver from {Path(log).name}")
    return identify_receiver(read_fixes(log), name=source_name(log))


def receiver_of_source(source: str | Path, progress: Progress = silent) -> GnssNoise:
    """Return the errors of a GNSS receiver: of a built-in grade, or identified from a log of fixes at rest."""
    return identify_fixes(source, progress).noise if is_file(source) else load_gnss(str(source))


def records_name(records: Sequence[Record]) -> str:
    """Return the short name of the log that records come from."""
    return source_name(records[0].source) if records[0].source else records[0].name
