"""Calls of the verbs with one argument, or two, that are wrong: drawn from a seed, so that each can be repeated."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from decimal import Decimal
from fractions import Fraction
from functools import cache
from io import BytesIO
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

import tuner
from models.arrays import FloatArray
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.simulation.drive import simulate_drive
from tuner.simulation.simulate_source import simulate_source
from tuner.simulation.static import simulate
from tuner.types.records import Record

HUGE = 10**5000
"""A whole number beyond every float."""
ROOTS = tuple(str(Path(tuner.__file__).parents[1] / name) for name in ("tuner", "models"))


@dataclass(frozen=True)
class WrongCall:
    """A verb, all its arguments, and which of them are wrong."""

    verb: str
    arguments: Mapping[str, Any]
    wrong: tuple[str, ...]

    def __str__(self) -> str:
        values = ", ".join(f"{name}={self.arguments[name]!r:.60}" for name in self.wrong)
        return f"{self.verb}({values})"


@cache
def noise() -> Any:
    return grade_identification(load_grade("mpu9250"))


@cache
def record() -> Record:
    y: FloatArray = np.random.default_rng(1).normal(0.0, 1e-3, (400, 1))
    return Record("gyro", 0.01 * np.arange(400), y, ("gyro_x",), "rad/s", 0.01)


@cache
def drive() -> Any:
    motion = TRAJECTORIES["city"](120.0)
    return simulate_drive(load_grade("mpu9250"), motion, load_gnss("spp"), rate=10.0, seed=3)[0]


@cache
def config() -> Any:
    return tuner.synthesize(noise(), gnss=load_gnss("spp"))


def _results() -> list[Any]:
    """Results of verbs, of which a parameter takes one kind at most, and things that are no argument of any."""
    return [
        record(),
        [record()],
        noise(),
        config(),
        drive(),
        tuner.curve(record(), "oadev"),
        load_grade("fog"),
        load_gnss("rtk"),
        tuner.plan(noise()),
        SimpleNamespace(name="gyro", channels={}, axes=("gyro_x",), interval=0.01),
        object(),
        len,
        Record,
        generator(),
        np.zeros((3, 2)),
        np.zeros(3, dtype=complex),
        np.array(["a", "b"]),
        np.array([object()]),
        np.array(None),
        np.array(1.0),
        np.float64(3.5),
        np.bool_(True),
        np.datetime64("2024-01-01"),
        pd.DataFrame({"a": [1.0]}),
        pd.Series([1.0, 2.0]),
        {"a": 1},
        {1: 2},
        {None: None},
        {},
        [],
        (),
        set(),
        [None],
        [[]],
        [1, 2],
        ["a", 1],
        [b"a"],
        b"mpu9250",
        bytearray(b"x"),
        memoryview(b"x"),
        True,
        False,
        5,
        -1,
        2.5,
        1j,
        HUGE,
        -HUGE,
        float("nan"),
        float("inf"),
        -float("inf"),
        "",
        " ",
        "no such thing",
        "a\nb\x1b[31m",
        "\0",
        "\udc80",
        "x" * 5000,
        "~",
        "/",
        ".",
        Path("/"),
        Path("/no/such/file.csv"),
        Path("/dev/null"),
        Path("x" * 5000),
        Path("a\0b"),
        range(3),
        slice(1, 2),
        NotImplemented,
        Ellipsis,
        ValueError("x"),
        Fraction(-1, 3),
        Decimal("2.5"),
        Decimal("nan"),
        np.int64(-1),
        np.float64("nan"),
        np.float32("inf"),
        date(2024, 1, 1),
        BytesIO(b"t,gyro_x\n"),
        np.ma.masked,
        np.array([1.0, np.nan]),
        np.array([[1.0, "a"]], dtype=object),
        {"gyro_x": -1.0},
        {"gyro_x": float("nan")},
        {"gyro_x": [[1.0, 2.0], [3.0]]},
        {"gyro": np.zeros((2, 2, 2))},
        {"no such axis": 1.0},
        {"gyro_x": HUGE},
        [float("nan")],
        [float("inf")],
        [-1.0],
        [1e12],
        [HUGE],
        [record(), None],
        [record(), record()],
        ["white", "no such term"],
        [""],
        ["no such effect"],
        "white",
        "line@no_axis:frequency=1",
        *with_wrong_content(),
        frozenset({1}),
        lambda: None,
    ]


@cache
def with_wrong_content() -> tuple[Any, ...]:
    """Return results that hold what no verb puts into them, and the pieces of which nothing follows."""
    one, known, settings, moving = record(), noise(), config(), drive()
    nothing, short = slice(0, 0), slice(0, 2)
    return (
        replace(one, y=np.full_like(one.y, np.nan)),
        replace(one, y=np.full_like(one.y, np.inf)),
        replace(one, t=one.t[nothing], y=one.y[nothing]),
        replace(one, t=one.t[short], y=one.y[short]),
        replace(one, y=np.zeros((400, 0)), axes=()),
        replace(known, channels={}),
        replace(settings, channels={}),
        replace(moving, gnss=moving.gnss.rows(nothing)),
        replace(moving, gnss=moving.gnss.rows(short)),
        replace(moving, imu_t=moving.imu_t[short], rates=moving.rates[short]),
        replace(moving, imu_t=moving.imu_t[nothing], rates=moving.rates[nothing]),
        replace(moving, rates=np.full_like(moving.rates, np.nan)),
        replace(moving, imu_t=moving.imu_t[::-1]),
    )


def generator() -> Any:
    """Return what can be gone through once, and holds nothing usable."""
    return (one for one in (1, 2))


NUMBERS = (float, int)
Fit = Callable[[Any], bool]


def a_number(low: float = -math.inf, high: float = math.inf, *, above: bool = True) -> Fit:
    def fits(value: Any) -> bool:
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, bool) or not isinstance(value, NUMBERS) or not abs(value) < 1e300:
            return False
        return bool((low < value if above else low <= value) and value <= high)

    return fits


def a_count(low: int = 0, high: float = math.inf) -> Fit:
    return lambda value: isinstance(value, int) and not isinstance(value, bool) and low <= value <= high


def one_of(*values: Any) -> Fit:
    return lambda value: isinstance(value, str) and value in values


def is_a(*kinds: Any) -> Fit:
    """Return whether a value is of a kind; none of the results that hold nothing usable."""
    return lambda value: isinstance(value, kinds) and not any(value is one for one in with_wrong_content())


def records_or(*kinds: Any) -> Fit:
    def fits(value: Any) -> bool:
        one = is_a(*(kinds or (Record,)))
        several = isinstance(value, list) and bool(value) and all(map(is_a(Record), value))
        return one(value) or (several and len(value) == 1)

    return fits


def optional(fits: Fit) -> Fit:
    return lambda value: value is None or fits(value)


def never(value: Any) -> bool:
    return False


def callable_with(value: Any) -> bool:
    return callable(value)


def flag(value: Any) -> bool:
    return isinstance(value, bool | np.bool_)


EMPTY: Fit = lambda value: isinstance(value, list | tuple) and not value  # noqa: E731
STRINGS: Fit = lambda value: (  # noqa: E731
    isinstance(value, list | tuple | set | frozenset) and all(isinstance(one, str) for one in value)
)
TERMS = optional(never)
LATITUDE = optional(a_number(-90.0, 90.0, above=False))


def _types() -> Any:
    from models.sensors import SensorGrade
    from tuner.types import FilterConfig, GnssNoise, Identification
    from tuner.types.records import Drive

    return SimpleNamespace(
        Drive=Drive,
        FilterConfig=FilterConfig,
        GnssNoise=GnssNoise,
        Identification=Identification,
        SensorGrade=SensorGrade,
    )


TYPES = _types()
TABLE = MappingProxyType({"gyro": np.random.default_rng(2).normal(0.0, 1e-3, (200, 3))})

Verb = tuple[Callable[..., Any], Callable[[], dict[str, Any]], dict[str, Fit]]


def verbs() -> dict[str, Verb]:
    """Return each verb with arguments that are right, and for each parameter whether a value may be right for it."""
    receiver = optional(is_a(TYPES.GnssNoise))
    identifying = {
        "terms": TERMS,
        "method": one_of("likelihood", "leastsquares", "slopes"),
        "arma": optional(one_of("bic", "aic")),
        "latitude": LATITUDE,
    }
    return {
        "tune": (
            tuner.tune,
            lambda: {"log": noise(), "gnss": load_gnss("spp")},
            {
                "log": lambda v: v is None or records_or(TYPES.Identification, Record)(v),
                "drive": optional(is_a(TYPES.Drive)),
                "horizon": a_number(0.0),
                "complete": optional(is_a(TYPES.SensorGrade)),
                "datasheet": optional(never),
                "gnss": optional(is_a(TYPES.GnssNoise)),
                "terms": optional(EMPTY),
                "latitude": LATITUDE,
                "conservative": flag,
                "replicas": a_count(),
                "seed": a_count(),
                "dialect": optional(never),
                "progress": callable_with,
            },
        ),
        "read": (
            tuner.read,
            lambda: {"path": TABLE, "rate": 100.0, "gyro_unit": "rad/s"},
            {
                "path": never,
                "rate": optional(a_number(0.0)),
                "gyro_unit": optional(never),
                "accel_unit": optional(never),
                "gyro_scale": optional(a_number(0.0)),
                "accel_scale": optional(a_number(0.0)),
                "columns": optional(lambda v: isinstance(v, dict) and not v),
                "constant_axes": flag,
                "assume": optional(never),
                "memory": optional(a_number(0.0)),
                "stamps": flag,
                "begin": optional(a_number(-math.inf, 1.0)),
                "end": optional(a_number(1.0)),
                "progress": optional(callable_with),
            },
        ),
        "identify": (
            tuner.identify,
            lambda: {"log": [record()], "arma": None},
            {"log": records_or(Record), **identifying},
        ),
        "diagnose": (
            tuner.diagnose,
            lambda: {"data": record()},
            {
                "data": records_or(Record, TYPES.Drive),
                "holdout": optional(records_or(Record)),
                "identification": optional(is_a(TYPES.Identification)),
                "replicas": a_count(),
                "seed": a_count(),
                "config": optional(never),
                "gnss": optional(never),
                "wheels": flag,
                "progress": callable_with,
            },
        ),
        "diagnose a drive": (
            tuner.diagnose,
            lambda: {"data": drive(), "config": "mpu9250"},
            {
                "holdout": optional(never),
                "config": optional(is_a(TYPES.FilterConfig)),
                "gnss": receiver,
                "wheels": flag,
            },
        ),
        "synthesize": (
            tuner.synthesize,
            lambda: {"identification": noise()},
            {
                "identification": is_a(TYPES.Identification),
                "horizon": a_number(0.0),
                "rule": never,
                "complete": optional(is_a(TYPES.SensorGrade)),
                "gnss": receiver,
                "turn_on": optional(lambda v: isinstance(v, dict) and not v),
                "inflations": EMPTY,
                "findings": EMPTY,
                "records": lambda v: EMPTY(v) or (isinstance(v, list) and records_or()(v)),
                "name": is_a(str),
                "seed": optional(a_count()),
            },
        ),
        "check": (
            tuner.check,
            lambda: {"config": "mpu9250", "runs": 2, "duration": 60.0},
            {
                "config": is_a(TYPES.FilterConfig),
                "trajectory": never,
                "duration": a_number(0.0, 1e6),
                "truth": optional(is_a(TYPES.FilterConfig)),
                "receiver": receiver,
                "runs": a_count(2, 1000),
                "seed": a_count(),
                "budget": flag,
                "engine": one_of("compiled", "filterpy"),
            },
        ),
        "navigate": (
            tuner.navigate,
            lambda: {"drive": drive(), "config": "mpu9250"},
            {
                "drive": is_a(TYPES.Drive),
                "config": is_a(TYPES.FilterConfig),
                "gnss": receiver,
                "states": optional(lambda v: isinstance(v, dict) and not v),
                "vehicle": never,
                "measured": optional(never),
            },
        ),
        "score": (
            tuner.score,
            lambda: {"errors": np.zeros((4, 5, 3)) + 0.1, "covariances": np.ones((4, 5, 3))},
            {"errors": never, "covariances": never, "names": optional(never)},
        ),
        "compare": (
            lambda one, other, **more: tuner.compare(one, other, **more),
            lambda: {"one": noise(), "other": noise()},
            {
                "one": records_or(TYPES.Identification, Record),
                "other": records_or(TYPES.Identification, Record),
                "by": optional(never),
                "gnss": never,
                "progress": callable_with,
            },
        ),
        "compare by": (
            lambda one, by: tuner.compare(one, by=by),
            lambda: {"one": [record()], "by": "still"},
            {"one": never, "by": one_of("still", "temperature")},
        ),
        "choose": (
            tuner.choose,
            lambda: {"outage": 10.0},
            {"outage": a_number(0.0, 300.0), "error": a_number(0.0), "gnss": never, "wheels": flag},
        ),
        "plan": (
            tuner.plan,
            lambda: {"noise": noise()},
            {
                "noise": records_or(TYPES.Identification, Record),
                "hours": a_number(0.01, 1e4),
                "accuracy": a_number(0.0, 1.0),
            },
        ),
        "curve": (
            tuner.curve,
            lambda: {"record": record(), "statistic": "oadev"},
            {"record": is_a(Record), "statistic": never, "tau": optional(is_a(pd.Series))},
        ),
        "curve at lags": (
            tuner.curve,
            lambda: {"record": record(), "statistic": "acf", "tau": [0.1]},
            {"tau": lambda v: isinstance(v, list | range | pd.Series | None)},
        ),
        "export": (
            tuner.export,
            lambda: {"config": config(), "dialect": "kalibr"},
            {
                "config": is_a(TYPES.FilterConfig),
                "dialect": never,
                "interval": optional(a_number(0.0)),
                "step": optional(a_number(0.0)),
                "memory": a_number(0.0),
            },
        ),
        "fleet": (
            tuner.fleet,
            lambda: {"logs": "tests/no/such/folder"},
            {
                "logs": never,
                "limits": never,
                "jobs": never,
                "scheduler": never,
                "store": never,
                "reading": never,
                "terms": never,
                "latitude": never,
                "progress": never,
            },
        ),
        "simulate a log": (
            simulate,
            lambda: {"sensor": load_grade("mpu9250"), "duration": 10.0, "rate": 10.0, "seed": 1},
            {
                "sensor": is_a(TYPES.SensorGrade),
                "duration": a_number(0.3, 1e6),
                "rate": optional(a_number(0.3, 1e6)),
                "seed": a_count(),
                "effects": EMPTY,
                "temperature": optional(never),
            },
        ),
        "simulate": (
            simulate_source,
            lambda: {"source": "mpu9250", "duration": 10.0, "rate": 10.0},
            {
                "source": never,
                "trajectory": optional(never),
                "gnss": optional(never),
                "duration": a_number(0.3, 1e6),
                "rate": optional(a_number(0.3, 1e6)),
                "effects": EMPTY,
                "seed": a_count(),
            },
        ),
        "load_grade": (load_grade, lambda: {"name": "fog"}, {"name": never}),
        "load_gnss": (load_gnss, lambda: {"name": "spp"}, {"name": never}),
    }


def wrong_calls(count: int, seed: int, log: Path) -> list[WrongCall]:
    """Return calls of all verbs of which each has a wrong argument, a fifth of them two.

    Parameters
    ----------
    count : int
        How many.
    seed : int
        Which.
    log : Path
        A log, which a fleet is measured from where its logs are right.
    """
    rng = np.random.default_rng(seed)
    every = verbs()
    values = _results()
    calls = []
    for index in range(count):
        name = list(every)[index % len(every)]
        _, right, parameters = every[name]
        arguments = right()
        if name == "fleet":
            arguments["logs"] = [str(log)]
        number = min(1 + int(rng.random() < 0.2), len(parameters))
        chosen = [str(one) for one in rng.choice(list(parameters), number, replace=False)]
        for parameter in chosen:
            wrong = [one for one in (*values, None) if not _may_be_right(parameters[parameter], one)]
            if name == "fleet":
                wrong = [one for one in wrong if not _fleet_takes(parameter, one)]
            arguments[parameter] = wrong[int(rng.integers(len(wrong)))]
        calls.append(WrongCall(name, arguments, tuple(chosen)))
    return calls


def _fleet_takes(parameter: str, value: Any) -> bool:
    """Whether a fleet may take a value."""
    fits: dict[str, Fit] = {
        "limits": optional(EMPTY),
        "jobs": a_count(1),
        "scheduler": optional(never),
        "store": optional(is_a(str, Path)),
        "reading": lambda v: isinstance(v, dict) and not v,
        "terms": optional(STRINGS),
        "latitude": LATITUDE,
        "progress": optional(callable_with),
    }
    return parameter in fits and _may_be_right(fits[parameter], value)


def _may_be_right(fits: Fit, value: Any) -> bool:
    if isinstance(value, str | Path) and str(value) in ("~",):
        return fits(value)
    if isinstance(value, np.ndarray | pd.DataFrame | np.datetime64):
        return False
    return bool(fits(value))


def outcome(call: WrongCall) -> str:
    """Return ``refused`` with a line of ours, ``taken``, or what was raised instead and where.

    Refused is a ValueError or TypeError that code of the project raises by itself, in one line that says more than
    the name of a type.
    """
    function = verbs()[call.verb][0]
    try:
        function(**call.arguments)
    except (ValueError, TypeError) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        ours = last.filename.startswith(ROOTS) and (last.line or "").lstrip().startswith("raise")
        line = str(error)
        if ours and "\n" not in line and line.isprintable() and len(line) <= 1200:
            return "refused"
        return f"{type(error).__name__} at {last.filename}:{last.lineno}: {line:.100}"
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} at {last.filename}:{last.lineno}: {error!s:.100}"
    return "taken"
