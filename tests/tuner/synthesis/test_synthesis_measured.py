"""A measured log of a STIM300 at rest through synthesis to every dialect (needs TUNER_DATA)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tuner.catalogue.grades import load_gnss, load_grade
from tuner.exporters import DIALECTS, export, text_of
from tuner.formats import noise_yaml
from tuner.formats.configuration import config_json, load_config
from tuner.identification import identify
from tuner.readers import read
from tuner.synthesis import synthesize
from tuner.types import FilterConfig
from tuner.types.records import DataError


@pytest.fixture(scope="module")
def config() -> FilterConfig:
    folder = os.environ.get("TUNER_DATA")
    if not folder:
        pytest.skip("TUNER_DATA names no folder of measured data")
    log = Path(folder) / "static" / "stim300_static.npz"
    if not log.exists():
        pytest.skip(f"no {log.name} in TUNER_DATA")
    return synthesize(identify(read(log), arma=None), gnss=load_gnss("rtk"))


def test_white_noise_is_that_of_the_data_sheet(config: FilterConfig) -> None:
    grade = load_grade("stim300")
    for axis, channel in config.channels.items():
        promised = grade.triad(axis.partition("_")[0]).white
        assert promised is not None
        assert channel.white_density == pytest.approx(promised.value, rel=0.3)


def test_what_160_seconds_cannot_show_is_bounded_and_said(config: FilterConfig) -> None:
    assert any(i.reason.startswith("bounded") for i in config.inflations)
    for channel in config.channels.values():
        assert set(channel.handling) >= {term.name for term in channel.identified}


def test_it_survives_the_yaml_and_reaches_every_dialect(config: FilterConfig) -> None:
    assert load_config(config_json(config), source="again") == config
    text = noise_yaml.dumps(config)
    assert noise_yaml.dumps(noise_yaml.loads(text)) == text
    for dialect in DIALECTS:
        assert "stim300_static" in text_of(config, dialect)


def test_limits_that_decide_the_drift_are_written_for_no_other_program(config: FilterConfig) -> None:
    with pytest.raises(DataError, match="half of the limit is ASSUMED"):
        export(config, "kalibr")
