"""Items on several processors: the results of one, errors passed on, nothing left running."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType

import numba
import numpy as np
import pytest

from models.noise import NoiseModel, RandomWalk, White
from tuner import diagnose, identify
from tuner.formats.diagnosis import diagnosis_json
from tuner.formats.identification import identification_json
from tuner.jobs import beside, each, limited, usable, within
from tuner.simulation.static import simulate
from tuner.stages import reached, watched

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only on Linux a process is copied")


def test_items_are_spread_over_processes_and_come_back_in_order():
    def function(number):
        time.sleep(0.05)
        return number, os.getpid(), usable()

    with limited(3):
        found = each(function, range(7))
    numbers, processes, processors = zip(*found, strict=True)
    assert numbers == tuple(range(7))
    assert len(set(processes)) == 3
    assert os.getpid() not in processes
    assert set(processors) == {1}  # nothing inside starts further processes


def test_one_processor_and_threads_work_in_this_process():
    with limited(1):
        assert set(each(lambda _: os.getpid(), range(3))) == {os.getpid()}
    with limited(3), ThreadPoolExecutor(1) as pool:
        assert pool.submit(lambda: set(each(lambda _: os.getpid(), range(3)))).result() == {os.getpid()}


def test_shared_objects_come_back_as_themselves_and_others_equal():
    mine = np.arange(3.0)
    with limited(2):
        (first, read_only), _ = each(lambda _: (mine, MappingProxyType({"a": 1})), range(2), shared=[mine])
    assert first is mine
    assert read_only == MappingProxyType({"a": 1})


def test_the_error_of_the_first_item_that_fails_is_raised():
    def function(number):
        if number in (2, 4):
            raise ValueError(number)

    with limited(3), pytest.raises(ValueError, match="2"):
        each(function, range(6))


def test_a_process_that_the_system_ends_is_reported():
    with limited(2), pytest.raises(MemoryError, match="--jobs"):
        each(lambda number: os.kill(os.getpid(), signal.SIGKILL) if number == 1 else number, range(2))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_copies_end_with_the_process(number):
    program = (
        "import os, signal, sys, time\nfrom tuner.jobs import each, limited\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell starts background jobs without it
        "def work(i):\n    os.write(1, f'{os.getpid()}\\n'.encode())\n    time.sleep(60)\n"
        "with limited(2):\n    each(work, range(2))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as one:
        assert one.stdout is not None
        copies = [int(one.stdout.readline()) for _ in range(2)]
        one.send_signal(number)
        assert one.stdout.read() == b""  # the pipe closes when the last of them has ended
    assert one.returncode != 0
    assert len(set(copies)) == 2


def test_identification_and_diagnosis_do_not_depend_on_the_number_of_processors():
    noise = NoiseModel([White(1e-4), RandomWalk(1e-6)])
    records, _ = simulate(dict.fromkeys(("gyro_x", "gyro_y"), noise), duration=30.0, rate=100.0, seed=20)
    texts = []
    for processors in (1, 2):
        with limited(processors):
            identified = identify(records, arma=None)
            found = diagnose(records, identification=identified)
        texts.append(json.dumps([identification_json(identified), diagnosis_json(found)], default=str))
    assert texts[0] == texts[1]


def test_threads_of_a_copy_may_compile():
    """A copy begins while this process holds the lock of the compiler; the first command of a machine stood still."""

    def compiles_in_a_thread(_):
        thread = threading.Thread(target=lambda: numba.njit(lambda x: x + 1)(1), daemon=True)
        thread.start()
        thread.join(60.0)
        return not thread.is_alive()

    with limited(2):
        assert each(compiles_in_a_thread, range(2)) == [True, True]


def test_no_copies_where_memory_is_scarce(monkeypatch):
    monkeypatch.setattr("tuner.jobs.free_memory", lambda: 0.0)
    with limited(4):
        assert each(lambda _: os.getpid(), range(3)) == 3 * [os.getpid()]


def test_copies_take_no_more_memory_than_is_allowed(monkeypatch):
    """Beside a process that holds 200 MB two copies of 1 GB fit into 2.9 GB, and none into 1.1 GB."""
    monkeypatch.setattr("tuner.jobs.used_memory", lambda: 2e8)
    monkeypatch.setattr("tuner.jobs.free_memory", lambda: 1e10)

    def processes(memory: float) -> set[int]:
        with limited(4), within(memory):
            return set(each(lambda _: time.sleep(0.05) or os.getpid(), range(4), memory=1e9))

    assert len(processes(2.9e9)) == 2
    assert processes(1.1e9) == {os.getpid()}


def test_what_runs_beside_ends_with_the_block(tmp_path):
    with limited(2), beside(lambda: (tmp_path / "done").write_text(str(os.getpid()))):
        pass
    assert int((tmp_path / "done").read_text()) != os.getpid()
    with limited(1), beside(lambda: (tmp_path / "alone").touch()):
        pass
    assert not (tmp_path / "alone").exists()
    with pytest.raises(KeyError), limited(2), beside(lambda: time.sleep(60.0)):
        raise KeyError  # and nothing waits for the rest


@pytest.mark.parametrize("processors", [1, 2])
def test_whoever_watches_sees_how_much_of_an_item_is_done_on_any_processor(processors, monkeypatch):
    monkeypatch.setattr("tuner.jobs.REPORT_INTERVAL", 0.01)
    seen = []
    with limited(processors), watched(lambda _doing, share, _until: seen.append(share)):
        each(lambda _: reached(1, 4) or time.sleep(0.3), range(2))
    assert {0.125, 0.625} <= set(seen) or 0.25 in seen  # one after the other, or together
    assert max(seen) == (0.625 if processors == 1 else 1.0)
