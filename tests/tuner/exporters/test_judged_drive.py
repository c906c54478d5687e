"""What is written for KF-GINS errs as its filter predicts, by a truth that the writer did not see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from models import rotation
from models.earth import ned_between
from models.noise import GaussMarkov
from tuner.cli import run
from tuner.consistency.choose_grade import scaled
from tuner.consistency.drive_scores import reference_at
from tuner.examination.examine import StreamNoise
from tuner.exporters.judged_drive import (
    as_read,
    best_known,
    chosen,
    compared,
    consistency,
    judged_drive,
    unknown_installation,
    unseen_sds,
)
from tuner.exporters.kf_gins_drive import drive_files, write_drive
from tuner.judgement import judge_export
from tuner.navigation.drive.run import initial_estimates, initial_state
from tuner.readers.drive import read_drive
from tuner.types import Compensation
from tuner.types.clock import Delay
from tuner.types.consistency import Consistency, RmsError, Score
from tuner.types.judgement import Use
from tuner.types.records import DataError

HONEST = 2.0
"""True ÷ predicted, or its inverse, up to which settings are written."""


def lasting(data, *, sd, time_constant, white, seed=4):
    """Return the arrays of a drive whose fixes err by a white and a lasting part, m, and report the white one."""
    rng = np.random.default_rng(seed)
    keep, drawn = np.exp(-1.0 / time_constant), rng.standard_normal((len(data["gnss_t"]), 3))
    error = np.zeros_like(drawn)
    error[0] = sd * drawn[0]
    for k in range(1, len(drawn)):
        error[k] = keep * error[k - 1] + np.sqrt(1.0 - keep**2) * sd * drawn[k]
    error += white * rng.standard_normal(error.shape)
    truth = np.column_stack(
        [
            np.interp(data["gnss_t"] - 0.15, data["ref_t"], data["ref_llh"][:, i], left=data["ref_llh"][0, i])
            for i in range(3)
        ]
    )
    metres = np.array([1.11e5, 1.11e5 * np.cos(np.radians(truth[0, 0])), -1.0])
    return {
        **data,
        "gnss_llh": truth + error / metres,
        "gnss_pstd": np.full((len(truth), 3), white),
    }


@pytest.fixture(scope="module")
def poor(data, saved, tmp_path_factory):
    """A drive whose fixes scatter by 0.05 m beside errors of 1.2 m that last: its file, and the one without a truth."""
    folder = tmp_path_factory.mktemp("poor")
    arrays = lasting(data, sd=1.2, time_constant=200.0, white=0.05)
    blind = {key: value for key, value in arrays.items() if not key.startswith("ref_")}
    same = {"lever_arm_frd_m": (0.0, 0.0, 0.0), "mounting_rpy_deg": (180.0, 3.0, 100.0)}
    return saved(folder / "poor.npz", arrays, **same), saved(folder / "blind.npz", blind, **same)


def with_lasting(config):
    """Return a configuration of that unit, white noise and constant biases, that knows how these fixes err."""
    channels = {
        axis: replace(noise, white_density=1.2e-4 if noise.unit == "rad/s" else 3e-3)
        for axis, noise in config.channels.items()
    }
    known = replace(
        config.gnss,
        position_sd=(0.05, 0.05, 0.05),
        correlated=(GaussMarkov(1.2, 200.0),),
    )
    return replace(config, channels=channels, gnss=known)


def test_a_start_that_a_file_states_is_where_the_filter_begins(configuration, file, tmp_path):
    # Seen: aligned anew from positions, our form of KF-GINS had a heading 15° off beside 2° of the program.
    write_drive(drive_files(read_drive(file), configuration()), tmp_path / "k.yaml")
    stated = yaml.safe_load((tmp_path / "k.yaml").read_text(encoding="utf-8"))
    stretch, settings = as_read(tmp_path / "k.yaml")
    x, p = initial_estimates(settings, stretch, None)
    start = initial_state(settings, stretch, x)
    assert stretch.steps.start == pytest.approx(0.0, abs=1e-6)
    angles = np.degrees(rotation.rpy_from_quat(start.quat_nb))
    np.testing.assert_allclose(angles % 360.0, np.array(stated["initatt"]) % 360.0)
    np.testing.assert_allclose(start.vel_n, stated["initvel"])
    np.testing.assert_allclose(np.sqrt(np.diag(p))[3:6], max(stated["initvelstd"]))
    del stated["initatt"]
    (tmp_path / "k.yaml").write_text(yaml.safe_dump(stated), encoding="utf-8")
    assert not as_read(tmp_path / "k.yaml")[0].stated


def test_fixes_without_a_vertical_velocity_tell_how_likely_receivers_are(drive_config, poor):
    """The component that is missing left no likelihood at all, and no truth."""
    drive = read_drive(poor[1])
    known = best_known(drive, with_lasting(drive_config))[0]
    flat = replace(drive, gnss=replace(drive.gnss, vel_n=drive.gnss.vel_n * [1.0, 1.0, np.nan]))
    found = best_known(flat, with_lasting(drive_config))[0]
    assert np.isfinite(found.sd).all()
    apart = np.linalg.norm(ned_between(found.llh, known.llh)[:, :2], axis=1)
    assert np.sqrt(np.mean(apart**2)) < np.sqrt(np.mean(np.sum(known.sd[:, :2] ** 2, axis=1)))


@pytest.mark.parametrize("which", [0, 1])
def test_errors_of_fixes_that_last_are_in_their_sds(drive_config, poor, tmp_path, which):
    """With a reference and without one; judged by the truth, which the second file does not have."""
    files, verdict = judged_drive(read_drive(poor[which]), with_lasting(drive_config))
    assert verdict.use in (Use.USABLE, Use.USABLE_EXCEPT)
    assert files.fixes[:, 4].min() > 0.5
    seen = drive_files(read_drive(poor[0]), with_lasting(drive_config))
    for fixes, honest in ((files.fixes, True), (seen.fixes, False)):
        write_drive(replace(seen, fixes=fixes), tmp_path / "k.yaml")
        stretch, settings = as_read(tmp_path / "k.yaml")
        truth = read_drive(tmp_path / "k.yaml").reference
        ratio = consistency(compared(stretch, settings, truth)).blocks[0].ratio
        assert (1.0 / HONEST < ratio < HONEST) == honest


def test_an_error_that_lasts_and_that_no_setting_knows_counts_in_the_truth(drive_config, poor):
    """Seen: settings left it out, as its time constant was doubted: errors were 3 to 9 × what was predicted."""
    drive, truth = read_drive(poor[1]), read_drive(poor[0]).reference
    told = with_lasting(drive_config)
    untold = replace(told, gnss=replace(told.gnss, correlated=()))

    def beyond(config):
        found, _, _ = best_known(drive, config)
        error = ned_between(found.llh, reference_at(truth, found.t)[0])[:, :2]
        return np.sqrt(np.nanmean((error / found.sd[:, :2])[len(error) // 4 :] ** 2))

    assert 1.0 / HONEST < beyond(untold) / beyond(told) < HONEST


def test_sds_of_fixes_are_those_of_the_position_with_them(drive_config, poor, tmp_path):
    """Seen: beside velocities and outages, which sds hardly move, positions erred by 1.6 × their prediction."""
    drive, config = read_drive(poor[1]), with_lasting(drive_config)
    files = drive_files(drive, config)
    write_drive(files, tmp_path / "k.yaml")
    known, _, _ = best_known(drive, config)
    known = replace(known, t=known.t - files.begin)
    stretch, settings = as_read(tmp_path / "k.yaml")
    best = chosen(stretch, settings, known)

    def score(factor):
        added = best.added[0] * factor, best.added[1]
        (found, *_) = compared(*replace(best, added=added).of(stretch, settings), known, ())
        spread = np.linalg.slogdet(found.covariance[:, :2, :2])[1]
        return float(np.mean(spread + found.squares(slice(0, 2))))

    assert score(1.0) < min(score(0.5), score(2.0))


def test_noise_of_a_grade_that_is_too_coarse_is_written_smaller(configuration, data, saved, tmp_path):
    """Seen: of 32 clean drives 12 were not written, as assumed grades predicted 2 to 14 × what they erred."""
    same = {"lever_arm_frd_m": (0.5, -0.3, -1.2), "mounting_rpy_deg": (180.0, 3.0, 100.0)}
    drive = read_drive(saved(tmp_path / "drive.npz", data, **same))
    coarse = scaled(configuration(), 10.0)
    files, verdict = judged_drive(drive, coarse)
    assert verdict.use in (Use.USABLE, Use.USABLE_EXCEPT)
    as_configured = drive_files(drive, coarse).tree["imunoise"]
    ratio = {
        name: files.tree["imunoise"][name].value.value[0] / as_configured[name].value.value[0]
        for name in ("arw", "vrw", "gbstd", "abstd")
    }
    assert max(ratio["gbstd"], ratio["abstd"]) < 0.5
    assert any("gbstd and abstd are" in note and "as this drive shows" in note for note in files.notes)


def test_what_a_receiver_states_and_its_readings_do_not_show_is_not_zero(drive_config):
    """Fixes of 1.0 m from reading to reading, stated with 1.4 m: 1.0 m that no filter sees; drives err by 2 to 3 ×."""
    noise = (
        StreamNoise("fixes", "", 1.0, 1.4, "m"),
        StreamNoise("fixes", "vertical", 3.0, 2.0, "m"),
        StreamNoise("velocities", "", 0.1, 9.0, "m/s"),
    )
    plain = replace(drive_config, gnss=replace(drive_config.gnss, correlated=()))
    assert unseen_sds(noise, plain) == pytest.approx([0.96**0.5, 0.96**0.5, 0.0])
    # Where states of the filter hold an error that lasts, only the rest is unseen.
    assert unseen_sds(noise, with_lasting(drive_config))[0] < 0.98


def test_what_a_drive_leaves_open_of_its_installation_is_not_zero(drive_config, file):
    """A lever arm of which two axes were taken out counted as known in the third; a delay that chance may make as 0."""
    drive, config = replace(read_drive(file), reference=None), drive_config
    partly = replace(config, compensation=Compensation.parse({"lever_arm.x": 0.0, "lever_arm.y": 0.0}))
    unstated = replace(drive, lever_arm=None)
    assert unknown_installation(unstated, partly) == {"lever_arm": 1.0, "time_offset": 0.1}
    assert unknown_installation(drive, config).keys() == {"time_offset"}
    certain = replace(drive, clock=replace(drive.clock, delay=Delay(1.0, 1e-6)))
    assert unknown_installation(certain, config) == {"time_offset": 1e-6}
    stated, open_arm = (
        np.sqrt(np.mean(best_known(*one)[0].sd[-100:, :3] ** 2, axis=0))
        for one in ((drive, config), (unstated, partly))
    )
    assert open_arm[2] > 1.5 * stated[2]


def test_fixes_that_our_filter_refuses_are_left_out(configuration, data, saved, tmp_path):
    far = data["gnss_llh"].copy()
    far[200:400:20, 2] += 60.0
    same = {"lever_arm_frd_m": (0.5, -0.3, -1.2), "mounting_rpy_deg": (180.0, 3.0, 100.0)}
    file = saved(tmp_path / "far.npz", {**data, "gnss_llh": far}, **same)
    files, _ = judged_drive(read_drive(file), configuration())
    assert any("fixes, which our filter refuses, are left out" in note for note in files.notes)
    assert np.ptp(files.fixes[:, 3]) < 50.0


def test_what_errs_by_more_than_it_predicts_or_than_the_fixes_is_not_written():
    def found(ratio, refused=0.0):
        score = Score("position", 3.0 * ratio**2, 3, 300.0, (2.5, 3.5), 300.0)
        errors = {"position": RmsError((1.0, 0.0, 0.0))}
        return Consistency(None, (score,), (), None, (), errors, refused, refused > 0.5)

    assert judge_export(found(1.0), 1.0, 1.0).use is Use.USABLE
    assert judge_export(found(1.7), 1.0, 1.0).use is Use.USABLE_EXCEPT
    assert judge_export(found(2.5), 1.0, 1.0).use is Use.DO_NOT_USE
    assert judge_export(found(0.4), 1.0, 1.0).use is Use.DO_NOT_USE
    assert judge_export(found(1.0, refused=0.6), 1.0, 1.0).use is Use.DO_NOT_USE
    worse = judge_export(found(1.0), 1.5, 1.0)
    assert worse.use is Use.DO_NOT_USE
    assert "errs by 1.50 m on this drive" in worse.reasons[0]


def test_what_cannot_be_judged_or_would_be_written_over_is_refused_in_one_line(
    configuration, data, saved, file, tmp_path, capsys
):
    same = {"lever_arm_frd_m": (0.5, -0.3, -1.2), "mounting_rpy_deg": (180.0, 3.0, 100.0)}
    early = data["gnss_t"] < 1110.0
    few = {key: value[early] if key.startswith("gnss") else value for key, value in data.items()}
    short = saved(tmp_path / "short.npz", few, **same)
    with pytest.raises(DataError, match="expected fixes beyond 60 s after the start"):
        judged_drive(read_drive(short), configuration())
    write_drive(drive_files(read_drive(file), configuration()), tmp_path / "k.yaml")
    k = str(tmp_path / "k.yaml")
    assert run(["export", "mpu9250", "--to", "kf-gins", "--drive", k, "-o", k]) == 2
    assert "expected another file to write" in capsys.readouterr().err
    stated = yaml.safe_load((tmp_path / "k.yaml").read_text(encoding="utf-8"))
    stated["initpos"][0] += 1.0
    (tmp_path / "far.yaml").write_text(yaml.safe_dump(stated), encoding="utf-8")
    assert run(["navigate", str(tmp_path / "far.yaml"), "--config", k, "--quiet"]) == 2
    assert "(initpos) 111 km from it" in capsys.readouterr().err


def test_nothing_is_written_where_the_verdict_forbids_it(configuration, poor, tmp_path, monkeypatch, capsys):
    from tuner.exporters import judged_drive as module
    from tuner.types.judgement import Judgement

    monkeypatch.setattr(
        module, "judge_export", lambda *_: Judgement(Use.DO_NOT_USE, ("errs 25 × its prediction",))
    )
    with pytest.raises(DataError, match="nothing is written for kf-gins"):
        judged_drive(read_drive(poor[0]), configuration())
    assert (
        run(["export", "mpu9250", "--to", "kf-gins", "--drive", str(poor[0]), "-o", str(tmp_path / "k.yaml")])
        == 2
    )
    assert "errs 25 × its prediction" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
