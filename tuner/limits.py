"""The limits that decide what a user sees, in the user's units. Beside them only probabilities decide."""

from __future__ import annotations

SHOWN_CHANGE = 0.05
"""Relative change of a quantity of the user, with and without a finding, from which the finding is on the screen."""
WRONG_FACTOR = 1.4
"""Factor beyond which a density, a setting or an sd that is written or shown counts as wrong."""
HONEST_RATIO = 1.5
"""True ÷ predicted error, or its inverse, up to which a filter is honest, however well the ratio is known."""
TOLERATED_RATIO = 2.0
"""True ÷ predicted error, or its inverse, beyond which settings are not written; attitudes are honest up to it."""
LOST_SHARE = 0.02
"""Share of the samples, or of the fixes, from which the first screen says that they are left out."""
MIN_RATE, MAX_RATE = 0.01, 1e6
"""Rates of inertial sensors, Hz, that are possible at all."""
SHEET_FACTOR = 2.0
"""Largest noise of a unit ÷ the typical one of its sheet: sheets that state both have up to twice the typical value."""
SHEET_SDS = 5.0
"""Sds of a sheet (constants, scale factors) that a unit may be off: of a million sound ones none is further."""
LOCAL_GRAVITY = 0.003
"""Relative distance of gravity from the standard one, from the equator to the poles and up to 1 km of height."""
COLLINEAR_SHARE = 0.9
"""Squared correlation of temperature and time from which a change is as likely that of either."""
ODD_DRIFT = 5.0
"""Drift over a log ÷ Allan deviation at 10 s from which a person is to see it: noise makes up to four of them."""
PRIOR_SHARE = 1.0 / 3.0
"""Sd ÷ prior sd up to which data determine a constant of the installation."""
WIDEST_INTERVAL = 5.0
"""Ratio of the ends of a 95 % interval beyond which an estimate names nothing."""
SHOWN_FINDINGS = 5
"""Findings on a screen."""
SCREEN_LINES = 30
"""Lines of a screen."""
TEST_POWER = 0.9
"""Probability with which data must show an error of `HONEST_RATIO` before a filter is called honest."""
ENGINE_DIFFERENCE = 1e-4
"""Difference of two engines ÷ stated sd up to which they agree: rounding is up to 3e-6 where RTK follows an outage."""
