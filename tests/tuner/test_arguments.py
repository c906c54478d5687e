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
