"""Diagnosis of a measured drive: what contradicts the filter's model, and which causes explain it.

`diagnose_drive` runs the filter and linearises the run (`linear_model`), tests causes that are constants by the
sensitivities of the innovations (`score_tests`), wrong noise, correlated errors, outliers and jumps by likelihood
(`hypothesis_tests`), accepts the cause with the largest gain and filters again (`search`) until no test is
significant.
"""

from tuner.diagnosis.drive.diagnose import ExaminedDrive, diagnose_drive, examine_drive

__all__ = ["ExaminedDrive", "diagnose_drive", "examine_drive"]
