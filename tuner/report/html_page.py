"""The report as one HTML page, complete in itself: noise, diagnosis, filter configuration and check.

The page carries its figures as inline SVG and its style in the head: it can be mailed, opened offline and
printed.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from rich.table import Table

from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, term_title
from tuner.report.allan_figure import draw_allan
from tuner.report.identification_tables import identification_tables
from tuner.types import ChannelNoise, FilterConfig, Identification
from tuner.types.prediction import PredictedBlock

PAGE_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c1917; max-width: 1180px; margin: 2rem auto; padding:
0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; }
h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #d6d3d1; padding-bottom: .2rem; }
table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums; font-size: .9rem; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { border-bottom: 1px solid #e7e5e4; padding: .25rem .7rem; text-align: right; white-space: pre-line; }
th:first-child, td:first-child { text-align: left; }
th { background: #f5f5f4; font-weight: 600; }
li { margin: .2rem 0; }
.quiet { color: #57534e; }
svg { max-width: 100%; height: auto; }
.wide { overflow-x: auto; }
"""


def write_page(
    identification: Identification,
    config: FilterConfig,
    *,
    title: str,
    sections: Sequence[tuple[str, Sequence[Table | str]]] = (),
    figures: Sequence[tuple[str, str]] = (),
    predictions: Mapping[str, PredictedBlock] = MappingProxyType({}),
    absent: Mapping[str, str],
) -> str:
    """Return the page as text.

    Parameters
    ----------
    identification : Identification
        Noise of every channel.
    config : FilterConfig
        Settings chosen from it.
    title : str
        Name of the log.
    sections : sequence of (str, sequence of Table or str)
        Further parts, such as the diagnosis and the consistency check.
    figures : sequence of (str, str)
        Captions and text of further SVG figures.
    predictions : mapping of str to PredictedBlock
        How well the settings of each axis predict the record.
    absent : mapping of str to str
        Parts that were not run, each with the reason.
    """
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        f'<p class="quiet">{html.escape(_origin(identification))}</p>',
        "<h2>Noise in the log</h2>",
        _blocks(identification_tables(identification)),
    ]
    if any(channel.allan.tau.size for channel in identification.channels.values()):
        parts.append(_allan(identification, predictions))
    for heading, content in sections:
        parts += [f"<h2>{html.escape(heading)}</h2>", _blocks(content)]
    parts += [_figure(svg, caption) for caption, svg in figures]
    parts += ["<h2>Filter configuration</h2>", _blocks([_settings(config)]), _reasons(config)]
    if absent:
        parts.append("<h2>What was not done</h2>")
        parts.append(_list([f"{part}: {reason}" for part, reason in absent.items()]))
    return _whole(title, parts)


def write_sections_page(
    title: str, sections: Sequence[tuple[str, Sequence[Table | str]]], figures: Sequence[tuple[str, Path]]
) -> str:
    """Return a page of sections and SVG figures with their captions, without an identification."""
    parts = [f"<h1>{html.escape(title)}</h1>"]
    for heading, content in sections:
        parts += [f"<h2>{html.escape(heading)}</h2>", _blocks(content)]
    parts += [_figure(path.read_text(encoding="utf-8"), caption) for caption, path in figures]
    return _whole(title, parts)


def _whole(title: str, parts: Sequence[str]) -> str:
    head = f"<meta charset='utf-8'><title>{html.escape(title)}</title><style>{PAGE_STYLE}</style>"
    body = "\n".join(parts)
    language = '<html lang="en">'
    return f"<!doctype html>\n{language}<head>{head}</head><body>\n{body}\n</body></html>\n"


def _origin(identification: Identification) -> str:
    source = identification.source
    files = ", ".join(str(f) for f in source.get("files", ())) or str(source.get("name", ""))
    digests = ", ".join(str(d)[:12] for d in source.get("digests", ()))
    return files + (f" · SHA-256 {digests}…" if digests else "")


def _blocks(content: Sequence[Table | str]) -> str:
    """Render tables as they come and runs of lines as lists."""
    answer: list[str] = []
    lines: list[str] = []
    for block in [*content, ""]:
        if isinstance(block, str) and block:
            lines.append(block.strip())
            continue
        if lines:
            answer.append(_list(lines))
            lines = []
        if isinstance(block, Table):
            answer.append(_table(block))
    return "\n".join(answer)


def _list(lines: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in lines) + "</ul>"


def _table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(str(column.header))}</th>" for column in table.columns)
    rows = zip(*(column.cells for column in table.columns), strict=True)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    caption = f"<caption>{html.escape(str(table.title))}</caption>" if table.title else ""
    return f'<div class="wide"><table>{caption}<tr>{head}</tr>{body}</table></div>'


def _allan(identification: Identification, predictions: Mapping[str, PredictedBlock]) -> str:
    drawn: list[bytes] = []
    draw_allan(
        identification,
        [Path("allan.svg")],
        predictions=predictions,
        put=lambda _, content: drawn.append(content),
    )
    return _figure(drawn[0].decode(), "Allan deviation with 95 % band, fitted sum and terms")


def _figure(svg: str, caption: str) -> str:
    return f"<figure>{svg[svg.index('<svg') :]}<figcaption>{html.escape(caption)}</figcaption></figure>"


def _settings(config: FilterConfig) -> Table:
    table = Table(title="Settings (customary units)")
    rows: dict[str, list[str]] = {}
    for channel in config.channels.values():
        for name, text in _of_channel(channel).items():
            rows.setdefault(name, []).append(text)
    table.add_column("")
    for axis in config.channels:
        table.add_column(axis)
    for name, cells in rows.items():
        table.add_row(name, *cells)
    return table


def _of_channel(channel: ChannelNoise) -> dict[str, str]:
    def shown(value: float, quantity: str) -> str:
        number = digits(in_customary(value, quantity, channel.unit))
        return f"{number} {pretty(customary_unit(quantity, channel.unit))}"

    ladder = "\n".join(f"{shown(s.sd, 'level')} over {digits(s.time_constant)} s" for s in channel.markov)
    return {
        "white noise": shown(channel.white_density, "white.density"),
        "Gauss–Markov states": ladder or "none",
        "random walk": shown(channel.random_walk_density, "random_walk.density"),
        "turn-on constant (sd)": shown(channel.constant_sd, "level"),
    }


def _reasons(config: FilterConfig) -> str:
    handling: dict[str, list[str]] = {}
    for channel in config.channels.values():
        for name, how in channel.handling.items():
            label = term_title(name) or name
            handling.setdefault(f"{label}: {how}", []).append(channel.axis)
    lines = [f"{text} [{', '.join(axes)}]" for text, axes in handling.items()]
    lines += [f"{i.quantity} × {i.factor:g}: {i.reason}" for i in config.inflations]
    lines += [f"{name}: {reason}" for name, reason in config.initial.reasons.items()]
    return "<h3>Why</h3>" + _list([*lines, *config.notes])
