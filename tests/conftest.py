"""Tests run linear algebra in one thread: the threads of several workers would wait for one another."""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # read when numpy is first imported, which is after this file

if "PYTEST_XDIST_WORKER" in os.environ:  # its neighbours have the other processors
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
