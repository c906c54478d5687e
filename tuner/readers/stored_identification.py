"""Identifications on file: what `tuner identify --json` and `tuner tune` stored stands wherever a log does.

A ``noise.yaml`` has the terms and the turn-on sd of every axis; the JSON of an identification (or of a whole result)
has the terms, the mean, σ(10 s) and the Allan curve. What a file does not have is computed from the sum of its terms.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tuner.catalogue.model_channel import channel_of_terms
from tuner.formats import noise_yaml
from tuner.formats.documents import parse_json, read_text
from tuner.formats.file_set import stale_files
from tuner.formats.identification import load_identification
from tuner.types import Identification

_RESULT_SCHEMA = "tuner.result/1"


def is_stored(path: Path) -> bool:
    """Return whether a file is a configuration of ours, or JSON."""
    if path.suffix.lower() == ".json":
        return path.is_file()
    try:
        with path.open(encoding="utf-8") as file:
            head = file.read(4096)
    except (OSError, UnicodeDecodeError):
        return False
    kind = noise_yaml.FORMAT.partition("/")[0]
    return any(line.strip().startswith(f"format: {kind}/") for line in head.splitlines())


def read_stored(path: Path) -> Identification:
    """Read an identification from a ``noise.yaml`` or from JSON.

    Raises
    ------
    DataError
        One line: file, place, expected, found, what to do.
    """
    if path.suffix.lower() == ".json":
        return _from_json(path)
    config = noise_yaml.load(path)
    channels = {
        axis: channel_of_terms(
            axis,
            noise.unit,
            noise.identified,
            interval=config.interval,
            method="configuration",
            shortest_tau=max(config.interval, 1e-3),
            reason="not in the configuration",
        )
        for axis, noise in config.channels.items()
    }
    constants = {
        axis: noise.constant_sd for axis, noise in config.channels.items() if noise.constant_sd > 0.0
    }
    source = {"name": config.name, "files": [path.name], "turn_on_sd": constants}
    return Identification(source, channels, config.notes)


def _from_json(path: Path) -> Identification:
    content = parse_json(read_text(path, expected="readable JSON"), source=str(path))
    if isinstance(content, dict) and content.get("schema") == _RESULT_SCHEMA:
        found = load_identification(content.get("identification"), source=f"{path}: identification")
        if stale := stale_files(path):
            note = f"{path.name} was written with other files than are beside it now: {', '.join(stale)}"
            return replace(found, notes=(*found.notes, note))
        return found
    return load_identification(content, source=str(path))
