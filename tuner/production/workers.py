"""Many tasks on several processes of this machine, or on a Dask cluster; none of them stops the others.

Each local process runs `tuner.production.worker` with one thread, answers through a pipe, and belongs to a thread of
this process that feeds it. It is therefore known whose task ended a process; all are killed at once when the caller is
interrupted, and they end by themselves when the caller is killed, as their pipes are closed then.
"""

from __future__ import annotations

import importlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

from tuner.formats.guard import reason
from tuner.formats.packages import install
from tuner.jobs import THREAD_LIMITS
from tuner.production.unit import Outcome, Task
from tuner.types.records import DataError

Attempt = Callable[[Task], Outcome]
SCHEDULER_PATIENCE = 20.0
"""Time in which a scheduler must answer, s: several round trips of the slowest network."""


def outcomes(
    attempt: Attempt, tasks: Sequence[Task], *, jobs: int, scheduler: str | None
) -> Iterator[tuple[int, Outcome]]:
    """Yield index and outcome of every task as they finish: here, in `jobs` processes, or on a cluster."""
    if scheduler is not None:
        return _on_cluster(attempt, tasks, scheduler)
    if jobs == 1 or len(tasks) < 2:
        return ((index, attempt(task)) for index, task in enumerate(tasks))
    return _in_processes(attempt, tasks, min(jobs, len(tasks)))


def _in_processes(attempt: Attempt, tasks: Sequence[Task], jobs: int) -> Iterator[tuple[int, Outcome]]:
    waiting: queue.SimpleQueue[tuple[int, Task]] = queue.SimpleQueue()
    done: queue.SimpleQueue[tuple[int, Outcome]] = queue.SimpleQueue()
    processes: list[subprocess.Popen[bytes]] = []
    lock, stopped = threading.Lock(), threading.Event()

    def feed() -> None:
        """Give tasks to a process, and to a new one after a task that ended the last."""
        process: subprocess.Popen[bytes] | None = None
        while True:
            try:
                index, task = waiting.get_nowait()
            except queue.Empty:
                break
            try:
                if process is None:
                    with lock:
                        if stopped.is_set():
                            break
                        process = _started(attempt)
                        processes.append(process)
                done.put((index, _answer(process, task)))
            except (EOFError, OSError, pickle.UnpicklingError):
                status = None if process is None else _ended(process)
                done.put((index, Outcome(error=_died(task, status))))
                process = None
        if process is not None:
            _ended(process)

    for pair in enumerate(tasks):
        waiting.put(pair)
    with ThreadPoolExecutor(jobs) as threads:
        try:
            for _ in range(jobs):
                threads.submit(feed)
            for _ in tasks:
                yield done.get()
        finally:
            with lock:
                stopped.set()
                for process in processes:
                    process.kill()


def _started(attempt: Attempt) -> subprocess.Popen[bytes]:
    """Start a process that does what `attempt` does with each task, with the modules and settings of this one."""
    environment = os.environ | dict.fromkeys(THREAD_LIMITS, "1")
    environment["PYTHONPATH"] = os.pathsep.join(path or str(os.curdir) for path in sys.path)
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "tuner.production.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
    )
    _send(process, attempt)
    return process


def _send(process: subprocess.Popen[bytes], value: object) -> None:
    assert process.stdin is not None
    pickle.dump(value, process.stdin)
    process.stdin.flush()


def _answer(process: subprocess.Popen[bytes], task: Task) -> Outcome:
    _send(process, task)
    assert process.stdout is not None
    outcome: Outcome = pickle.load(process.stdout)
    return outcome


def _ended(process: subprocess.Popen[bytes]) -> int:
    """Close the pipes of a process, upon which it ends, and return its status."""
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        with suppress(OSError):
            pipe.close()
    return process.wait()


def _died(task: Task, status: int | None) -> str:
    ended = "could not be started" if status is None else f"ended with status {status}"
    return (
        f"{task.file}: the process that was to read it {ended}: not enough memory, or a damaged file; "
        "try it alone, or with fewer --jobs"
    )


def _on_cluster(attempt: Attempt, tasks: Sequence[Task], scheduler: str) -> Iterator[tuple[int, Outcome]]:
    """Run tasks on a Dask cluster: those of a worker that is lost go to another one."""
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise DataError(
            f"--scheduler needs Dask, which is not installed: {install('dask', 'distributed')}"
        ) from None
    try:
        client = distributed.Client(scheduler, timeout=SCHEDULER_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise DataError(
            f"{scheduler}: expected the address of a Dask scheduler, such as tcp://host:8786, got {reason(error)}"
        ) from None
    with client:
        futures = {client.submit(attempt, task, pure=False): index for index, task in enumerate(tasks)}
        try:
            for future in distributed.as_completed(list(futures), loop=client.loop):
                index = futures[future]
                lost = future.exception()
                if lost is None:
                    yield index, future.result()
                else:
                    yield index, Outcome(error=f"{tasks[index].file}: lost by the cluster: {reason(lost)}")
        finally:
            client.cancel(list(futures))
