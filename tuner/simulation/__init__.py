"""Simulated static logs and drives, Monte-Carlo runs of a filter, and effects in simulated data."""
