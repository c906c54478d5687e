"""What no answer may say: 2 000 made results of all kinds, each invariant broken once on purpose, simulated results."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from models.noise import NoiseModel, RandomWalk, White
from tuner import check, diagnose, identify, tune
from tuner.catalogue.grades import load_gnss
from tuner.exporters import export
from tuner.identification.identify_source import identify_source
from tuner.invariants import INVARIANTS, Claims, Statement, violations
from tuner.judgement import judge_drive, judge_log
from tuner.limits import SCREEN_LINES
from tuner.report.claims import _written, claims_of, lawful
from tuner.report.terminal import fitted
from tuner.report.tune_answer import tune_answer
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.tune_result import TuneResult
from tuner.types import Coefficient, Diagnosis, DriveDiagnosis, Enlargement, Finding, Quantity, Unexplained
from tuner.types.consistency import Consistency, Outage, RmsError, Score
from tuner.types.identification import TermEstimate
from tuner.types.judgement import Judgement, Use
from tuner.types.records import DataError

KNOWN = Coefficient.known(2.0, 1.5, 2.5, "1")
WIDE = Coefficient.known(2.0, 0.1, 40.0, "1")
BOUND = Coefficient.bounded(6e-4, "1", "at its bound")


def made_score(rng, name, dof, ratio=None, freedom=None):
    """A score of any size and certainty; its band as `mean_band` has it."""
    from tuner.consistency.scores import mean_band

    ratio = float(np.exp(rng.normal(0.0, 0.6))) if ratio is None else ratio
    freedom = float(np.exp(rng.uniform(0.0, 8.0))) if freedom is None else freedom
    return Score(name, dof * ratio**2, dof, freedom, mean_band(dof, freedom))


def made_scores(rng, **how):
    blocks = [made_score(rng, name, 3, **how) for name in ("position", "velocity", "attitude")]
    nis = [made_score(rng, name, 3, **how) for name in ("nis_position", "nis_velocity")]
    outages = [
        Outage(s, 2.0, 1.0, made_score(rng, f"outage {s:g} s", 1, **how), 5)
        for s in (10.0, 30.0, 60.0, 300.0)
    ]
    truth = bool(rng.integers(2))
    errors = {"position" if truth else "nis_position": RmsError((1.0,), "m")}
    return Consistency(None, tuple(blocks[: rng.integers(4)]), tuple(nis), None, tuple(outages[: rng.integers(5)]),
                       errors, 0.0, diverged=bool(rng.random() < 0.05))  # fmt: skip


def made_diagnosis(rng):
    figures = [KNOWN, WIDE, BOUND]
    found = [
        Finding(
            "step",
            ("gyro_x",),
            "a statistic",
            1.0,
            1e-9,
            {"size": figures[rng.integers(3)]},
            "step in gyro_x",
        )
        for _ in range(rng.integers(3))
    ]
    left = [Unexplained("shape of the spectrum", ("gyro_x",), 1e-9) for _ in range(rng.integers(3))]
    return Diagnosis(tuple(one for one in found if one.determined), tuple(left))


def of_drive(found):
    return DriveDiagnosis(found.findings, None, None, unexplained=found.unexplained)


def test_no_made_result_contradicts_itself():
    """Scores of every size, certainty and combination; diagnoses with and without names and rests."""
    rng = np.random.default_rng(20261127)
    uses = set()
    for _ in range(1000):
        for result in (made_scores(rng), made_diagnosis(rng), of_drive(made_diagnosis(rng))):
            said = claims_of(result)
            uses.add(said.verdict.use)
            assert violations(said) == ()
    assert uses == {Use.HONEST, Use.TOO_SHORT, Use.OPTIMISTIC, Use.PESSIMISTIC, Use.DO_NOT_USE,
                    Use.NOTHING_CONTRADICTS, Use.EXPLAINED, Use.NOT_EXPLAINED, Use.USABLE}  # fmt: skip


def test_no_made_settings_contradict_their_verdict():
    """Settings with any scores, rests, enlargements, borrowed terms and losses: what may not be used is not written."""
    rng = np.random.default_rng(7)
    axes = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    noise = NoiseModel([White(1e-4), RandomWalk(1e-5)])
    records, _ = simulate(dict.fromkeys(axes, noise), duration=120.0, rate=20.0, seed=7)
    found = identify(records, arma=None)
    config = synthesize(found, name="unit", gnss=load_gnss("spp"))
    uses = set()
    for _ in range(200):
        sensors = [
            {
                **one,
                "used_share": float(rng.uniform(0.4, 1.0)) if rng.random() < 0.3 else one["used_share"],
            }
            for one in found.source["sensors"]
        ]
        scores = replace(made_scores(rng), errors={"position": RmsError((1.0,), "m")})
        check = SimpleNamespace(consistency=scores, notes=())
        larger = Enlargement(Quantity("gyro_x", "white_density"), float(np.exp(rng.normal())), "vibration")
        result = TuneResult(
            "unit", records, replace(found, source={"sensors": sensors}), made_diagnosis(rng), None, None,
            replace(config, inflations=(larger,) if rng.random() < 0.5 else ()),
            check if rng.random() < 0.7 else None, {}, {}, {"noise.yaml": "a text"},
        ).written  # fmt: skip
        uses.add(result.verdict.use)
        assert violations(claims_of(result)) == ()
        assert bool(result.exports) == (result.verdict.use is not Use.DO_NOT_USE)
        assert len(fitted(tune_answer(result, None))) <= SCREEN_LINES
    assert uses == {Use.USABLE, Use.USABLE_EXCEPT, Use.DO_NOT_USE}


RNG = np.random.default_rng(1)
OFF = made_scores(RNG, ratio=3.0, freedom=1e4)
WEAK = made_scores(RNG, ratio=1.0, freedom=3.0)
FINDING = Finding("step", ("gyro_x",), "a statistic", 1.0, 1e-9, {"size": BOUND}, "step in gyro_x")
GOOD = Judgement(Use.USABLE)
BROKEN = {
    1: Claims(Judgement(Use.NOTHING_CONTRADICTS), unexplained=("shape of the spectrum",)),
    2: Claims(Judgement(Use.HONEST), (replace(WEAK, diverged=False),)),
    3: Claims(GOOD, (replace(OFF, blocks=(), nis=(), outages=(), diverged=True),)),
    4: Claims(GOOD, errors={"position_rms_m": False}),
    5: Claims(GOOD, names=(FINDING,)),
    6: Claims(GOOD, lost={"gyro_x": 0.48}),
    8: Claims(
        GOOD, statements=(Statement("gyro_x.white", "here", 1.0), Statement("gyro_x.white", "there", 1.1))
    ),
    9: Claims(GOOD, files=("noise.yaml",), beside_fixes=(3.8, 1.0)),
}


@pytest.mark.parametrize("number", INVARIANTS)
def test_each_invariant_is_told_where_it_is_broken(number):
    told = {text.partition(":")[0] for text in violations(BROKEN[number])}
    assert told == {str(number)}


@pytest.mark.parametrize(
    "one",
    [
        Statement("gyro_z.walk", "identified", 7.37, (51.6, 59.8)),
        Statement("gyro_z.walk", "in the configuration", 65.0, None, 59.8),
    ],
)
def test_a_number_beyond_its_own_interval_or_limit_is_told(one):
    assert violations(Claims(GOOD, statements=(one,)))


def test_a_cause_that_is_named_and_unexplained_is_told():
    named = replace(FINDING, cause="gnss_noise_scale", parameters={"size": KNOWN})
    left = ("gnss_noise_scale: likelihood ratio of a factor on the noise",)
    assert violations(Claims(GOOD, names=(named,), unexplained=left))
    assert not violations(Claims(GOOD, names=(named,), unexplained=("imu_noise_scale: likelihood ratio",)))


def test_a_result_that_contradicts_itself_is_refused_in_one_line():
    unlawful = Diagnosis((FINDING,))
    with pytest.raises(DataError, match="contradict itself: 5: step is named") as refusal:
        lawful(unlawful)
    assert "\n" not in str(refusal.value)


def test_what_is_unexplained_is_in_the_verdict_of_a_diagnosis():
    rest = Unexplained("shape of the spectrum", ("gyro_x",), 1e-9)
    named = replace(FINDING, parameters={"size": KNOWN})
    assert judge_log(Diagnosis((), (rest,))).text.endswith("; not explained: shape of the spectrum in gyro x")
    both = judge_drive(of_drive(Diagnosis((named,), (rest,))))
    assert both.use is Use.NOT_EXPLAINED
    assert both.text == "not explained: shape of the spectrum in gyro x; explained: step"
    assert judge_drive(of_drive(Diagnosis((named,)))).text == "causes found: step"


def test_the_verdict_on_a_log_says_whether_it_can_be_used_and_for_what():
    """It was "not explained: …", below which nobody knew whether settings may be made from the log."""
    assert judge_log(Diagnosis(())).text.startswith("usable: for the settings of a filter")
    lost = replace(FINDING, parameters={"size": KNOWN}, extension={"in_motion": "motion is lost"})
    filtered = judge_log(Diagnosis((lost,)))
    assert filtered.use is Use.USABLE_EXCEPT
    assert filtered.text.startswith(
        "usable except: in motion, as gyro x are filtered (motion is lost); usable for"
    )
    small = Unexplained("shape of the spectrum", ("gyro_x",), 1e-9, drift={"60 s": (1.02, 1.0)})
    assert "not explained, below 5 % of the drift: shape" in judge_log(Diagnosis((), (small,))).text
    large = replace(small, drift={"60 s": (2.0, 1.0)})
    assert (
        "gyro x: after 60 s its drift is 2.0 × that of its noise" in judge_log(Diagnosis((), (large,))).text
    )


def test_two_terms_of_one_kind_are_two_quantities():
    """Two lines of one axis have two amplitudes: the invariant of one number a quantity does not mix them."""
    noise = dict.fromkeys(("gyro_x", "gyro_y", "gyro_z"), NoiseModel([White(1e-4)]))
    records, _ = simulate(noise, duration=20.0, rate=50.0, seed=3)
    found = identify(records)
    lines = [TermEstimate("sinusoid", {"amplitude": replace(KNOWN, value=size)}) for size in (1.6, 2.4)]
    of_axis = replace(found.channels["gyro_x"], terms=(*found.channels["gyro_x"].terms, *lines))
    lawful(replace(found, channels={**found.channels, "gyro_x": of_axis}))


def test_a_file_and_the_screen_have_one_number():
    """The file of another filter is of the settings that the screen shows."""
    config = synthesize(identify_source("mpu9250"))
    whole = SimpleNamespace(config=config, exports={"kalibr.yaml": export(config, "kalibr")})
    usable = Judgement(Use.USABLE, ())
    assert violations(Claims(usable, statements=tuple(_written(whole)))) == ()
    other = replace(config.channels["gyro_y"], white_density=2.0 * config.channels["gyro_y"].white_density)
    whole.config = replace(config, channels={**config.channels, "gyro_y": other})
    (found,) = {text[:1] for text in violations(Claims(usable, statements=tuple(_written(whole))))}
    assert found == "8"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_no_simulated_result_contradicts_itself(seed):
    """Logs with and without an effect, of one minute to one hour; identified, diagnosed, tuned and checked."""
    rng = np.random.default_rng(seed)
    noise = NoiseModel(
        [White(float(10 ** rng.uniform(-5, -3))), RandomWalk(float(10 ** rng.uniform(-8, -6)))]
    )
    axes = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    records, _ = simulate(
        dict.fromkeys(axes, noise), duration=float(rng.uniform(60.0, 1200.0)), rate=50.0, seed=seed
    )
    found = identify(records)
    results = [found, diagnose(records, identification=found), tune(records, gnss="spp", seed=seed)]
    results.append(check("mpu9250", runs=4, duration=600.0, seed=seed))
    for result in results:
        assert violations(claims_of(result)) == ()
