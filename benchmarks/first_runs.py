"""First runs of the plain command on recordings that others made: the figures of ``docs/first-runs.md``.

    python -m benchmarks.first_runs FOLDER [--tuner CMD] [--out DIR] [--noise] [CODE …]

FOLDER holds git clones of the repositories that ``first_runs.yaml`` names, each as OWNER+NAME or OWNER/NAME, bare ones
too. The files of a recording are taken out of its commit, their SHA-256 compared, and the command runs once with the
options that the recording's own documentation states. Printed is one row a run; its screen, configuration and result
are kept in DIR/CODE. Beside the white noise of noise.yaml stands an overlapping Allan deviation (allantools) of the
longest quiet part, read here with numpy: √τ times its value at τ = 0.1 s or 4 samples, in rad/s/√Hz and m/s²/√Hz.
``--noise`` prints these alone, at several τ. Nothing of the repositories is built or run.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shlex
import subprocess
import time
import warnings
from pathlib import Path
from typing import Any

import allantools
import h5py
import numpy as np
import yaml
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from scipy.io import loadmat

FloatArray = NDArray[np.float64]

LIST = Path(__file__).with_name("first_runs.yaml")
LIMIT = 600.0
"""Longest time of a run, s."""
SHORT_TAU, SHORT_COUNT = 0.1, 4
"""Cluster time of the independent value, s, and the fewest samples in it."""
TAUS = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Cluster times that ``--noise`` prints, s."""
QUIET = 3.0
"""A second is quiet where no axis scatters by more than this times its lower quartile over all seconds."""


