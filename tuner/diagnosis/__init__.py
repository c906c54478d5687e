"""What a simulation of the fitted noise gets wrong, and why.

`diagnose` fits the base noise to every channel, turns the record into residuals that must be independent standard
normal numbers, tests them in every way it knows (`panel`), extends the model by the cause that explains most and
starts again (`loop`) until nothing alarms. Every cause is one file in `causes`.
"""

from tuner.diagnosis.static.diagnose import diagnose

__all__ = ["diagnose"]
