"""Diagnosis of static logs: search for the causes of misfit between a log and its noise model."""
