#!/usr/bin/env python3
"""Recordings at rest as public reports describe them: make each, run the plain command, judge its first screen.

    python run.py TUNER [NAME ...]     (TUNER: the command; in/ and out/ of the working folder)

Right is: the white noise of noise.yaml within 1.4 times the truth on every axis that has one, no settings for an axis
that has none, and the cause named on the first screen where it changes anything; or, where the recording leaves no
other way, one line that refuses it, names the cause and says what to do. Advice that leads to wrong numbers is wrong.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import yaml
from make import CASES

COUNTS = "--gyro-unit deg/s --gyro-scale 0.00763 --accel-unit g --accel-scale 6.1035e-5"
REPEAT = r"repeat|duplicat|\bheld\b|same (value|reading|sample)|identical|frozen|freez|constant"
STILL = r"constant|frozen|freez|stuck|not change|never change|changes (fewer|less)|zeros|dead (zone|band)"
LOST = r"missing|\blost\b|\bgaps?\b|did not come"
WRAP = r"wrap|unsigned|two.s complement|16.bit|65.?53[56]|sign\b"
# name: (options that its user states, words wanted beside right numbers, words that make a refusal right, words that
# mislead wherever they stand); a refusal that no words make right is wrong, as the recording can be read
TOLD = {
    "optor5": ("--gyro-unit deg/s --accel-unit m/s^2", REPEAT, REPEAT, None),
    "mesh585": ("", REPEAT, REPEAT, None),
    "wit14": ("", STILL, STILL, None),
    "rs5601": ("", STILL, None, "mrad/s"),
    "stim9": ("", STILL, None, None),
    "avros10": ("", STILL, rf"({STILL}|0 ± 0).*--", None),
    "xrp72": (
        "--gyro-unit mdeg/s --accel-unit mg --columns 't=time_ms [ms]'",
        STILL + "|stop",
        STILL + "|stop",
        None,
    ),
    "adxl7": (
        "--accel-unit g --accel-scale 0.00390625 --columns accel_x=Raw-x,accel_y=Raw-y,accel_z=Raw-z,t=none --rate 100",
        STILL + "|satur|full.scale",
        STILL + "|satur|full.scale",
        "its unit or its scale is wrong",  # that axis is clipped
    ),
    "septentrio104": ("", "deg/s", "--gyro-unit deg/s", None),
    "livox98": ("", r"\bg\b", r"--accel-unit g\b", None),
    "vcu13": ("", r"\bg\b|9\.8", r"--accel-unit g\b|\bin g\b", None),
    "una314": ("--gyro-unit deg/s --accel-unit g", "m/s", r"m/s\^2", None),
    "icm2": ("", None, r"twice|double|factor (of )?2\b|half", None),
    "depthai319": ("", None, None, None),
    "ford3": ("--gyro-unit rad/s --accel-unit m/s^2", "gravity", "gravity", None),
    "gins6": ("", "increment", r"increment|--gyro-unit rad\b(?!/)", None),
    "openlog45": ("--gyro-unit deg/s --accel-unit mg", None, None, None),
    "berry30": (
        "--gyro-unit deg/s --gyro-scale 0.0175 --accel-unit g --accel-scale 0.000244 --columns 't=ms [ms]'",
        WRAP,
        WRAP,
        None,
    ),
    "st737858": (
        "",
        WRAP + r"|full.scale|satur|jump|± ?2 ?g",
        WRAP + r"|full.scale|satur|jump|± ?2 ?g",
        None,
    ),
    "riot22135": (
        f"{COUNTS} --columns 't=ms [ms]'",
        None,
        r"\bbytes?\b|endian|at rest|no (gyro|sensor|accel)",
        None,
    ),
    "bmi160": (
        f"{COUNTS} --columns 't=ms [ms]'",
        REPEAT + r"|32.?768|every (other|second)",
        REPEAT + r"|32.?768|every (other|second)|half of|250 deg/s|satur|full.scale",
        None,
    ),
    "mpu333174": (COUNTS, r"glitch|spike|outlier|corrupt|wrong (byte|reading|value)|\b256\b", None, None),
    "ard128654": ("--gyro-unit deg/s --gyro-scale 0.061 --rate 100", None, None, None),
    "cats408": ("", None, None, None),
    "gyroflow54": ("", None, "count|--gyro-scale", "--gyro-unit deg/s(?! --gyro-scale)"),
    "m2ud13": ("", None, "t=none|digits|same stamp|constant", None),
    "slict18": ("", None, None, None),
    "sick487": ("", "clock|stamps", "clock|stamps", None),
    "xsens52": ("", None, None, None),
    "mynt25": ("", LOST, None, None),
    "sitl26230": ("", f"{REPEAT}|{LOST}", "xgyro|xacc", "--gyro-unit rad/s"),
    "avros3": ("", None, None, None),
    "pymav58": ("", LOST, None, None),
    "plotj473": ("", None, None, None),
    "xsens14": ("", "zeros?", "zeros?", None),
    "shimmer2": ("", None, None, None),
    "pupil446": ("", None, None, None),
    "blackbox34": ("", None, "2048|acc_1G|--accel-scale", "--accel-unit m/s"),
    "mscl215": ("", None, r"--accel-unit g\b", None),
    "opensim2812": ("", None, "--rate", None),
    "gici10": ("", None, None, None),
    "orbbec37": ("", None, "of JSON|rows of numbers|per sensor|each row", None),
    "gps21": ("", None, "each row|rows of|per sensor|one file", None),
    "accelexp11": ("", None, "empty|no (value|number|sample|data)|without|missing", None),
    "nave20": ("", None, "--columns", None),
    "kallan3": ("", None, "--columns", None),
    "mpu78490": (
        "--gyro-unit deg/s --gyro-scale 0.015267 --accel-unit g --accel-scale 0.00024414 --columns 't=msecs [ms]'",
        "temperature|warm|drift at rest",
        None,
        None,
    ),
    "slime222": (
        "",
        r"\bsteps?\b|jump|calibrat|high.?pass|bias (is|was) (removed|subtracted|set)",
        None,
        None,
    ),
    "instk64": ("--rate 100", r"\bline\b|sine|sinus|oscillat|vibrat|period|0\.4[34]", None, None),
    "avros43": ("", r"short|longer|\bh would", "short|longer|samples", None),
    "allan3": ("", None, r"not at rest|motion|moves|moved", "--gyro-unit deg/s"),
    "klip3323": ("", None, "mm/s|--accel-scale", None),
}
UNITS = {"gyro": ("deg/√h", 180 / 3.141592653589793 * 60), "accel": ("µg/√Hz", 1e6 / 9.80665)}


def run(tuner, name):
    """Write the recording if it is not there, run the command and keep what it says."""
    if not list(Path("in").glob(f"{name}.*")):
        CASES[name][0](f"in/{name}")
    log = next(Path("in").glob(f"{name}.*"))
    command = [tuner, "tune", str(log), "-o", f"out/{name}", "--jobs", "1", *shlex.split(TOLD[name][0])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    said = done.stdout + done.stderr
    Path("out", f"{name}.said").write_text(f"{shlex.join(command)}\n{said}", encoding="utf-8")
    return done.returncode, said


def judge(name, status, said):
    """Return whether an answer is right, and why."""
    _, wanted, refusal, misleads = TOLD[name]
    settings = Path("out", name, "noise.yaml")
    last = said.strip().splitlines()[-1] if said.strip() else ""
    if misleads and re.search(misleads, said):
        return False, f"misleads: {last[:200]}"
    if status not in (0, 1, 2):
        return False, f"exit status {status}: {last[:200]}"
    if status == 2 or not settings.exists():
        line = last if status == 2 else " ".join(said.split())
        return bool(refusal and re.search(refusal, line, re.IGNORECASE)), f"refused: {line[:200]}"
    off, told = compare(name, yaml.safe_load(settings.read_text(encoding="utf-8"))["sensors"])
    if wanted and not re.search(wanted, said, re.IGNORECASE):
        off.append("no word of the cause")
    return not off, "; ".join(off) or ", ".join(told)


def compare(name, sensors):
    """Return what is off in the settings written, and all their white noise."""
    off, told = [], []
    for sensor, (truth, axes) in CASES[name][1].items():
        unit, factor = UNITS[sensor]
        given = sensors.get(sensor) or {}
        for axis in axes if truth else "":
            channel = (given.get(f"{sensor}_{axis}") or {}).get("filter")
            if channel is None:
                off.append(f"no {sensor}_{axis}")
                continue
            n = channel["white_density"]
            told.append(f"{sensor}_{axis} {n * factor:.3g}")
            if not 1 / 1.4 <= n / truth <= 1.4:
                off.append(f"{sensor}_{axis} N {n * factor:.3g} for {truth * factor:.3g} {unit}")
        off += [
            f"settings for {one}, which has no truth" for one in given if not truth or one[-1] not in axes
        ]
    return off, told


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    Path("in").mkdir(exist_ok=True)
    Path("out").mkdir(exist_ok=True)
    names = sys.argv[2:] or list(TOLD)
    right = 0
    for name in names:
        good, why = judge(name, *run(sys.argv[1], name))
        right += good
        sys.stdout.write(f"{'right' if good else 'WRONG':6} {name:14} {why}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{right} of {len(names)} right\n")
    sys.exit(int(right < len(names)))