def main() -> None:
    """Run each recording that is named, or all that are not sealed, and print its row."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tuner", default="tuner")
    parser.add_argument("--out", type=Path, default=Path("first-runs"))
    parser.add_argument("--noise", action="store_true")
    parser.add_argument("codes", nargs="*")
    asked = parser.parse_intermixed_args()
    for entry in yaml.safe_load(LIST.read_text()):
        if entry.get("sealed") or (asked.codes and entry["code"] not in asked.codes):
            continue
        kept = asked.out / entry["code"]
        try:
            argument = taken_out(entry, asked.folder, kept / "recording")
        except LookupError as error:
            print(f"{entry['code']}: {error}", flush=True)
            continue
        if asked.noise:
            curves(entry, kept / "recording")
        else:
            run(entry, argument, asked.tuner, kept)


def taken_out(entry: dict[str, Any], folder: Path, scratch: Path) -> Path:
    """Return the path for the command line, after the files of a recording were taken out of its commit."""
    clones = [folder / entry["source"].replace("/", sign) for sign in "+/"]
    clone = next((path for path in clones if path.exists()), None)
    if clone is None:
        raise LookupError(f"no clone of {entry['source']}")
    for file in entry["files"]:
        command = ["git", "-C", str(clone), "show", f"{entry['commit']}:{file['path']}"]
        shown = subprocess.run(command, capture_output=True, check=False)
        if hashlib.sha256(shown.stdout).hexdigest() != file["sha256"]:
            raise LookupError(f"{file['path']} has another SHA-256, or the clone lacks the commit")
        path = scratch / file.get("name", Path(file["path"]).name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(shown.stdout)
    if "argument" in entry:
        return scratch / str(entry["argument"])
    return path if len(entry["files"]) == 1 else scratch


def run(entry: dict[str, Any], argument: Path, tuner: str, kept: Path) -> None:
    """Run the plain command once, keep its screen, and print the row."""
    command = [*shlex.split(tuner), "tune", *["--drive"] * (entry["kind"] == "drive"), str(argument)]
    command += [*entry.get("options", []), "--jobs", "1", "-o", str(kept / "tuned")]
    begun = time.monotonic()
    with (kept / "screen.txt").open("w") as screen, (kept / "progress.txt").open("w") as progress:
        wide = {**os.environ, "COLUMNS": "120"}
        child = subprocess.Popen(command, stdout=screen, stderr=progress, env=wide)
        status, memory = waited(child)
    seconds = time.monotonic() - begun
    shown = (kept / "screen.txt").read_text().split("\n")
    shown += (kept / "progress.txt").read_text().split("\n")[::-1]
    first = next((line for line in shown if line.strip()), "")
    print(f"{entry['code']}: status {status}, {seconds:.0f} s, {memory:.0f} MiB: {first}", flush=True)
    written = kept / "tuned" / "noise.yaml"
    densities = written_noise(written) if written.exists() else {}
    independent = {name: own[0, 1] for name, own in own_noise(entry, kept / "recording").items()}
    for name in sorted({*densities, *independent}, reverse=True):
        ours, other = densities.get(name, np.nan), independent.get(name, np.nan)
        print(f"    {name:8} written {ours:10.4g}  independent {other:10.4g}  ratio {ours / other:7.3g}")


def waited(child: subprocess.Popen[bytes]) -> tuple[int, float]:
    """Return the exit status of a run (-9: it passed the limit) and its peak memory, MiB."""
    begun, pid = time.monotonic(), 0
    while not pid:
        time.sleep(0.1)
        pid, status, used = os.wait4(child.pid, os.WNOHANG)
        if not pid and time.monotonic() - begun > LIMIT:
            child.kill()
    child.returncode = os.waitstatus_to_exitcode(status)
    return child.returncode, used.ru_maxrss / 1024


def written_noise(path: Path) -> dict[str, float]:
    """Return the white densities of a configuration by axis."""
    sensors = yaml.safe_load(path.read_text())["sensors"]
    axes = {name: axis for sensor in sensors.values() for name, axis in sensor.items()}
    return {name: float(axis["filter"]["white_density"]) for name, axis in axes.items() if "filter" in axis}


def own_noise(entry: dict[str, Any], folder: Path, taus: tuple[float, ...] = ()) -> dict[str, FloatArray]:
    """Return τ and √τ times the overlapping Allan deviation of the longest quiet part, (k, 2), by axis."""
    found: dict[str, FloatArray] = {}
    for sensor, (rate, samples) in own_reading(entry, folder).items():
        begin, end = quiet_part(samples, rate)
        for axis, series in zip("xyz", samples[begin:end].T, strict=False):
            wanted = taus or (max(SHORT_TAU, SHORT_COUNT / rate),)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                tau, deviation, _, _ = allantools.oadev(
                    series, rate=rate, data_type="freq", taus=list(wanted)
                )
            found[f"{sensor}_{axis}"] = np.column_stack((tau, np.sqrt(tau) * deviation))
    return found


def own_reading(entry: dict[str, Any], folder: Path) -> dict[str, tuple[float, FloatArray]]:
    """Return rate and samples of each sensor in SI units, read as `independent` of the entry says."""
    found = {}
    for sensor in ("gyro", "accel"):
        how = {**entry.get("independent", {}), **entry.get("independent", {}).get(sensor, {})}
        if "columns" not in how:
            continue
        table = own_table(folder / how.get("file", Path(entry["files"][0]["path"]).name), how)
        samples = table[:, how["columns"]] * float(how.get("factor", 1.0))
        time_of = table[:, how["time"]] * float(how.get("tick", 1.0)) if "time" in how else None
        rate = float(how["rate"]) if time_of is None else (len(table) - 1) / float(time_of[-1] - time_of[0])
        found[sensor] = (rate, samples[np.isfinite(samples).all(axis=1)])
    return found


def own_table(path: Path, how: dict[str, Any]) -> FloatArray:
    """Return the numbers of a file: text, arrays (MAT, HDF5, NPZ) or the IMU messages of a ROS bag."""
    held: Any
    if how.get("format") in ("mat", "h5", "npz"):
        held = {"mat": loadmat, "h5": h5py.File, "npz": np.load}[how["format"]](path)
        arrays = [np.asarray(held[name], float) for name in how["arrays"]]
        return np.column_stack([array.T if array.shape[0] < array.shape[-1] else array for array in arrays])
    if how.get("format") == "bag":
        with AnyReader([path]) as bag:
            links = [link for link in bag.connections if link.topic == how["topic"]]
            held = [bag.deserialize(raw, link.msgtype) for link, _, raw in bag.messages(links)]
        both = [(m.header.stamp, m.angular_velocity, m.linear_acceleration) for m in held]
        return np.array([(s.sec + 1e-9 * s.nanosec, w.x, w.y, w.z, f.x, f.y, f.z) for s, w, f in both])
    text = path.read_text(encoding="utf-8", errors="replace")
    for old, new in how.get("replace", {}).items():
        text = text.replace(old, new)
    lines, skip = text.splitlines(), how.get("skip", 0)
    return np.genfromtxt(lines, delimiter=how.get("delimiter", ","), skip_header=skip, invalid_raise=False)


def quiet_part(samples: FloatArray, rate: float) -> tuple[int, int]:
    """Return where the longest run of quiet seconds begins and ends."""
    size = max(round(rate), 8)
    blocks = samples[: len(samples) // size * size].reshape(-1, size, samples.shape[1])
    scatter = blocks.std(axis=1)
    usual = np.maximum(np.quantile(scatter, 0.25, axis=0), 1e-12)
    moved = np.flatnonzero((scatter > QUIET * usual).any(axis=1))
    edges = np.concatenate(([-1], moved, [len(blocks)]))
    longest = int(np.argmax(np.diff(edges)))
    return (int(edges[longest]) + 1) * size, int(edges[longest + 1]) * size


def curves(entry: dict[str, Any], folder: Path) -> None:
    """Print the independent values at several cluster times."""
    for name, values in own_noise(entry, folder, TAUS).items():
        print(f"{entry['code']} {name:8}", *(f"{value:10.4g} ({tau:.2g} s)" for tau, value in values))


if __name__ == "__main__":
    main()
