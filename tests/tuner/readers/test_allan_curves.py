"""Tabulated Allan curves are read with their units, or refused with the place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.tuner.readers.plain_logs import rows, write
from tuner.readers import is_curve, read_curve
from tuner.types.records import DataError


def test_curve(tmp_path: Path) -> None:
    path = write(tmp_path / "c.csv", ["4,1,10", "1,2,30", "2,1.5,20"], "tau,deviation [deg/h],dof")
    assert is_curve(path)
    curve = read_curve(path)
    np.testing.assert_array_equal(curve.tau, [1, 2, 4])
    np.testing.assert_allclose(curve.deviation()[:, 0], np.deg2rad([2, 1.5, 1]) / 3600, rtol=1e-12)
    np.testing.assert_array_equal(curve.dof[:, 0], [30, 20, 10])
    assert (curve.unit, curve.axes) == ("rad/s", ("gyro",))
    assert not is_curve(write(tmp_path / "log.csv", rows()))
    assert not is_curve(tmp_path / "nowhere.csv")


def test_curve_of_an_accelerometer_without_dof(tmp_path: Path) -> None:
    curve = read_curve(write(tmp_path / "c.csv", ["1,2", "2,1"], "tau,adev [mg]"))
    assert (curve.unit, curve.axes) == ("m/s^2", ("accel",))
    assert np.isnan(curve.dof).all()


@pytest.mark.parametrize(
    ("lines", "header", "pattern"),
    [
        (["1,2", "2,-1"], "tau,deviation", "data row 2: expected a positive deviation, found -1"),
        (["1,2", "2,x"], "tau,deviation", ":3:2: expected a number in column 'deviation', found 'x'"),
        (["1,2", "1,3"], "tau,deviation", "at least two different tau"),
        (["1,2", "2,3"], "tau,value", "no column 'deviation': expected tau,deviation"),
        (["1,2", "2,3"], "tau,deviation [V]", "unknown unit 'V'"),
    ],
)
def test_bad_curves(tmp_path: Path, lines: list[str], header: str, pattern: str) -> None:
    with pytest.raises(DataError, match=pattern):
        read_curve(write(tmp_path / "c.csv", lines, header))
