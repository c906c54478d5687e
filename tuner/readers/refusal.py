"""What a judgement says that refuses a log: what it measured, and the readings that might be meant instead.

The reader tries each of them (`tuner.readers.readings`) and names those that pass every judgement.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tuner.types.records import DataError

CUSTOMARY_UNITS = ("rad/s", "deg/s", "m/s^2", "g")
"""Units in which logs are written where nothing states another; samples in them are no whole numbers."""


@dataclass(frozen=True)
class Change:
    """Options of another reading.

    Attributes
    ----------
    unit, scale : mapping of str
        Unit, and units in one count, by sensor.
    columns : mapping of str to str
        Columns by role.
    requested : str
        What only its owner knows: the sensor whose count it is (``--gyro-scale X``), or the ``rate`` (``--rate HZ``);
        ``sums`` where increments of gyroscopes were made beside rates of accelerometers.
    when : str
        Under which condition it holds, in words.
    """

    unit: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    requested: str = ""
    when: str = ""

    def clashes(self, other: Change) -> bool:
        """Return whether both state the same thing, or exchange axes whose unit is then a rare one, counts, or stated.

        Among enough units some fit any numbers: two surprises at once show neither.
        """
        if self.scale and other.columns.keys() - {"t"}:
            return True
        both = self.with_(other)
        stated = any(" [" in column for column in both.columns.values())
        rare = not set(CUSTOMARY_UNITS).issuperset(both.unit.values())
        if any("_" in role for role in both.columns) and both.unit and (stated or rare):
            return True
        pairs = ((self.unit, other.unit), (self.columns, other.columns))
        return any(not a.keys().isdisjoint(b) for a, b in pairs)

    def with_(self, other: Change) -> Change:
        """Return both changes at once."""
        return Change(
            {**self.unit, **other.unit},
            {**self.scale, **other.scale},
            {**self.columns, **other.columns},
            self.requested or other.requested,
            " and ".join(text for text in (self.when, other.when) if text),
        )

    def __str__(self) -> str:
        mapped = ",".join(f"{role}={name}" for role, name in self.columns.items())
        words = [f"--columns '{mapped}'"] if mapped else []
        for sensor, unit in self.unit.items():
            words.append(f"--{sensor}-unit {unit}")
            if sensor in self.scale:
                words.append(f"--{sensor}-scale {self.scale[sensor]:.6g}")
            if sensor == self.requested:
                words.append(f"--{sensor}-scale X with the {unit} in one count of its data sheet")
        if self.requested == "rate":
            words.append("--rate HZ, the rate the sensor was set to")
        return " ".join(words) + (f" {self.when}" if self.when else "")


EVEN = Change(columns={"t": "none"}, requested="rate")
"""Even samples, whatever the stamps say, at a rate that only the owner knows."""


def without_options(message: str, known: frozenset[str] = frozenset()) -> str:
    """Return a line without the clauses that recommend an option which is not known; commands in quotes stay."""
    parts = re.split(r"(; |: (?=[a-z])|, or )", message)
    kept = parts[:1]
    for mark, clause in zip(parts[1::2], parts[2::2], strict=True):
        options = re.findall(r"(?<![\w`-])--[a-z][\w-]*", re.sub(r"`[^`]*`", "", clause))
        if known.issuperset(options):
            kept += [mark, clause]
    return "".join(kept)


class Contradiction(DataError):
    """A log whose samples are those of no sensor in order, as it is stated to be read."""


class Refusal(DataError):
    """A reading that the samples contradict.

    Parameters
    ----------
    measured : str
        One line: place, what was measured and what is expected.
    changes : sequence of Change
        Readings that may be meant, none of which was tried.
    contradicts : bool
        Whether the samples contradict what is stated; else something is not stated.
    """

    def __init__(self, measured: str, changes: Sequence[Change] = (), *, contradicts: bool = False) -> None:
        super().__init__(measured)
        self.changes, self.contradicts = tuple(changes), contradicts

    def line(self, text: str) -> DataError:
        """Return what the user is shown instead."""
        return (Contradiction if self.contradicts else DataError)(text)


class RowsApart(Refusal):
    """Sensors that stand in different rows of one table: each of the changes reads one of them."""
