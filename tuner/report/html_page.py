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

from tuner.exporters import DIALECTS, export, lacking, withheld
from tuner.jobs import each
from tuner.pipeline import EXPORTED_DIALECTS
from tuner.report.alike_sentences import alike_sentences
from tuner.report.axis_figure import axis_figure
from tuner.report.document import Document
from tuner.report.identification_answer import warning_lines
from tuner.report.identification_tables import identification_tables
from tuner.report.interactive_figure import Chart, charts_of_figure
from tuner.report.noise_table import legend, states_tables, why_larger
from tuner.report.page_findings import findings_content
from tuner.report.page_parts import Picture, blocks
from tuner.report.tune_answer import (
    against_datasheet,
    fixes_content,
    left_out_groups,
    left_out_text,
    noise_tables,
    recording_line,
)
from tuner.report.tune_sections import setting_reasons, tune_sections
from tuner.tune_result import TuneResult
from tuner.types.judgement import Judgement, Use
from tuner.types.records import Record

CAPTIONS = (
    "Allan deviation: measured with its 95 % band, what the settings predict, and each identified term",
    "Spectrum: root of the two-sided density with its 95 % band, and that of the identified noise",
    "Time course: from the smallest to the largest sample of each piece of time; events are marked",
)
"""What the charts of an axis show."""
STANDING = {Use.USABLE: "good", Use.USABLE_EXCEPT: "open", Use.DO_NOT_USE: "bad"}
"""How the page shows a verdict."""
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
    proofs = {one.text for one in result.drive.diagnosis.findings} if result.drive is not None else set()
    own = [one for one in pictures if one.name.startswith("drive-") and one.caption not in proofs]
    axes = list(dict.fromkeys(axis for by_axis in curves.values() for axis in by_axis))
    noise = blocks(identification_tables(result.identification))
    measured = noise_tables(result, result.exports)
    fixes = fixes_content(result)
    others = {
        name: export(result.config, name)
        for name, dialect in DIALECTS.items()
        if result.exports
        and name not in ("native", *EXPORTED_DIALECTS)
        and not lacking(result.config, dialect)
        and not withheld(result.config, name)
    }
    content = {
        "name": result.name,
        "verdict": f"Verdict: {result.verdict.text}.",
        "standing": STANDING[result.verdict.use],
        "facts": _facts(result),
        "measured": blocks([*measured, *fixes[:1]]),
        "legend": ". ".join(filter(None, (legend(*measured), why_larger(result.exports.values())))),
        "states": blocks(states := states_tables(result.config)),
        "marks": legend(*states),
        "against": [*fixes[1:], *against_datasheet(result)],
        "reasons": setting_reasons(result),
        "files": [{"name": name, "text": text} for name, text in result.exports.items()],
        "dialects": list(others),
        "texts": others,
        **findings_content(result, pictures),
        "axes": axes,
        "kinds": curves,
        "allan": allan,
        "noise": [block for block in noise if "rows" in block],
        "sections": [
            (at, heading, blocks(part), own * (at == "drive")) for at, heading, part in tune_sections(result)
        ],
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
    sections: Sequence[tuple[str, Document, Sequence[Picture]]],
    command: str = "",
    verdict: Judgement | None = None,
) -> str:
    """Return a page of answers under their headings, with captioned figures, and the command that makes it again.

    Above them stands the verdict, where there is one.
    """
    drawn = any(picture.charts for _, _, pictures in sections for picture in pictures)
    content = {
        "name": title,
        "sections": [
            (heading, blocks((*answer.parts, *answer.remarks)), pictures, blocks(answer.more))
            for heading, answer, pictures in sections
        ],
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
    repairs = dict.fromkeys(note for record in result.records for note in record.notes)
    facts = (
        ("Recording", recording_line(result)),
        ("Not in the settings", left_out_text(left_out_groups(result.diagnosis))),
        ("Time stamps", ("; ".join(wrong) or "no gap, no repetition") if result.records else ""),
        ("Read with", "; ".join(repairs)),
    )
    return [(term, words) for term, words in facts if words]


def _limits(result: TuneResult, noise: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return warnings first, then what was not done or written, the reasons of bounds, and notes."""
    lines = (
        *warning_lines(result.identification, predicted=result.predictions),
        *(f"no {part}: {reason}" for part, reason in result.absent.items()),
        *(f"not written: {name}: {reason}" for name, reason in result.withheld.items()),
        *(line for block in noise for line in block.get("lines", ())),
        *result.config.notes,
    )
    return list(dict.fromkeys(lines)) or ["none known beyond the intervals above"]


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
