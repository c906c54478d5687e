"""Declarations of causes of drives: complete, consistent with their effects, and open to further ones."""

from __future__ import annotations

import re
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from models.earth import llh_displaced
from models.effects.drive import EFFECTS, parse
from models.noise import GaussMarkov, NoiseModel
from models.registry import RegistryError
from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.causes.base import (
    DRIVE_CAUSES,
    ConstantCause,
    DriveCause,
    FinalCause,
    NoiseCause,
    constant_causes,
    constant_parameters,
)
from tuner.diagnosis.drive.causes.correlated_gnss import CorrelatedGnss
from tuner.diagnosis.drive.causes.registry import FALSE_FINDING_PROBABILITY, significance_threshold
from tuner.formats.configuration import config_json, load_config

CROSS_COUPLING = 0.02
EXAMPLE = Path(__file__).with_name("cross_coupling_cause.py")


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install the example as pip would, for one test."""
    (tmp_path / "cross_coupling_cause.py").write_text(EXAMPLE.read_text())
    facts = tmp_path / "coupling-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: coupling\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text(
        "[tuner.drive_causes]\naccel_cross_coupling = cross_coupling_cause:AccelCrossCoupling\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    for registry in (DRIVE_CAUSES, EFFECTS):
        monkeypatch.setattr(registry, "_declared", dict(registry._declared))
        monkeypatch.setattr(registry, "_entry_points_loaded", False)
    yield
    sys.modules.pop("cross_coupling_cause", None)


@pytest.mark.usefixtures("package")
def test_a_constant_of_another_package_is_named_estimated_and_compensated(simulated, drive_config):
    """Its one declaration is all that the diagnosis, the compensation and the configuration file need."""
    drive = simulated(3, values={"accel_cross_coupling.xy": CROSS_COUPLING})
    diagnosis = diagnose_drive(drive, drive_config)
    (finding,) = diagnosis.findings
    assert finding.cause == "accel_cross_coupling"
    low, high = finding.parameters["xy"].interval
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    assert abs(middle - CROSS_COUPLING) < 2.5 * half
    assert half < 0.25 * CROSS_COUPLING
    assert diagnosis.compensation.value("accel_cross_coupling", "xy") == pytest.approx(middle, abs=half)
    stored = load_config(config_json(diagnosis.after), source="stored")
    assert stored.compensation == diagnosis.compensation
    assert str(parse("accel_cross_coupling:xy=0.02")) == "accel_cross_coupling:xy=0.02"


def test_the_page_shows_the_example():
    page = (Path(__file__).parents[4] / "docs/extending/drive_cause.md").read_text()
    assert EXAMPLE.read_text() in page
    assert len(EXAMPLE.read_text().splitlines()) <= 45


def test_a_further_cause_lowers_the_threshold_of_the_others():
    class Further(NoiseCause):
        """A cause that is never found."""

        cause, channels, meaning, consequence = "further", ("gnss",), "further", "none"

        @classmethod
        def test(cls, run, noise, threshold):
            return ()

    before = significance_threshold()
    with DRIVE_CAUSES.added(Further):
        assert significance_threshold() < before
    assert significance_threshold() == before


def test_parameters_of_constants_are_those_of_their_effects():
    for code, cause in constant_causes().items():
        assert tuple(cause.units) == tuple(f.name for f in fields(cause.effect)), code
        assert all(cause.effect.is_parameter_of_compensation(name) for name in cause.units), code
        assert 0.0 < cause.prior_sd < cause.largest


def test_the_false_finding_probability_is_shared_out():
    shares = sum(cause.shares for cause in DRIVE_CAUSES.values())
    assert shares * significance_threshold() == pytest.approx(FALSE_FINDING_PROBABILITY)
    assert len(constant_parameters()) == len(set(constant_parameters()))


def test_incomplete_and_unknown_causes_are_refused_in_one_line():
    class Incomplete(ConstantCause):
        cause = "incomplete"
        channels = ("gnss",)

    needed = "the class needs meaning, consequence, effect, units, prior_sd, largest"
    with pytest.raises(RegistryError, match=needed):
        DRIVE_CAUSES.add(Incomplete)
    unknown = re.escape("unknown cause of a drive 'lever_arms' (did you mean 'lever_arm'?)")
    with pytest.raises(RegistryError, match=unknown):
        DRIVE_CAUSES["lever_arms"]


@pytest.mark.parametrize(
    ("kind", "complaint"),
    [
        (ConstantCause, "the class needs effect, units, prior_sd, largest"),
        (NoiseCause, "the class needs test"),
        (FinalCause, "expected a subclass of ConstantCause or NoiseCause: of FinalCause there are"),
        (DriveCause, "expected a subclass of ConstantCause or NoiseCause: no stage tests any other"),
    ],
)
def test_a_cause_that_no_stage_could_test_is_refused_in_one_line(kind, complaint):
    told = {"cause": "further", "channels": ("gnss",), "meaning": "further", "consequence": "none"}
    with pytest.raises(RegistryError, match=rf"^cause of a drive 'further': {complaint}[^\n]*$"):
        DRIVE_CAUSES.add(type("Further", (kind,), told))


def test_a_noise_cause_without_a_generative_model_is_found_and_not_simulated(simulated, drive_config):
    """It takes the place of the built-in cause whose test it borrows: named and compensated like that."""

    class Slow(NoiseCause):
        cause, channels, meaning, consequence = "slow_fixes", ("gnss",), "slow errors", "a state"

        @classmethod
        def test(cls, run, noise, threshold):
            return tuple(
                replace(found, result=replace(found.result, cause=cls.cause, gain=found.result.gain + 1.0))
                for found in CorrelatedGnss.test(run, noise, threshold)
            )

    drive = simulated(3)
    slow = NoiseModel([GaussMarkov(3.0, 60.0)])
    rng = np.random.default_rng(4)
    metres = np.stack([slow.sample(len(drive.gnss.t), 1.0, rng) for _ in range(3)], axis=1)
    drive = replace(drive, gnss=replace(drive.gnss, llh=llh_displaced(drive.gnss.llh, metres)))
    with DRIVE_CAUSES.added(Slow):
        diagnosis = diagnose_drive(drive, drive_config)
        assert "slow_fixes" in [finding.cause for finding in diagnosis.findings]
        assert diagnosis.after.gnss.correlated
    with pytest.raises(ValueError, match=r"^an effect must be one of [^\n]*; got 'slow_fixes'$"):
        parse("slow_fixes:sd=1")
