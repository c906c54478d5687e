"""What verbs are given by mistake: each is refused in one line that says what to pass, never by a raw exception."""

import numpy as np
import pandas as pd
import pytest

import tuner
from tuner.catalogue.grades import grade_identification, load_grade
from tuner.types.records import DataError, Record

NOISE = grade_identification(load_grade("mpu9250"))
RECORD = Record("gyro", np.arange(8.0), np.zeros((8, 1)), ("gyro_x",), "rad/s", 1.0)
MISTAKES = {
    "None": None,
    "empty text": "",
    "no such file": "no/such/file.csv",
    "empty frame": pd.DataFrame(),
    "frame of text": pd.DataFrame({"gyro_x": ["a", "b"]}),
    "empty dict": {},
    "dict": {"a": 1},
    "number": 5,
    "list": [1, 2],
    "array": np.zeros(3),
    "object": object(),
}
ARGUMENTS = {
    "read": tuner.read,
    "identify": tuner.identify,
    "diagnose": tuner.diagnose,
    "synthesize": tuner.synthesize,
    "check": tuner.check,
    "check: trajectory": lambda x: tuner.check("mpu9250", x),
    "navigate": lambda x: tuner.navigate(x, "mpu9250"),
    "score": lambda x: tuner.score(x, x),
    "compare": lambda x: tuner.compare("mpu9250", x),
    "compare: gnss": lambda x: tuner.compare("mpu9250", "fog", gnss=x),
    "choose: gnss": lambda x: tuner.choose(gnss=x),
    "plan": tuner.plan,
    "curve": lambda x: tuner.curve(x, "oadev"),
    "export": lambda x: tuner.export(x, "kalibr"),
    "export: dialect": lambda x: tuner.export("mpu9250", x),
    "fleet": tuner.fleet,
    "tune": lambda x: tuner.tune(x) if x is not None else tuner.tune(""),
    "tune: drive": lambda x: tuner.tune("mpu9250", drive=x if x is not None else ""),
}
NUMBERS = {
    "check: runs": lambda x: tuner.check("mpu9250", runs=x),
    "check: seed": lambda x: tuner.check("mpu9250", seed=x),
    "choose: outage": lambda x: tuner.choose(outage=x),
    "choose: error": lambda x: tuner.choose(error=x),
    "plan: hours": lambda x: tuner.plan("mpu9250", hours=x),
    "plan: accuracy": lambda x: tuner.plan("mpu9250", accuracy=x),
    "tune: seed": lambda x: tuner.tune("mpu9250", seed=x),
    "tune: replicas": lambda x: tuner.tune("mpu9250", replicas=x),
    "synthesize: turn_on": lambda x: tuner.synthesize(NOISE, turn_on={"gyro_x": x}),
    "diagnose: seed": lambda x: tuner.diagnose(RECORD, seed=x),
    "diagnose: replicas": lambda x: tuner.diagnose(RECORD, replicas=x),
}
ALWAYS_REFUSED = {
    "tune: progress": lambda x: tuner.tune("mpu9250", progress=x),
    "diagnose: progress": lambda x: tuner.diagnose(RECORD, progress=x),
    "compare: progress": lambda x: tuner.compare("mpu9250", "fog", progress=x),
    "read: progress": lambda x: tuner.read({"gyro_x": [1.0]}, progress=5 if x is None else x),
}


@pytest.mark.parametrize("verb", [*ARGUMENTS, *NUMBERS, *ALWAYS_REFUSED])
def test_a_wrong_argument_is_refused_in_one_line(verb):
    for name, value in MISTAKES.items():
        if verb in NUMBERS and name == "number":
            continue
        with pytest.raises(DataError) as refused:
            (ARGUMENTS | NUMBERS | ALWAYS_REFUSED)[verb](value)
        line = str(refused.value)
        assert "\n" not in line, (name, line)
        assert any(word in line for word in ("expected", "no such file", "unknown")), (name, line)


