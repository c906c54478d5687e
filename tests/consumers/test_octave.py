"""NaveGo's and PSINS' formulas in Octave, on the exported scripts."""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.consumers.examples import EXAMPLES, text_of
from tests.consumers.filters import STEP
from tuner.synthesis.error_growth import modelled_growth

pytestmark = pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")

NAVEGO = r"""
imu = struct(); source('exported.m');
% ins_gnss.m: Q = diag([arw vrw gb_psd ab_psd].^2); F_update.m: bias -1/corr; kf_prediction.m: A = expm(F dt),
% Qd = G Q G' dt; one axis of gyro and accelerometer each.
Q = diag([imu.arw(1) imu.vrw(1) imu.gb_psd(1) imu.ab_psd(1)].^2);
F = [0 0 1 0; 0 0 0 1; 0 0 -1/imu.gb_corr(1) 0; 0 0 0 -1/imu.ab_corr(1)];
dt = 1 / imu.freq; A = expm(F * dt); P = zeros(4);
steps = round([%LAGS%] / dt);
for k = 1:max(steps)
    P = A * P * A' + Q * dt;
    if any(k == steps), printf('%.9g %.9g\n', P(1, 1), P(2, 2)); end
end
printf('%.9g %.9g\n', imu.gb_sta(1), imu.ab_sta(1));
"""

PSINS = r"""
% imuerrset.m: customary units to SI, driving density sqrtR0 sqrt(2/Tau); glvf.m: glv.ug = 1e-6 g0.
function e = imuerrset(eb, db, web, wdb, sqrtR0G, TauG, sqrtR0A, TauA)
    dph = pi / 180 / 3600; dpsh = pi / 180 / 60; ug = 9.7803267715e-6;
    e.web = web * dpsh; e.wdb = wdb * ug;
    e.sqg = sqrtR0G * dph .* sqrt(2 ./ TauG); e.sqa = sqrtR0A * ug .* sqrt(2 ./ TauA);
    e.eb = eb * dph; e.db = db * ug;
end
source('exported.m');
% kfinit.m, kfinit186: Qt = diag([web wdb 0 sqg sqa 0])^2; kfinit0.m: Qk = Qt nts; insinit.m: tauG = inf.
nts = %STEP%; Qk = diag([imuerr.web(1) imuerr.wdb(1) imuerr.sqg(1) imuerr.sqa(1)])^2 * nts;
Phi = eye(4) + [0 0 1 0; 0 0 0 1; 0 0 0 0; 0 0 0 0] * nts; P = zeros(4);
steps = round([%LAGS%] / nts);
for k = 1:max(steps)
    P = Phi * P * Phi' + Qk;
    if any(k == steps), printf('%.9g %.9g\n', P(1, 1), P(2, 2)); end
end
printf('%.9g %.9g\n', imuerr.eb(1), imuerr.db(1));
"""

LAGS = (1.0, 10.0, 60.0)


def run(dialect: str, formulas: str, folder: Path) -> np.ndarray:
    (folder / "exported.m").write_text(text_of("walk", dialect), encoding="utf-8")
    lags = " ".join(map(str, LAGS))
    program = "1;\n" + formulas.replace("%LAGS%", lags).replace("%STEP%", str(STEP))
    (folder / "program.m").write_text(program, encoding="utf-8")
    done = subprocess.run(
        ["octave-cli", "--quiet", "--norc", "program.m"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()])


@pytest.mark.parametrize(("dialect", "formulas"), [("navego", NAVEGO), ("psins", PSINS)])
def test_predicted_growth_is_that_of_the_model(dialect: str, formulas: str, tmp_path: Path) -> None:
    found = run(dialect, formulas, tmp_path)
    channels = EXAMPLES["walk"]().channels
    expected = [
        [modelled_growth(channels[f"{sensor}_x"], lag, memory=96.0) for sensor in ("gyro", "accel")]
        for lag in LAGS
    ]
    assert np.sqrt(found[:3] / expected) == pytest.approx(np.ones((3, 2)), abs=0.01)
    if dialect == "navego":
        assert found[3] == pytest.approx([0.0, 0.0])  # nothing is subtracted from the samples
    else:
        assert found[3] == pytest.approx(
            [channels["gyro_x"].constant_sd, channels["accel_x"].constant_sd], rel=1e-4
        )
    assert math.isfinite(found.sum())
