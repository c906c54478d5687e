"""Criticism of the navigation simulation: what a measured drive says against the filter, why, and what naming it gains."""
