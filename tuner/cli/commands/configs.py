"""A filter configuration by its file or by the name of a built-in grade."""

from __future__ import annotations

from pathlib import Path

from tuner.cli.commands.inputs import is_file
from tuner.types import FilterConfig
from tuner.types.records import DataError


def load_config(source: str) -> FilterConfig:
    """Load a noise.yaml, or synthesise the configuration of a datasheet or a built-in grade.

    Raises
    ------
    DataError
        If the source is no configuration.
    """
    from tuner.catalogue.datasheet import is_datasheet, read_datasheet
    from tuner.catalogue.grades import grade_identification, grade_names, load_grade
    from tuner.formats import native
    from tuner.synthesis import synthesize

    if is_file(source):
        path = Path(source)
        if is_datasheet(path):
            return synthesize(read_datasheet(path))
        return native.load(path)
    if source not in grade_names():
        msg = (
            f"{source}: expected a noise.yaml or a built-in grade ({' '.join(grade_names())}), found neither"
        )
        raise DataError(msg)
    return synthesize(grade_identification(load_grade(source)))
