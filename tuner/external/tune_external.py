"""Tune another program's filter as it is: run it on a drive, score its output, move a few factors, judge on the rest.

The factors are fitted to the first 60 % of the drive, and kept where the rest is more likely with them. The output is
scored as `tuner score` does, with the factors and without.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.score_output import OutputScore, score_outputs
from tuner.exporters import DIALECTS, text_of
from tuner.external.innovations import Deviations, common, deviations_of, errors_of, without_outliers
from tuner.external.inputs import Inputs, inputs_of
from tuner.external.noise_factors import NOISE_FACTORS, with_factors, with_two_numbers
from tuner.external.program import Program
from tuner.external.search import GRADIENT_BLOCKS, MAX_RUNS, Found, search
from tuner.readers.estimate import in_order, read_estimate
from tuner.readers.estimate_columns import Frames, assemble
from tuner.types import FilterConfig
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError, Drive

FITTED_SHARE = 0.6
"""Share of the drive that is fitted; the rest judges, as for our own filter."""
OUTPUT_FOLDERS = ("kf-gins",)
"""Dialects whose programs write where their settings say."""
NO_CHANGE = dict.fromkeys(NOISE_FACTORS, 1.0)


@dataclass(frozen=True)
class ExternalTuning:
    """The settings of another program's filter after it was run on a drive.

    Attributes
    ----------
    dialect : str
        Of its settings.
    found : Found
        Factors, runs, what was scored.
    gain : float
        Mean logarithm of the likelihood of the rest of the drive, with the factors less without, nats an epoch.
    gain_sd : float
        Its sd, by blocks of time.
    reference_gain : float or None
        The same of the errors against the reference of the drive, where it was not they that were fitted.
    ratios : (float, float)
        True rms ÷ predicted sd of the rest of the drive, without and with the factors.
    scores : (OutputScore, OutputScore)
        Of the whole drive, without and with the factors.
    config : FilterConfig
        With the factors where `kept`, else as it was.
    text : str
        The same in the dialect.
    notes : tuple of str
        What was assumed and done.
    """

    dialect: str
    found: Found
    gain: float
    gain_sd: float
    reference_gain: float | None
    ratios: tuple[float, float]
    scores: tuple[OutputScore, OutputScore]
    config: FilterConfig
    text: str
    notes: tuple[str, ...]

    @property
    def kept(self) -> bool:
        """Whether the part of the drive that was not fitted supports the factors, and no reference contradicts them."""
        return _is_kept(self.gain, self.reference_gain)


def tune_external(
    program: Program,
    drive: Drive,
    config: FilterConfig,
    dialect: str,
    *,
    path: str | Path,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> ExternalTuning:
    """Move the settings of a program's filter to the largest likelihood of its output on a drive.

    Parameters
    ----------
    program : Program
        The command.
    drive : Drive
        The drive.
    config : FilterConfig
        Where the search begins.
    dialect : str
        In which the program reads its settings.
    path : str or Path
        Of the drive, for programs that read it themselves.
    progress : callable, optional
        Called with the runs that are done, and with all.

    Raises
    ------
    DataError
        Where the program fails, takes too long or writes nothing that can be scored, in one line.
    """
    if dialect not in DIALECTS:
        raise DataError(f"--to: {DIALECTS.unknown(dialect)}")
    if dialect not in OUTPUT_FOLDERS and not program.names("output"):
        raise DataError(
            "--filter: expected {output}, the path of what the program writes, without ending, found none"
        )
    begin = config if dialect == "native" else with_two_numbers(config, DIALECTS[dialect])
    with tempfile.TemporaryDirectory(prefix="tuner-filter-") as name:
        scratch = Path(name)
        inputs = inputs_of(drive, begin, dialect, scratch)
        truth = _truth(inputs, scratch)
        notes = list(inputs.notes)

        def output_of(factors: Mapping[str, float]) -> FilterOutput:
            with tempfile.TemporaryDirectory(dir=scratch) as place:
                folder = Path(place)
                paths = inputs.write(with_factors(begin, factors), factors["fix sds"], folder)
                program.run(paths | {"drive": Path(path).resolve(), "output": folder / "output"}, folder)
                return _output(program, folder)

        progress(0, MAX_RUNS)
        untouched = output_of(NO_CHANGE)
        first = deviations_of(untouched, inputs.fixes, 1.0, truth)
        good = without_outliers(first)
        gross = np.setdiff1d(first.t, good.t)

        def run(factors: Mapping[str, float]) -> Deviations:
            found = deviations_of(output_of(factors), inputs.fixes, factors["fix sds"], truth)
            return found.rows(~np.isin(found.t, gross))

        until = float(good.t[0] + FITTED_SHARE * (good.t[-1] - good.t[0]))
        found = search(run, good, until=until, progress=progress)
        tuned = output_of(found.factors)
        progress(MAX_RUNS, MAX_RUNS)
    if len(gross):
        notes.append(
            f"{len(gross)} fixes left out of the likelihood: gross outliers for the filter as it was"
        )
    if not found.converged:
        notes.append(f"the search ended after {found.runs} runs, before its steps were small")
    before, after = _rest(found.before, found.after, until)
    gains = after.log_likelihood() - before.log_likelihood()
    blocks = [float(part.mean()) for part in np.array_split(gains, GRADIENT_BLOCKS)]
    gain = float(gains.mean())
    reason = f"as {Path(program.words[0]).name} showed on {drive.name}"
    reference_gain = None if before.kind == "errors" else _reference_gain(untouched, tuned, truth, until)
    kept = _is_kept(gain, reference_gain)
    final = with_factors(begin, found.factors, reason=reason) if kept else config
    return ExternalTuning(
        dialect,
        found,
        gain,
        float(np.std(blocks, ddof=1) / np.sqrt(GRADIENT_BLOCKS)),
        reference_gain,
        (before.ratio(), after.ratio()),
        (_scored(untouched, found.before, truth), _scored(tuned, found.after, truth)),
        final,
        text_of(final, dialect),
        tuple(notes),
    )


def _is_kept(gain: float, reference_gain: float | None) -> bool:
    """Return whether the rest of the drive is likelier with the factors, and the errors against its reference, too."""
    return gain > 0.0 and (reference_gain is None or reference_gain > 0.0)


def _rest(one: Deviations, other: Deviations, until: float) -> tuple[Deviations, Deviations]:
    """Return the rows of two series at the same instants, after the part of the drive that was fitted."""
    rows, same = common(one, other)
    late = one.t[rows] > until
    return one.rows(rows[late]), other.rows(same[late])


def _reference_gain(
    untouched: FilterOutput, tuned: FilterOutput, truth: FilterOutput | None, until: float
) -> float | None:
    """Mean gain of the log-likelihood of an epoch, nats: errors against the reference, rest of the drive."""
    one, other = errors_of(untouched, truth), errors_of(tuned, truth)
    if one is None or other is None or one.z.shape[1] != other.z.shape[1]:
        return None
    before, after = _rest(one, other, until)
    return float(np.mean(after.log_likelihood() - before.log_likelihood())) if len(before.t) else None


def _truth(inputs: Inputs, scratch: Path) -> FilterOutput | None:
    """Return the reference of the drive on the clock of the program."""
    reference = inputs.drive.reference
    if reference is None:
        return None
    if inputs.tree is not None:
        return read_estimate(scratch / "drive-truth.nav")
    columns: dict[str, tuple[FloatArray, str | None]] = {"t": (reference.t + inputs.drive.origin, "s")}
    parts = (
        (("lat", "lon", "height"), reference.llh, ("rad", "rad", "m")),
        (("vn", "ve", "vd"), reference.vel_n, ("m/s",) * 3),
        (("roll", "pitch", "yaw"), reference.rpy, ("rad",) * 3),
    )
    for names, values, units in parts:
        columns |= {name: (values[:, j], units[j]) for j, name in enumerate(names)}
    return in_order(assemble(f"reference of {inputs.drive.name}", columns, Frames()))


def _output(program: Program, folder: Path) -> FilterOutput:
    """Return what the program wrote."""
    if not program.names("output"):
        return read_estimate(folder)
    written = sorted(folder.glob("output*"))
    if len(written) != 1:
        raise DataError(f"--filter: expected one file at {{output}}, with any ending, found {len(written)}")
    return read_estimate(written[0])


def _scored(output: FilterOutput, scored: Deviations, truth: FilterOutput | None) -> OutputScore:
    """Return the scores of an output, against the truth where there is one, else by its innovations."""
    if truth is not None or output.has_innovations:
        return score_outputs([output], [] if truth is None else [truth])
    k, d = len(scored.t), scored.z.shape[1]
    z, s = np.full((k, 6), np.nan), np.full((k, 6, 6), np.nan)
    z[:, :d], s[:, :d, :d] = scored.z, scored.s
    near = np.searchsorted(output.t, scored.t).clip(0, len(output) - 1)
    rows = np.unique(near, return_index=True)[1]
    fixed = replace(output.rows(near[rows]), innovation=z[rows], innovation_covariance=s[rows])
    return score_outputs([fixed])
