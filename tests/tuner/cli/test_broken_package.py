"""A package that cannot be loaded, as a numba that refuses the installed numpy, is one line and not a traceback."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("raised", "shown"),
    [
        ('ImportError("Numba needs an older NumPy")', "Numba needs an older NumPy"),
        ("ModuleNotFoundError(\"No module named 'numba'\", name='numba')", "No module named 'numba'"),
    ],
)
def test_a_broken_or_missing_numba_is_reported_in_one_line_that_says_what_to_install(tmp_path, raised, shown):
    (tmp_path / "numba.py").write_text(f"raise {raised}")
    program = "import sys; from tuner.cli import run; sys.exit(run(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", program, "check", "adis16405", "--runs", "2", "--quiet"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert shown in done.stderr
    assert "pip install --upgrade numba numpy" in done.stderr
    assert "no smaller number of runs" in done.stderr
