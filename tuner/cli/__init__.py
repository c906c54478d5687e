"""The command line, `tuner COMMAND …`; each command lives in a file of its own, imported when used.

Exit status: 0 done; 1 done, but with a verdict against the filter or the model (only with ``--strict``);
2 bad usage or bad input, said in one line; 3 a mistake of this program; 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import importlib
import os
import sys
import traceback
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

import click

# Threads inside small matrix products cost more than they give; this must be said before numpy is imported.
# Their sums also depend on the number of threads in the last digit.
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")

from models.registry import RegistryError
from tuner.cli.examples import EXAMPLES
from tuner.cli.package_check import foreign_models
from tuner.cli.process import ANSWERS, Terminated, answer, kernel_cache, robust_streams, termination
from tuner.formats.files import STAGE
from tuner.formats.guard import reason
from tuner.formats.packages import python
from tuner.process import keep_freed_memory
from tuner.readers.refusal import without_options
from tuner.types.one_line import printable
from tuner.types.records import DataError

COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "tune": "The main job: from a log to a filter configuration, with report.",
        "identify": "Noise terms of a log, with intervals.",
        "diagnose": "What a simulation of the noise, or a filter on a drive, gets wrong, and why.",
        "examine": "What is wrong with the streams of a drive, before any filter.",
        "covariances": "Which covariance to give each stream of a recording.",
        "check": "Is the filter consistent? Monte-Carlo on simulated trajectories.",
        "navigate": "Filter a measured drive: innovations, errors, outages.",
        "score": "Any filter on trial: is its output as uncertain as it says, and if not, why?",
        "plan": "How long a static test must be.",
        "curve": "One empirical curve: Allan family, spectrum, correlation.",
        "compare": "Logs, identifications and built-in grades side by side.",
        "choose": "Which built-in grade keeps the position without fixes within a limit.",
        "fleet": "Many logs, one row a unit: limits, outlying units, spread.",
        "export": "Write a configuration in the dialect of another filter.",
        "simulate": "A log or a drive of a sensor, with effects on request.",
    }
)
"""Every command with its line of help; its code is `tuner.cli.commands.NAME.command`."""

ISSUES = "the issue tracker of ins-noise-tuner"
"""Where to report."""


class _Commands(click.Group):
    """Commands imported on use, so that starting is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        command = importlib.import_module(f"tuner.cli.commands.{cmd_name}").command
        assert isinstance(command, click.Command)
        lines = "\n".join(f"  {line}" for line in EXAMPLES[cmd_name])
        command.epilog = f"\b\nExamples:\n{lines}"
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="ins-noise-tuner", message="%(package)s %(version)s")
def tuner() -> None:
    """Turn inertial-sensor recordings into navigation-filter settings one can trust."""


def main() -> None:
    """Run the command line and leave the process with its exit status."""
    robust_streams()
    keep_freed_memory()
    if not sys.warnoptions:
        warnings.simplefilter(
            "ignore", RuntimeWarning
        )  # of arithmetic, in libraries: what matters of it is a note
    if (clash := foreign_models()) is not None:
        sys.exit(_refuse(clash))
    try:
        with kernel_cache(), termination():
            status = run(sys.argv[1:])
    except (KeyboardInterrupt, Terminated) as request:  # before the command began, or after it
        status = 143 if isinstance(request, Terminated) else 130
    if status in ANSWERS:  # threads that still work would hold up the usual end
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit status; bad usage and bad input are one line on standard error."""
    try:
        status = tuner.main(
            args=list(arguments), prog_name="tuner", standalone_mode=False, obj=tuple(arguments)
        )
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        _write_error(error.format_message())
        return 2
    except click.ClickException as error:
        return _refuse(error.format_message())
    except BrokenPipeError:  # whoever read the tables has seen enough; files are written before
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (DataError, RegistryError) as error:
        return _refuse(_possible(str(error), arguments))
    except OSError as error:
        return _refuse(_of_system(error, arguments))
    except ImportError as error:
        return _refuse(_missing(arguments[0], error))
    except MemoryError as error:
        return _refuse(f"not enough memory: {error}; ask for less, or split the log")
    except (click.Abort, KeyboardInterrupt):
        _write_error(answer(130))
        return 130
    except Terminated:
        _write_error(answer(143))
        return 143
    except Exception as error:
        return _report_fault(error)
    return status if isinstance(status, int) else 0


def _possible(message: str, arguments: Sequence[str]) -> str:
    """Return a refusal without the advice of options that the command which is run does not have."""
    command = tuner.get_command(click.Context(tuner), arguments[0]) if arguments else None
    if command is None:
        return message
    return without_options(message, frozenset(option for param in command.params for option in param.opts))


def _of_system(error: OSError, arguments: Sequence[str]) -> str:
    """Say what the system refused of which file: beside a temporary one, of its folder; of none, of what was given."""
    given = [one for one in arguments if Path(one).exists()]
    path = Path(str(error.filename or ", ".join(given) or "no file"))
    return f"{path.parent if path.name.startswith(STAGE) else path}: {error.strerror or error}"


def _missing(command: str, error: ImportError) -> str:
    """Say which package a command lacks, and what to install; every kernel needs numba, whatever the options are."""
    last = error.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    raised_in = "" if last is None else str(last.tb_frame.f_globals.get("__name__"))
    if "numba" in {(error.name or "").partition(".")[0], raised_in.partition(".")[0]}:
        return (
            f"'tuner {command}' needs numba, which cannot be loaded ({error}); install one that fits the installed "
            f"numpy: {python()} -m pip install --upgrade numba numpy; no option and no smaller number of runs does "
            "without it"
        )
    return f"a package that 'tuner {command}' needs cannot be loaded ({error}); install it anew"


def _write_error(text: str) -> None:
    """Write on standard error; where that is full or gone, the exit status says what it can."""
    with suppress(OSError):
        sys.stderr.write(text + "\n")
        sys.stderr.flush()


def _refuse(message: str) -> int:
    _write_error("tuner: " + printable(message))
    return 2


def _report_fault(error: Exception) -> int:
    """Say in one line that this program made a mistake, where, and what a report of it needs."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [
        f
        for f in frames
        if Path(f.filename).parts[-4:-1] and {"tuner", "models"} & set(Path(f.filename).parts)
    ]
    at = f" in {Path(ours[-1].filename).name}, line {ours[-1].lineno}" if ours else ""
    line = (
        f"a mistake of this program, not of the input: {type(error).__name__}{at}: {reason(error)}; "
        f"please report it with the command and, if you may, the file: {ISSUES}"
    )
    _write_error("tuner: " + printable(line))
    return 3
