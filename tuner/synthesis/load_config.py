"""A filter configuration by its file or by the name of a built-in grade."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tuner.catalogue.datasheet import is_datasheet, read_datasheet
from tuner.catalogue.grades import grade_identification, grade_names, load_gnss, load_grade
from tuner.formats import noise_yaml
from tuner.readers import kf_gins_settings
from tuner.readers.source_kind import is_file
from tuner.synthesis.synthesize import synthesize
from tuner.types import FilterConfig, GnssNoise
from tuner.types.arguments import expect
from tuner.types.records import DataError

CONFIG = "a FilterConfig, the path of a noise.yaml or the name of a built-in grade"
"""What stands for the settings of a filter."""


def load_config(
    source: str | Path, *, gnss: GnssNoise | str | None = None, default_gnss: GnssNoise | str | None = None
) -> FilterConfig:
    """Return the configuration a source stands for.

    Parameters
    ----------
    source : str or Path
        A noise.yaml, a kf-gins.yaml, a datasheet, or the name of a built-in grade.
    gnss : GnssNoise or str, optional
        Receiver (or the name of a built-in one) in place of that of the source.
    default_gnss : GnssNoise or str, optional
        Receiver that goes with a grade or a datasheet, which name none.

    Raises
    ------
    DataError
        If the source is no configuration, or the receiver unknown.
    """
    expect(source, (str, Path), "configuration", CONFIG)
    receiver = load_gnss(gnss) if isinstance(gnss, str) else gnss
    default = load_gnss(default_gnss) if isinstance(default_gnss, str) else default_gnss
    if is_file(source):
        path = Path(source)
        if is_datasheet(path):
            return synthesize(read_datasheet(path), gnss=receiver or default)
        config = kf_gins_settings.load(path) if kf_gins_settings.is_settings(path) else noise_yaml.load(path)
        return config if receiver is None else replace(config, gnss=receiver)
    if source not in grade_names():
        raise DataError(
            f"{source}: expected a noise.yaml or a built-in grade ({' '.join(grade_names())}), found neither"
        )
    return synthesize(grade_identification(load_grade(str(source))), gnss=receiver or default)
