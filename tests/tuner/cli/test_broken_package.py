"""A package that cannot be loaded, as a numba that refuses the installed numpy, is one line and not a traceback."""

from __future__ import annotations

import os
import subprocess
import sys


def test_a_broken_numba_is_reported_in_one_line(tmp_path):
    (tmp_path / "numba.py").write_text('raise ImportError("Numba needs an older NumPy")')
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
    assert "Numba needs an older NumPy" in done.stderr
