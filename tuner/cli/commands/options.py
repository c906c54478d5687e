"""Options that several commands share."""

from __future__ import annotations

import functools
import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from tuner.cli.progress import Messages
from tuner.formats.documents import json_text
from tuner.formats.files import inputs_kept, refuse_input, write_text
from tuner.jobs import limited, within
from tuner.limits import MAX_RATE, MIN_RATE
from tuner.stages import finished
from tuner.types.one_line import printable
from tuner.types.records import DataError

Command = Callable[..., Any]


class AnyFinite(click.types.FloatParamType):
    """A finite number: click's own lets NaN and infinity pass."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, or refuse it."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


class Finite(AnyFinite, click.FloatRange):
    """A finite number in a range."""


POSITIVE = Finite(min=0, min_open=True)
RATE = Finite(min=MIN_RATE, max=MAX_RATE)
FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
"""Formats of figures, by the ends of their names."""
LONGEST_COMMAND = 1 << 20
"""Characters of a command on a page: those of thousands of files."""
WITHOUT_NUMBERS = ("-o", "--output-dir", "--json", "--page", "--figure", "--jobs")
"""Options followed by a word that changes no number of a result: where it goes, and on how many processors."""
WRITTEN = frozenset(WITHOUT_NUMBERS) - {"--jobs"}
"""Options that name what is written."""
OUTPUT_FLAGS = ("--quiet", "--verbose")
"""Options that change how much is printed."""


class Folder(click.Path):
    """A folder that is written into: made where it does not exist, which a file in its way forbids."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path; refuse an empty one, and one on whose way a file lies."""
        if not str(value):
            self.fail("expected a folder, found an empty name; the current one is .", param, ctx)
        if taken := [one for one in Path(value).parents if one.exists() and not one.is_dir()]:
            self.fail(f"expected a folder, found the file {taken[0]}", param, ctx)
        there = next((one for one in (Path(value), *Path(value).parents) if one.exists()), Path())
        if not os.access(there, os.W_OK):
            self.fail(f"expected a folder that can be written, found {there}, which cannot", param, ctx)
        return super().convert(value, param, ctx)


DIRECTORY = Folder(path_type=Path, file_okay=False)


@dataclass(frozen=True)
class Reading:
    """What the user states of a log: units, rate, columns, memory in bytes, part; arguments of `tuner.readers.read`."""

    rate: float | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    gyro_scale: float | None = None
    accel_scale: float | None = None
    columns: Mapping[str, str] | None = None
    assume: str | None = None
    memory: float | None = None
    begin: float | None = None
    end: float | None = None

    @property
    def words(self) -> tuple[str, ...]:
        """The same as options, for the command that follows."""
        columns = ",".join(f"{name}={column}" for name, column in (self.columns or {}).items()) or None
        stated = {**vars(self), "columns": columns, "memory": self.memory and self.memory / 1e9}
        given = {name.replace("_", "-"): value for name, value in stated.items() if value is not None}
        return tuple(f"--{name}={value}" for name, value in given.items())


@dataclass(frozen=True)
class Output:
    """Where the machine-readable result goes: a file, standard output (``-``) or nowhere."""

    json_file: str | None

    @property
    def tables(self) -> bool:
        """Whether tables may be printed: standard output is not taken by JSON."""
        return self.json_file != "-"

    def write(self, content: Mapping[str, Any]) -> None:
        """Write the JSON result, if one is wanted."""
        if self.json_file == "-":
            finished()
            text = json_text(content)
            if (
                "utf" not in (sys.stdout.encoding or "utf").lower()
            ):  # other code pages lack characters of the text
                text = json.dumps(json.loads(text), indent=1) + "\n"
            sys.stdout.write(text)
        elif self.json_file is not None:
            write_text(Path(self.json_file), json_text(content))


def common(command: Command) -> Command:
    """Add ``--json``, ``--seed``, ``--quiet``; the command receives `output`, `seed` and `messages`."""

    @click.option(
        "--json",
        "json_file",
        metavar="FILE",
        callback=_json_file,
        help="Write the result as JSON (- for standard output).",
    )
    @click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        metavar="N",
        help="Seed of all random numbers.",
    )
    @click.option("--quiet", is_flag=True, help="Show no progress and no messages.")
    @functools.wraps(command)
    def wrapped(*args: Any, json_file: str | None, quiet: bool, **options: Any) -> Any:
        messages = Messages(quiet)
        read, written = _files_named(click.get_current_context())
        with inputs_kept(read), messages.kept(), messages.steps():
            for path in written:
                refuse_input(path)
            return command(*args, output=Output(json_file), messages=messages, **options)

    return wrapped


