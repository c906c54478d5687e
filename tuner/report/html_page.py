"""The report as one HTML page, complete in itself: verdict, settings, findings, curves, check, limits and provenance.

It makes no request: pictures, style, data and the drawing library are in the file, which can be mailed, opened offline
and printed. The same result gives the same bytes. Layout: ``templates/report.html.j2``.
"""

from __future__ import annotations

import functools
import gzip
from base64 import b64encode
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs
from rich.table import Table

from tuner.exporters import DIALECTS, export, lacking
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import term_title
from tuner.jobs import each
from tuner.pipeline import EXPORTED_DIALECTS
from tuner.report.alike_sentences import alike_sentences
from tuner.report.axis_figure import axis_figure
from tuner.report.calibration_text import calibration_lines
from tuner.report.consistency_tables import consistency_tables
from tuner.report.drive_answer import fixes_parts
from tuner.report.identification_tables import identification_tables
from tuner.report.interactive_figure import Chart, charts_of_figure
from tuner.report.noise_table import legend, more_white_noise, states_tables
from tuner.report.page_findings import findings_content
from tuner.report.page_parts import Picture, blocks
from tuner.report.prediction_tables import prediction_tables
from tuner.report.tune_answer import (
    against_datasheet,
    assumptions,
    noise_tables,
    recording_line,
)
from tuner.tune_result import TuneResult
from tuner.types.judgement import Use
from tuner.types.records import Record

CAPTIONS = (
    "Allan deviation: measured with its 95 % band, what the settings predict, and each identified term",
    "Spectrum: root of the two-sided density with its 95 % band, and that of the identified noise",
    "Time course: from the smallest to the largest sample of each piece of time; events are marked",
)
"""What the charts of an axis show."""
STANDING = {Use.USABLE: "good", Use.USABLE_EXCEPT: "open", Use.DO_NOT_USE: "bad"}
"""How the page shows a verdict."""
WARNING = "warning: "
"""How a warning begins among the lines below the tables of noise; the page lists them first of its limits."""
TIMING = {
    "gap_count": "gaps",
    "missing": "missing samples",
    "duplicates": "repeated stamps",
    "disordered": "disordered",
}
"""What time stamps can show to be wrong, in words."""


def write_page(
    result: TuneResult, pictures: Sequence[Picture] = (), allan: Picture | None = None, command: str = ""
) -> str:
    """Return the page as text.

    Parameters
    ----------
    result : TuneResult
        Of `tuner.tune`.
    pictures : sequence of Picture
        Of findings, captioned by their words; others belong to the drive.
    allan : Picture, optional
        The Allan figure: its panels are shown by axis; for print and for readers without scripts it is a picture.
    command : str
        What was typed; empty where the page was made from Python.
    """
    curves = _curves(result, allan)
    axes = list(dict.fromkeys(axis for by_axis in curves.values() for axis in by_axis))
    noise = blocks(identification_tables(result.identification))
    measured = noise_tables(result, result.exports)
    fixes = [] if result.drive is None else fixes_parts(result.drive, result.config)
    others = {
        name: export(result.config, name)
        for name, dialect in DIALECTS.items()
        if result.exports
        and name not in ("native", *EXPORTED_DIALECTS)
        and not lacking(result.config, dialect)
    }
    content = {
        "name": result.name,
        "verdict": f"Verdict: {result.verdict.text}.",
        "standing": STANDING[result.verdict.use],
        "facts": _facts(result),
        "measured": blocks([*measured, *fixes[:1]]),
        "legend": legend(*measured),
        "states": blocks(states := states_tables(result.config)),
        "marks": legend(*states),
        "against": [*fixes[1:], *against_datasheet(result), *more_white_noise(result.config, result.exports)],
        "reasons": _reasons(result),
        "files": [{"name": name, "text": text} for name, text in result.exports.items()],
        "dialects": list(others),
        "texts": others,
        **findings_content(result, pictures),
        "axes": axes,
        "kinds": curves,
        "allan": allan,
        "noise": [block for block in noise if "rows" in block],
        "sections": _sections(result, pictures),
        "limits": _limits(result, noise),
        "provenance": _provenance(result, command),
    }
    content["plotly"] = _packed_library() if axes or any(picture.charts for picture in pictures) else ""
    content["contents"] = [
        ("settings", "Settings"),
        ("files", "Files"),
        ("findings", "Findings"),
        *([("curves", "Curves")] if axes else []),
        ("noise", "Noise"),
        *((anchor, heading) for anchor, heading, _, _ in content["sections"]),
        ("limits", "Limits"),
        ("provenance", "Provenance"),
    ]
    return _filled("report.html.j2", content)


def write_sections_page(
    title: str,
    sections: Sequence[tuple[str, Sequence[Table | str], Sequence[Picture]]],
    command: str = "",
    verdict: tuple[bool, str] | None = None,
) -> str:
    """Return a page of sections with their tables and captioned figures, and the command that makes it again.

    Above them stands the verdict, whether it is good and its words, where there is one.
    """
    drawn = any(picture.charts for _, _, pictures in sections for picture in pictures)
    content = {
        "name": title,
        "sections": [(heading, blocks(words), pictures) for heading, words, pictures in sections],
        "command": command,
        "verdict": verdict,
        "plotly": _packed_library() if drawn else "",
    }
    return _filled("sections.html.j2", content)


def tables_html(content: Sequence[Table | str]) -> str:
    """Return tables and lines as HTML without a page around them."""
    return _filled("tables.html.j2", {"content": blocks(content)})


