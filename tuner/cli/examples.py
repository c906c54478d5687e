"""Two examples of every command, as its help shows them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

EXAMPLES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "tune": (
            "tuner tune static.csv --gyro-unit deg/s --accel-unit g",
            "tuner tune static.csv --drive drive.npz -o out",
        ),
        "identify": (
            "tuner identify static.csv --figure allan.png",
            "tuner identify day1.csv day2.csv --verbose",
        ),
        "diagnose": (
            "tuner diagnose static.csv --page findings.html",
            "tuner diagnose drive.npz --config noise.yaml --wheels",
        ),
        "examine": (
            "tuner examine drive.npz",
            "tuner examine flight.bag -o mended",
        ),
        "covariances": (
            "tuner covariances drive.npz --to robot_localization",
            "tuner covariances run.bag --rest static.csv -o covariances",
        ),
        "check": (
            "tuner check noise.yaml --gnss rtk --budget",
            "tuner check mpu9250 --truth adis16465 --trajectory figure_eight",
        ),
        "navigate": (
            "tuner navigate drive.npz --config noise.yaml -o out",
            "tuner navigate drive.npz --config icm20602 --lever-arm 0.5,0,-1.2",
        ),
        "score": (
            "tuner score solution.csv --truth reference.csv -o out",
            "tuner score run1.csv run2.csv --truth truth.csv --strict",
        ),
        "plan": (
            "tuner plan mpu9250 --accuracy 0.1 --hours 6",
            "tuner plan static.csv --accuracy 0.05 --page plan.html",
        ),
        "curve": (
            "tuner curve static.csv --estimator theoh --page curve.html",
            "tuner curve static.csv --estimator oadev --tau 1,10,100",
        ),
        "compare": (
            "tuner compare static.csv icm20602 --figure both.png",
            "tuner compare day1.csv day2.csv --gnss rtk",
        ),
        "choose": (
            "tuner choose --outage 60 --error 2 --gnss rtk --wheels",
            "tuner choose --outage 10 --error 5 --page choice.html",
        ),
        "fleet": (
            "tuner fleet logs/ --limits limits.yaml",
            "tuner fleet 'logs/*.csv' --jobs 8",
        ),
        "export": (
            "tuner export noise.yaml --to kalibr -o imu.yaml",
            "tuner export --list",
        ),
        "simulate": (
            "tuner simulate icm20602 --hours 2 --hide line@gyro_x:frequency=12,amplitude=1e-4 -o static.npz",
            "tuner simulate stim300 --trajectory city --gnss rtk -o drive.npz",
        ),
    }
)
"""Lines to type, by the name of the command."""
