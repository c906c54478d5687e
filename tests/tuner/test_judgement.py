"""Verdicts: what is honest, what can be judged at all, and what settings may be used for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from models.noise import NoiseModel, RandomWalk, White
from models.probability import chi2_quantile
from tuner import pipeline
from tuner.catalogue.grades import load_gnss
from tuner.cli.commands.check import command
from tuner.consistency.check import DEFAULT_DURATION, DEFAULT_RUNS
from tuner.consistency.scores import mean_band, score
from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
from tuner.diagnosis.drive.predictive_score import PredictiveScore
from tuner.identification import identify
from tuner.identification.identify_channel import CURVE_DISAGREES
from tuner.judgement import Settings, judge_noise, judge_settings, lost_shares
from tuner.limits import HONEST_RATIO, TEST_POWER
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.tune_result import TuneResult
from tuner.types import (
    AppliedNoiseScale,
    BoundUsed,
    Compensation,
    Diagnosis,
    DriveDiagnosis,
    Enlargement,
    Quantity,
    Unexplained,
)
from tuner.types.consistency import Consistency, Outage, RmsError, Score
from tuner.types.diagnosis import START
from tuner.types.honesty import shows_dishonesty
from tuner.types.judgement import Use
from tuner.types.verdict import Severity, Verdict, VerdictCode

MANY = 1e5


def scored(name, ratio, freedom=MANY, dof=3):
    return Score(name, dof * ratio**2, dof, freedom, mean_band(dof, freedom))


def scores(*blocks, outages=(), truth=True, **more):
    errors = {"position" if truth else "nis_position": RmsError((1.0,), "m")}
    nis = [one for one in blocks if one.name.startswith("nis")]
    rest = [one for one in blocks if one not in nis]
    found = Consistency(None, tuple(rest), tuple(nis), None, tuple(outages), errors, 0.0, diverged=False)
    return replace(found, **more)


def outage(seconds, ratio, windows):
    one = scored(f"outage {seconds:g} s", ratio, 2.0 * windows, dof=1)
    return Outage(seconds, 10.0 * ratio, 10.0, one, windows, one.interval)


@pytest.mark.parametrize(
    ("ratio", "use"), [(1.0, Use.HONEST), (1.4, Use.HONEST), (1.6, Use.OPTIMISTIC), (0.6, Use.PESSIMISTIC)]
)
def test_a_filter_is_honest_within_a_factor_of_one_and_a_half(ratio, use):
    assert scores(scored("position", ratio), scored("velocity", 1.0)).honesty.use is use


def test_attitudes_are_honest_within_a_factor_of_two():
    assert scores(scored("position", 1.0), scored("attitude", 1.9)).honesty.use is Use.HONEST
    assert scores(scored("position", 1.0), scored("attitude", 2.1)).honesty.use is Use.OPTIMISTIC


def test_a_ratio_that_few_windows_allow_does_not_speak_against_a_filter():
    few = scores(scored("position", 1.0), outages=[outage(60.0, 1.9, 2)]).honesty
    assert few.use is Use.HONEST
    assert "too short to judge: position after 60 s without fixes (" in few.text
    assert scores(scored("position", 1.0), outages=[outage(60.0, 1.9, 400)]).honesty.use is Use.OPTIMISTIC


def test_one_window_is_too_short_to_judge():
    """One outage with 0.11 × the predicted error was "consistent"."""
    verdict = scores(outages=[outage(60.0, 0.11, 1)]).honesty
    assert verdict.use is Use.TOO_SHORT
    assert not verdict.good
    assert "times as much data would do" in verdict.text


def test_a_power_of_nine_tenths_is_what_draws_show():
    """Of draws with an error of 1.5 × the prediction, 90 % fall outside the band of the smallest sample that counts."""
    one = replace(scored("position", 1.0), effective=1.0)
    nu = next(n for n in range(2, 1000) if shows_dishonesty(one, float(n)))
    rng = np.random.default_rng(5)
    high = chi2_quantile(1.0 - 0.0005, float(nu)) / nu
    drawn = HONEST_RATIO**2 * rng.chisquare(nu, 20000) / nu
    # five standard deviations of a share of 20 000 draws: 5 √(0.9 · 0.1/20 000) = 0.011
    assert np.mean(drawn > high) >= TEST_POWER - 0.011
    assert not shows_dishonesty(one, float(nu - 1))


def test_a_score_whose_few_groups_hardly_tell_its_scatter_is_too_short():
    """A drive of three minutes: velocities at 1.88 (1.65 to 2.19) were "honest", as their band reached to 2.03."""
    few = score("nis_velocity", [[6.0, 7.1, 8.3, 9.2] * 20, [4.1, 6.2, 8.4, 12.0] * 20], 3)
    assert few.effective > 4.0 * few.freedom
    low, high = few.interval
    assert low < 1.5 < few.ratio < high  # the interval rests on what is certain, as the band does
    assert not shows_dishonesty(few)
    assert scores(few, truth=False).honesty.use is Use.TOO_SHORT


def test_of_right_filters_three_in_a_thousand_are_called_wrong():
    """Null distribution of the verdict: 3000 filters with 40 windows of three components in each of two scores."""
    rng = np.random.default_rng(6)
    wrong = 0
    for _ in range(3000):
        blocks = [score(name, list(rng.chisquare(3, (40, 1))), 3) for name in ("position", "velocity")]
        wrong += scores(*blocks).honesty.use in (Use.OPTIMISTIC, Use.PESSIMISTIC)
    # 0.3 % for all together, and five standard deviations of a Poisson number of 9
    assert wrong <= 9 + 15


def test_without_a_truth_distances_to_fixes_are_no_errors():
    blocks = scored("position", 5.0), scored("nis_position", 1.0), scored("nis_velocity", 1.0)
    verdict = scores(*blocks, outages=[outage(10.0, 1.0, 400)], truth=False).honesty
    assert verdict.use is Use.HONEST  # the smoother decides nothing
    assert "distances to the fixes 1.00 × predicted, up to 10 s without fixes" in verdict.text
    assert "error" not in verdict.text


@pytest.fixture(scope="module")
def known():
    axes = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    noise = NoiseModel([White(1e-4), RandomWalk(1e-5)])
    records, _ = simulate(dict.fromkeys(axes, noise), duration=1200.0, rate=20.0, seed=3)
    found = identify(records, arma=None)
    return Settings(found, synthesize(found, name="unit"))


def test_settings_that_nothing_speaks_against_are_usable(known):
    assert judge_settings(known).use is Use.USABLE


def with_config(known, **what):
    return replace(known, config=replace(known.config, **what))


@pytest.mark.parametrize(
    ("one", "said"),
    [
        (
            Enlargement(Quantity("gyro_x", "white_density"), 3.1, "vibration"),
            "settings not as measured or stated: white noise of gyro x × 3.1",
        ),
        (
            AppliedNoiseScale(Quantity("gyro", "white_density"), 190.0, "", causes=("unknown",)),
            "settings not as measured or stated: white noise of gyro x y z × 190 (unknown)",
        ),
    ],
)
def test_a_factor_on_a_setting_is_in_the_verdict(known, one, said):
    verdict = judge_settings(with_config(known, inflations=(one,)))
    assert verdict.use is Use.USABLE_EXCEPT
    assert said in verdict.text
    small = replace(one, factor=1.3)
    assert judge_settings(with_config(known, inflations=(small,))).use is Use.USABLE


def test_what_changes_a_setting_together_is_one_factor_in_the_verdict(known):
    """It read "white noise of gyro x y z × 39 (vibration)", then "white noise of gyro × 0.43 (unknown)"."""
    noise = "white_density"
    shaken = (Enlargement(Quantity(f"gyro_{axis}", noise), 40.0, "", ("vibration",)) for axis in "xyz")
    scale = AppliedNoiseScale(Quantity("gyro", noise), 0.4, "", causes=("unknown",))
    fixes = [AppliedNoiseScale(Quantity("gnss", f"{row}_sd"), 0.4, "") for row in ("position", "velocity")]
    text = judge_settings(with_config(known, inflations=(*shaken, scale, *fixes))).text
    assert "white noise of gyro x y z × 16 (vibration, unknown)" in text
    assert "position sds of fixes × 0.40, velocity sds of fixes × 0.40" in text  # both read "sds of fixes"
    # What the filter gets: 0.0057 to 0.017 stood there, factors of a trial, beside sds of 0.14 of 1.9 m.
    rows = {"horizontal": 0.073, "vertical": 0.33}
    applied = Compensation.parse({f"gnss_noise_scale.position_{row}": x for row, x in rows.items()})
    config = replace(known.config, inflations=tuple(fixes), compensation=applied)
    assert "position sds of fixes × 0.073 to 0.33" in judge_settings(replace(known, config=config)).text


def test_a_limit_names_its_term(known):
    """It read "values of accel z behind →", on screens without a table that has →."""
    limit = BoundUsed(Quantity("accel_z", "random_walk.density"), 0.1, "")
    text = judge_settings(with_config(known, inflations=(limit,))).text
    assert "bias random walk (accel z): not seen, half of the limit is ASSUMED" in text
    assert "→" not in text


def test_samples_that_are_left_out_are_in_the_verdict(known):
    sensors = [{**one, "used_share": 0.52} for one in known.identification.source["sensors"]]
    source = {**known.identification.source, "sensors": sensors}
    verdict = judge_settings(replace(known, identification=replace(known.identification, source=source)))
    assert "only 52 % of the samples are used" in verdict.text


def test_a_clock_that_jumps_loses_no_samples():
    (record,), _ = simulate({"gyro_x": NoiseModel([White(1e-4)])}, duration=60.0, rate=20.0, seed=3)
    t = record.t + np.where(np.arange(1200) < 600, 0.0, 1e5)
    jumped = replace(record, t=t, segments=((0, 600), (600, 1200)))
    assert lost_shares(identify([jumped], arma=None)) == {"gyro_x": 0.0}
    half = replace(jumped, segments=((0, 600),))
    assert lost_shares(identify([half], arma=None)) == {"gyro_x": 0.5}


def test_what_the_samples_speak_against_is_in_the_verdict_on_noise_and_settings():
    noise = NoiseModel([White(1e-4), RandomWalk(1e-5)])
    records, _ = simulate({"gyro_x": noise, "accel_x": noise}, duration=1200.0, rate=20.0, seed=3)
    against = "accel, which reads 1.33 × gravity at rest"
    assert judge_noise(identify(records, arma=None)).use is Use.USABLE
    found = identify([replace(record, contradicted=(against,)) for record in records], arma=None)
    assert judge_noise(found).text == f"usable except: {against}"
    assert judge_settings(Settings(found, synthesize(found))).text == f"usable except: {against}"


def test_an_axis_that_a_log_lacks_is_in_the_verdict():
    noise = NoiseModel([White(1e-4), RandomWalk(1e-5)])
    records, _ = simulate({"gyro_x": noise, "gyro_z": noise}, duration=1200.0, rate=20.0, seed=3)
    assert (
        judge_noise(identify(records, arma=None)).text == "usable except: gyro y, which the log does not hold"
    )


def test_what_drifts_further_than_its_noise_is_in_the_verdict(known):
    rest = Unexplained("shape of the spectrum", ("gyro_x",), 1e-9, drift={"60 s": (30.0, 10.0)})
    assert (
        "drift is 3.0 × that of its noise"
        in judge_settings(replace(known, diagnosis=Diagnosis((), (rest,)))).text
    )
    harmless = replace(rest, drift={"60 s": (10.1, 10.0)})
    assert judge_settings(replace(known, diagnosis=Diagnosis((), (harmless,)))).use is Use.USABLE


def test_a_start_that_failed_forbids_the_settings_of_a_drive(known):
    """An alignment that was corrected by 278° stood in a note beside "nothing found"."""
    failed = Unexplained(
        "the start failed: its attitude was corrected by 278.0°", ("drive",), 0.0, about=START
    )
    drive = DriveDiagnosis((), known.config, known.config, (failed,))
    verdict = judge_settings(replace(known, drive=drive))
    assert verdict.use is Use.DO_NOT_USE
    assert verdict.text.startswith("do not use: the start failed: its attitude was corrected by 278.0°")


def test_settings_that_err_more_than_the_fixes_alone_are_not_used(known):
    square = np.ones(4)
    late = PredictiveScore((), 3.8, square, fixes_rms=1.0)
    worse = HeldOutChoice(known.config, "with the findings", {}, late, late)
    assert judge_settings(replace(known, choice=worse)).use is Use.DO_NOT_USE
    alike = replace(worse, after=replace(late, tracking_rms=1.1))
    assert judge_settings(replace(known, choice=alike)).use is Use.USABLE


@pytest.mark.parametrize(
    ("ratio", "use"), [(1.7, Use.USABLE_EXCEPT), (2.3, Use.DO_NOT_USE), (0.4, Use.DO_NOT_USE)]
)
def test_beyond_twice_their_prediction_settings_are_not_used(known, ratio, use):
    off = scores(scored("position", ratio), scored("velocity", 1.0))
    assert judge_settings(replace(known, measured=off)).use is use
    checked = replace(known, check=SimpleNamespace(consistency=off))
    named = replace(known.config, gnss=load_gnss("spp"))
    assert judge_settings(replace(checked, config=named)).use is use
    # A receiver that nobody named, on a city drive, says nothing of a tag on an animal, sampled at 1 Hz.
    assert judge_settings(checked).text.startswith("usable except: drives with GNSS: in simulation")
    # Nor against a recorded drive: one of 25 simulated runs refused settings that are honest where they are used.
    lost = replace(
        scores(),
        diverged=True,
        verdicts=(
            Verdict(VerdictCode.RUNS_DIVERGED, Severity.DIVERGED, numbers={"diverged_runs": 1, "runs": 25}),
        ),
    )
    lost = replace(known, config=named, check=SimpleNamespace(consistency=lost))
    said = "in simulation the filter diverged in 1 of 25 runs"
    assert judge_settings(lost).text == f"do not use: {said}"
    driven = replace(lost, measured=scores(scored("position", 1.0), scored("velocity", 1.0)))
    assert judge_settings(driven).text == f"usable except: drives with GNSS: {said}"


def test_demanded_terms_that_the_curve_contradicts_are_not_used(known):
    """`identify --terms` of a log that the sensor filters was usable, with white noise 80 times too small."""
    channels = {
        axis: replace(one, warnings=(f"{CURVE_DISAGREES} (χ² = 90 on 9)",))
        for axis, one in known.identification.channels.items()
    }
    refuted = replace(known.identification, channels=channels)
    assert judge_noise(refuted).use is Use.DO_NOT_USE
    assert judge_noise(known.identification).use is Use.USABLE


def test_the_verdict_stands_atop_the_settings_and_nothing_is_written_that_must_not_be_used(known):
    made = TuneResult(
        "unit",
        (),
        known.identification,
        None,
        None,
        None,
        known.config,
        None,
        {},
        {},
        {"noise.yaml": "a: 1\n"},
    )
    text = made.written.exports["noise.yaml"]
    assert text.startswith("# Verdict: usable")
    assert text.endswith("\na: 1\n")
    off = SimpleNamespace(consistency=scores(scored("position", 2.3)))
    named = replace(known.config, gnss=load_gnss("spp"))
    withheld = replace(made, check=off, config=named).written
    assert not withheld.exports
    assert "position 2.30" in withheld.withheld["noise.yaml"]


def test_tune_and_check_simulate_the_same_runs():
    """One file, one verdict: number, length and trajectory of the runs stand in three places."""
    options = {one.name: one.default for one in command.params}
    stated = pipeline.CHECK_RUNS, pipeline.CHECK_DURATION, pipeline.CHECK_TRAJECTORY
    assert (options["runs"], options["duration"], options["trajectory"]) == stated
    assert stated[:2] == (DEFAULT_RUNS, DEFAULT_DURATION)
