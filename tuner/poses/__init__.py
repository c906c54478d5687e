"""Runs beside poses of another sensor: cameras, lidars, motion capture."""
