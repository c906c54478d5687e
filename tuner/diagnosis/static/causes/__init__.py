"""Causes in static logs: one file each, with its statistic, null distribution, extension and words."""