def _filled(template: str, content: Mapping[str, Any]) -> str:
    environment = Environment(
        loader=PackageLoader("tuner.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "ensure_ascii": False}
    environment.globals["unlike"] = _unlike()
    return environment.get_template(template).render(content).lstrip()


def _unlike() -> Callable[[str], str]:
    """Return a function that numbers names which it has returned before: each region of a page needs its own."""
    times = Counter[str]()

    def unlike(name: str) -> str:
        times[name] += 1
        return name if times[name] == 1 else f"{name} ({times[name]})"

    return unlike


@functools.cache
def _packed_library() -> Markup:
    """Return the drawing library as gzip in base64: 1.9 MB in place of 4.8 MB."""
    return Markup(b64encode(gzip.compress(get_plotlyjs().encode(), 6, mtime=0)).decode())


def _curves(result: TuneResult, allan: Picture | None) -> dict[str, dict[str, Chart]]:
    """Return the charts of each axis by their caption; captions without a chart are absent."""
    findings = () if result.diagnosis is None else result.diagnosis.findings
    parts = {} if result.diagnosis is None else result.diagnosis.parts

    def drawn(place: tuple[Record, int]) -> Sequence[Chart]:
        record, j = place
        (axis,) = axes = record.axes[j : j + 1]
        figure = axis_figure(
            replace(record, y=record.y[:, j : j + 1], axes=axes),
            parts.get(axis),
            result.identification.channels.get(axis),
            [finding for finding in findings if axis in finding.channels],
        )
        return charts_of_figure(figure) or ()

    places = [(record, j) for record in result.records for j in range(len(record.axes))]
    of_samples = zip(*each(drawn, places), strict=True) if places else ((), ())
    kinds = zip(CAPTIONS, ((allan and allan.charts) or (), *of_samples), strict=True)
    by_axis = {caption: {one["title"]: one for one in own if one["traces"]} for caption, own in kinds}
    return {caption: own for caption, own in by_axis.items() if own}


def _facts(result: TuneResult) -> list[tuple[str, str]]:
    wrong = alike_sentences(
        (f"{record.timing[key]:.0f} {words}", record.name)
        for key, words in TIMING.items()
        for record in result.records
        if record.timing.get(key)
    )
    facts = [("Recording", recording_line(result))]
    if result.records:
        repairs = dict.fromkeys(note for record in result.records for note in record.notes)
        facts.append(("Time stamps", "; ".join(wrong) or "no gap, no repetition"))
        facts.append(("Read with", "; ".join(repairs)))
        facts.append(("Units assumed", "; ".join(assumptions(result)) or "none"))
    return [(term, words) for term, words in facts if words]


def _reasons(result: TuneResult) -> list[str]:
    config = result.config
    handling: dict[str, list[str]] = {}
    for channel in config.channels.values():
        for name, how in channel.handling.items():
            handling.setdefault(f"{term_title(name) or name}: {how}", []).append(channel.axis)
    lines = [f"{text} [{axes_text(axes)}]" for text, axes in handling.items()]
    lines += [f"{one.quantity} × {one.factor:g}: {one.reason}" for one in config.inflations]
    lines += [
        f"at its worst {one.quantity} × {one.factor:.4g}, not in the settings: {one.reason}"
        for one in config.worst_case
    ]
    return lines + [f"{name}: {reason}" for name, reason in config.initial.reasons.items()]


def _sections(
    result: TuneResult, pictures: Sequence[Picture]
) -> list[tuple[str, str, list[dict[str, Any]], list[Picture]]]:
    """Return prediction, calibration, drive and checks, each as anchor, heading, content and pictures."""
    measured, check = (
        [] if run is None else consistency_tables(run.consistency, run.notes)
        for run in (result.measured, result.check)
    )
    calibration = [] if result.calibration is None else calibration_lines(result.calibration)
    drive: Sequence[Table | str] = []
    own: list[Picture] = []
    if result.drive is not None:
        from tuner.report.drive_diagnosis_tables import drive_tables  # loads the diagnosis of drives

        drive = drive_tables(result.drive.diagnosis)
        proofs = {one.text for one in result.drive.diagnosis.findings}
        own = [p for p in pictures if p.name.startswith("drive-") and p.caption not in proofs]
    sections: list[tuple[str, str, Sequence[Table | str], list[Picture]]] = [
        ("prediction", "Does it predict the log?", prediction_tables(result.predictions), []),
        ("calibration", "Calibration", calibration, []),
        ("measured", "The filter on the measured drive", measured, []),
        ("drive", "The drive", drive, own),
        ("check", "Filter check: simulated", check, []),
    ]
    return [(at, head, blocks(content), shown) for at, head, content, shown in sections if content or shown]


def _limits(result: TuneResult, noise: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = [f"no {part}: {reason}" for part, reason in result.absent.items()]
    lines += [f"not written: {name}: {reason}" for name, reason in result.withheld.items()]
    lines += [line for block in noise for line in block.get("lines", ())]
    lines += result.config.notes
    warnings = [f"Warning: {line.removeprefix(WARNING)}" for line in lines if line.startswith(WARNING)]
    others = [line.removeprefix("note: ") for line in lines if not line.startswith(WARNING)]
    return list(dict.fromkeys([*warnings, *others])) or ["none known beyond the intervals above"]


def _provenance(result: TuneResult, command: str) -> list[tuple[str, str]]:
    source = result.identification.source
    versions = result.config.provenance.get("versions", {})
    facts = (
        ("Made again by", command or f"tuner.tune in Python, seed {result.seed}"),
        ("Source", ", ".join(map(str, source.get("files", ())))),
        ("SHA-256", ", ".join(map(str, source.get("digests", ())))),
        ("Versions", ", ".join(f"{name} {version}" for name, version in versions.items()) or "unknown"),
        ("Seed", str(result.seed)),
    )
    return [(term, words) for term, words in facts if words]