OTHERS = {
    "rate": lambda log: tuner.read(log, rate="100"),
    "scale": lambda log: tuner.read(log, gyro_scale=[2]),
    "begin": lambda log: tuner.read(log, begin="5"),
    "memory": lambda log: tuner.read(log, memory="4"),
    "terms": lambda log: tuner.identify(tuner.read(log), terms="white"),
    "latitude": lambda log: tuner.identify(tuner.read(log), latitude="48"),
    "complete": lambda log: tuner.tune(log, complete=object()),
    "receiver": lambda log: tuner.tune(log, gnss=5),
    "receiver simulated": lambda log: tuner.check("mpu9250", receiver="rtk"),
    "turn_on": lambda _: tuner.synthesize(NOISE, turn_on=[1, 2]),
    "inflations": lambda _: tuner.synthesize(NOISE, inflations=object()),
    "findings": lambda _: tuner.synthesize(NOISE, findings=[1]),
    "synthesized records": lambda _: tuner.synthesize(NOISE, records=5),
    "logs": lambda log: tuner.fleet([]),
    "folder": lambda log: tuner.check(log.parent / "none.yaml"),
}


@pytest.mark.parametrize("case", OTHERS)
def test_an_argument_beside_the_log_is_refused_in_one_line(case, tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, t=0.01 * np.arange(200), gyro=np.random.default_rng(1).normal(0.0, 1e-3, (200, 3)))
    with pytest.raises(DataError, match=r"expected|: no such file$"):
        OTHERS[case](path)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda r: tuner.identify(r, foo=1),
            "identify: foo: expected with the path of a log or a table, found records",
        ),
        (lambda r: tuner.identify(r, rate=50), "identify: rate: expected with the path of a log or a table"),
        (lambda _: tuner.identify([]), "identify: expected records, such as .* found list of 0"),
        (
            lambda r: tuner.identify(r, terms=["white", "white"]),
            "terms: expected white once, found it 2 times",
        ),
        (
            lambda r: tuner.identify(r, terms=["ramp"]),
            "terms: expected one or more of quantization .* found ramp",
        ),
        (
            lambda _: tuner.plan("mpu9250", accuracy=1e-300),
            "plan: accuracy: expected a share from 1e-06 .* found 1e-300",
        ),
        (
            lambda _: tuner.synthesize(NOISE, turn_on={"foo": 1}),
            "synthesize: turn_on: expected axes .* found 'foo'",
        ),
        (
            lambda _: tuner.synthesize(NOISE, findings=[{"a": 1}]),
            "synthesize: findings: expected those of a config",
        ),
        (lambda _: tuner.check("mpu9250", runs=1), "check: runs: expected a whole number from 2 on, found 1"),
        (lambda _: tuner.compare("nofile.csv"), r"nofile\.csv: no such file"),
        (lambda _: tuner.compare("."), r"compare: expected two sources or more, found \.;"),
        (lambda _: tuner.read("nofile.csv", memory=-1), "read: memory: expected a positive number, found -1"),
        (lambda _: tuner.choose(error=-1), "choose: error: expected metres above 0, found -1"),
        (lambda r: tuner.diagnose(r, wheels=True), "diagnose: wheels: expected with a drive"),
    ],
)
def test_what_can_have_no_effect_is_refused_by_the_name_of_its_argument(call, said):
    """Each was taken and ignored, ended in an error of numpy, or named an option of the command line."""
    y = np.random.default_rng(1).normal(0.0, 1e-3, (400, 1))
    record = Record("gyro", 0.01 * np.arange(400), y, ("gyro_x",), "rad/s", 0.01)
    with pytest.raises(DataError, match=f"^{said}"):
        call([record])


def test_what_is_wrong_with_a_list_of_numbers_is_said():
    """Expected a list of numbers, found list of 1 (float)."""
    with pytest.raises(
        DataError, match=r"tau: expected a list of numbers.*, found list of 1 \(float\), not all finite"
    ):
        tuner.curve(RECORD, "oadev", tau=[np.nan])
