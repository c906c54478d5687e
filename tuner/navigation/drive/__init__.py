"""Measured drives: alignment, checks of axes and units, motion constraints, and the run of the filter over them."""
