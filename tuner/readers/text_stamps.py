"""Dates and clock times in text: ISO 8601, and as spreadsheets, loggers and MATLAB write them."""

from __future__ import annotations

import datetime
import re
from typing import Any

MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
STAMP = re.compile(
    r"(?:(?P<day>\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.](?:\d{4}|\d{2})|\d{1,2}[- ][A-Za-z]{3}[- ]\d{4})"
    r"[T ]+)?"
    r"(?P<clock>\d{1,2}:\d{2}:\d{2}|\d{1,2}:\d{2}(?=[.,]\d))(?P<part>[.,:]\d{1,9})?(?: ?(?P<half>[AaPp][Mm]))?"
    r"(?P<zone>Z|UTC|[+-]\d{2}:?\d{2})?"
)
"""A date with time, or a clock time alone; minutes and seconds with a fraction, as Excel shows times."""


def seconds_of_stamps(stamps: Any, first: str) -> Any:
    """Return stamps, a pandas Series of text, as seconds since the beginning of a day, missing ones as NaN.

    Parameters
    ----------
    stamps : Series
        As the file has them.
    first : str
        Day of the first stamp of the file as it stands there; empty where stamps are clock times alone, which are then
        seconds of their day.

    Raises
    ------
    ValueError
        What is no stamp, or no day.
    """
    import pandas as pd

    if re.fullmatch(r"\d{4}[-/]\d{2}[-/]\d{2}", first):
        found = pd.to_datetime(stamps, format="ISO8601", utc=True)
        return (found - pd.Timestamp(first, tz="UTC")).dt.total_seconds()
    parts = stamps.str.strip(' "').str.extract(STAMP)
    if (parts["clock"].isna() & stamps.notna()).any():
        raise ValueError("no date with time")
    whole = parts["clock"].where(parts["clock"].str.count(":") > 1, "0:" + parts["clock"])
    clock = whole + parts["part"].fillna("").str.replace("[,:]", ".", regex=True)
    seconds = pd.to_timedelta(clock).dt.total_seconds()
    half = parts["half"].str.lower()
    seconds += 43200.0 * (half == "pm") - 43200.0 * (half.notna() & parts["clock"].str.startswith("12"))
    if first:
        days = {day: days_after(first, day) for day in parts["day"].dropna().unique()}
        seconds += 86400.0 * parts["day"].map(days)
    return seconds


def days_after(first: str, day: str) -> int:
    """Return the days from one date to another; of 05/01 and 05/02, the order that brings them nearest.

    Raises
    ------
    ValueError
        What is no date.
    """
    differences = [
        (other - one).days
        for one, other in zip(_readings(first), _readings(day), strict=True)
        if one and other
    ]
    if not differences:
        raise ValueError(f"no date: {day}")
    return min(differences, key=abs)


def _readings(day: str) -> tuple[datetime.date | None, datetime.date | None]:
    """Return a date with the day before the month, and with the month before the day; None where it is none."""
    numbers = [
        1 + MONTHS.index(word.lower()) if word.lower() in MONTHS else int(word) if word.isdecimal() else 0
        for word in re.split("[-/. ]", day)
    ]
    year, month, of_month = numbers if numbers[0] > 31 else numbers[::-1]
    one = _date(year, month, of_month)
    return one, _date(year, of_month, month) if "/" in day and numbers[0] <= 31 else one


def _date(year: int, month: int, day: int) -> datetime.date | None:
    try:
        return datetime.date(year, month, day)
    except ValueError:
        return None
