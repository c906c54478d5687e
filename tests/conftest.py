"""Tests run linear algebra in one thread: the threads of several workers would wait for one another."""

from __future__ import annotations

import os

import pytest

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # read when numpy is first imported, which is after this file

if "PYTEST_XDIST_WORKER" in os.environ:  # its neighbours have the other processors
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")


@pytest.fixture(scope="session", autouse=True)
def share_of_compiling(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Of several workers with the tests of the filter each compiles a part of what the tests call, for all of them."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if workers == 1 or not any("navigation" in item.nodeid for item in request.session.items):
        return
    from tests.compiled_shares import compile_share

    compile_share(tmp_path_factory.getbasetemp().parent)