def _files_named(context: click.Context) -> tuple[list[Path], list[Path]]:
    """Return the paths that a command line names: those that may be read, and those that are written."""
    from tuner.readers.source_kind import unit_of_log

    read: list[Path] = []
    written: list[Path] = []
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        values = value if isinstance(value, tuple | list) else (value,)
        paths = [Path(one) for one in values if isinstance(one, str | Path)]
        if WRITTEN.isdisjoint(parameter.opts):
            read += [unit_of_log(path)[0] for path in paths]
        else:
            written += paths
    return read, written


def drawable(_ctx: click.Context, _parameter: click.Parameter, path: Path | None) -> Path | None:
    """Refuse a figure in a format that is not drawn, before anything is computed."""
    if path is not None and path.suffix.lower() not in ("", *FIGURE_SUFFIXES):
        raise click.BadParameter(f"expected a file that ends in {', '.join(FIGURE_SUFFIXES)}, got '{path}'")
    return path


def paged(command: Command) -> Command:
    """Add ``--page``; the command receives `page`, a function that writes results by their headings where wanted."""

    @click.option(
        "--page",
        "page_file",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="Write tables and figures as one offline page (HTML).",
    )
    @functools.wraps(command)
    def wrapped(*args: Any, page_file: Path | None, messages: Messages, **options: Any) -> Any:
        def page(title: str, results: Mapping[str, object]) -> None:
            if page_file is not None:
                from tuner.report.result_views import page_of

                write_text(
                    page_file,
                    page_of(results, printable(title), stated_command(click.get_current_context().obj)),
                )
                messages.say(f"wrote {page_file}")

        return command(*args, page=page, messages=messages, **options)

    return wrapped


def strict(verdict: str) -> Callable[[Command], Command]:
    """Add ``--strict``: exit status 1 where the verdict is the one given."""
    return click.option("--strict", is_flag=True, help=f"Exit status 1 where {verdict}.")


def folder(content: str) -> Callable[[Command], Command]:
    """Add ``-o``; the command receives as ``directory`` the folder to write into, None where nothing is."""
    return click.option("-o", "--output", "directory", type=DIRECTORY, metavar="DIR", help=content)


def verbose(command: Command) -> Command:
    """Add ``--verbose``; the command receives whether everything is to be shown in full."""
    return click.option(
        "--verbose",
        is_flag=True,
        help="Print every table in full, not only the short answer.",
    )(command)


def noise_terms(command: Command) -> Command:
    """Add ``--terms``; the command receives a tuple of names of noise terms, or None."""
    option = click.option(
        "--terms",
        callback=term_list,
        metavar="LIST",
        help="Fit exactly these noise terms, such as white,gauss_markov,random_walk.",
    )
    return option(command)


def horizon(command: Command) -> Command:
    """Add ``--horizon``, s."""
    option = click.option(
        "--horizon",
        type=POSITIVE,
        default=1000.0,
        show_default=True,
        metavar="S",
        help="Longest time the filter must predict without aiding, s.",
    )
    return option(command)


def latitude(command: Command) -> Command:
    """Add ``--latitude``, deg."""
    option = click.option(
        "--latitude",
        type=Finite(-90, 90),
        metavar="DEG",
        help="Latitude of the recording: the Earth's rate is subtracted from the gyro means.",
    )
    return option(command)


def lever_arm(command: Command) -> Command:
    """Add ``--lever-arm``; the command receives three numbers, m, or None."""
    option = click.option(
        "--lever-arm",
        callback=three_numbers,
        metavar="X,Y,Z",
        help="From the sensor to the antenna: forward, right, down, m.",
    )
    return option(command)


def replicas(command: Command) -> Command:
    """Add ``--replicas``."""
    option = click.option(
        "--replicas",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        metavar="N",
        help="Records simulated for each finding, whose range the figures show as a band; 0 for none.",
    )
    return option(command)


def jobs(command: Command) -> Command:
    """Add ``--jobs``: how many processors everything in the command may use."""

    @click.option(
        "--jobs",
        type=click.IntRange(1),
        metavar="N",
        help="Processors to use; default all. The results are the same for any number.",
    )
    @functools.wraps(command)
    def wrapped(*args: Any, jobs: int | None, **options: Any) -> Any:
        with limited(jobs):
            return command(*args, **options)

    return wrapped


