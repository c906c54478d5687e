"""Criticism of the navigation simulation: what a measured drive says against the filter, and why.

`diagnose_drive` filters the drive, makes the pass linear (`record`), tests causes that shift the innovations by their
sensitivities (`score`), wrong noise, correlated errors, outliers and jumps by likelihood (`candidates`), holds true
what gains most, filters again (`loop`) until nothing alarms.
"""

from tuner.diagnosis.drive.diagnose import ExaminedDrive, diagnose_drive, examine_drive

__all__ = ["ExaminedDrive", "diagnose_drive", "examine_drive"]
