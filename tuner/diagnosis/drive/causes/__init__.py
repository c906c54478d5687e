"""Causes in drives: one file each, with its effect on the innovations, its test and its parameters."""