def reading(command: Command) -> Command:
    """Add the options on units, rate and columns of a log; the command receives `reading`."""

    @click.option(
        "--rate",
        type=RATE,
        metavar="HZ",
        help="Sampling rate, Hz, where the log has no time stamps.",
    )
    @click.option(
        "--gyro-unit",
        metavar="UNIT",
        help="Unit of the gyros: rad/s deg/s deg/h mrad/s mdeg/s, or increments rad deg arcsec.",
    )
    @click.option(
        "--accel-unit",
        metavar="UNIT",
        help="Unit of the accelerometers: m/s^2 g mg ug cm/s^2 ft/s^2, or increments m/s cm/s ft/s.",
    )
    @click.option("--gyro-scale", type=float, metavar="X", help="Size of one gyro count in that unit.")
    @click.option(
        "--accel-scale", type=float, metavar="X", help="Size of one accelerometer count in that unit."
    )
    @click.option(
        "--columns",
        metavar="NAME=COLUMN,…",
        help="Columns of the log, or arrays of an NPZ, such as gyro_x=wx,t=stamp; t=none reads no stamps.",
    )
    @click.option(
        "--assume",
        type=click.Choice(["si"]),
        help="Take samples whose unit nothing states as rad/s and m/s^2.",
    )
    @click.option(
        "--memory",
        type=POSITIVE,
        metavar="GB",
        help="Memory that the program may take, by default half of what is free and what 4 million rows need. A longer "
        "log is read as means of neighbouring samples. As many processors are used as fit.",
    )
    @click.option(
        "--begin",
        type=AnyFinite(),
        metavar="S",
        help="Use a static log from this time on, s, of its own clock, as answers state times.",
    )
    @click.option(
        "--end", type=AnyFinite(), metavar="S", help="Use a static log up to this time of its own clock, s."
    )
    @functools.wraps(command)
    def wrapped(
        *args: Any,
        rate: float | None,
        gyro_unit: str | None,
        accel_unit: str | None,
        gyro_scale: float | None,
        accel_scale: float | None,
        columns: str | None,
        assume: str | None,
        memory: float | None,
        begin: float | None,
        end: float | None,
        **options: Any,
    ) -> Any:
        from tuner.readers import parse_columns

        chosen = None if columns is None else parse_columns(columns)
        size = None if memory is None else 1e9 * memory
        how = Reading(rate, gyro_unit, accel_unit, gyro_scale, accel_scale, chosen, assume, size, begin, end)
        with within(size):
            return command(*args, reading=how, **options)

    return wrapped


def stated_command(words: Sequence[str]) -> str:
    """Return a command line as a shell reads it, without what only says where results go, and printable."""
    kept: list[str] = []
    rest = iter(words)
    for word in rest:
        if word in WITHOUT_NUMBERS:
            next(rest, None)
        elif word not in OUTPUT_FLAGS and not word.startswith(
            ("-o", *(f"{name}=" for name in WITHOUT_NUMBERS))
        ):
            kept.append(word)
    return printable(shlex.join(["tuner", *kept]), longest=LONGEST_COMMAND)


def term_list(
    _context: click.Context, _parameter: click.Parameter, value: str | None
) -> tuple[str, ...] | None:
    """Turn ``white,random_walk`` into names of noise terms that can be fitted (a callback of click)."""
    if value is None:
        return None
    from models.noise import TERMS

    fitted = [name for name, kind in TERMS.items() if kind.fitted]
    names = tuple(part.strip() for part in value.split(","))
    if unknown := [name for name in names if name not in fitted]:
        raise click.BadParameter(f"expected terms out of {' '.join(fitted)}, got {unknown[0]!r}")
    from tuner.identification.objective import expect_terms

    try:
        expect_terms(names)
    except DataError as error:
        raise click.UsageError(f"--{error}") from None
    return names


def three_numbers(
    _context: click.Context, parameter: click.Parameter, value: str | None
) -> tuple[float, float, float] | None:
    """Turn ``1,2.5,-3`` into three finite numbers (a callback of click)."""
    if value is None:
        return None
    try:
        x, y, z = (float(part) for part in value.split(","))
    except ValueError:
        x = y = z = math.nan
    if not math.isfinite(x + y + z):
        raise click.UsageError(f"{parameter.opts[0]} {value}: expected three numbers with commas between")
    return x, y, z


def state(_context: click.Context, _parameter: click.Parameter, values: tuple[str, ...]) -> dict[str, float]:
    """Turn ``NAME=SD`` texts into prior sds of optional states of the filter (a callback of click)."""
    from models.filter_states import named_states

    states = {}
    for text in values:
        name, _, value = text.partition("=")
        try:
            sd = float(value)
        except ValueError:
            sd = -1.0
        if name not in named_states() or not 0.0 < sd < math.inf:
            raise click.UsageError(
                f"--state {text}: expected NAME=SD with NAME one of {' '.join(named_states())} and a positive SD"
            )
        states[name] = sd
    return states


def _json_file(_context: click.Context, _parameter: click.Parameter, value: str | None) -> str | None:
    if value is not None and value != "-" and not value.endswith(".json"):
        raise click.BadParameter(
            f"expected a file that ends in .json, or - for standard output, got {value!r}"
        )
    return value
