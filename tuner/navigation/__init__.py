"""Navigation: the error-state filter that shows whether a configuration is consistent.

``settings``          a `FilterConfig` as the states, driving noise and prior of a filter
``data``              inertial steps, satellite fixes, and what a filter returns
``reference_filter``  the filter, readable, on filterpy
``engine``            the same filter compiled, for long drives and many runs
``smoother``          estimates that use the fixes before and after each instant
``drive``             measured drives: alignment, checks of axes and units, motion constraints
"""
