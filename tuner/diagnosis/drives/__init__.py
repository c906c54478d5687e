"""Criticism of the navigation simulation: what a measured drive says against the filter, and why."""
